//! The simulated rig that an arm or a printer moves: the world with it and its program at one end of the link, the
//! core's [`RigOverLink`] at the other, in virtual time.

use std::time::Duration;

use tactus_core::probe::RigState;
use tactus_core::rig::Ended;
use tactus_core::rig::arm::{ArmOrder, ArmReport};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::over_link::RigOverLink;
use tactus_core::rig::pins::{Inputs, Outputs};
use tactus_core::sensor::FingerCode;
use tactus_core::sensor::pressure::{Pressure, SLOTS_HZ};

use tactus_world::arm::Arm;
use tactus_world::arm_program::ArmProgram;
use tactus_world::slot::Reader;
use tactus_world::world::{Setup, World};

const TICK_NS: u64 = 1_000_000;
const SAYS_MS: u64 = 10;

/// The program that moves the finger of a world as a probe orders it.
pub trait Mover {
    /// Takes an order of the probe.
    fn order(&mut self, order: ArmOrder);

    /// Takes the probe's force, N.
    fn force(&mut self, newton: f64);

    /// A millisecond: moves what holds the finger, and returns the reports that reach the probe now.
    fn tick(&mut self, world: &mut World) -> Vec<ArmReport>;

    /// Takes the level of the line of permission.
    fn permit(&mut self, world: &mut World, permitted: bool);
}

impl Mover for ArmProgram {
    fn order(&mut self, order: ArmOrder) {
        self.ask(order);
    }

    fn force(&mut self, newton: f64) {
        self.force(newton);
    }

    fn tick(&mut self, world: &mut World) -> Vec<ArmReport> {
        let arm = world.arm();
        arm.map(|arm| self.tick(arm)).unwrap_or_default()
    }

    fn permit(&mut self, world: &mut World, permitted: bool) {
        // the line is wired to the arm's protective stop
        if !permitted && let Some(arm) = world.arm() {
            arm.go(0.0, 0.0);
        }
    }
}

/// A rig that an arm moves.
pub struct ArmRig<M = ArmProgram> {
    world: World,
    reader: Reader,
    rig: RigOverLink,
    finger: FingerCode,
    program: M,
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
        let program = ArmProgram::new(setup.trial_seed);
        Self::over(world, setup, unguarded, program)
    }
}

impl<M: Mover> ArmRig<M> {
    /// A rig whose finger is moved in this world by this program.
    pub fn over(mut world: World, setup: Setup, unguarded: Unguarded, program: M) -> Self {
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
            finger: FingerCode::of(setup.finger),
            program,
            now_ns: began_ns,
            slot: 0,
            began_ns,
            words: Vec::new(),
            outputs: Outputs::default(),
            lost_permission: false,
        }
    }

    /// The finger.
    pub fn finger(&self) -> FingerCode {
        self.finger
    }

    /// The world: its truth, its faults.
    pub fn world(&mut self) -> &mut World {
        &mut self.world
    }

    /// The program that moves the finger.
    pub fn program(&mut self) -> &mut M {
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
        let reports = self.program.tick(&mut self.world);
        let inputs = Inputs {
            words: self.words.drain(..).collect(),
            ..Inputs::default()
        };
        let (outputs, order) = self.rig.tick(&inputs, &reports);
        if let Some(order) = order {
            self.program.order(order);
        }
        self.lost_permission |= !outputs.lever_enabled;
        self.program.permit(&mut self.world, outputs.lever_enabled);
        self.outputs = outputs;
        &self.outputs
    }
}
