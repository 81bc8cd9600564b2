//! The constants of one rig, and how they are found: lines through measured points.

use heapless::Vec;
use serde::{Deserialize, Serialize};

use super::turning;
use crate::CRC32;
use crate::sensor::FingerModel;
use crate::sensor::pressure::{Calibration, CalibrationError};

/// Measured constants of one rig, with their dates and the sensor they belong to.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RigCalibration {
    /// Fingertip: zero and counts per newton.
    pub pressure: Calibration,
    /// Motor current of the stage without load: A at standstill, and A per mm/s.
    pub unloaded_a: (f32, f32),
    /// Shear per motor current above that, N/A (the paper's inclined stage).
    pub newton_per_ampere: f32,
    /// Day on which the force per count was measured, as 20261121; 0 if it was not measured.
    pub date: u32,
    /// True if P_DC in the air was measured with this finger and is no default.
    pub air_known: bool,
    /// Day on which the accelerometer was turned over and `pressure.pac_pa_per_count` was measured with it, in mg;
    /// format as `date`.
    pub turned: u32,
    /// Serial number of the sensor, as the sensor sends it.
    pub serial: [u8; 16],
}

impl RigCalibration {
    /// The reference rig's constants with such a finger, until measured ones are read from the store.
    pub const fn unmeasured(finger: &FingerModel) -> Self {
        Self {
            pressure: finger.calibration,
            unloaded_a: (0.037, 0.0),
            newton_per_ampere: 16.4,
            date: 0,
            air_known: false,
            turned: 0,
            serial: [0; 16],
        }
    }

    const AIR_KNOWN: u32 = 1 << 31;

    /// Returns the day on which the force per count was measured, see [`RigCalibration::date`]; `None` if it was not.
    pub fn scale_day(&self) -> Option<u32> {
        (self.date != 0).then_some(self.date)
    }

    /// The calibration with a measured P_DC in the air, counts.
    #[must_use]
    pub fn with_air(mut self, counts: f32) -> Self {
        self.pressure.pdc_no_contact = counts;
        self.air_known = true;
        self
    }

    /// Shear in N at a motor current and speed.
    pub fn shear_n(&self, current_a: f32, speed_mm_s: f32) -> f32 {
        let (standstill, per_mm_s) = self.unloaded_a;
        (current_a - standstill - per_mm_s * speed_mm_s) * self.newton_per_ampere
    }

    /// Bytes of a stored record.
    pub const BYTES: usize = 64;

    /// Returns the record as it is stored: nine f32, the date, the day on which the accelerometer was turned over, the
    /// serial number, and a CRC-32 of these; little-endian. The highest bit of the date is set where P_DC in the air is
    /// known.
    #[inline(never)]
    pub fn to_bytes(&self) -> Vec<u8, { Self::BYTES }> {
        let air = if self.air_known { Self::AIR_KNOWN } else { 0 };
        let numbers = self.numbers().into_iter().flat_map(f32::to_le_bytes);
        let days = [self.date | air, self.turned].into_iter();
        let fields = numbers.chain(days.flat_map(u32::to_le_bytes));
        let mut bytes = Vec::new();
        // there is room for all of them
        for byte in fields.chain(self.serial) {
            let _ = bytes.push(byte);
        }
        let _ = bytes.extend_from_slice(&CRC32.checksum(&bytes).to_le_bytes());
        bytes
    }

    /// Returns the record in `bytes`, checked.
    /// Errors: [`RigCalibrationError::Damaged`], or the error of [`RigCalibration::check`].
    #[inline]
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, RigCalibrationError> {
        let whole: &[u8; Self::BYTES] =
            bytes.try_into().map_err(|_| RigCalibrationError::Damaged)?;
        let (words, _) = whole.as_chunks::<4>();
        let (body, crc) = whole.split_at(Self::BYTES - 4);
        if crc != CRC32.checksum(body).to_le_bytes() {
            return Err(RigCalibrationError::Damaged);
        }
        let mut words = words.iter().copied();
        let mut word = || words.next().unwrap_or_default();
        let mut number = || f32::from_le_bytes(word());
        let pressure = Calibration {
            pac_pa_per_count: number(),
            pac_rest: number(),
            pdc_pa_per_count: number(),
            pdc_no_contact: number(),
            force_mn_per_count: number(),
            linear_mn: number(),
        };
        let unloaded_a = (number(), number());
        let newton_per_ampere = number();
        let [date, turned] = [word(), word()].map(u32::from_le_bytes);
        let mut serial = [0; 16];
        for (to, from) in serial.iter_mut().zip(words.flatten()) {
            *to = from;
        }
        let record = Self {
            pressure,
            unloaded_a,
            newton_per_ampere,
            date: date & !Self::AIR_KNOWN,
            air_known: date & Self::AIR_KNOWN != 0,
            turned,
            serial,
        };
        record.check()?;
        Ok(record)
    }

    fn numbers(&self) -> [f32; 9] {
        let p = &self.pressure;
        let (standstill, per_mm_s) = self.unloaded_a;
        [
            p.pac_pa_per_count,
            p.pac_rest,
            p.pdc_pa_per_count,
            p.pdc_no_contact,
            p.force_mn_per_count,
            p.linear_mn,
            standstill,
            per_mm_s,
            self.newton_per_ampere,
        ]
    }

    /// Checks a record before it moves a motor.
    #[inline(never)]
    pub fn check(&self) -> Result<(), RigCalibrationError> {
        self.pressure
            .check()
            .map_err(RigCalibrationError::Pressure)?;
        if !PLAUSIBLE_MN.contains(&self.pressure.force_mn_per_count) {
            return Err(RigCalibrationError::Pressure(CalibrationError::Scale));
        }
        let mg = &self.pressure.pac_pa_per_count;
        if self.turned != 0 && !turning::PLAUSIBLE_MG.contains(mg) {
            return Err(RigCalibrationError::Turned);
        }
        let (standstill, per_mm_s) = self.unloaded_a;
        let good = standstill.is_finite() && per_mm_s.is_finite();
        if !(good && self.newton_per_ampere > 0.0 && self.newton_per_ampere.is_finite()) {
            return Err(RigCalibrationError::Current);
        }
        Ok(())
    }
}

/// Reasons for refusing a calibration.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
pub enum RigCalibrationError {
    /// The fingertip's constants.
    #[error(transparent)]
    Pressure(CalibrationError),
    /// The stage's constants.
    #[error("the stage's current must be finite, and newtons per ampere above 0")]
    Current,
    /// The stored record has changed since it was written.
    #[error("the stored calibration is damaged: calibrate again")]
    Damaged,
    /// Fewer than three points, or all at the same place.
    #[error("a line takes three points or more, at different places")]
    Points,
    /// The points do not lie on a line: R^2 below 0.99.
    #[error("the points do not lie on a line (R^2 below 0.99): measure again")]
    NoLine,
    /// The value of an accelerometer's count.
    #[error("an accelerometer's count is within a tenth of 0.976 mg: turn the finger over again")]
    Turned,
}

/// Contact force per count that a fingertip can have, mN: the paper's 11.5, half of it and twice as much (chosen).
const PLAUSIBLE_MN: core::ops::RangeInclusive<f32> = 5.75..=23.0;

/// Least R^2 that counts as a line; the paper's force line has 0.995 (fig. 3).
const LEAST_R2: f64 = 0.99;

/// A straight line through points as they come: motor current against load on the inclined
/// stage (Methods, "Traction of texture"), motor current against speed.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct LineFit {
    points: u32,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl LineFit {
    /// Takes a point; one that is not finite is left out.
    pub fn push(&mut self, x: f32, y: f32) {
        if !(x.is_finite() && y.is_finite()) {
            return;
        }
        self.points += 1;
        let n = f64::from(self.points);
        let (dx, dy) = (f64::from(x) - self.x, f64::from(y) - self.y);
        self.x += dx / n;
        self.y += dy / n;
        // Welford's way, which does not lose small slopes on large offsets
        self.xx += dx * (f64::from(x) - self.x);
        self.xy += dx * (f64::from(y) - self.y);
        self.yy += dy * (f64::from(y) - self.y);
    }

    /// Offset and slope of y = offset + slope x.
    pub fn line(&self) -> Result<(f32, f32), RigCalibrationError> {
        if self.points < 3 || self.xx <= 0.0 {
            return Err(RigCalibrationError::Points);
        }
        let slope = self.xy / self.xx;
        if self.yy > 0.0 && slope * self.xy < LEAST_R2 * self.yy {
            return Err(RigCalibrationError::NoLine);
        }
        Ok(((self.y - slope * self.x) as f32, slope as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_found_again() {
        let mut fit = LineFit::default();
        for n in 0..20 {
            let x = n as f32 * 0.1;
            let wobble = if n % 2 == 0 { 0.001 } else { -0.001 };
            fit.push(x, 0.3 + 0.05 * x + wobble);
        }
        let (offset, slope) = fit.line().unwrap();
        assert!(
            (offset - 0.3).abs() < 1e-3 && (slope - 0.05).abs() < 1e-3,
            "{offset} {slope}"
        );
    }

    #[test]
    fn what_is_no_line_is_refused() {
        let fit = |points: &[(f32, f32)]| {
            let mut fit = LineFit::default();
            points.iter().for_each(|&(x, y)| fit.push(x, y));
            fit.line()
        };
        assert_eq!(
            fit(&[(0.0, 1.0), (1.0, 2.0)]),
            Err(RigCalibrationError::Points)
        );
        assert_eq!(
            fit(&[(1.0, 1.0), (1.0, 2.0), (1.0, 3.0)]),
            Err(RigCalibrationError::Points)
        );
        assert_eq!(
            fit(&[(0.0, 0.0), (1.0, 3.0), (2.0, 1.0), (3.0, 2.0)]),
            Err(RigCalibrationError::NoLine)
        );
        assert_eq!(
            fit(&[(0.0, 0.0), (1.0, f32::NAN), (2.0, 1.0)]),
            Err(RigCalibrationError::Points)
        );
        assert_eq!(fit(&[(0.0, 2.0), (1.0, 2.0), (2.0, 2.0)]), Ok((2.0, 0.0)));
    }

    #[test]
    fn shear_is_the_current_above_the_unloaded_one() {
        let rig = RigCalibration {
            pressure: Calibration::PAPER,
            unloaded_a: (0.1, 0.002),
            newton_per_ampere: 8.0,
            date: 20_261_121,
            air_known: true,
            turned: 0,
            serial: *b"BT-0000000000001",
        };
        assert!((rig.shear_n(0.25, 25.0) - 0.8).abs() < 1e-5);
        assert_eq!(rig.check(), Ok(()));
        let mut wrong = [rig; 3];
        wrong[0].newton_per_ampere = 0.0;
        wrong[1].unloaded_a.0 = f32::NAN;
        wrong[2].newton_per_ampere = f32::NAN;
        for wrong in wrong {
            let current = RigCalibrationError::Current;
            assert_eq!(wrong.check(), Err(current));
            assert_eq!(RigCalibration::from_bytes(&wrong.to_bytes()), Err(current));
        }
        assert_eq!(RigCalibration::from_bytes(&rig.to_bytes()), Ok(rig));
        let mg = Calibration {
            pac_pa_per_count: 0.95,
            ..Calibration::PAPER
        };
        let turned = RigCalibration {
            pressure: mg,
            turned: 20_261_126,
            ..rig
        };
        assert_eq!(RigCalibration::from_bytes(&turned.to_bytes()), Ok(turned));
        for whole in [rig.to_bytes(), turned.to_bytes()] {
            for bit in 0..8 * whole.len() {
                let mut bytes = whole.clone();
                bytes[bit / 8] ^= 1 << (bit % 8);
                assert_eq!(
                    RigCalibration::from_bytes(&bytes),
                    Err(RigCalibrationError::Damaged)
                );
            }
            for length in 0..whole.len() {
                assert_eq!(
                    RigCalibration::from_bytes(&whole[..length]),
                    Err(RigCalibrationError::Damaged)
                );
            }
        }
        assert_eq!(
            RigCalibration {
                turned: 20_261_126,
                ..rig
            }
            .check(),
            Err(RigCalibrationError::Turned)
        );
        for (date, air_known) in [(0, false), (0, true), (1, false), (1, true)] {
            let rig = RigCalibration {
                date,
                air_known,
                ..rig
            };
            assert_eq!(RigCalibration::from_bytes(&rig.to_bytes()), Ok(rig));
        }
        assert_eq!(rig.scale_day(), Some(20_261_121));
        assert_eq!(RigCalibration { date: 0, ..rig }.scale_day(), None);
        let pressure = Calibration {
            force_mn_per_count: -1.0,
            ..Calibration::PAPER
        };
        assert!(matches!(
            RigCalibration { pressure, ..rig }.check(),
            Err(RigCalibrationError::Pressure(_))
        ));
    }
}
