//! Pressures of the fingertip, the common form of every sensor's samples, and the calibration that turns counts into
//! pascals and newtons.
//!
//! Words, parity and commands end at [`crate::sensor`]. From here on there are [`Counts`] of two channels and one
//! [`Calibration`] record for each fingertip.

use serde::{Deserialize, Serialize};

/// Samples of one channel in a second (Methods, "BioTac": both pressures are sampled at 2200 Hz).
pub const RATE_HZ: u32 = 2200;
/// Slots in a second: the channels take turns, see [`Channel::PATTERN`].
pub const SLOTS_HZ: u32 = 2 * RATE_HZ;

/// The two pressures of the fluid under the skin.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Channel {
    /// Dynamic pressure P_AC: vibration, 10-1040 Hz, biased to half of full scale.
    Pac,
    /// Static pressure P_DC: contact force.
    Pdc,
}

impl Channel {
    /// The channels in the order of the slots: both at 2200 Hz out of 4400 slots a second.
    pub const PATTERN: [Self; 2] = [Self::Pac, Self::Pdc];

    /// The channel whose sample slot `n` gives.
    pub const fn of_slot(n: u32) -> Self {
        if n.is_multiple_of(2) {
            Self::Pac
        } else {
            Self::Pdc
        }
    }
}

/// A 12-bit reading of a converter over 0..3.3 V: 0..=4095.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct Counts(u16);

impl Counts {
    /// 0 V.
    pub const MIN: Self = Self(0);
    /// Full scale.
    pub const MAX: Self = Self(4095);

    /// `value` if it has 12 bits.
    pub const fn new(value: u16) -> Option<Self> {
        if value <= Self::MAX.0 {
            Some(Self(value))
        } else {
            None
        }
    }

    /// The lower 12 bits of `word`; the upper 4 are ignored.
    pub(crate) const fn from_low_bits(word: u16) -> Self {
        Self(word & Self::MAX.0)
    }

    /// 0..=4095.
    pub const fn get(self) -> u16 {
        self.0
    }

    /// Returns whether the reading sits at an end of the range: the real voltage may lie beyond it.
    pub(crate) const fn is_clipped(self) -> bool {
        self.0 == Self::MIN.0 || self.0 == Self::MAX.0
    }

    /// Returns whether the reading is within a sound finger's noise of an end of the range: a signal that stays there
    /// stands at a rail.
    pub(crate) const fn is_at_rail(self) -> bool {
        const NOISE: u16 = 8;
        self.0 <= NOISE || self.0 >= Self::MAX.0 - NOISE
    }
}

/// One sample of one channel.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct Pressure {
    /// The channel: one of the two pressures.
    pub channel: Channel,
    /// The reading.
    pub counts: Counts,
}

/// The constants of one fingertip. All of them differ from device to device; store those measured on yours.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Calibration {
    /// Dynamic pressure of one count, Pa.
    pub pac_pa_per_count: f32,
    /// P_AC at rest, counts (the 1.65 V bias).
    pub pac_rest: f32,
    /// Static pressure of one count, Pa.
    pub pdc_pa_per_count: f32,
    /// P_DC without contact, counts. It drifts with temperature: take a mean in the air before every approach.
    pub pdc_no_contact: f32,
    /// Contact force of one count of P_DC above its no-contact value, mN.
    pub force_mn_per_count: f32,
    /// Largest force for which force and P_DC are proportional, mN.
    pub linear_mn: f32,
}

/// Samples of a channel in so many ms.
pub const fn samples_in(ms: u16) -> u32 {
    ms as u32 * RATE_HZ / 1000
}

/// Voltage of one count: 12 bits over 0..3.3 V (Methods, "BioTac").
const MV_PER_COUNT: f32 = 3300.0 / 4096.0;

impl Calibration {
    /// A BioTac with the paper's values, and any transducer behind the paper's circuit.
    ///
    /// P_DC has 21.8 mV/kPa, P_AC 2.16 mV/Pa (21.8 mV/kPa times the second gain of 99.1) around 1.65 V (Methods,
    /// "BioTac"): 36.96 Pa and 0.373 Pa a count. The BioTac SP manual says 36.5 and 0.37. Force: 11.5 mN a count, a
    /// line below 2 N (fig. 3). The no-contact value is a recorded one, 2583..2695 over time (biotac_sp_ros,
    /// output.txt).
    pub const PAPER: Self = Self {
        pac_pa_per_count: MV_PER_COUNT / 2.16,
        pac_rest: 2048.0,
        pdc_pa_per_count: MV_PER_COUNT / 21.8e-3,
        pdc_no_contact: 2593.0,
        force_mn_per_count: 11.5,
        linear_mn: 2000.0,
    };

    /// Checks a record that comes from storage or from the host before a motor is moved by it.
    /// Errors: the first impossible value: a scale that is not above 0, a rest value outside the converter's range, or
    /// a no-contact value that leaves less than the linear range below full scale, so that the finger would press on
    /// and P_DC would not show it.
    #[inline(never)]
    pub fn check(&self) -> Result<(), CalibrationError> {
        let scales = [
            self.pac_pa_per_count,
            self.pdc_pa_per_count,
            self.force_mn_per_count,
            self.linear_mn,
        ];
        // not-a-number fails every comparison, so each is written as what must hold
        if !scales.iter().all(|s| *s > 0.0 && s.is_finite()) {
            return Err(CalibrationError::Scale);
        }
        let full_scale = f32::from(Counts::MAX.get());
        if !(self.pac_rest > 0.0 && self.pac_rest < full_scale) {
            return Err(CalibrationError::PacRest);
        }
        let top = self.pdc_no_contact + self.linear_mn / self.force_mn_per_count;
        if !(self.pdc_no_contact > 0.0 && top < full_scale) {
            return Err(CalibrationError::PdcNoContact);
        }
        Ok(())
    }

    /// Counts of P_DC above the no-contact value at a contact force (fig. 3), where the lever stops; `None` beyond the
    /// linear range. Not rounded: a mean of P_DC resolves less than a count, and 2 N rounded to 174 counts would read
    /// as 2001 mN, beyond the linear range.
    pub(crate) fn force_counts(&self, force_mn: u16) -> Option<f32> {
        let mn = f32::from(force_mn);
        (mn <= self.linear_mn).then_some(mn / self.force_mn_per_count)
    }
}

/// The faults of a calibration record.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum CalibrationError {
    #[error(
        "a scale of the calibration is absurd (a count of P_DC is 5.75 to 23 mN; below 0, a load cell's signal wires \
         are swapped): calibrate again"
    )]
    Scale,
    #[error("P_AC at rest is outside 0..4095 counts: measure it again without contact")]
    PacRest,
    #[error(
        "P_DC without contact leaves no room for the linear range below 4095 counts: \
         lift the finger and measure it again; if it stays, the sensor is over-inflated or broken"
    )]
    PdcNoContact,
}

#[cfg(test)]
mod tests {
    use super::*;

    const C: Calibration = Calibration::PAPER;

    #[test]
    fn the_papers_sensitivities_give_the_known_pascals_per_count() {
        assert!((C.pac_pa_per_count - 0.373).abs() < 5e-4);
        assert!((C.pdc_pa_per_count - 36.96).abs() < 5e-3);
        // the manual's own figures
        assert!((C.pac_pa_per_count / 0.37 - 1.0).abs() < 0.02);
        assert!((C.pdc_pa_per_count / 36.5 - 1.0).abs() < 0.02);
        // the second gain joins the two
        assert!((C.pdc_pa_per_count / C.pac_pa_per_count - 99.1).abs() < 0.05);
    }

    #[test]
    fn counts_have_twelve_bits_and_clip_at_their_ends() {
        assert_eq!(Counts::new(4095), Some(Counts::MAX));
        assert_eq!(Counts::new(4096), None);
        assert_eq!(Counts::from_low_bits(0xFABC).get(), 0x0ABC);
        for value in 0..=4095 {
            let clipped = Counts::new(value).unwrap().is_clipped();
            assert_eq!(clipped, value == 0 || value == 4095);
        }
    }

    #[test]
    fn target_forces_give_the_worked_counts_and_none_beyond_2_n() {
        for (force_mn, counts) in [(200, 17), (500, 43), (1260, 110), (2000, 174)] {
            let above_rest = C.force_counts(force_mn).unwrap();
            assert_eq!(libm::roundf(above_rest) as u16, counts);
        }
        let unrounded = C.force_counts(200).unwrap();
        assert!((unrounded - 17.391).abs() < 1e-3);
        assert_eq!(C.force_counts(2001), None);
    }

    #[test]
    fn a_calibration_that_would_press_for_ever_is_refused() {
        assert_eq!(C.check(), Ok(()));
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            for scale in 0..4 {
                let mut c = C;
                *[
                    &mut c.pac_pa_per_count,
                    &mut c.pdc_pa_per_count,
                    &mut c.force_mn_per_count,
                    &mut c.linear_mn,
                ][scale] = bad;
                assert_eq!(c.check(), Err(CalibrationError::Scale), "{scale} {bad}");
            }
        }
        for pac_rest in [0.0, 4095.0, f32::NAN] {
            let c = Calibration { pac_rest, ..C };
            assert_eq!(c.check(), Err(CalibrationError::PacRest), "{pac_rest}");
        }
        let no_contact = |pdc_no_contact| {
            Calibration {
                pdc_no_contact,
                ..C
            }
            .check()
        };
        for bad in [0.0, 3921.5, f32::NAN] {
            let refused = Err(CalibrationError::PdcNoContact);
            assert_eq!(no_contact(bad), refused, "{bad}");
        }
        // 2 N are 173.9 counts: 3921 is the last whole count with room for them
        assert_eq!(no_contact(3921.0), Ok(()));
        // exactly full scale is already too much: a clipped reading is no reading
        let exact = Calibration {
            pdc_no_contact: 3895.0,
            force_mn_per_count: 10.0,
            ..C
        };
        assert_eq!(exact.check(), Err(CalibrationError::PdcNoContact));
    }
}
