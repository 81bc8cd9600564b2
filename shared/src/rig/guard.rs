//! What can go wrong, how it is noticed and what happens then: one table, and the detection of everything in it that can
//! be seen from outside the lever and the stage.
//!
//! Whatever is noticed, the stage's motor is braked and the finger lifts before anything is reported.

use serde::{Deserialize, Serialize};

use super::force::ForceMeter;
use super::lever::LeverFault;
use super::stage::StageFault;
use crate::pressure::{Calibration, Pressure};

/// A fault of the rig.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub enum Fault {
    /// The finger is pressed too hard.
    ForceHigh,
    /// The emergency stop is pressed.
    EStop,
    /// The limit switch of the lever is pressed while the finger presses.
    LeverLimit,
    /// The stage is at a limit switch while it should not be.
    StageLimit,
    /// The motor of the stage is driven and does not turn.
    StageStall,
    /// The motor of the stage turns, and the encoder says nothing.
    EncoderSilent,
    /// The stage does not follow its profile.
    StageOff,
    /// No readable word from the sensor.
    SensorSilent,
    /// Too many words are damaged.
    SensorErrors,
    /// The sensor says the same thing again and again.
    SensorFrozen,
    /// Samples of a slide are missing.
    SlideGap,
    /// Three slides in a row were rejected.
    Rejected,
    /// The lever came down all the way without contact.
    NoContact,
    /// The lever steps and the force does not follow.
    LeverSlips,
    /// The contact force does not stay where it was put.
    Unsteady,
    /// The probe's own tasks do nothing any more.
    TasksHung,
    /// The lever did not find its limit switch.
    LeverNotHome,
    /// The stage did not find its limit switch.
    StageNotHome,
}

/// A row of the fault table.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Row {
    /// The fault.
    pub fault: Fault,
    /// Its name on the link and on the display.
    pub name: &'static str,
    /// How it is detected.
    pub detected: &'static str,
    /// Longest time in ms from the moment it can be detected until the motors have been told.
    pub deadline_ms: u32,
    /// What stops.
    pub stops: &'static str,
    /// What is refused until it is over.
    pub refused: &'static str,
    /// What the user does.
    pub recovery: &'static str,
}

const BOTH: &str = "stage motor braked, finger lifted to the limit switch";
const ALL: &str = "every movement, until reset";

macro_rules! rows {
    ($($fault:ident, $name:literal, $detected:literal, $deadline:literal, $stops:expr, $refused:expr, $recovery:literal;)*) => {
        /// Every fault, once.
        pub const FAULTS: &[Row] = &[$(Row {
            fault: Fault::$fault,
            name: $name,
            detected: $detected,
            deadline_ms: $deadline,
            stops: $stops,
            refused: $refused,
            recovery: $recovery,
        }),*];

        const NAMES: &[&str] = &[$($name),*];
        const RECOVERIES: &[&str] = &[$($recovery),*];
    };
}

rows! {
    ForceHigh, "force too high", "P_DC means more than 2.05 N, mean of 10 ms made up for its lag; it bends: that is 2.1 N", 12,
        "lever driver off at once, then finger lifted; stage motor braked", ALL, "look at the lever and the sample, then reset";
    EStop, "emergency stop", "its input", 2, BOTH, ALL, "release it, then reset";
    LeverLimit, "lever at its limit", "upper limit switch closed more than 1 mm below it, 3 ms", 5, BOTH, ALL,
        "check the switch and its wire, then reset";
    StageLimit, "stage at its limit", "the limit switch that it is moving towards, and it is not looking for it, 3 ms", 5, BOTH, ALL,
        "clear the stage's way, then reset";
    StageStall, "stage blocked", "less than a tenth of the way made in 30 ms, and the motor has no back-EMF", 35, BOTH, ALL,
        "clear the stage's way, then reset";
    EncoderSilent, "encoder silent", "less than a tenth of the way made in 30 ms, and the motor's back-EMF says that it turns", 35,
        BOTH, ALL, "check the encoder's wires, then reset";
    StageOff, "stage off its path", "more than 1 mm and the way of 40 ms off the profile, or not arrived 0.3 s after its end", 2, BOTH, ALL,
        "check load, supply and encoder, then reset";
    SensorSilent, "sensor silent", "no readable word of P_AC or of P_DC for 10 ms", 12, BOTH, ALL, "check the sensor's cable and power, then reset";
    SensorErrors, "sensor link bad", "23 damaged words within a second: half a percent", 2, BOTH, ALL,
        "check cable length, ground and clock phase, then reset";
    SensorFrozen, "sensor frozen", "P_AC the same for 100 ms, which always has noise", 102, BOTH, ALL,
        "switch the sensor's power off and on, then reset";
    SlideGap, "gap in a slide", "a damaged or late word between the background and the end of the slide", 2,
        "nothing: the slide is finished", "the slide: it is repeated", "none";
    Rejected, "three slides rejected", "counted", 2, "the exploration ends, finger lifted", "nothing", "look at the reasons given";
    NoContact, "no contact", "lever at its lower end, P_DC unchanged", 2, BOTH, ALL, "put a sample under the finger, then reset";
    LeverSlips, "lever slips", "3 mm of steps after contact and the force not reached, or still in contact when lifted, or not lifted where a press begins", 2, BOTH, ALL,
        "check the lever's motor and its current, then reset";
    Unsteady, "force unsteady", "six trims and still more than 1 count and 5 % off, trims that add up to 15 %, or a zero that has moved by 8 counts", 2, BOTH, ALL,
        "check that sample and lever are fixed, then reset";
    TasksHung, "tasks hung", "the firmware's tasks have not checked in for 2 s, or what was asked for makes no progress for 30 s", 2, BOTH, ALL,
        "none: the watchdog restarts the probe once the finger is lifted";
    LeverNotHome, "lever not home", "limit switch not reached in 1.25 times the travel, or P_DC there or at the first zero more than 40 counts off the calibration's", 2,
        "lever motor off, stage motor braked", ALL, "lift the finger by hand, check the switch, then reset; calibrate a finger that has drifted";
    StageNotHome, "stage not home", "limit switch not reached: the stage falls behind, or has gone 1.25 times the travel", 2, BOTH, ALL,
        "clear the stage's way and check the switch, then reset";
}

impl Fault {
    /// Its name on the link and on the display. By itself, for the whole table would be in the chip's flash.
    pub fn name(self) -> &'static str {
        NAMES.get(self as usize).copied().unwrap_or("unknown fault")
    }

    /// What the user does. By itself as well.
    pub fn recovery(self) -> &'static str {
        RECOVERIES.get(self as usize).copied().unwrap_or("reset")
    }

    /// The fault's row of the table.
    pub fn row(self) -> Option<&'static Row> {
        FAULTS.iter().find(|row| row.fault == self)
    }

    const fn bit(self) -> u32 {
        1 << self as u32
    }
}

impl core::fmt::Display for Fault {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.name())
    }
}

impl core::error::Error for Fault {}

impl From<LeverFault> for Fault {
    fn from(fault: LeverFault) -> Self {
        match fault {
            LeverFault::NotHome => Self::LeverNotHome,
            LeverFault::NoContact => Self::NoContact,
            LeverFault::Slips => Self::LeverSlips,
            LeverFault::Unsteady => Self::Unsteady,
        }
    }
}

impl From<StageFault> for Fault {
    fn from(fault: StageFault) -> Self {
        match fault {
            StageFault::Following => Self::StageOff,
            StageFault::NotHome => Self::StageNotHome,
        }
    }
}

/// Force by P_DC at which the finger is lifted, mN, so that it never feels more than 2.2 N.
///
/// P_DC bends above 2 N, where the skin touches the core, and says less than there is (fig. 3); what silicone adds to a
/// fast press it does not say at all. 2.05 N by P_DC are 2.07 to 2.13 N.
pub const FORCE_LIMIT_MN: f32 = 2050.0;
const SILENT_MS: u32 = 10;
const FROZEN_MS: u32 = 100;
const SWITCH_MS: u32 = 3;
const MOTION_MS: usize = 30;
/// Damaged words in a second that are one too many.
const MAX_DAMAGED: u32 = 22;
/// Slices of that second.
const SLICES: usize = 10;
const SLICE_MS: u32 = 100;

/// Faults whose detection is switched off. For tests, which must see that a missing guard is noticed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Unguarded(u32);

impl Unguarded {
    /// All guards are on but this one.
    pub const fn against(fault: Fault) -> Self {
        Self(fault.bit())
    }

    /// Whether `fault` is not looked for.
    pub const fn ignores(self, fault: Fault) -> bool {
        self.0 & fault.bit() != 0
    }
}

/// What the guard looks at every millisecond.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// Words since the last millisecond; `None` is a damaged one.
    pub words: &'a [Option<Pressure>],
    /// The emergency stop.
    pub e_stop: bool,
    /// The tasks that the rig serves have not checked in.
    pub hung: bool,
    /// The lever's upper limit switch, while it should be open.
    pub lever_top: bool,
    /// The limit switch that the stage is moving towards, while it should be open.
    pub stage_limit: bool,
    /// How fast the stage should go, mm/s.
    pub stage_wanted_mm_s: f32,
    /// How far the stage has come, mm.
    pub stage_mm: f32,
    /// How fast the stage's motor turns by its back-EMF, mm/s.
    pub emf_mm_s: f32,
}

/// Watches over sensor, switches, stage and force.
#[derive(Clone, Debug, Default)]
pub struct Guard {
    unguarded: Unguarded,
    /// For how many ms nothing was heard of P_AC and of P_DC.
    silent_ms: [u32; 2],
    /// The last P_AC and P_DC, and for how many ms they have not changed.
    last: [Option<Pressure>; 2],
    frozen_ms: [u32; 2],
    damaged: [u32; SLICES],
    slice_ms: u32,
    lever_top_ms: u32,
    stage_limit_ms: u32,
    /// How far the stage should have come, has come by its encoder and has come by its motor's back-EMF, in mm since it
    /// began to move: the last [`MOTION_MS`] and where the next goes.
    motion: [[f32; 3]; MOTION_MS],
    motion_ms: usize,
}

impl Guard {
    /// A guard that looks for everything but `unguarded`.
    pub fn new(unguarded: Unguarded) -> Self {
        Self {
            unguarded,
            ..Self::default()
        }
    }

    /// Forgets what it has seen, not what it ignores.
    pub fn reset(&mut self) {
        *self = Self::new(self.unguarded);
    }

    /// Whether `fault` is looked for.
    pub fn looks_for(&self, fault: Fault) -> bool {
        !self.unguarded.ignores(fault)
    }

    /// One millisecond. `limit_mn` is the force at which the finger is lifted, at most [`FORCE_LIMIT_MN`]. The first of
    /// several faults is the one that can hurt most.
    pub fn tick(
        &mut self,
        seen: &Seen<'_>,
        meter: &ForceMeter,
        mn_per_count: f32,
        limit_mn: f32,
    ) -> Option<Fault> {
        let sensor = self.sensor(seen.words);
        let stage = self.stage(seen);
        self.lever_top_ms = if seen.lever_top {
            self.lever_top_ms.saturating_add(1)
        } else {
            0
        };
        self.stage_limit_ms = if seen.stage_limit {
            self.stage_limit_ms.saturating_add(1)
        } else {
            0
        };
        // a calibration that says less than the paper's does not allow more
        let mn_per_count = mn_per_count.max(Calibration::PAPER.force_mn_per_count);
        let force =
            meter.counts().max(meter.counts_now()) * mn_per_count > limit_mn.min(FORCE_LIMIT_MN);
        [
            force.then_some(Fault::ForceHigh),
            seen.e_stop.then_some(Fault::EStop),
            seen.hung.then_some(Fault::TasksHung),
            (self.lever_top_ms >= SWITCH_MS).then_some(Fault::LeverLimit),
            (self.stage_limit_ms >= SWITCH_MS).then_some(Fault::StageLimit),
            stage,
        ]
        .into_iter()
        .chain(sensor)
        .flatten()
        .find(|&fault| self.looks_for(fault))
    }

    fn sensor(&mut self, words: &[Option<Pressure>]) -> [Option<Fault>; 3] {
        for frozen in &mut self.frozen_ms {
            *frozen = frozen.saturating_add(1);
        }
        for word in words.iter().flatten() {
            let channel = word.channel as usize;
            if let (Some(last), Some(frozen)) =
                (self.last.get_mut(channel), self.frozen_ms.get_mut(channel))
                && *last != Some(*word)
            {
                *last = Some(*word);
                *frozen = 0;
            }
        }
        for silent in &mut self.silent_ms {
            *silent = silent.saturating_add(1);
        }
        for word in words.iter().flatten() {
            if let Some(silent) = self.silent_ms.get_mut(word.channel as usize) {
                *silent = 0;
            }
        }
        // where nothing at all is heard, that is silence and no damage
        let heard = words.iter().flatten().count();
        let damaged = if heard > 0 {
            (words.len() - heard) as u32
        } else {
            0
        };
        self.slice_ms += 1;
        if self.slice_ms >= SLICE_MS {
            self.slice_ms = 0;
            self.damaged.rotate_right(1);
            let [newest, ..] = &mut self.damaged;
            *newest = 0;
        }
        let [newest, ..] = &mut self.damaged;
        *newest += damaged;
        // P_DC may well stand still for that long; P_AC has noise of a count and more
        let [pac_frozen_ms, _] = self.frozen_ms;
        [
            self.silent_ms
                .iter()
                .any(|&ms| ms >= SILENT_MS)
                .then_some(Fault::SensorSilent),
            (self.damaged.iter().sum::<u32>() > MAX_DAMAGED).then_some(Fault::SensorErrors),
            (pac_frozen_ms >= FROZEN_MS).then_some(Fault::SensorFrozen),
        ]
    }

    fn stage(&mut self, seen: &Seen<'_>) -> Option<Fault> {
        let wanted = libm::fabsf(seen.stage_wanted_mm_s);
        let Some(slot) = self
            .motion
            .get(self.motion_ms.wrapping_sub(1) % MOTION_MS)
            .filter(|_| wanted >= 1.0)
        else {
            self.motion_ms = 0;
            return None;
        };
        let [expected, _, turned] = if self.motion_ms == 0 { [0.0; 3] } else { *slot };
        let now = [
            expected + wanted * 1e-3,
            seen.stage_mm,
            turned + libm::fabsf(seen.emf_mm_s) * 1e-3,
        ];
        let oldest = self.motion.get_mut(self.motion_ms % MOTION_MS)?;
        let before = core::mem::replace(oldest, now);
        self.motion_ms += 1;
        if self.motion_ms <= MOTION_MS {
            return None;
        }
        let [expected, made, turned] = [now[0] - before[0], now[1] - before[1], now[2] - before[2]];
        let stands = libm::fabsf(made) < expected * 0.1;
        match (stands, turned < expected * 0.5) {
            (true, true) => Some(Fault::StageStall),
            (true, false) => Some(Fault::EncoderSilent),
            (false, _) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pressure::{Channel, Counts};

    fn word(channel: Channel, counts: u16) -> Option<Pressure> {
        Some(Pressure {
            channel,
            counts: Counts::new(counts).unwrap(),
        })
    }

    /// What a rig at rest shows; P_AC has its noise.
    fn at_rest(ms: u32) -> ([Option<Pressure>; 4], Seen<'static>) {
        let pac = |n: u32| word(Channel::Pac, 2040 + (ms * 7 + n * 5) as u16 % 9);
        let words = [
            pac(0),
            word(Channel::Pdc, 2593),
            pac(1),
            word(Channel::Pdc, 2593),
        ];
        let seen = Seen {
            words: &[],
            e_stop: false,
            hung: false,
            lever_top: false,
            stage_limit: false,
            stage_wanted_mm_s: 0.0,
            stage_mm: 30.0,
            emf_mm_s: 0.0,
        };
        (words, seen)
    }

    /// Runs a second of ms, each changed by `change`; returns the first fault and when.
    fn run(
        change: impl Fn(u32, &mut [Option<Pressure>; 4], &mut Seen<'_>),
    ) -> Option<(u32, Fault)> {
        let mut guard = Guard::default();
        let meter = ForceMeter::new(2593.0);
        (0..1000).find_map(|ms| {
            let (mut words, mut seen) = at_rest(ms);
            change(ms, &mut words, &mut seen);
            Some((
                ms,
                guard.tick(
                    &Seen {
                        words: &words,
                        ..seen
                    },
                    &meter,
                    11.5,
                    2050.0,
                )?,
            ))
        })
    }

    #[test]
    fn a_rig_at_rest_has_no_fault() {
        assert_eq!(run(|_, _, _| ()), None);
    }

    #[test]
    fn faults_are_seen_when_the_table_says() {
        assert_eq!(
            run(|ms, _, s| s.e_stop = ms >= 500),
            Some((500, Fault::EStop))
        );
        assert_eq!(
            run(|ms, _, s| s.lever_top = ms >= 500),
            Some((502, Fault::LeverLimit))
        );
        assert_eq!(
            run(|ms, _, s| s.stage_limit = ms >= 500),
            Some((502, Fault::StageLimit))
        );
        assert_eq!(
            run(|ms, _, s| s.stage_limit = ms % 3 != 0),
            None,
            "two ms of a switch are its bouncing"
        );
        assert_eq!(
            run(|ms, w, _| if ms >= 500 {
                *w = [None; 4]
            }),
            Some((509, Fault::SensorSilent))
        );
        assert_eq!(
            run(|ms, w, _| if ms >= 500 {
                *w = at_rest(500).0;
                w[2] = w[0]
            }),
            Some((600, Fault::SensorFrozen))
        );
    }

    #[test]
    fn half_a_percent_of_damaged_words_is_too_many() {
        // one of four words every 40 ms is 25 a second, every 50 ms 20
        assert!(matches!(
            run(|ms, w, _| if ms % 40 == 0 {
                w[1] = None
            }),
            Some((880, Fault::SensorErrors))
        ));
        assert_eq!(
            run(|ms, w, _| if ms % 50 == 0 {
                w[1] = None
            }),
            None
        );
    }

    #[test]
    fn a_standing_stage_is_blocked_or_its_encoder_silent() {
        let moving = |ms: u32, s: &mut Seen<'_>| {
            s.stage_wanted_mm_s = 10.0;
            s.emf_mm_s = 10.0;
            s.stage_mm = 30.0 + ms.min(500) as f32 * 0.01;
        };
        let blocked = run(|ms, _, s| {
            moving(ms, s);
            if ms > 500 {
                s.emf_mm_s = 0.5;
            }
        });
        let silent = run(|ms, _, s| moving(ms, s));
        assert!(
            matches!(blocked, Some((527..=531, Fault::StageStall))),
            "{blocked:?}"
        );
        assert!(
            matches!(silent, Some((527..=531, Fault::EncoderSilent))),
            "{silent:?}"
        );
        let goes = run(|ms, _, s| {
            moving(ms, s);
            s.stage_mm = 30.0 + ms as f32 * 0.01;
        });
        assert_eq!(goes, None);
    }

    #[test]
    fn no_calibration_allows_more_than_the_papers() {
        let mut meter = ForceMeter::new(2000.0);
        for _ in 0..44 {
            // 2.05 N are 178.3 counts of 11.5 mN
            meter.push(Counts::new(2179).unwrap());
        }
        let (words, seen) = at_rest(0);
        for mn_per_count in [1.0, 11.5, 12.0] {
            let fault = Guard::default().tick(
                &Seen {
                    words: &words,
                    ..seen
                },
                &meter,
                mn_per_count,
                2050.0,
            );
            assert_eq!(fault, Some(Fault::ForceHigh));
        }
        meter.zero();
        assert_eq!(
            Guard::default().tick(
                &Seen {
                    words: &words,
                    ..seen
                },
                &ForceMeter::new(2000.0),
                11.5,
                2050.0
            ),
            None
        );
    }

    #[test]
    fn the_table_has_every_fault_once_and_a_fault_can_be_ignored() {
        for (at, row) in FAULTS.iter().enumerate() {
            assert_eq!(row.fault as usize, at, "{}", row.name);
            assert_eq!(row.fault.row(), Some(row));
            let said = (row.fault.name(), row.fault.recovery());
            assert_eq!(said, (row.name, row.recovery));
            assert!(!FAULTS[..at].iter().any(|other| other.name == row.name));
        }
        assert_eq!(Fault::StageNotHome as usize + 1, FAULTS.len());
        let mut guard = Guard::new(Unguarded::against(Fault::EStop));
        let (words, seen) = at_rest(0);
        let seen = Seen {
            words: &words,
            e_stop: true,
            lever_top: true,
            ..seen
        };
        let meter = ForceMeter::new(2593.0);
        assert_eq!(guard.tick(&seen, &meter, 11.5, 2050.0), None);
        guard.reset();
        guard.tick(&seen, &meter, 11.5, 2050.0);
        guard.tick(&seen, &meter, 11.5, 2050.0);
        assert_eq!(
            guard.tick(&seen, &meter, 11.5, 2050.0),
            Some(Fault::LeverLimit),
            "the others are still looked for"
        );
    }
}
