//! Inputs and outputs of the rig's control, every millisecond: the only interface between the control and the board or
//! the simulator.

use crate::features::SamplePhase;
use heapless::Vec;

use crate::sensor::pressure::Pressure;

/// Most words in one tick: 14 ms of slots, should a tick be late.
pub const MAX_WORDS: usize = 64;
/// The state of the inputs.
#[derive(Clone, Debug, Default)]
pub struct Inputs {
    /// Sensor words since the last tick, oldest first; `None` is a damaged or missing one.
    pub words: Vec<Option<Pressure>, MAX_WORDS>,
    /// Steps made by the lever so far, downwards positive.
    pub steps: i32,
    /// Count of the stage's encoder.
    pub encoder: i32,
    /// Motor current of the stage, A.
    pub current_a: f32,
    /// The lever's upper limit switch.
    pub lever_top: bool,
    /// The stage's limit switches, left and right.
    pub stage_limits: (bool, bool),
    /// The emergency stop.
    pub e_stop: bool,
    /// The tasks that the rig serves have not checked in for too long.
    pub hung: bool,
}

/// The commanded state of the outputs.
#[derive(Clone, Debug, Default)]
pub struct Outputs {
    /// Steps per second of the lever, downwards positive; 0 holds.
    pub lever_steps_s: i32,
    /// The lever's driver has current.
    pub lever_enabled: bool,
    /// Duty of the stage's motor, -1 to 1.
    pub stage_duty: f32,
    /// The stage's bridge is on.
    pub stage_enabled: bool,
    /// The phase that this tick's samples belong to.
    pub sample_phase: SamplePhase,
    /// P_AC of this tick in counts about the still finger's, where it is sampled.
    pub pac: Vec<i16, MAX_WORDS>,
    /// Shear of this tick in mN, at constant speed.
    pub shear_mn: Option<i16>,
}
