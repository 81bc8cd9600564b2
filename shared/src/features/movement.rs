//! Exploratory movements: a contact force and a sliding speed (eq. 20-22), and how much it wears the skin.

use core::fmt;

use serde::{Deserialize, Serialize};

/// One exploratory movement: the contact force that is set before the slide and the speed of the slide.
///
/// Whole millinewtons and micrometres per second, so that a movement in a table, on the link and in a recording's
/// manifest is the same movement to the bit.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
#[serde(try_from = "(u16, u32)", into = "(u16, u32)")]
pub struct Movement {
    force_mn: u16,
    speed_um_s: u32,
}

/// The reasons why a force and a speed are not a movement of this rig.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum MovementError {
    #[error(
        "contact force {} mN is outside {}..={} mN",
        .0,
        Movement::FORCE_MN.start(),
        Movement::FORCE_MN.end()
    )]
    Force(u32),
    #[error(
        "sliding speed {} um/s is outside {}..={} um/s",
        .0,
        Movement::SPEED_UM_S.start(),
        Movement::SPEED_UM_S.end()
    )]
    Speed(u32),
}

impl TryFrom<(u16, u32)> for Movement {
    type Error = MovementError;

    fn try_from((force_mn, speed_um_s): (u16, u32)) -> Result<Self, MovementError> {
        Self::new(force_mn, speed_um_s)
    }
}

impl From<Movement> for (u16, u32) {
    fn from(movement: Movement) -> Self {
        (movement.force_mn, movement.speed_um_s)
    }
}

impl Movement {
    /// Contact forces that a movement may have: a tenth of a newton is 9 counts of P_DC, and over 2 N the skin touches
    /// the core (fig. 3).
    pub(crate) const FORCE_MN: core::ops::RangeInclusive<u16> = 100..=2000;
    /// Sliding speeds that a movement may have.
    pub(crate) const SPEED_UM_S: core::ops::RangeInclusive<u32> = 5_000..=150_000;

    /// Movement 1 of the study: 1.26 N, 1.00 cm/s, the most useful one for traction.
    pub const FOR_TRACTION: Self = Self::on_grid(630_957, 100_000);
    /// Movement 2 of the study: 0.50 N, 2.51 cm/s, the most useful one for fineness.
    pub const FOR_FINENESS: Self = Self::on_grid(251_189, 251_189);
    /// Movement 3 of the study: 0.20 N, 6.31 cm/s, the most useful one for roughness.
    pub const FOR_ROUGHNESS: Self = Self::on_grid(100_000, 630_957);

    /// The movement of a recording that does not say how it was made: no rig makes it.
    pub const UNKNOWN: Self = Self {
        force_mn: 0,
        speed_um_s: 0,
    };

    /// Returns whether force and speed are both known.
    pub fn is_known(self) -> bool {
        self.force_mn != 0 && self.speed_um_s != 0
    }

    /// As [`Movement::new`], where 0 says that a value is unknown: as tables and recordings have it.
    /// Errors: the first value that is out of its range.
    pub const fn stored(force_mn: u16, speed_um_s: u32) -> Result<Self, MovementError> {
        // what is unknown is in every range
        let any = Self::FOR_FINENESS;
        let force = if force_mn == 0 {
            any.force_mn
        } else {
            force_mn
        };
        let speed = if speed_um_s == 0 {
            any.speed_um_s
        } else {
            speed_um_s
        };
        match Self::new(force, speed) {
            Ok(_) => Ok(Self {
                force_mn,
                speed_um_s,
            }),
            Err(why) => Err(why),
        }
    }

    /// As [`Movement::from_si`], of values that may be unknown.
    /// Errors: the first value that is known, and out of its range.
    pub fn partly(force_n: Option<f32>, speed_mm_s: Option<f32>) -> Result<Self, MovementError> {
        let any = Self::FOR_FINENESS;
        let all = Self::from_si(
            force_n.unwrap_or(any.force_n()),
            speed_mm_s.unwrap_or(any.speed_mm_s()),
        )?;
        Ok(Self {
            force_mn: force_n.map_or(0, |_| all.force_mn),
            speed_um_s: speed_mm_s.map_or(0, |_| all.speed_um_s),
        })
    }

    /// A movement of `force_mn` millinewtons and `speed_um_s` micrometres per second.
    /// Errors: the first value that is out of its range.
    #[inline(never)]
    pub const fn new(force_mn: u16, speed_um_s: u32) -> Result<Self, MovementError> {
        if force_mn < *Self::FORCE_MN.start() || force_mn > *Self::FORCE_MN.end() {
            return Err(MovementError::Force(force_mn as u32));
        }
        if speed_um_s < *Self::SPEED_UM_S.start() || speed_um_s > *Self::SPEED_UM_S.end() {
            return Err(MovementError::Speed(speed_um_s));
        }
        Ok(Self {
            force_mn,
            speed_um_s,
        })
    }

    /// A movement from newtons and millimetres per second, rounded to whole mN and um/s.
    /// Errors: the first value that is out of its range; not-a-number is out of every range.
    pub fn from_si(force_n: f32, speed_mm_s: f32) -> Result<Self, MovementError> {
        // `as` saturates, and turns not-a-number into 0: both are refused below
        let force_mn = libm::roundf(force_n * 1e3) as u32;
        let speed_um_s = libm::roundf(speed_mm_s * 1e3) as u32;
        match u16::try_from(force_mn) {
            Ok(mn) => Self::new(mn, speed_um_s),
            Err(_) => Err(MovementError::Force(force_mn)),
        }
    }

    /// 10^((i-1)/5) of eq. 20 and 21, times 100 000.
    const STEPS: [u32; 6] = [100_000, 158_489, 251_189, 398_107, 630_957, 1_000_000];

    /// Grid cell of a step of eq. 21 (force) and one of eq. 20 (speed).
    const fn on_grid(force: u32, speed: u32) -> Self {
        Self {
            force_mn: ((force * 2 + 500) / 1000) as u16,
            speed_um_s: (speed + 5) / 10,
        }
    }

    /// The 36 movements of the pilot study, force by force: F_i of eq. 21 with v_k of eq. 20.
    pub fn grid() -> impl Iterator<Item = Self> {
        let of_force = |force| Self::STEPS.map(|speed| Self::on_grid(force, speed));
        Self::STEPS.into_iter().flat_map(of_force)
    }

    /// Contact force in mN.
    pub const fn force_mn(self) -> u16 {
        self.force_mn
    }

    /// Contact force in N and sliding speed in mm/s, as far as they are known.
    pub fn known(self) -> (Option<f32>, Option<f32>) {
        let (force, speed) = self.written();
        (
            (self.force_mn != 0).then_some(force),
            (self.speed_um_s != 0).then_some(speed),
        )
    }

    /// Contact force in N and sliding speed in mm/s as people write them, 1.262 and not 1.2620001; 0 where one is
    /// unknown.
    pub fn written(self) -> (f32, f32) {
        let (force, speed) = (f32::from(self.force_mn), self.speed_um_s as f32);
        (force / 1e3, speed / 1e3)
    }

    /// Contact force in N; 0 where it is unknown.
    pub fn force_n(self) -> f32 {
        f32::from(self.force_mn) * 1e-3
    }

    /// Sliding speed in um/s.
    pub const fn speed_um_s(self) -> u32 {
        self.speed_um_s
    }

    /// Sliding speed in mm/s; 0 where it is unknown.
    pub fn speed_mm_s(self) -> f32 {
        // at most 150 000: exact in f32
        self.speed_um_s as f32 * 1e-3
    }

    /// Sliding power over the coefficient of friction, F v, in mW (eq. 22 without its mu).
    ///
    /// The paper prints `10^((a-2)/5) mu 20 mW`; 0.2 N times 1 cm/s is 2 mW, and that is what this returns.
    pub fn power_mw(self) -> f32 {
        self.force_n() * self.speed_mm_s()
    }

    /// Returns whether the movement wears the fingerprints off (Results, "Identifying the most useful exploratory
    /// movements").
    ///
    /// The paper avoids pairs of high sliding power but prints the limit only as grey boxes in fig. 7. Its three chosen
    /// movements all have a = i + k = 6 (12.6 mW); its example of a worn-out one has a = 10 (79.6 mW). Chosen here: the
    /// limit lies half a step of the grid above the chosen three.
    pub fn is_high_wear(self) -> bool {
        self.power_mw() > Self::WEAR_LIMIT_MW
    }

    /// See [`Movement::is_high_wear`]: 2 mW times 10^(4.5/5).
    pub(crate) const WEAR_LIMIT_MW: f32 = 15.887;
}

impl fmt::Display for Movement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::UNKNOWN {
            return f.write_str("unknown");
        }
        // as core prints an f32, to the nearest and then the even one: with core that takes the chip 9 KB
        let nearest = |value: f32, parts: f64| libm::rint(f64::from(value) * parts) as u32;
        let hundredths_n = nearest(self.force_n(), 100.0);
        let tenths_mm_s = nearest(self.speed_mm_s(), 10.0);
        if self.force_mn != 0 {
            write!(f, "{}.{:02} N", hundredths_n / 100, hundredths_n % 100)?;
        }
        if self.is_known() {
            f.write_str(", ")?;
        }
        if self.speed_um_s != 0 {
            write!(f, "{}.{} mm/s", tenths_mm_s / 10, tenths_mm_s % 10)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_printed_as_the_numbers_would_be() {
        use std::{format, string::ToString as _};
        let forces = Movement::FORCE_MN.map(|mn| Movement::new(mn, 5_000));
        let speeds = Movement::SPEED_UM_S.map(|um_s| Movement::new(100, um_s));
        for movement in forces.chain(speeds).map(Result::unwrap) {
            let (n, mm_s) = (movement.force_n(), movement.speed_mm_s());
            assert_eq!(movement.to_string(), format!("{n:.2} N, {mm_s:.1} mm/s"));
        }
    }

    #[test]
    fn grid_is_the_geometric_series_of_eq_20_and_21() {
        let grid: heapless::Vec<Movement, 36> = Movement::grid().collect();
        assert_eq!(grid.len(), 36);
        for (n, m) in grid.iter().enumerate() {
            let (i, k) = (n / 6, n % 6);
            let force = 0.2 * 10f64.powf(i as f64 / 5.0);
            let speed = 10.0 * 10f64.powf(k as f64 / 5.0);
            assert!((f64::from(m.force_mn()) - force * 1e3).abs() <= 0.5);
            assert!((f64::from(m.speed_um_s()) - speed * 1e3).abs() <= 0.5);
            assert_eq!(Movement::new(m.force_mn(), m.speed_um_s()), Ok(*m));
        }
    }

    #[test]
    fn the_studys_movements_are_low_wear_and_its_worn_example_is_not() {
        for (m, force, speed) in [
            (Movement::FOR_TRACTION, 1.26, 10.0),
            (Movement::FOR_FINENESS, 0.50, 25.1),
            (Movement::FOR_ROUGHNESS, 0.20, 63.1),
        ] {
            assert!((m.force_n() - force).abs() < 5e-3 && (m.speed_mm_s() - speed).abs() < 0.05);
            assert!(
                (m.power_mw() - 12.6).abs() < 0.05,
                "the three have equal power"
            );
            assert!(!m.is_high_wear());
        }
        assert!(Movement::from_si(1.262, 63.096).unwrap().is_high_wear());
        // a = i + k <= 6: 5 + 4 + 3 + 2 + 1 cells
        assert_eq!(Movement::grid().filter(|m| !m.is_high_wear()).count(), 15);
    }

    #[test]
    fn either_value_may_be_unknown() {
        use std::string::ToString as _;
        for (force_n, speed_mm_s, stored, text) in [
            (None, None, (0, 0), "unknown"),
            (Some(0.5), None, (500, 0), "0.50 N"),
            (None, Some(25.0), (0, 25_000), "25.0 mm/s"),
            (Some(0.5), Some(25.0), (500, 25_000), "0.50 N, 25.0 mm/s"),
        ] {
            let movement = Movement::partly(force_n, speed_mm_s).unwrap();
            assert_eq!(Movement::stored(stored.0, stored.1), Ok(movement));
            assert_eq!(movement.to_string(), text);
            let close = |a: Option<f32>, b: Option<f32>| match (a, b) {
                (Some(a), Some(b)) => libm::fabsf(a - b) < 1e-4,
                (a, b) => a == b,
            };
            let (force, speed) = movement.known();
            assert!(
                close(force, force_n) && close(speed, speed_mm_s),
                "{movement}"
            );
            let numbers = Movement::partly(Some(1.262), Some(25.119)).map(Movement::written);
            assert_eq!(numbers, Ok((1.262, 25.119)));
            assert_eq!(movement.is_known(), stored.0 != 0 && stored.1 != 0);
        }
        assert_eq!(Movement::stored(9, 0), Err(MovementError::Force(9)));
        assert_eq!(Movement::stored(0, 9), Err(MovementError::Speed(9)));
        // a value that is there is a value: 0 N is none
        let none = Movement::partly(Some(0.0), None);
        assert_eq!(none, Err(MovementError::Force(0)));
    }

    #[test]
    fn out_of_range_is_refused_with_the_value() {
        assert_eq!(Movement::new(99, 10_000), Err(MovementError::Force(99)));
        assert_eq!(Movement::new(2001, 10_000), Err(MovementError::Force(2001)));
        assert_eq!(Movement::new(200, 4_999), Err(MovementError::Speed(4_999)));
        assert_eq!(
            Movement::new(200, 150_001),
            Err(MovementError::Speed(150_001))
        );
        assert!(Movement::new(100, 5_000).is_ok() && Movement::new(2000, 150_000).is_ok());
        assert_eq!(
            Movement::from_si(f32::NAN, 25.0),
            Err(MovementError::Force(0))
        );
        assert_eq!(
            Movement::from_si(70.0, 25.0),
            Err(MovementError::Force(70_000))
        );
        assert_eq!(
            Movement::from_si(0.5, -3.0),
            Err(MovementError::Speed(0)),
            "negative speeds saturate to 0"
        );
    }
}
