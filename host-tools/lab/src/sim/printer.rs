//! A simulated rig that a 3D printer moves: the world with the printer at one end of a line of G-code, the host's
//! [`Printer`] at the other and between it and the probe, in virtual time.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::time::Duration;

use embassy_futures::block_on;
use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::Method;
use tactus_core::features::{FeatureSet, Movement};
use tactus_core::rig::arm::{ArmOrder, ArmReport};
use tactus_core::rig::guard::Unguarded;
use tactus_core::sensor::FingerCode;
use tactus_core::wire::{Command, Event, Failure};
use tactus_link::printer::{Axis, Carrier, Dialect, Printer, PrinterError, Setup as Measured};
use tactus_world::noise::Noise;
use tactus_world::printer::{Kind, Printer as Machine};
use tactus_world::world::{Setup, World};

use super::collection::{Collection, LearnError, calibrated};
use super::flash::{RamFlash, TABLE};
use super::over_link::{ArmRig, Mover};
use super::probe::{Host, SimProbe, switch_on};
use crate::data::recorder::Recorder;
use crate::eval::learn::{self, Expected, ObservedTrial};

/// Stream of the seed that the line draws from.
const STREAM: u64 = 0x77;
/// A frame takes so many ms between probe and program (chosen: USB, and a program that is awake).
const FRAME_MS: (f64, f64) = (2.0, 12.0);
/// Length of a sample within the places that a person has shown, mm.
const SAMPLE_MM: f64 = 74.2;

/// The program of the host, its line to the probe and its clock.
pub struct PrinterEnd {
    /// The host's printer.
    pub printer: Printer,
    carrier: Carrier,
    noise: Noise,
    /// Ms since power-up by the host's clock.
    pub now_ms: u64,
    orders: VecDeque<(u64, ArmOrder)>,
    forces: VecDeque<(u64, f64)>,
    reports: VecDeque<(u64, ArmReport)>,
    /// The motors' supply hangs on the line of permission.
    pub has_relay: bool,
    /// Time until which the program does not run, ms.
    pub sleeps_until: u64,
}

impl PrinterEnd {
    /// A program that has this set-up.
    pub fn new(seed: u64, measured: Measured) -> Self {
        let (printer, carrier) = Printer::new(Some(measured));
        Self {
            printer,
            carrier,
            noise: Noise::new(seed, STREAM),
            now_ms: 0,
            orders: VecDeque::new(),
            forces: VecDeque::new(),
            reports: VecDeque::new(),
            has_relay: false,
            sleeps_until: 0,
        }
    }

    fn later(&mut self) -> u64 {
        self.now_ms + self.noise.between(FRAME_MS.0, FRAME_MS.1) as u64
    }
}

impl Mover for PrinterEnd {
    fn order(&mut self, order: ArmOrder) {
        let at = self.later();
        self.orders.push_back((at, order));
    }

    fn force(&mut self, newton: f64) {
        let at = self.later();
        self.forces.push_back((at, newton));
    }

    fn tick(&mut self, world: &mut World) -> Vec<ArmReport> {
        self.now_ms += 1;
        let now = self.now_ms;
        let mut reached = Vec::new();
        while let Some((_, report)) = self.reports.pop_front_if(|(at, _)| *at <= now) {
            reached.push(report);
        }
        let Some(machine) = world.printer() else {
            return reached;
        };
        if now < self.sleeps_until {
            return reached;
        }
        while let Some((_, order)) = self.orders.pop_front_if(|(at, _)| *at <= now) {
            self.printer.order(order);
        }
        while let Some((_, newton)) = self.forces.pop_front_if(|(at, _)| *at <= now) {
            self.printer.force((newton * 1e3) as i16);
        }
        let said = machine.said();
        let send = self.carrier.carry(&said, Duration::from_millis(now));
        machine.receive(&send);
        for report in self.printer.reports() {
            let at = self.later();
            self.reports.push_back((at, report));
        }
        reached
    }

    fn permit(&mut self, world: &mut World, permitted: bool) {
        if self.has_relay
            && let Some(machine) = world.printer()
        {
            machine.power_motors(permitted);
        }
    }
}

/// The set-up of a simulated printer as a person has measured it, whose frame is that of its power-up.
pub fn measured(kind: Kind) -> Measured {
    let (dialect, start_s) = match kind {
        Kind::Klipper => (Dialect::Klipper, [0.34, 0.40]),
        Kind::Marlin { emergency_parser } => (Dialect::Marlin { emergency_parser }, [0.0, 0.04]),
        Kind::Unknown => (Dialect::Klipper, [0.0, 0.0]),
    };
    Measured {
        version: 1,
        port: "simulated".to_owned(),
        baud: 115_200,
        dialect,
        axis: Axis::X,
        sample_mm: [0.0, SAMPLE_MM],
        lifted_mm: 1.0,
        floor_mm: -9.0,
        acceleration_mm_s2: 500.0,
        start_s,
        stiffness_n_mm: Some(1.0),
        backlash_mm: Some(0.06),
        parked: Some([0.0, 0.0]),
    }
}

/// A rig whose finger hangs on a printer over the texture of `setup`; the machine is that of the world's seed, its
/// sample lies by the trial's. All guards are on but `unguarded`.
pub fn rig<M: Mover>(setup: Setup, kind: Kind, unguarded: Unguarded, mover: M) -> ArmRig<M> {
    let mut world = World::new(setup);
    world.mount_on_printer(Machine::new(setup.world_seed, setup.trial_seed, kind));
    ArmRig::over(world, setup, unguarded, mover)
}

/// Why no table was learned on a printer.
#[derive(Debug, thiserror::Error)]
pub enum PrinterLearnError {
    /// What it begins with cannot be learned, or the table of its slides.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// A slide did not come.
    #[error("slides of texture {texture} did not come: {why} ({printer:?})")]
    Slides {
        /// Number of the texture.
        texture: u8,
        /// The probe's reason.
        why: Box<Failure>,
        /// The printer's.
        printer: Option<PrinterError>,
    },
}

#[derive(Default)]
struct Slides(Vec<(Movement, ObservedTrial)>);

impl Host for Slides {
    fn tell(&mut self, event: Event) {
        let Event::SlideReport {
            action, observed, ..
        } = event
        else {
            return;
        };
        let movement = Collection::MOVEMENTS.get(usize::from(action.movement));
        let slide = ObservedTrial {
            whole: observed.observation(),
            first: Vec::new(),
        };
        self.0.extend(movement.map(|movement| (*movement, slide)));
    }
}

/// Learns the textures of a collection on a simulated printer, as a person does with `tactus device record`.
/// Errors: the probe's failure where slides did not come, or a table that cannot be.
pub fn learn_on(collection: &Collection, kind: Kind) -> Result<Vec<u8>, PrinterLearnError> {
    let setup = collection.setup(collection.textures[0], 0);
    let bands = (Method::Fused, Some(FeatureSet::Bands));
    let movements = &Collection::MOVEMENTS;
    // what it knows before decides nothing: it says which movements are made
    let first = Collection {
        textures: collection.textures.iter().copied().take(2).collect(),
        trials: 2,
        ..collection.clone()
    };
    let table = first.learn_at(
        movements,
        bands,
        &[],
        calibrated(setup).map_err(LearnError::from)?,
        || (),
    )?;
    let trials: Vec<Vec<Vec<ObservedTrial>>> = collection
        .textures
        .par_iter()
        .map(|&texture| {
            // the sample is moved before each, as whoever records is asked to
            let trials = 0..u64::from(collection.trials);
            let slides = trials.map(|trial| record(collection.setup(texture, trial), kind, &table));
            let slides = slides.collect::<Result<Vec<_>, _>>()?.concat();
            let of = |movement: &Movement| {
                let of = slides.iter().filter(|(made, _)| made == movement);
                of.map(|(_, trial)| trial.clone()).collect()
            };
            Ok(movements.iter().map(of).collect())
        })
        .collect::<Result<_, PrinterLearnError>>()?;
    let names = collection.names();
    let table = learn::learn_lengths(&Expected::default(), bands, &names, movements, &[], &trials);
    let table = table.map_err(LearnError::from)?;
    let finger = FingerCode::of(collection.finger);
    let named = learn::name_finger(&table, finger, 0, "");
    let named = named.map_err(learn::TableError::from);
    Ok(named.map_err(LearnError::from)?)
}

fn record(
    setup: Setup,
    kind: Kind,
    table: &[u8],
) -> Result<Vec<(Movement, ObservedTrial)>, PrinterLearnError> {
    let (plan, host) = (Plan::new(), RefCell::new(Slides::default()));
    let mut buffer = vec![0; TABLE];
    let end = PrinterEnd::new(setup.trial_seed, measured(kind));
    let rig = rig(setup, kind, Unguarded::default(), end);
    let probe = switch_on(rig, RamFlash::blank(), table, &mut buffer, &plan, &host);
    let failed = |why: Failure, printer| PrinterLearnError::Slides {
        texture: setup.texture,
        why: Box::new(why),
        printer,
    };
    // its store is in RAM and new
    let mut probe: SimProbe<'_, Slides, ArmRig<PrinterEnd>> =
        probe.map_err(|why| failed(Failure::Memory(why.into()), None))?;
    let slides = Collection::MOVEMENTS.len() as u8;
    let wanted = Recorder::wanted(0, slides, setup.trial_seed as u32);
    if let Err(why) = block_on(probe.perform(&Command::Identify(wanted))) {
        let program = probe.rig.servo.rig().program();
        return Err(failed(why, program.printer.take_failure()));
    }
    drop(probe);
    Ok(host.into_inner().0)
}
