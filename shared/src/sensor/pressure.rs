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
    pub const fn from_low_bits(word: u16) -> Self {
        Self(word & Self::MAX.0)
    }

    /// The nearest reading; what is out of range gives the end of the range, not-a-number gives 0.
    pub fn saturating(value: f32) -> Self {
        // `as` saturates at the ends of u16
        Self((libm::roundf(value) as u16).min(Self::MAX.0))
    }

    /// 0..=4095.
    pub const fn get(self) -> u16 {
        self.0
    }

    /// Returns whether the reading sits at an end of the range: the real voltage may lie beyond it.
    pub const fn is_clipped(self) -> bool {
        self.0 == Self::MIN.0 || self.0 == Self::MAX.0
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

/// A contact force read from P_DC.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Force {
    /// mN by the linear relation; below 0 when P_DC has drifted under its no-contact value.
    pub mn: f32,
    /// The force lies beyond the range where the relation is a line: the skin touches the core, `mn` is only a lower
    /// bound of how hard the finger presses, and the finger must be lifted.
    pub beyond_linear: bool,
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
    ///
    /// # Errors
    /// The first impossible value: a scale that is not above 0, a rest value outside the converter's range, or a
    /// no-contact value that leaves less than the linear range below full scale, so that the finger would press on and
    /// P_DC would not show it.
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

    /// Pressure of `counts` on `channel`, Pa: P_AC about its rest value, P_DC above its no-contact value. `counts` may
    /// be a mean.
    pub fn pascals(&self, channel: Channel, counts: f32) -> f32 {
        let (rest, pa_per_count) = self.line(channel);
        (counts - rest) * pa_per_count
    }

    /// The reading of `pa` pascals on `channel`: the inverse of [`Calibration::pascals`], rounded, and clipped as the
    /// converter clips.
    pub fn counts(&self, channel: Channel, pa: f32) -> Counts {
        let (rest, pa_per_count) = self.line(channel);
        Counts::saturating(rest + pa / pa_per_count)
    }

    fn line(&self, channel: Channel) -> (f32, f32) {
        match channel {
            Channel::Pac => (self.pac_rest, self.pac_pa_per_count),
            Channel::Pdc => (self.pdc_no_contact, self.pdc_pa_per_count),
        }
    }

    /// Contact force at `pdc` counts of P_DC (fig. 3). One count is 5.7 % of 0.2 N: give a mean over 10 ms or more.
    ///
    /// Not-a-number is reported as beyond the linear range, the side on which the finger is lifted.
    pub fn force(&self, pdc: f32) -> Force {
        let mn = (pdc - self.pdc_no_contact) * self.force_mn_per_count;
        Force {
            mn,
            beyond_linear: mn > self.linear_mn || mn.is_nan(),
        }
    }

    /// Counts of P_DC above the no-contact value at which the lever stops for a contact force of `force_mn` mN. Not
    /// rounded: a mean of P_DC resolves less than a count, and 2 N rounded to 174 counts would read as 2001 mN, beyond
    /// the linear range.
    ///
    /// # Errors
    /// The force is beyond the linear range.
    pub fn force_counts(&self, force_mn: u16) -> Result<f32, BeyondLinear> {
        let mn = f32::from(force_mn);
        if mn <= self.linear_mn {
            Ok(mn / self.force_mn_per_count)
        } else {
            Err(BeyondLinear {
                force_mn,
                linear_mn: self.linear_mn,
            })
        }
    }
}

/// The requested force lies beyond the range that P_DC can measure.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
#[error(
    "contact force {force_mn} mN is beyond {linear_mn} mN, where the skin touches the core: ask for less"
)]
pub struct BeyondLinear {
    /// The force asked for, mN.
    pub force_mn: u16,
    /// The end of the linear range, mN.
    pub linear_mn: f32,
}

/// The faults of a calibration record.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum CalibrationError {
    /// A scale, or the end of the linear range, is not a number above 0, or no finger has so many mN per count.
    #[error(
        "a scale of the calibration is absurd (a count of P_DC is 5.75 to 23 mN; below 0, a load cell's signal wires are swapped): \
         calibrate again"
    )]
    Scale,
    /// P_AC at rest is outside the converter's range.
    #[error("P_AC at rest is outside 0..4095 counts: measure it again without contact")]
    PacRest,
    /// P_DC without contact is outside the converter's range, or leaves too little of it for the linear range.
    #[error(
        "P_DC without contact leaves no room for the linear range below 4095 counts: \
         lift the finger and measure it again; if it stays, the sensor is over-inflated or broken"
    )]
    PdcNoContact,
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::string::ToString;

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
    fn pascals_count_from_the_rest_values() {
        assert_eq!(C.pascals(Channel::Pac, 2048.0), 0.0);
        assert_eq!(C.pascals(Channel::Pdc, 2593.0), 0.0);
        assert!((C.pascals(Channel::Pac, 0.0) + 764.0).abs() < 0.5);
        assert!((C.pascals(Channel::Pac, 2021.0) + 27.0 * 0.373).abs() < 0.01);
        assert!((C.pascals(Channel::Pdc, 2603.0) - 369.6).abs() < 0.05);
    }

    #[test]
    fn every_reading_survives_pascals_and_back() {
        for value in 0..=4095 {
            let counts = Counts::new(value).unwrap();
            for channel in Channel::PATTERN {
                let pa = C.pascals(channel, f32::from(value));
                assert_eq!(C.counts(channel, pa), counts);
            }
        }
    }

    #[test]
    fn pressures_beyond_the_converter_clip() {
        assert_eq!(C.counts(Channel::Pac, 800.0), Counts::MAX);
        assert_eq!(C.counts(Channel::Pac, -800.0), Counts::MIN);
        assert_eq!(C.counts(Channel::Pdc, 1e6), Counts::MAX);
        assert_eq!(C.counts(Channel::Pdc, f32::NEG_INFINITY), Counts::MIN);
        for value in 0..=4095 {
            let clipped = Counts::new(value).unwrap().is_clipped();
            assert_eq!(clipped, value == 0 || value == 4095);
        }
    }

    #[test]
    fn counts_have_twelve_bits() {
        assert_eq!(Counts::new(4095), Some(Counts::MAX));
        assert_eq!(Counts::new(4096), None);
        assert_eq!(Counts::from_low_bits(0xFABC).get(), 0x0ABC);
        assert_eq!(Counts::saturating(17.5).get(), 18);
        assert_eq!(Counts::saturating(17.4).get(), 17);
        assert_eq!(Counts::saturating(1e9), Counts::MAX);
        assert_eq!(Counts::saturating(f32::NAN), Counts::MIN);
    }

    #[test]
    fn target_forces_give_the_worked_counts() {
        for (force_mn, counts) in [(200, 17), (500, 43), (1260, 110), (2000, 174)] {
            let above_rest = C.force_counts(force_mn).unwrap();
            assert_eq!(libm::roundf(above_rest) as u16, counts);
            let force = C.force(C.pdc_no_contact + above_rest);
            assert!((force.mn - f32::from(force_mn)).abs() < 0.02);
        }
        assert!(
            (C.force_counts(200).unwrap() - 17.391).abs() < 1e-3,
            "unrounded"
        );
    }

    #[test]
    fn one_count_is_11_5_mn_and_5_7_percent_of_the_lightest_touch() {
        assert_eq!(C.force(2594.0).mn, 11.5);
        assert!((C.force(2594.0).mn / 200.0 - 0.0575).abs() < 1e-6);
        assert_eq!(C.force(2591.0).mn, -23.0, "drift below rest is shown");
        // the whole count nearest to 2 N is already beyond it
        assert_eq!(C.force(2593.0 + 174.0).mn, 2001.0);
        assert!(C.force(2593.0 + 174.0).beyond_linear);
    }

    #[test]
    fn beyond_2_n_is_flagged_and_never_a_target() {
        let half = Calibration {
            pdc_no_contact: 0.0,
            force_mn_per_count: 10.0,
            ..C
        };
        assert!(
            !half.force(200.0).beyond_linear,
            "2 N itself is still linear"
        );
        assert!(half.force(200.1).beyond_linear);
        assert!((half.force(210.0).mn - 2100.0).abs() < 1e-3);
        assert!(half.force(f32::NAN).beyond_linear);
        assert!(!half.force(-5.0).beyond_linear);
        assert_eq!(half.force_counts(2000), Ok(200.0));
        let beyond = BeyondLinear {
            force_mn: 2001,
            linear_mn: 2000.0,
        };
        assert_eq!(half.force_counts(2001), Err(beyond));
        assert!(beyond.to_string().contains("2001 mN is beyond 2000 mN"));
    }

    #[test]
    fn a_calibration_that_would_press_for_ever_is_refused() {
        assert_eq!(C.check(), Ok(()));
        let with = |change: fn(&mut Calibration)| {
            let mut c = C;
            change(&mut c);
            c.check()
        };
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
        for bad in [0.0, 4095.0, f32::NAN] {
            let c = Calibration { pac_rest: bad, ..C };
            assert_eq!(c.check(), Err(CalibrationError::PacRest), "{bad}");
        }
        for bad in [0.0, 3921.5, f32::NAN] {
            let c = Calibration {
                pdc_no_contact: bad,
                ..C
            };
            assert_eq!(c.check(), Err(CalibrationError::PdcNoContact), "{bad}");
        }
        // 2 N are 173.9 counts: 3921 is the last whole count with room for them
        assert_eq!(with(|c| c.pdc_no_contact = 3921.0), Ok(()));
        // exactly full scale is already too much: a clipped reading is no reading
        let exact = Calibration {
            pdc_no_contact: 3895.0,
            force_mn_per_count: 10.0,
            ..C
        };
        assert_eq!(exact.check(), Err(CalibrationError::PdcNoContact));
        for error in [
            CalibrationError::Scale,
            CalibrationError::PacRest,
            CalibrationError::PdcNoContact,
        ] {
            assert!(
                error.to_string().contains("again"),
                "{error} says what to do"
            );
        }
    }
}
