//! What a probe shows of itself: the state of its rig, the table in force, and what changes while it moves.

use crate::rig::calibration::RigCalibration;
use crate::rig::control::Control;
use crate::rig::over_link::RigOverLink;
use crate::rig::skin::SkinCare;
use crate::rig::{Ended, Phase};
use crate::wire::{Event, Live};

/// The state of the rig, as of its last tick.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RigState {
    /// Its phase.
    pub phase: Phase,
    /// The finger is lifted and the stage stands.
    pub at_rest: bool,
    /// The end of the last movement, until the next command.
    pub ended: Option<Ended>,
    /// Contact force, mN.
    pub force_mn: f32,
    /// Steps that the lever has made, downwards positive.
    pub steps: i32,
    /// Where the stage stands, mm.
    pub stage_mm: f32,
    pub(crate) velocity_mm_s: f32,
    /// Motor current, A.
    pub current_a: f32,
    /// Mean motor current of the last run at constant speed, A.
    pub mean_current_a: Option<f32>,
    /// P_DC in the air, counts, by the last run without load.
    pub air_counts: Option<f32>,
    /// The constants in use.
    pub calibration: RigCalibration,
    /// True if movements may press with up to 2 N.
    pub high_force: bool,
    /// The wear of the skin.
    pub skin: SkinCare,
}

impl RigState {
    /// The state before the first tick.
    pub const fn parked(calibration: RigCalibration) -> Self {
        Self {
            phase: Phase::Parked,
            at_rest: true,
            ended: None,
            force_mn: 0.0,
            steps: 0,
            stage_mm: 0.0,
            velocity_mm_s: 0.0,
            current_a: 0.0,
            mean_current_a: None,
            air_counts: None,
            calibration,
            high_force: false,
            skin: SkinCare::NEW,
        }
    }

    /// The state after a tick with these steps and this motor current.
    #[inline]
    pub fn of(control: &mut Control, steps: i32, current_a: f32, ended: Option<Ended>) -> Self {
        Self {
            phase: control.phase(),
            at_rest: control.is_at_rest(),
            ended,
            force_mn: control.force_mn(),
            steps,
            stage_mm: control.stage_mm(),
            velocity_mm_s: control.stage_velocity_mm_s(),
            current_a,
            mean_current_a: control.mean_current_a(),
            air_counts: control.air_counts(),
            calibration: *control.calibration(),
            high_force: control.high_force(),
            skin: *control.skin(),
        }
    }

    /// The state after a tick of a rig that an arm moves. Where the arm is, it alone knows.
    pub fn over_link(rig: &mut RigOverLink, ended: Option<Ended>) -> Self {
        Self {
            phase: rig.phase(),
            at_rest: rig.is_at_rest(),
            ended,
            force_mn: rig.force_mn(),
            air_counts: rig.air_counts(),
            high_force: rig.high_force(),
            skin: *rig.skin(),
            ..Self::parked(*rig.calibration())
        }
    }
}

/// The table in force.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TableInUse {
    /// Its textures.
    pub textures: u16,
    /// Its bytes.
    pub bytes: u32,
    /// Its checksum.
    pub crc: u32,
    /// The table came with the firmware: the probe has learned no texture and the host has written no table.
    pub factory: bool,
    /// Share of false alarms that its limits are for, if it was set; otherwise its own.
    pub false_alarm: Option<f32>,
}

impl TableInUse {
    /// There is no table yet.
    pub const NONE: Self = Self {
        textures: 0,
        bytes: 0,
        crc: 0,
        factory: true,
        false_alarm: None,
    };
}

/// Reports every phase and fault, and where the rig is while it moves.
#[derive(Clone, Copy, Debug, Default)]
pub struct Watch {
    phase: Option<Phase>,
    looks: u32,
}

impl Watch {
    /// The rig is to be looked at this often, ms.
    pub const EVERY_MS: u64 = 5;
    /// Looks from one report of a moving rig to the next.
    const LIVE: u32 = 10;

    /// The same for an arm, which presses by the force that is reported: 10 ms.
    const LIVE_FOR_ARM: u32 = 2;

    /// Looks at the rig.
    pub fn look(&mut self, rig: &RigState, tell: impl FnMut(Event)) {
        self.look_every::<{ Self::LIVE }>(rig, tell);
    }

    /// Looks at a rig that an arm moves.
    pub fn look_for_arm(&mut self, rig: &RigState, tell: impl FnMut(Event)) {
        self.look_every::<{ Self::LIVE_FOR_ARM }>(rig, tell);
    }

    fn look_every<const LIVE: u32>(&mut self, rig: &RigState, mut tell: impl FnMut(Event)) {
        if self.phase != Some(rig.phase) {
            self.phase = Some(rig.phase);
            if let Phase::Faulted(fault) = rig.phase {
                tell(Event::Fault(fault));
            }
            tell(Event::Phase(rig.phase.into()));
        }
        self.looks = self.looks.wrapping_add(1);
        if self.looks.is_multiple_of(LIVE) && !rig.at_rest {
            tell(Event::Live(Live {
                force_mn: rig.force_mn as i16,
                steps: rig.steps,
                stage_um: (rig.stage_mm * 1e3) as i32,
                speed_um_s: (rig.velocity_mm_s * 1e3) as i32,
                current_ma: (rig.current_a * 1e3) as i16,
            }));
        }
    }
}
