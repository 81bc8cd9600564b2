//! A name, letter by letter, with one button.

use crate::table::Name;

/// The letters of the wheel; then its ends.
const LETTERS: &str = "abcdefghijklmnopqrstuvwxyz 0123456789";
/// Places on the wheel besides letters: done, rub out.
const DONE: usize = 0;
const RUB: usize = 1;
const FIRST: usize = 2;
/// Letters that fit the display.
const MOST: usize = 14;
/// Places that are shown at once.
pub const WHEEL: usize = 7;

#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Taken {
    /// The name has changed.
    Letter,
    /// The name is this.
    Done(Name),
    /// There is no name.
    Back,
}

/// A place on the wheel.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Place {
    /// The name ends.
    Done,
    /// The last letter is deleted; without any, the spelling ends.
    Rub,
    /// A letter.
    Letter(char),
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Spelling {
    name: Name,
    at: usize,
}

impl Default for Spelling {
    fn default() -> Self {
        Self {
            name: Name::new(),
            at: FIRST,
        }
    }
}

impl Spelling {
    fn places() -> usize {
        FIRST + LETTERS.len()
    }

    fn place(at: usize) -> Place {
        match at % Self::places() {
            DONE => Place::Done,
            RUB => Place::Rub,
            at => LETTERS
                .chars()
                .nth(at - FIRST)
                .map_or(Place::Done, Place::Letter),
        }
    }

    pub(super) fn text(&self) -> &str {
        &self.name
    }

    /// The places of the wheel about the one that a long press takes, which is in the middle.
    pub(super) fn wheel(&self) -> [Place; WHEEL] {
        core::array::from_fn(|n| Self::place(self.at + Self::places() + n - WHEEL / 2))
    }

    pub(super) fn turn(&mut self) {
        self.at = (self.at + 1) % Self::places();
    }

    pub(super) fn take(&mut self) -> Taken {
        match Self::place(self.at) {
            Place::Done if self.name.trim().is_empty() => Taken::Back,
            Place::Done => Taken::Done(Name::try_from(self.name.trim()).unwrap_or_default()),
            Place::Rub => {
                if self.name.pop().is_none() {
                    return Taken::Back;
                }
                Taken::Letter
            }
            Place::Letter(letter) => {
                if self.name.len() < MOST {
                    // 40 bytes hold it
                    let _ = self.name.push(letter);
                }
                if self.name.len() == MOST {
                    self.at = DONE;
                }
                Taken::Letter
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_spelled_rubbed_out_and_given_up() {
        let mut spelling = Spelling::default();
        let to = |spelling: &mut Spelling, place: Place| {
            while Spelling::place(spelling.at) != place {
                spelling.turn();
            }
        };
        for letter in "silk9".chars() {
            to(&mut spelling, Place::Letter(letter));
            assert_eq!(spelling.take(), Taken::Letter);
        }
        to(&mut spelling, Place::Rub);
        assert_eq!(spelling.take(), Taken::Letter);
        assert_eq!(spelling.text(), "silk");
        assert_eq!(spelling.wheel()[WHEEL / 2], Place::Rub);
        to(&mut spelling, Place::Done);
        assert_eq!(
            spelling.take(),
            Taken::Done(Name::try_from("silk").unwrap())
        );
        let mut nothing = Spelling::default();
        to(&mut nothing, Place::Letter(' '));
        assert_eq!(nothing.take(), Taken::Letter);
        to(&mut nothing, Place::Done);
        assert_eq!(nothing.take(), Taken::Back);
        to(&mut nothing, Place::Rub);
        assert_eq!(nothing.take(), Taken::Letter);
        assert_eq!(nothing.take(), Taken::Back);
        let mut long = Spelling::default();
        (0..40).for_each(|_| drop(long.take()));
        assert_eq!(long.text().len(), MOST);
    }
}
