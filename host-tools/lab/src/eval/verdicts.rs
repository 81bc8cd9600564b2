//! The verdicts of explorations, and their shares.

use serde::{Deserialize, Serialize};
use tactus_core::explorer::VerdictKind;

/// Shares of explorations, 0 to 1; all but `changed` and `most_like_right` add up to 1.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Verdicts {
    /// Verdict: the right name, as sure.
    pub right: f64,
    /// Verdict: none of the known textures.
    pub new: f64,
    /// Verdict: a wrong name, as sure.
    pub wrong: f64,
    /// Verdict: "most like this one", of tables that would be sure of a wrong name for too many new textures: neither
    /// right nor wrong.
    pub most_like: f64,
    /// Of these, those that named the right one.
    pub most_like_right: f64,
    /// Verdict: "not sure", with any name as the most likely one.
    pub undecided: f64,
    /// Of the names told as sure, right or wrong, those with the remark that the texture has changed since it was
    /// learned. Only calibrated tables make it.
    pub changed: f64,
}

impl Verdicts {
    /// Counts the verdict of each exploration, with true if the most probable texture was the right one.
    pub fn of(told: impl IntoIterator<Item = (VerdictKind, bool)>) -> Self {
        let mut counts = Self::default();
        let mut all = 0.0_f64;
        for (told, is_right) in told {
            all += 1.0;
            counts.changed += f64::from(u8::from(told == VerdictKind::Changed));
            let most_like_right = told == VerdictKind::MostLike && is_right;
            counts.most_like_right += f64::from(u8::from(most_like_right));
            *match told {
                VerdictKind::Sure | VerdictKind::Changed if is_right => &mut counts.right,
                VerdictKind::Sure | VerdictKind::Changed => &mut counts.wrong,
                VerdictKind::New => &mut counts.new,
                VerdictKind::MostLike => &mut counts.most_like,
                VerdictKind::Undecided => &mut counts.undecided,
            } += 1.0;
        }
        let share = |count: f64| count / all.max(1.0);
        Self {
            right: share(counts.right),
            new: share(counts.new),
            wrong: share(counts.wrong),
            most_like: share(counts.most_like),
            most_like_right: share(counts.most_like_right),
            undecided: share(counts.undecided),
            changed: share(counts.changed),
        }
    }

    /// The same of textures that the table does not have: no name is right.
    pub(crate) fn of_unknown(told: impl IntoIterator<Item = VerdictKind>) -> Self {
        Self::of(told.into_iter().map(|told| (told, false)))
    }
}

/// Shares of explorations from which the probe would learn by itself, 0 to 1.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Updates {
    /// All of them.
    pub made: f64,
    /// Those that would move the mean of a wrong texture.
    pub wrong: f64,
}

impl Updates {
    /// Counts explorations, each with true if the probe would learn from it, and true if the texture is the right one.
    pub fn of(learned: impl IntoIterator<Item = (bool, bool)>) -> Self {
        let (mut made, mut wrong, mut all) = (0, 0, 0);
        for (learns, is_right) in learned {
            all += 1;
            made += u32::from(learns);
            wrong += u32::from(learns && !is_right);
        }
        let [made, wrong] = [made, wrong].map(|some| f64::from(some) / f64::from(all.max(1)));
        Self { made, wrong }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_name_told_as_sure_is_right_or_wrong() {
        let told = [
            (VerdictKind::Sure, true),
            (VerdictKind::Sure, true),
            (VerdictKind::Sure, false),
            (VerdictKind::New, true),
            (VerdictKind::New, false),
            (VerdictKind::Undecided, true),
            (VerdictKind::Changed, true),
            (VerdictKind::Changed, false),
            (VerdictKind::MostLike, true),
            (VerdictKind::MostLike, false),
        ];
        let expected = Verdicts {
            right: 0.3,
            new: 0.2,
            wrong: 0.2,
            most_like: 0.2,
            most_like_right: 0.1,
            undecided: 0.1,
            changed: 0.2,
        };
        assert_eq!(Verdicts::of(told), expected);
        assert_eq!(Verdicts::of([]), Verdicts::default());
    }

    #[test]
    fn an_update_is_wrong_only_where_it_is_made() {
        let of = |learned: &[(bool, bool)]| {
            let Updates { made, wrong } = Updates::of(learned.iter().copied());
            (made, wrong)
        };
        let some = [(true, true), (true, false), (false, false), (false, true)];
        assert_eq!(of(&some), (0.5, 0.25));
        assert_eq!(of(&[]), (0.0, 0.0));
    }
}
