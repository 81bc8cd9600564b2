//! Checks that P_AC comes from a sensor that works: a signal that hangs or is cut off measures no texture.

use super::block::BLOCK;
use super::slide::SlideError;
use crate::sensor::pressure::{Counts, RATE_HZ};

/// So many equal samples of P_AC in a row show that it hangs: 100 ms. Its noise changes it all the time: the longest
/// run of equal samples in 680 recorded slides of 20 materials is 6.
pub(crate) const FROZEN: u16 = (RATE_HZ / 10) as u16;
/// An end of the converter's range is at least so far from a sound finger's rest, which is about its middle, counts.
const LEAST_RAIL: i32 = Counts::MAX.get() as i32 / 8 * 3;
/// From one end of the range to the other, counts; one less where somebody cut both off alike.
const RANGE: i32 = Counts::MAX.get() as i32 - 1;
/// More than one of so many samples cut off is told: the powers are too low then. In the 680 slides no value that far
/// out comes twice; an accelerometer that is slid fast over silk cuts off up to a tenth (simulated).
const TOLD: u32 = 100;
/// More than one of so many is no measurement.
const REFUSED: u32 = 4;

/// An extreme of the samples, and how many have it.
#[derive(Clone, Copy, Debug, Default)]
struct Extreme {
    value: i16,
    samples: u32,
}

impl Extreme {
    /// Takes samples of which this is the farthest out.
    fn take(&mut self, farthest: i16, is_beyond: bool, samples: &[i16]) {
        if is_beyond {
            self.value = farthest;
            self.samples = 0;
        }
        if farthest == self.value {
            let there = samples.iter().filter(|sample| **sample == farthest);
            self.samples += there.count() as u32;
        }
    }

    fn is_rail(self) -> bool {
        is_far(self.value)
    }
}

fn is_far(sample: i16) -> bool {
    i32::from(sample).abs() >= LEAST_RAIL
}

/// True if a sample shows no change since the one before: equal, or as far out on one side.
fn stands(last: i16, sample: i16) -> bool {
    let same_side = (last < 0) == (sample < 0);
    last == sample || same_side && is_far(last) && is_far(sample)
}

/// P_AC as it comes, in counts about its rest. The ends of the range are where samples pile up: the rest, which differs
/// from finger to finger, need not be known.
#[derive(Clone, Debug, Default)]
pub struct Signal {
    samples: u32,
    last: Option<i16>,
    /// Samples in a row that are equal, or as far out as an end of the range may be, on one side: a vibration comes
    /// back.
    stands: u16,
    hangs: bool,
    low: Extreme,
    high: Extreme,
}

impl Signal {
    /// Takes the next samples.
    pub fn push(&mut self, samples: &[i16]) {
        // a run that is too long reaches over the ends of such a part: inside of it nothing needs to be counted
        const { assert!(BLOCK < FROZEN as usize) };
        for part in samples.chunks(BLOCK) {
            if self.reaches_an_extreme(part) {
                // as words, which cost less to compare
                let (low, high) = part
                    .iter()
                    .fold((i32::MAX, i32::MIN), |(low, high), sample| {
                        (low.min(i32::from(*sample)), high.max(i32::from(*sample)))
                    });
                let (low, high) = (low as i16, high as i16);
                let first = self.last.is_none();
                self.low.take(low, first || low < self.low.value, part);
                self.high.take(high, first || high > self.high.value, part);
            }
            self.count_standing(part);
            self.last = part.last().copied();
        }
        self.samples = self.samples.saturating_add(samples.len() as u32);
    }

    /// True if a sample is not between the extremes so far.
    fn reaches_an_extreme(&self, part: &[i16]) -> bool {
        let low = i32::from(self.low.value);
        let between = (i32::from(self.high.value) - low - 1).max(0) as u32;
        let is_out = |sample: &i16| (i32::from(*sample) - low - 1) as u32 >= between;
        let (fours, rest) = part.as_chunks::<4>();
        let any = |[a, b, c, d]: &[i16; 4]| is_out(a) || is_out(b) || is_out(c) || is_out(d);
        fours.iter().any(any) || rest.iter().any(is_out)
    }

    /// True if all samples are of two neighbouring counts: a dead converter may go to and fro between them, and a
    /// sliding finger's signal has noise of more than one.
    pub fn is_flat(&self) -> bool {
        self.high.value.saturating_sub(self.low.value) <= 1
    }

    fn count_standing(&mut self, part: &[i16]) {
        let links = || part.iter().zip(part.iter().skip(1));
        let first = self.last.iter().zip(part);
        let begin = first.chain(links());
        let begin = begin.take_while(|(last, sample)| stands(**last, **sample));
        let begin = begin.count() as u16;
        let joined = self.stands.saturating_add(begin);
        self.hangs |= joined >= FROZEN;
        let all = part.len() - usize::from(self.last.is_none());
        self.stands = if usize::from(begin) == all {
            joined
        } else {
            let end = links().rev();
            let end = end.take_while(|(last, sample)| stands(**last, **sample));
            end.count() as u16
        };
    }

    /// Checks what has come; [`SlideError::Clipped`] is told of a signal with more than 1 % of its samples at the ends
    /// of the converter's range.
    /// Errors: [`SlideError::Silent`] for a signal that did not change for 100 ms or stood at an end of the range,
    /// [`SlideError::Clipped`] for one with more than a quarter of its samples there.
    pub fn check(&self) -> Result<Option<SlideError>, SlideError> {
        if self.hangs {
            return Err(SlideError::Silent);
        }
        let [low, high] = [self.low, self.high];
        let clipped = if i32::from(high.value) - i32::from(low.value) >= RANGE {
            low.samples + high.samples
        } else {
            let rails = [low, high].into_iter().filter(|end| end.is_rail());
            rails.map(|end| end.samples).max().unwrap_or(0)
        };
        let of = self.samples;
        let why = SlideError::Clipped { clipped, of };
        if clipped > of / REFUSED {
            return Err(why);
        }
        Ok((clipped > of / TOLD).then_some(why))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::vec::Vec;

    fn check(samples: impl IntoIterator<Item = i16>) -> Result<Option<SlideError>, SlideError> {
        let samples: Vec<i16> = samples.into_iter().collect();
        let (mut signal, mut whole) = (Signal::default(), Signal::default());
        samples.chunks(64).for_each(|samples| signal.push(samples));
        whole.push(&samples);
        assert_eq!(signal.check(), whole.check(), "blocks make no difference");
        whole.check()
    }

    /// A tone of this amplitude, cut off at the ends of a range about such a rest.
    fn tone(amplitude: f64, rest: i32) -> impl Iterator<Item = i16> {
        (0..6600).map(move |n| {
            let value = (amplitude * (f64::from(n) * 0.7123).sin()).round() as i32;
            ((value + rest).clamp(0, 4095) - rest) as i16
        })
    }

    #[test]
    fn a_signal_that_hangs_or_stands_at_a_rail_is_none() {
        for value in [0, 5, 2047, -2048, i16::MAX, i16::MIN] {
            assert_eq!(check([value; 6600]), Err(SlideError::Silent), "{value}");
        }
        // for 100 ms, anywhere
        let hangs = |n: usize, at_rail: i16| {
            tone(90.0, 2048).enumerate().map(move |(at, x)| match at {
                at if (3000..3000 + n).contains(&at) => at_rail + at as i16 % 5,
                _ => x,
            })
        };
        for rail in [2041, -2048, 1790, -1790] {
            assert_eq!(check(hangs(222, rail)), Err(SlideError::Silent), "{rail}");
            assert_eq!(check(hangs(218, rail)), Ok(None), "{rail}");
            let flickers = |(n, _): (usize, _)| rail + n as i16 % 5;
            let all = tone(1.0, 0).enumerate().map(flickers);
            assert_eq!(check(all), Err(SlideError::Silent), "{rail}");
        }
        // from one rail to the other
        let ends = (0..6600).map(|n| if n % 3 == 0 { 2047 } else { -2048 });
        assert!(matches!(
            check(ends),
            Err(SlideError::Clipped {
                clipped: 6600,
                of: 6600
            })
        ));
    }

    #[test]
    fn more_than_one_percent_at_the_ends_of_the_range_is_told_and_a_quarter_refused() {
        for rest in [1900, 2021, 2048, 2200] {
            // a pure tone piles up at its own extremes, too
            for amplitude in [1.0, 40.0, 900.0, 1600.0, 1890.0] {
                assert_eq!(check(tone(amplitude, rest)), Ok(None), "{amplitude} {rest}");
            }
            let told = check(tone(2150.0, rest));
            assert!(
                matches!(told, Ok(Some(SlideError::Clipped { .. }))),
                "{rest} {told:?}"
            );
            let refused = check(tone(9000.0, rest));
            assert!(matches!(refused, Err(SlideError::Clipped { .. })), "{rest}");
        }
        let clips = |n: usize, both: bool| {
            tone(700.0, 2048)
                .enumerate()
                .map(move |(at, x)| match at % 100 {
                    0 if at / 100 < n => 2047,
                    50 if both && at / 100 < n => -2048,
                    _ => x,
                })
        };
        assert_eq!(check(clips(66, false)), Ok(None));
        assert_eq!(check(clips(33, true)), Ok(None));
        let more = |clipped| Ok(Some(SlideError::Clipped { clipped, of: 6600 }));
        assert_eq!(check(clips(34, true)), more(68));
        let one_more = clips(66, false).enumerate();
        assert_eq!(
            check(one_more.map(|(at, x)| if at == 7 { 2047 } else { x })),
            more(67)
        );
        assert_eq!(check([]), Ok(None));
    }

    #[test]
    fn a_signal_of_two_neighbouring_counts_is_flat() {
        let flat = |samples: &[i16]| {
            let mut signal = Signal::default();
            samples.chunks(64).for_each(|part| signal.push(part));
            signal.is_flat()
        };
        for [a, b] in [[0, 1], [7, 8], [-3, -2], [1900, 1901]] {
            let to_and_fro: Vec<i16> = (0..6600).map(|n| if n % 3 == 0 { a } else { b }).collect();
            assert!(flat(&to_and_fro), "{a} {b}");
            let mut one_more = to_and_fro;
            one_more[4321] = b + 1;
            assert!(!flat(&one_more), "{a} {b}");
        }
    }
}
