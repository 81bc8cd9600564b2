//! How well the link to the sensor works, and what to do when it does not.

use core::fmt;

use super::word::WordError;

/// Counts of the words of a link by what they turned out to be. Counters stay at their ends instead of wrapping: at 4400
/// words a second that is after 11 days.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct WordStats {
    /// All words.
    pub words: u32,
    /// Words with bad parity.
    pub parity: u32,
    /// Words with good parity and a padding bit set.
    pub padding: u32,
    /// Error frames.
    pub error_frames: u32,
    /// Those error frames that say the read came too early.
    pub too_early: u32,
    /// FF FF and 00 00.
    pub no_sensor: u32,
}

impl WordStats {
    /// Words it takes for a diagnosis: 23 ms of slots.
    pub const ENOUGH: u32 = 100;

    /// Counts one decoded word.
    pub fn count<T>(&mut self, decoded: &Result<T, WordError>) {
        let add = |counter: &mut u32| *counter = counter.saturating_add(1);
        add(&mut self.words);
        match decoded {
            Ok(_) => {}
            Err(WordError::Parity(_)) => add(&mut self.parity),
            Err(WordError::Padding(_)) => add(&mut self.padding),
            Err(WordError::NoSensor) => add(&mut self.no_sensor),
            Err(WordError::ErrorFrame(code)) => {
                add(&mut self.error_frames);
                if code.is_too_early() {
                    add(&mut self.too_early);
                }
            }
        }
    }

    /// Words that were not samples.
    pub fn failed(&self) -> u32 {
        [self.parity, self.padding, self.error_frames, self.no_sensor]
            .into_iter()
            .fold(0, u32::saturating_add)
    }

    /// What the counts say about the link.
    ///
    /// With the wrong clock phase words arrive shifted by one bit. Over all values three of four then fail parity; a
    /// sensor at rest repeats a few values, so its share may be anything up to all. Noise on a link that is set up right
    /// is far below half: 39,600 recorded samples (biotac_sp_ros, output.txt) have no failure at all.
    pub fn diagnosis(&self) -> Diagnosis {
        let failed = self.failed();
        let half_of = |whole: u32, part: u32| part >= whole - whole / 2;
        if self.words < Self::ENOUGH {
            Diagnosis::TooFewWords
        } else if failed == 0 {
            Diagnosis::Good
        } else if half_of(self.words, self.no_sensor) {
            Diagnosis::NoSensor
        } else if half_of(failed, self.too_early) {
            Diagnosis::TooEarly
        } else if half_of(self.words, self.parity.saturating_add(self.padding)) {
            Diagnosis::ClockPhase
        } else if half_of(self.words, self.error_frames) {
            Diagnosis::Refused
        } else {
            Diagnosis::Noise
        }
    }
}

/// What is wrong with a link. Its text says what to do next.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Diagnosis {
    /// Fewer than [`WordStats::ENOUGH`] words.
    TooFewWords,
    /// No word failed.
    Good,
    /// At least half of the words are FF FF or 00 00.
    NoSensor,
    /// At least half of the failures say that the read came too early.
    TooEarly,
    /// At least half of the words fail parity or padding.
    ClockPhase,
    /// At least half of the words are other error frames.
    Refused,
    /// Some words fail, in no pattern.
    Noise,
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooFewWords => "too few words to tell",
            Self::Good => "the link works",
            Self::NoSensor => "no sensor answers: check power, cable and chip select",
            Self::TooEarly => "answers are read too early: leave 50 us between command and read",
            Self::ClockPhase => {
                "most words are garbled: set SPI mode 0 (idle low, sample on the first edge), \
                 most significant bit first"
            }
            Self::Refused => "the sensor refuses the commands: check MOSI and the SPI mode",
            Self::Noise => {
                "some words are garbled: shorten the cable, check ground, lower the clock"
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::word::{BadParity, ErrorCode, decode, encode};
    use super::*;
    use crate::sensor::pressure::Counts;
    use std::string::ToString;

    const PARITY: WordError = WordError::Parity(BadParity::Byte0);
    const PADDING: WordError = WordError::Padding(0x07);
    const EARLY: WordError = WordError::ErrorFrame(ErrorCode::Delay);
    const REFUSED: WordError = WordError::ErrorFrame(ErrorCode::UnknownCommand);

    fn stats(good: u32, failures: &[(u32, WordError)]) -> WordStats {
        let mut stats = WordStats::default();
        (0..good).for_each(|_| stats.count(&Ok(())));
        for (n, error) in failures {
            (0..*n).for_each(|_| stats.count(&Err::<(), _>(*error)));
        }
        stats
    }

    #[test]
    fn every_word_is_counted_once() {
        let s = stats(
            10,
            &[
                (1, PARITY),
                (2, PADDING),
                (3, EARLY),
                (4, REFUSED),
                (5, WordError::NoSensor),
            ],
        );
        let expected = WordStats {
            words: 25,
            parity: 1,
            padding: 2,
            error_frames: 7,
            too_early: 3,
            no_sensor: 5,
        };
        assert_eq!(s, expected);
        assert_eq!(s.failed(), 15);
    }

    #[test]
    fn counters_stop_at_their_ends() {
        let full = WordStats {
            words: u32::MAX,
            parity: u32::MAX,
            padding: 1,
            ..WordStats::default()
        };
        let mut s = full;
        s.count(&Err::<(), _>(PARITY));
        assert_eq!(s, full);
        assert_eq!(s.failed(), u32::MAX);
        assert_eq!(s.diagnosis(), Diagnosis::ClockPhase);
    }

    #[test]
    fn each_fault_has_its_diagnosis() {
        use Diagnosis::*;
        for (good, failures, expected) in [
            (99, &[][..], TooFewWords),
            (0, &[(99, WordError::NoSensor)], TooFewWords),
            (100, &[], Good),
            (50, &[(50, WordError::NoSensor)], NoSensor),
            (51, &[(50, WordError::NoSensor)], Noise),
            (990, &[(10, EARLY)], TooEarly),
            (990, &[(5, EARLY), (5, PARITY)], TooEarly),
            (990, &[(4, EARLY), (5, PARITY)], Noise),
            (50, &[(50, PARITY)], ClockPhase),
            (51, &[(50, PARITY)], Noise),
            (50, &[(20, PARITY), (30, PADDING)], ClockPhase),
            (50, &[(50, REFUSED)], Refused),
            (51, &[(50, REFUSED)], Noise),
            (99, &[(1, PARITY)], Noise),
            // half of an odd number is rounded up
            (51, &[(50, PADDING)], Noise),
            (50, &[(51, PADDING)], ClockPhase),
        ] {
            let s = stats(good, failures);
            assert_eq!(s.diagnosis(), expected, "{s:?}");
        }
    }

    #[test]
    fn every_diagnosis_says_what_to_do() {
        for (diagnosis, text) in [
            (Diagnosis::TooFewWords, "too few"),
            (Diagnosis::Good, "works"),
            (Diagnosis::NoSensor, "chip select"),
            (Diagnosis::TooEarly, "50 us"),
            (Diagnosis::ClockPhase, "mode 0"),
            (Diagnosis::Refused, "MOSI"),
            (Diagnosis::Noise, "cable"),
        ] {
            assert!(diagnosis.to_string().contains(text), "{diagnosis}");
        }
    }

    /// Words as they arrive one bit late (the idle level first) or one bit early (the idle level last).
    fn shifted(word: [u8; 2], late: bool, idle: bool) -> [u8; 2] {
        let (word, idle) = (u16::from_be_bytes(word), u16::from(idle));
        if late {
            word >> 1 | idle << 15
        } else {
            word << 1 | idle
        }
        .to_be_bytes()
    }

    #[test]
    fn a_shift_by_one_bit_fails_the_parity_of_three_words_in_four() {
        for (late, idle) in [(false, false), (false, true), (true, false), (true, true)] {
            let mut bad_parity = 0;
            let mut s = WordStats::default();
            for raw in 0..=4095 {
                let word = shifted(encode(Counts::new(raw).unwrap()), late, idle);
                bad_parity += u32::from(word.iter().any(|b| b.count_ones() % 2 == 0));
                s.count(&decode(word));
            }
            assert_eq!(bad_parity, 3 * 1024);
            assert_eq!(s.diagnosis(), Diagnosis::ClockPhase, "{s:?}");
        }
    }
}
