//! Simulated rigs for tests: homed, sliding, and watched.

use std::fmt::Display;
use std::time::Duration;

use rayon::prelude::*;
use tactus_core::features::Movement;
use tactus_core::probe::RigState;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::{Fault, Phase};
use tactus_core::wire::{Event, Failure, Verdict};
use tactus_lab::sim::probe::Host;
use tactus_lab::sim::rig::SimRig;
use tactus_world::world::Setup;

pub(crate) const MOVEMENTS: [Movement; 3] = [
    Movement::FOR_TRACTION,
    Movement::FOR_FINENESS,
    Movement::FOR_ROUGHNESS,
];

/// A number from 0 to below `n`, the same for the same seed.
pub(crate) fn draw(seed: u64, n: u64) -> u64 {
    let mut x = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5bf0_3635;
    x ^= x >> 31;
    x = x.wrapping_mul(0x94d0_49bb_1331_11eb);
    (x ^ (x >> 29)) % n
}

/// One of the 117 textures, another for each of 117 seeds.
pub(crate) fn texture(seed: u64) -> u8 {
    1 + (seed * 37 % 117) as u8
}

/// A sample and a finger of these seeds in world 1.
pub(crate) fn setup(texture: u8, seed: u64) -> Setup {
    Setup {
        texture,
        trial_seed: seed,
        finger_seed: 1 + seed % 5,
        ..Setup::default()
    }
}

pub(crate) fn homed(setup: Setup, unguarded: Unguarded) -> SimRig {
    let mut rig = SimRig::unguarded(setup, unguarded);
    rig.home().unwrap();
    rig
}

pub(crate) fn wait(rig: &mut SimRig, ms: u64) {
    for _ in 0..ms {
        rig.tick();
    }
}

/// Milliseconds until `reached`, or an objection.
pub(crate) fn until(
    rig: &mut SimRig,
    what: &str,
    mut reached: impl FnMut(&mut SimRig) -> bool,
) -> Result<u32, String> {
    for ms in 0..120_000 {
        if reached(rig) {
            return Ok(ms);
        }
        rig.tick();
    }
    Err(format!("never {what}: {:?}", rig.control().phase()))
}

/// Starts a movement, and waits for a phase of it.
pub(crate) fn start(rig: &mut SimRig, movement: Movement, phase: Phase) {
    rig.control().start(movement, 0.3).unwrap();
    until(rig, "in the phase", |rig| rig.control().phase() == phase).unwrap();
}

/// Runs all cases at once, and objects with what any of them says.
pub(crate) fn assert_all<C: Sync + Send, E: Display + Send>(
    cases: Vec<C>,
    judge: impl Fn(&C) -> Result<(), E> + Sync,
) {
    let objections: Vec<String> = cases
        .par_iter()
        .filter_map(|case| judge(case).err().map(|why| why.to_string()))
        .collect();
    let (wrong, all) = (objections.len(), cases.len());
    assert_eq!(wrong, 0, "of {all}:\n{}", objections.join("\n"));
}

/// Words of a probe whose finger somebody else moves.
#[derive(Default, Debug)]
pub(crate) struct Heard {
    pub(crate) verdict: Option<Verdict>,
    pub(crate) slides: u32,
    pub(crate) rejected: Vec<Failure>,
    pub(crate) faults: Vec<Fault>,
    /// Virtual time so far, s.
    pub(crate) seconds: f64,
}

impl Host for Heard {
    fn tell(&mut self, event: Event) {
        match event {
            Event::Verdict(verdict) => self.verdict = Some(verdict),
            Event::SlideReport { .. } => self.slides += 1,
            Event::Rejected { why, .. } => self.rejected.push(why),
            _ => {}
        }
    }

    fn tick(&mut self, now: Duration, rig: &RigState) {
        self.seconds = now.as_secs_f64();
        if let Phase::Faulted(fault) = rig.phase
            && self.faults.last() != Some(&fault)
        {
            self.faults.push(fault);
        }
    }
}
