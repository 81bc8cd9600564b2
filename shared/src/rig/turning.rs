//! Calibration of an accelerometer by turning it over: gravity along it one way and the other gives the value of a
//! count, and its zero.

use core::ops::RangeInclusive;

use super::weigh::Still;
use crate::sensor::mems;

/// Least gravity along a finger that points up or down, counts: one that lies on its side is not measured.
const LEAST: f32 = 0.7 * COUNTS_PER_G;
/// Value of a count in the data sheet of the IIS3DWB, mg.
const MG_PER_COUNT: f32 = mems::PARTS.model.calibration.pac_pa_per_count;
const COUNTS_PER_G: f32 = 1e3 / MG_PER_COUNT;
/// Plausible values of a count, mg: within a tenth of the data sheet's (chosen, since its own limits could not be
/// read). A finger that is turned over 15 degrees askew shows 3 % less.
pub(crate) const PLAUSIBLE_MG: RangeInclusive<f32> = 0.9 * MG_PER_COUNT..=1.1 * MG_PER_COUNT;
/// Largest offset of its zero, mg (chosen, for the same reason).
const MOST_OFFSET_MG: f32 = 250.0;

#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Turning {
    still: Still,
    first: Option<f32>,
}

impl Turning {
    pub(crate) fn wants_turn(&self) -> bool {
        self.first.is_some()
    }

    /// Takes gravity along the finger, counts of P_AC ([`crate::sensor::AnyFinger::gravity`]),
    /// [`LOOKS_HZ`](super::weigh::LOOKS_HZ) times a second. Both ways, once it has been still in each.
    pub(crate) fn take(&mut self, counts: f32) -> Option<Turned> {
        let mean = self.still.take(counts)?;
        if libm::fabsf(mean) < LEAST {
            return None;
        }
        let first = *self.first.get_or_insert(mean);
        (first * mean < 0.0).then_some(Turned {
            g_counts: libm::fabsf(first - mean) / 2.0,
            offset_counts: (first + mean) / 2.0,
        })
    }
}

/// The result.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Turned {
    /// Counts of P_AC that 1 g makes.
    pub g_counts: f32,
    /// Reading at 0 g, counts.
    pub offset_counts: f32,
}

impl Turned {
    /// Acceleration of a count, mg; `None` where no sound IIS3DWB is like that.
    pub fn mg_per_count(&self) -> Option<f32> {
        let mg = 1e3 / self.g_counts;
        let good = PLAUSIBLE_MG.contains(&mg)
            && libm::fabsf(self.offset_counts * MG_PER_COUNT) <= MOST_OFFSET_MG;
        good.then_some(mg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Takes gravity in g for so many looks each; returns the result.
    fn turn(ways: &[(f32, u32)]) -> (Turning, Option<Turned>) {
        let mut turning = Turning::default();
        let mut looks = 0u32;
        for &(g, times) in ways {
            for _ in 0..times {
                looks += 1;
                let trembles = if looks.is_multiple_of(2) { 4.0 } else { -4.0 };
                if let turned @ Some(_) = turning.take(g / 0.976e-3 + trembles) {
                    return (turning, turned);
                }
            }
        }
        (turning, None)
    }

    #[test]
    fn both_ways_give_scale_and_zero() {
        // 3 % too much and 40 mg off, from either way, with its side up for a while between
        for way in [1.0, -1.0] {
            let ways = [(1.03, 160), (0.0, 300), (-1.03, 160)];
            let (_, turned) = turn(&ways.map(|(g, looks)| (way * g + 0.04, looks)));
            let turned = turned.unwrap();
            let mg = turned.mg_per_count().unwrap();
            assert!((mg * 1.03 / 0.976 - 1.0).abs() < 1e-3, "{turned:?}");
            let offset_mg = turned.offset_counts * 0.976;
            assert!((offset_mg - 40.0).abs() < 0.5, "{turned:?}");
        }
    }

    #[test]
    fn what_is_not_turned_over_is_waited_for() {
        let (turning, turned) = turn(&[(1.0, 160)]);
        assert!(turning.wants_turn() && turned.is_none());
        assert_eq!(turn(&[(1.0, 1000)]).1, None);
        // half a turn, and one that does not rest
        assert_eq!(turn(&[(1.0, 160), (0.1, 1000), (0.9, 1000)]).1, None);
        assert_eq!(turn(&[(1.0, 160), (-1.0, 140), (1.0, 1000)]).1, None);
        // on its side all the while
        assert!(!turn(&[(0.0, 1000), (-0.5, 1000)]).0.wants_turn());
        assert_eq!(turn(&[(1.0, 160), (f32::NAN, 1000)]).1, None);
    }

    #[test]
    fn what_no_accelerometer_does_is_refused() {
        let turned = |g_counts, offset_counts| Turned {
            g_counts,
            offset_counts,
        };
        for (g, offset) in [(1025.0, 0.0), (960.0, 200.0), (1080.0, -200.0)] {
            assert!(turned(g, offset).mg_per_count().is_some(), "{g} {offset}");
        }
        for (g, offset) in [
            (900.0, 0.0),
            (1150.0, 0.0),
            (1025.0, 300.0),
            (1025.0, -300.0),
            (0.0, 0.0),
            (f32::NAN, 0.0),
            (1025.0, f32::NAN),
        ] {
            assert_eq!(turned(g, offset).mg_per_count(), None, "{g} {offset}");
        }
    }
}
