//! Detection of every fault that can be seen from outside the lever and the stage: sensor, switches, stage and force.

use super::force::ForceMeter;
use crate::sensor::FingerModel;
use crate::sensor::pressure::{Calibration, Pressure};

use super::fault::Fault;
use super::phase::{HIGH_FORCE_MN, most_mn};

/// Force by P_DC at which the finger is lifted, mN, so that it never bears more than 2.2 N.
///
/// P_DC bends above 2 N, where the skin touches the core, and reads too low (fig. 3); it does not show the part that
/// silicone adds to a fast press. 2.05 N by P_DC are 2.07 to 2.13 N.
pub(crate) const FORCE_LIMIT_MN: f32 = 2050.0;
/// The same while a rig that was allowed to presses more than 1.26 N. Friction adds to P_DC, 3 % of the shear in the
/// model: 2.1 N by P_DC are at most 2.18 N.
pub(crate) const HIGH_FORCE_LIMIT_MN: f32 = 2100.0;
const SILENT_MS: u32 = 10;
const FROZEN_MS: u32 = 100;
/// The switch under a lever that stands there is open for so long when the lever has left it: contacts bounce, and the
/// stage shakes them (chosen).
const LEFT_MS: u32 = 20;
const MOTION_MS: usize = 30;
/// Number of damaged words in a second that is a fault.
const MAX_DAMAGED: u32 = 22;
/// Slices of that second.
const SLICES: usize = 10;
const SLICE_MS: u32 = 100;

/// Force by P_DC at which the finger is lifted, mN: while a `high` force is pressed, or otherwise. A finger whose line
/// ends before 2 N has the tolerance of the paper's.
pub(super) fn force_limit_mn(finger: &Calibration, high: bool) -> f32 {
    let most_mn = if high {
        HIGH_FORCE_LIMIT_MN
    } else {
        FORCE_LIMIT_MN
    };
    (finger.linear_mn * (most_mn / Calibration::PAPER.linear_mn)).min(most_mn)
}

/// Returns true if a rig with or without permission for high forces may press this finger of this model with so many
/// mN.
pub(super) fn may_press(
    model: &FingerModel,
    finger: &Calibration,
    force_mn: u16,
    high_force: bool,
) -> bool {
    // the guard takes a count for no less than the model's
    let most_counts = model.counts(HIGH_FORCE_LIMIT_MN);
    let counts = finger.force_counts(force_mn);
    force_mn <= most_mn(high_force)
        && counts.is_some_and(|counts| force_mn <= HIGH_FORCE_MN || counts < most_counts)
}

/// Faults whose detection is switched off. For tests, which must notice a missing guard.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Unguarded(u32);

impl Unguarded {
    /// All guards are on but this one.
    pub const fn against(fault: Fault) -> Self {
        Self(fault.bit())
    }

    /// And this one.
    #[must_use]
    pub const fn and(self, fault: Fault) -> Self {
        Self(self.0 | fault.bit())
    }

    /// Returns true if `fault` is not looked for.
    pub const fn ignores(self, fault: Fault) -> bool {
        self.0 & fault.bit() != 0
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct GuardInputs<'a> {
    /// Words since the last millisecond; `None` is a damaged one.
    pub(crate) words: &'a [Option<Pressure>],
    pub(crate) e_stop: bool,
    /// True if the tasks that the rig serves have not checked in.
    pub(crate) hung: bool,
    /// The lever's upper limit switch, while it should be open.
    pub(crate) lever_top: bool,
    /// The lever's upper limit switch is open, while it should be closed.
    pub(crate) lever_left: bool,
    /// The limit switch that the stage is moving towards, while it should be open.
    pub(crate) stage_limit: bool,
    pub(crate) stage_wanted_mm_s: f32,
    /// Position of the stage, mm.
    pub(crate) stage_mm: f32,
    pub(crate) emf_mm_s: f32,
}

/// A limit switch, or the emergency stop. It counts as closed when it has been pressed for 3 ms: less is its bouncing,
/// or a disturbance of its wire.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Switch {
    closed_ms: u32,
}

impl Switch {
    pub(super) fn tick(&mut self, closed: bool) -> bool {
        self.closed_ms = if closed {
            self.closed_ms.saturating_add(1)
        } else {
            0
        };
        self.closed_ms >= 3
    }
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Guard {
    unguarded: Unguarded,
    /// Time without a word of P_AC and of P_DC, ms.
    silent_ms: [u32; 2],
    /// The last P_AC and P_DC, and for how many ms they have not changed, or stood at an end of the range.
    last: [Option<Pressure>; 2],
    frozen_ms: [u32; 2],
    damaged: [u32; SLICES],
    slice_ms: u32,
    e_stop: Switch,
    lever_top: Switch,
    /// For how many ms the lever's switch has been open without a break while it should be closed.
    left_ms: u32,
    stage_limit: Switch,
    /// Way of the stage by its command, its encoder and its motor's back-EMF, mm since it began to move: a ring of the
    /// last [`MOTION_MS`] and its next index.
    motion: [[f32; 3]; MOTION_MS],
    motion_ms: usize,
}

impl Guard {
    /// A guard that looks for everything but `unguarded`.
    pub(crate) fn new(unguarded: Unguarded) -> Self {
        Self {
            unguarded,
            ..Self::default()
        }
    }

    /// Forgets its history, not the faults that it ignores.
    pub(crate) fn reset(&mut self) {
        *self = Self::new(self.unguarded);
    }

    pub(crate) fn looks_for(&self, fault: Fault) -> bool {
        !self.unguarded.ignores(fault)
    }

    /// One millisecond. `limit_mn` is the force at which the finger is lifted, at most [`HIGH_FORCE_LIMIT_MN`]. The
    /// first of several faults is the one that can hurt most.
    #[inline]
    pub(crate) fn tick(
        &mut self,
        inputs: &GuardInputs<'_>,
        meter: &ForceMeter,
        model: &FingerModel,
        mn_per_count: f32,
        limit_mn: f32,
    ) -> Option<Fault> {
        let sensor = self.sensor(inputs.words);
        let stage = self.stage(inputs);
        // its second contact has taken the motors' supply by then
        let e_stop = self.e_stop.tick(inputs.e_stop);
        let lever_top = self.lever_top.tick(inputs.lever_top);
        self.left_ms = if inputs.lever_left {
            self.left_ms.saturating_add(1)
        } else {
            0
        };
        let stage_limit = self.stage_limit.tick(inputs.stage_limit);
        // a calibration with less than the model's force per count does not allow more
        let mn_per_count = mn_per_count.max(model.calibration.force_mn_per_count);
        let force = meter.counts().max(meter.counts_now()) * mn_per_count
            > limit_mn.min(HIGH_FORCE_LIMIT_MN);
        [
            force.then_some(Fault::ForceHigh),
            e_stop.then_some(Fault::EStop),
            inputs.hung.then_some(Fault::TasksHung),
            lever_top.then_some(Fault::LeverLimit),
            (self.left_ms >= LEFT_MS).then_some(Fault::LeverNotHome),
            stage_limit.then_some(Fault::StageLimit),
            stage,
        ]
        .into_iter()
        .chain(sensor)
        .flatten()
        .find(|&fault| self.looks_for(fault))
    }

    #[inline]
    fn sensor(&mut self, words: &[Option<Pressure>]) -> [Option<Fault>; 3] {
        for (silent, frozen) in self.silent_ms.iter_mut().zip(&mut self.frozen_ms) {
            *silent = silent.saturating_add(1);
            *frozen = frozen.saturating_add(1);
        }
        let mut damaged = 0;
        for word in words {
            let Some(word) = word else {
                damaged += 1;
                continue;
            };
            let channel = word.channel as usize;
            if let (Some(last), Some(silent), Some(frozen)) = (
                self.last.get_mut(channel),
                self.silent_ms.get_mut(channel),
                self.frozen_ms.get_mut(channel),
            ) {
                *silent = 0;
                if *last != Some(*word) {
                    *last = Some(*word);
                    // what flickers at a rail does not change either
                    *frozen = if word.counts.is_at_rail() { *frozen } else { 0 };
                }
            }
        }
        // where no word comes at all, that is silence and no damage
        if damaged as usize == words.len() {
            damaged = 0;
        }
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

    #[inline]
    fn stage(&mut self, inputs: &GuardInputs<'_>) -> Option<Fault> {
        let wanted = libm::fabsf(inputs.stage_wanted_mm_s);
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
            inputs.stage_mm,
            turned + libm::fabsf(inputs.emf_mm_s) * 1e-3,
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
mod tests;
