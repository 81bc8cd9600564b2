//! One button: a short press moves on, a long one takes.

/// Equal looks that make a level, ticks: contacts bounce for less.
const STEADY: u8 = 3;
/// A press of this many ticks is a long one.
const LONG: u8 = 60;

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Press {
    Short,
    Long,
}

#[derive(Clone, Copy, Default)]
pub(super) struct Button {
    /// Ticks for which the level has been other than `down`.
    other: u8,
    down: bool,
    /// Ticks for which it has been down.
    held: u8,
}

impl Button {
    pub(super) fn tick(&mut self, pressed: bool) -> Option<Press> {
        self.other = if pressed == self.down {
            0
        } else {
            self.other + 1
        };
        let changed = self.other >= STEADY;
        if changed {
            self.other = 0;
            self.down = pressed;
        }
        match (self.down, changed) {
            (true, true) => {
                self.held = 0;
                None
            }
            (true, false) => {
                let before = self.held;
                self.held = self.held.saturating_add(1).min(LONG);
                // reported at once, while it is held
                (before < LONG && self.held == LONG).then_some(Press::Long)
            }
            (false, true) => (self.held < LONG).then_some(Press::Short),
            (false, false) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn presses(levels: &[(bool, usize)]) -> Vec<Press> {
        let mut button = Button::default();
        let looks = levels
            .iter()
            .flat_map(|&(level, ticks)| std::iter::repeat_n(level, ticks));
        looks.filter_map(|level| button.tick(level)).collect()
    }

    #[test]
    fn presses_are_short_or_long_and_bounces_are_none() {
        assert_eq!(presses(&[(true, 2), (false, 5), (true, 1), (false, 9)]), []);
        assert_eq!(presses(&[(true, 10), (false, 10)]), [Press::Short]);
        assert_eq!(
            presses(&[(true, 5), (false, 2), (true, 5), (false, 3)]),
            [Press::Short]
        );
        assert_eq!(presses(&[(true, 62)]), []);
        // at once, and only once
        assert_eq!(presses(&[(true, 63)]), [Press::Long]);
        assert_eq!(presses(&[(true, 400), (false, 10)]), [Press::Long]);
    }
}
