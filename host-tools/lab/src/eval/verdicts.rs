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
}
