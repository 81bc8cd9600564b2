//! The simulated rig that an arm moves: the world with an arm and its program at one end of the link, the core's
//! [`RigOverLink`] at the other, in virtual time.

use std::time::Duration;

use tactus_core::probe::RigState;
use tactus_core::rig::Ended;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::over_link::RigOverLink;
use tactus_core::rig::pins::{Inputs, Outputs};
use tactus_core::sensor::pressure::{Pressure, SLOTS_HZ};

use tactus_world::arm::Arm;
use tactus_world::arm_program::ArmProgram;
use tactus_world::slot::Reader;
use tactus_world::world::{Setup, World};

const TICK_NS: u64 = 1_000_000;
const SAYS_MS: u64 = 10;

/// A rig that an arm moves.
pub struct ArmRig {
    world: World,
    reader: Reader,
    rig: RigOverLink,
    program: ArmProgram,
    now_ns: u64,
    slot: u64,
    began_ns: u64,
    words: Vec<Option<Pressure>>,
    outputs: Outputs,
    lost_permission: bool,
}

impl ArmRig {
    /// An arm that holds the finger over the texture of `setup`.
    pub fn new(setup: Setup, unguarded: Unguarded) -> Self {
        let mut world = World::new(setup);
        world.mount_on(Arm::new(setup.trial_seed));
        let reader = Reader::new(setup.finger);
        let model = reader.model();
        let calibration = RigCalibration::unmeasured(model);
        let mut began_ns = u64::from(reader.power_up_ms()) * 1_000_000;
        if !reader.start().is_empty() {
            // parts that do not start give no words, and that is noticed
            let started = reader.start_up(began_ns, |transfer, mosi, miso| {
                world.transfer(transfer, mosi, miso);
            });
            began_ns = started.unwrap_or(began_ns);
        }
        Self {
            world,
            rig: RigOverLink::new(model, calibration, unguarded),
            reader,
            program: ArmProgram::new(setup.trial_seed),
            now_ns: began_ns,
            slot: 0,
            began_ns,
            words: Vec::new(),
            outputs: Outputs::default(),
            lost_permission: false,
        }
    }

    /// The world: its truth, its faults.
    pub fn world(&mut self) -> &mut World {
        &mut self.world
    }

    /// The program on the arm.
    pub fn program(&mut self) -> &mut ArmProgram {
        &mut self.program
    }

    /// The probe's end.
    pub fn rig(&mut self) -> &mut RigOverLink {
        &mut self.rig
    }

    /// Virtual time since power-up.
    pub fn now(&self) -> Duration {
        Duration::from_nanos(self.now_ns)
    }

    /// Returns true if the line of permission has fallen so far.
    pub fn lost_permission(&self) -> bool {
        self.lost_permission
    }

    /// State of the rig, as a probe shows it.
    pub fn state(&mut self, ended: Option<Ended>) -> RigState {
        RigState::over_link(&mut self.rig, ended)
    }

    /// One millisecond: the slots in it, the arm, then the probe.
    pub fn tick(&mut self) -> &Outputs {
        let end_ns = self.now_ns + TICK_NS;
        loop {
            let at = u128::from(self.slot) * 1_000_000_000 / u128::from(SLOTS_HZ);
            let at_ns = self.began_ns + at as u64;
            if at_ns >= end_ns {
                break;
            }
            let (slot, world) = (self.slot, &mut self.world);
            self.slot += 1;
            let word = self
                .reader
                .word_of_slot(slot, at_ns, |transfer, mosi, miso| {
                    world.transfer(transfer, mosi, miso);
                });
            self.words.push(word);
        }
        self.world.advance_to(end_ns);
        self.now_ns = end_ns;
        if (end_ns / TICK_NS).is_multiple_of(SAYS_MS) {
            self.program.force(f64::from(self.rig.force_mn()) * 1e-3);
        }
        let reports = match self.world.arm() {
            Some(arm) => self.program.tick(arm),
            None => Vec::new(),
        };
        let inputs = Inputs {
            words: self.words.drain(..).collect(),
            ..Inputs::default()
        };
        let (outputs, order) = self.rig.tick(&inputs, &reports);
        if let Some(order) = order {
            self.program.ask(order);
        }
        self.lost_permission |= !outputs.lever_enabled;
        // the line is wired to the arm's protective stop
        if !outputs.lever_enabled
            && let Some(arm) = self.world.arm()
        {
            arm.go(0.0, 0.0);
        }
        self.outputs = outputs;
        &self.outputs
    }
}
