//! A finger of an IIS3DWB accelerometer that floats in silicone behind the skin, and of a bar load cell of 1 kg on an
//! ADS1220.
//!
//! Z is read in each of the 4400 slots; a half-band filter takes it to 2200 Hz, and a high-pass of 10 Hz takes gravity
//! and tilt away, and most of a hand's tremor. The cell is read in every fourth slot, 1100 times a second, and held
//! between.

use super::finger::{AtRest, FingerError, FingerModel, FingerName, FingerParts, GRAVITY_PARTS};
use super::pressure::{Calibration, Channel, Counts, Pressure, RATE_HZ};
use super::slot::StartStep;
use super::{ads1220, iis3dwb};

/// A count of P_AC is so many LSBs of acceleration: 16, 0.98 mg. Its noise of 60 ug/sqrt(Hz) is then 2 counts
/// (DS12569).
const PAC_LSB: i32 = 16;
/// P_AC at rest.
const PAC_REST: i32 = 2048;
/// A count of P_DC is so many LSBs of the cell, as a shift.
const PDC_SHIFT: u32 = 10;
/// P_DC of a cell whose bridge is in balance: one that is wired the wrong way round is seen to go down.
const PDC_BALANCE: i32 = 1000;
/// Force of a count: 1 mV/V at 1 kg are 0.102 mV/V for each newton, 109 492 LSB, 106.9 counts.
const MN_PER_COUNT: f32 = 9.806_65e6 * (1 << PDC_SHIFT) as f32 / ads1220::LSB_PER_UNIT;

/// Half of a half-band filter of 15 taps, from its end to the tap before the middle, every other one being 0; in
/// 1/32768. Kaiser's window with beta 3: flat within 0.2 dB to 800 Hz, -3.5 dB at 1025 Hz, and 32 dB down from 1400 Hz
/// on.
const SIDE: [i32; 4] = [-306, 1048, -2766, 10_197];
const MIDDLE: i32 = 16_422;
const TAPS: usize = 15;

/// Share of the high-pass's slow part that a sample makes, in 1/32768: 10 Hz at 2200 samples a second.
const SLOW_SHARE: i32 = (core::f32::consts::TAU * 10.0 / RATE_HZ as f32 * 32_768.0) as i32;

/// The cell says the same in so many reads in a row when it has stopped, 4.5 ms. Two are usual, since it converts 1000
/// times a second and is read 1100 times. With its noise of some 300 LSBs one conversion is equal to the next in one of
/// a thousand: by chance there are three equal reads every few seconds, and five once in a month.
const MOST_SAME: u8 = 5;

/// The finger on its bus.
pub const PARTS: FingerParts = FingerParts {
    model: FingerModel {
        name: FingerName::Mems,
        calibration: Calibration {
            // in the place of pascals: mg
            pac_pa_per_count: PAC_LSB as f32 * iis3dwb::G_PER_LSB * 1e3,
            pac_rest: PAC_REST as f32,
            // of the force on a square centimetre
            pdc_pa_per_count: MN_PER_COUNT * 10.0,
            pdc_no_contact: PDC_BALANCE as f32,
            force_mn_per_count: MN_PER_COUNT,
            linear_mn: Calibration::PAPER.linear_mn,
        },
        pac_shows_force: false,
        at_rest: AtRest {
            pac_noise_counts: (0.8, 8.0),
            // a cell's zero is off by a tenth of its range or less, 105 counts, and the tip on it weighs 10 g at most,
            // 10 counts
            pdc_counts: (850.0, 1150.0),
        },
    },
    ports: &[iis3dwb::PORT, ads1220::PORT],
    power_up_ms: iis3dwb::POWER_UP_MS,
    start: &START,
    slots: &[
        &[iis3dwb::READ_Z],
        &[iis3dwb::READ_Z, ads1220::READ],
        &[iis3dwb::READ_Z],
        &[iis3dwb::READ_Z, iis3dwb::READ_ON],
    ],
    deaf_ms: 0,
    feels_gravity: true,
};

/// The decoder's memory.
#[derive(Clone, Debug)]
pub struct Mems {
    /// Z in the last slots, the latest last, LSB; how many of them came.
    z: [i16; TAPS],
    came: u8,
    /// The high-pass's slow part, in 1/32768 LSB; it begins at the first value.
    slow: Option<i64>,
    /// The last conversion of the cell, and how often in a row it was read.
    cell: Option<i32>,
    same: u8,
    /// True if the accelerometer was on when it was asked last.
    on: bool,
}

impl Mems {
    /// Creates the state before the first read.
    pub(super) const fn new() -> Self {
        Self {
            z: [0; TAPS],
            came: 0,
            slow: None,
            cell: None,
            same: 0,
            on: true,
        }
    }

    pub(super) fn sample(&mut self, n: u32, answer: &[u8]) -> Result<Pressure, FingerError> {
        let [low, high, _, rest @ ..] = answer else {
            return Err(FingerError::Silent);
        };
        self.take_z(i16::from_le_bytes([*low, *high]));
        // -1 from both at once is a line that nobody drives
        if matches!(answer, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]) {
            self.cell = None;
            return Err(FingerError::Silent);
        }
        match *rest {
            [upper, middle, lower] => self.take_cell(ads1220::code([upper, middle, lower])),
            [ctrl1_xl] => self.on = iis3dwb::is_on(ctrl1_xl),
            _ => {}
        }
        let channel = Channel::of_slot(n);
        let counts = match channel {
            Channel::Pac => self.pac()?,
            Channel::Pdc => self.pdc()?,
        };
        Ok(Pressure { channel, counts })
    }

    /// Gravity along the finger: what the high-pass takes away.
    pub(super) fn gravity(&self) -> Option<i32> {
        const { assert!(PAC_LSB as f32 == GRAVITY_PARTS) };
        Some((self.slow? >> 15) as i32)
    }

    /// The filtered acceleration of 7 slots ago, without what is slower than 10 Hz, LSB.
    fn acceleration(&mut self) -> i32 {
        let ends = self.z.iter().zip(self.z.iter().rev()).step_by(2);
        let sides: i32 = ends
            .zip(SIDE)
            .map(|((a, b), share)| (i32::from(*a) + i32::from(*b)) * share)
            .sum();
        let middle = self.z.get(TAPS / 2).map_or(0, |z| i32::from(*z));
        let now = i64::from(sides) + i64::from(middle) * i64::from(MIDDLE);
        let before = self.slow.unwrap_or(now);
        let slow = before + (now - before) * i64::from(SLOW_SHARE) / 32_768;
        self.slow = Some(slow);
        // the mean of before and after: flat up to half the rate
        ((now - (before + slow) / 2) >> 15) as i32
    }

    fn take_z(&mut self, z: i16) {
        self.z.rotate_left(1);
        let [.., last] = &mut self.z;
        *last = z;
        self.came = self.came.saturating_add(1);
    }

    fn take_cell(&mut self, code: i32) {
        self.same = if self.cell == Some(code) {
            self.same.saturating_add(1)
        } else {
            1
        };
        self.cell = Some(code);
    }

    fn pac(&mut self) -> Result<Counts, FingerError> {
        if usize::from(self.came) < TAPS {
            return Err(FingerError::Begins);
        }
        let acceleration = self.acceleration();
        let [.., before, last] = self.z;
        if !self.on {
            return Err(FingerError::Off);
        }
        // at an end of the accelerometer's range nobody knows how far it was beyond
        for z in [before, last] {
            match z {
                i16::MAX => return Ok(Counts::MAX),
                i16::MIN => return Ok(Counts::MIN),
                _ => {}
            }
        }
        Ok(clamp(
            PAC_REST + (acceleration + PAC_LSB / 2).div_euclid(PAC_LSB),
        ))
    }

    fn pdc(&self) -> Result<Counts, FingerError> {
        let code = self.cell.ok_or(FingerError::Begins)?;
        if ads1220::is_clipped(code) {
            return Err(FingerError::Cell);
        }
        if self.same >= MOST_SAME {
            return Err(FingerError::Stale);
        }
        let half = 1 << (PDC_SHIFT - 1);
        Ok(clamp(PDC_BALANCE + ((code + half) >> PDC_SHIFT)))
    }
}

fn clamp(counts: i32) -> Counts {
    let within = counts.clamp(0, i32::from(Counts::MAX.get()));
    Counts::from_low_bits(within as u16)
}

#[allow(clippy::indexing_slicing)] // while compiling
const START: [StartStep; iis3dwb::START.len() + ads1220::START.len()] = {
    let mut both = [iis3dwb::START[0]; iis3dwb::START.len() + ads1220::START.len()];
    let mut at = 0;
    while at < both.len() {
        both[at] = if at < iis3dwb::START.len() {
            iis3dwb::START[at]
        } else {
            ads1220::START[at - iis3dwb::START.len()]
        };
        at += 1;
    }
    both
};

#[cfg(test)]
mod tests;
