//! One case of the campaign of faults: a probe on the simulated rig gets a request, one to three things break
//! meanwhile, and bits of its flash change before it is switched on again. All of it comes from a seed.
//!
//! The campaign checks the world: the force on the finger, motion at the end, the contents of the store, and whether a
//! repaired rig works.

pub mod naming;

use std::cell::RefCell;
use std::fmt;
use std::time::Duration;

use embassy_futures::block_on;
use rand::seq::IndexedRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::dsp;
use tactus_core::probe::RigState;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::{Fault as Named, Phase};
use tactus_core::sensor::biotac;
use tactus_core::store::StoreError;
use tactus_core::wire::{Command, Event, Identify, Train};

use self::naming::Naming;
use super::collection::Collection;
use super::flash::{RamFlash, SECTOR, TABLE};
use super::probe::{Host, SimProbe, switch_on};
use super::rig::{FORCE_LIMIT_N, SimError, SimRig};
use tactus_world::faults::Fault;
use tactus_world::mount::Mount;
use tactus_world::world::Truth;

/// Number of tries to home for a rig that is repaired.
const HOMINGS: usize = 3;
/// The share of false alarms that the probe is set to.
const SHARE: f32 = 0.03;
/// Largest force on a lifted finger, N.
const LIFTED_N: f64 = 0.02;
/// Largest speed of a stage that stands, mm/s.
const STANDS_MM_S: f64 = 0.5;
/// Largest way of a lever that stands, mm, in [`STILL_MS`].
const STILL_MM: f64 = 0.01;
/// See [`STILL_MM`].
const STILL_MS: u32 = 500;
/// Time until a rig is at rest at the latest, s.
const REST_S: u64 = 120;

/// The world that the table of the firmware is learned from.
pub fn world() -> Collection {
    Collection::new(1, (1..=117).collect(), 5)
}

/// The request to the probe.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Activity {
    /// To find its switches.
    Homing,
    /// To identify the texture under the finger.
    Identify,
    /// To learn a texture.
    Train,
    /// To learn a texture from an exploration.
    Label,
    /// To measure its motor.
    Calibrate,
    /// Nothing.
    Idle,
}

impl Activity {
    const ALL: [Self; 6] = [
        Self::Homing,
        Self::Identify,
        Self::Train,
        Self::Label,
        Self::Calibrate,
        Self::Idle,
    ];

    /// Its usual duration, ms.
    pub fn takes_ms(self) -> u64 {
        match self {
            Self::Homing => 6_000,
            Self::Identify | Self::Label => 15_000,
            Self::Train | Self::Calibrate => 40_000,
            Self::Idle => 5_000,
        }
    }
}

/// The events of a case.
#[derive(Clone, PartialEq, Debug)]
pub struct Case {
    /// The seed that all of it is drawn from.
    pub seed: u64,
    /// Number of the texture under the finger.
    pub texture: u8,
    /// The request to the probe.
    pub activity: Activity,
    /// The faults, and their times after that, ms.
    pub faults: Vec<(u64, Fault)>,
    /// Bits of the flash that change while the power is off.
    pub bits: Vec<usize>,
    /// The finger's mount has no spring, against the list of parts.
    pub stiff: bool,
}

/// Returns true if the user's remedy for the fault frees a finger that still presses: where the rig cannot lift it, by
/// the lever's knob or because the stop has taken the supply.
fn frees_the_finger(named: Named) -> bool {
    named == Named::EStop || named.recovery().contains("knob")
}

impl Case {
    /// The case of a seed.
    pub fn draw(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let activity = *Activity::ALL.choose(&mut random).unwrap_or(&Activity::Idle);
        let faults = (0..random.random_range(1..=3))
            .filter_map(|_| {
                let at_ms = random.random_range(0..activity.takes_ms());
                let example = Fault::EXAMPLES.choose(&mut random)?;
                Some((at_ms, example.varied(random.random())))
            })
            .collect();
        Self {
            seed,
            texture: random.random_range(1..=117),
            activity,
            faults,
            bits: (0..random.random_range(0..=3))
                .map(|_| random.random_range(0..8 * 4 * SECTOR))
                .collect(),
            stiff: false,
        }
    }

    /// An exploration of the texture under the finger.
    pub fn identify(&self) -> Identify {
        Identify {
            seed: self.seed as u32,
            ..Identify::default()
        }
    }

    /// The commands to the probe, one after the other.
    pub fn commands(&self) -> Vec<Command> {
        let name = || "a new one".try_into().unwrap_or_default();
        match self.activity {
            Activity::Homing => vec![Command::Home],
            Activity::Identify => vec![Command::Identify(self.identify())],
            Activity::Train => vec![Command::Train(Train {
                name: name(),
                trials: 1,
                pilot: false,
                seed: self.seed as u32,
            })],
            Activity::Label => vec![Command::Identify(self.identify()), Command::Label(name())],
            Activity::Calibrate => vec![Command::Calibrate],
            Activity::Idle => Vec::new(),
        }
    }
}

/// The result of a case.
#[derive(Clone, PartialEq, Debug)]
pub struct Outcome {
    /// The case.
    pub case: Case,
    /// Largest force on the finger until the end of the request, N.
    pub force_max_n: f64,
    /// The reason why the request was not done.
    pub refused: Option<String>,
    /// The faults that the rig named.
    pub named: Vec<Named>,
    /// Their fit to the injected faults.
    pub naming: Naming,
    /// Violated conditions.
    pub wrong: Vec<String>,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

impl Outcome {
    /// Notes the faults of a rig that has come to rest, by the world: its finger is lifted, unless a fault was named
    /// that says how it is freed.
    fn judge_rest(truth: &Truth, named: &[Named], wrong: &mut Vec<String>) {
        if truth.speed_mm_s.abs() > STANDS_MM_S {
            wrong.push(format!("the stage moves, {:.1} mm/s", truth.speed_mm_s));
        }
        if truth.force_n > LIFTED_N && !named.iter().any(|named| frees_the_finger(*named)) {
            wrong.push(format!("the finger is down, {:.3} N", truth.force_n));
        }
        if truth.force_max_n > FORCE_LIMIT_N {
            wrong.push(format!("{:.3} N on the finger", truth.force_max_n));
        }
    }

    /// What the store has lost: with each thing, whether it is as it was, or may be another one.
    fn judge_kept(kept: [bool; 3], wrong: &mut Vec<String>) {
        let what = ["table", "calibration", "share of false alarms"];
        let lost = kept.into_iter().zip(what).filter(|(is_kept, _)| !is_kept);
        wrong.extend(lost.map(|(_, what)| format!("the {what} has changed")));
    }

    /// The store after the power was off: another one than before only with a word, and only if its bits changed.
    fn judge_store(case: &Case, same: bool, troubles: &[String], wrong: &mut Vec<String>) {
        if !same && troubles.is_empty() {
            wrong.push("another store after the power was off, without a word".into());
        }
        if case.bits.is_empty() && !(same && troubles.is_empty()) {
            let troubles = troubles.join("; ");
            wrong.push(format!("the store did not outlive its power: {troubles}"));
        }
    }
}

#[derive(Default)]
struct HostLog {
    named: Vec<Named>,
    first_ns: Option<u64>,
    learned: bool,
    troubles: Vec<String>,
}

impl Host for HostLog {
    fn tell(&mut self, event: Event) {
        match event {
            Event::TextureLearned(_) => self.learned = true,
            Event::Trouble(why) => self.troubles.push(why.to_string()),
            _ => {}
        }
    }

    fn tick(&mut self, now: Duration, rig: &RigState) {
        if let Phase::Faulted(fault) = rig.phase
            && self.named.last() != Some(&fault)
        {
            self.first_ns.get_or_insert(now.as_nanos() as u64);
            self.named.push(fault);
        }
    }
}

/// Reasons why a case could not be run.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// The rig, before anything broke.
    #[error(transparent)]
    Rig(#[from] SimError),
    /// Its store, before anything broke.
    #[error(transparent)]
    Store(#[from] StoreError),
}

/// The common beginning of all cases.
#[derive(Clone, Copy, Debug)]
pub struct Bench<'t> {
    /// The table that comes with the firmware.
    pub factory: &'t [u8],
    /// The calibration of the rig of [`world`].
    pub calibration: RigCalibration,
    /// Guards that are off: a campaign must notice that.
    pub unguarded: Unguarded,
}

impl<'t> Bench<'t> {
    /// A calibrated rig.
    pub fn new(factory: &'t [u8]) -> Result<Self, SimError> {
        let mut rig = SimRig::new(world().setup(1, 1));
        rig.home()?;
        let calibration = rig.calibrate(20_261_123)?;
        Ok(Self {
            factory,
            calibration,
            unguarded: Unguarded::default(),
        })
    }

    /// Runs a case.
    pub fn run(&self, case: &Case) -> Result<Outcome, CaseError> {
        let setup = world().setup(case.texture, case.seed);
        let mut rig = SimRig::unguarded(setup, self.unguarded);
        if !case.stiff {
            rig.world().mount(Mount::SPRUNG);
        }
        rig.control()
            .calibrate(self.calibration)
            .map_err(SimError::from)?;
        rig.home()?;
        let (host, plan) = (RefCell::new(HostLog::default()), dsp::Plan::new());
        let mut buffer = vec![0; TABLE];
        let blank = RamFlash::blank();
        let mut probe = switch_on(rig, blank, self.factory, &mut buffer, &plan, &host)?;
        if let Ok(store) = probe.memory.store() {
            block_on(store.set_calibration(&self.calibration))?;
            block_on(store.set_false_alarm(Some(SHARE)))?;
        }
        let mut wrong = Vec::new();
        let began_ns = now_ns(&mut probe);
        for &(at_ms, fault) in &case.faults {
            let at_ns = began_ns + at_ms * 1_000_000;
            probe.rig.servo.rig().world().schedule(at_ns, fault);
        }
        let before = Kept::of(&mut probe);
        let asked = ask(&mut probe, case);
        // the scheduled faults happen in any case
        let ends_ns = began_ns + case.activity.takes_ms() * 1_000_000;
        while now_ns(&mut probe) < ends_ns {
            probe.rig.servo.tick();
        }
        let force_max_n = rest(&mut probe, &host, &mut wrong);
        let after = Kept::of(&mut probe);
        let learns = matches!(case.activity, Activity::Train | Activity::Label);
        let learned = learns && (asked.is_ok() || host.borrow().learned);
        let measured = case.activity == Activity::Calibrate && asked.is_ok();
        let kept = [
            learned || after.table == before.table,
            measured || after.calibration == before.calibration,
            after.false_alarm == before.false_alarm,
        ];
        Outcome::judge_kept(kept, &mut wrong);
        let named = host.borrow().named.clone();
        let breaks_ns = case.faults.iter().map(|(ms, _)| began_ns + ms * 1_000_000);
        if let (Some(first_ns), breaks_ns) = (host.borrow().first_ns, breaks_ns.min())
            && breaks_ns.is_none_or(|breaks_ns| first_ns < breaks_ns)
        {
            wrong.push(format!("{named:?} before anything broke"));
        }
        let broke = case.faults.iter().map(|(_, fault)| fault);
        let naming = naming::judge(broke, &named, asked.is_err());
        let mut probe = self.restarted(probe, case, &host, &after, &mut wrong)?;
        repaired(&mut probe, case, measured, &mut wrong);
        Ok(Outcome {
            case: case.clone(),
            force_max_n,
            refused: asked.err(),
            named,
            naming,
            wrong,
        })
    }

    /// The power is off for a moment, in which bits of the flash change.
    fn restarted<'p>(
        &self,
        probe: SimProbe<'p, HostLog>,
        case: &Case,
        host: &RefCell<HostLog>,
        before: &Kept,
        wrong: &mut Vec<String>,
    ) -> Result<SimProbe<'p, HostLog>, StoreError>
    where
        't: 'p,
    {
        host.borrow_mut().troubles.clear();
        let mut probe = super::probe::switch_off_changed_and_on(probe, &case.bits)?;
        let after = Kept::of(&mut probe);
        Outcome::judge_store(case, after == *before, &host.borrow().troubles, wrong);
        Ok(probe)
    }
}

#[derive(PartialEq)]
struct Kept {
    table: Vec<u8>,
    calibration: Option<RigCalibration>,
    false_alarm: Option<f32>,
}

impl Kept {
    fn of(probe: &mut SimProbe<'_, HostLog>) -> Self {
        let table = probe.memory.in_force().to_vec();
        let store = probe.memory.store().ok();
        let (calibration, false_alarm) = store.map_or((None, None), |store| {
            let calibration = block_on(store.calibration()).unwrap_or(None);
            (calibration, block_on(store.false_alarm()).unwrap_or(None))
        });
        Self {
            table,
            calibration,
            false_alarm,
        }
    }
}

fn now_ns(probe: &mut SimProbe<'_, HostLog>) -> u64 {
    probe.rig.servo.rig().now().as_nanos() as u64
}

/// Sends the probe a command; returns the reason why it was not done, in its words.
fn send(probe: &mut SimProbe<'_, HostLog>, command: Command) -> Result<(), String> {
    block_on(probe.perform(&command))
        .map(drop)
        .map_err(|why| why.to_string())
}

fn ask(probe: &mut SimProbe<'_, HostLog>, case: &Case) -> Result<(), String> {
    case.commands()
        .into_iter()
        .try_for_each(|command| send(probe, command))
}

/// The rig comes to rest, with its motors off and its finger lifted; the largest force until then, N.
fn rest(
    probe: &mut SimProbe<'_, HostLog>,
    host: &RefCell<HostLog>,
    wrong: &mut Vec<String>,
) -> f64 {
    let servo = &mut probe.rig.servo;
    let ends = servo.rig().now() + Duration::from_secs(REST_S);
    // a lever that nothing drives is at rest, too, while it runs down
    let mut tip_mm = f64::NAN;
    while servo.rig().now() < ends {
        for _ in 0..STILL_MS {
            servo.tick();
        }
        let before = std::mem::replace(&mut tip_mm, servo.rig().world().truth().tip_mm);
        if servo.rig().control().is_at_rest() && (tip_mm - before).abs() < STILL_MM {
            break;
        }
    }
    let rig = servo.rig();
    if !rig.control().is_at_rest() {
        wrong.push(format!("no rest in {:?}", rig.control().phase()));
    }
    let outputs = rig.outputs();
    if outputs.stage_duty != 0.0 || outputs.lever_steps_s != 0 {
        wrong.push("a motor is still driven".into());
    }
    let truth = rig.world().truth();
    Outcome::judge_rest(&truth, &host.borrow().named, wrong);
    truth.force_max_n
}

/// Everything is repaired: the rig homes, and carries out a request.
fn repaired(
    probe: &mut SimProbe<'_, HostLog>,
    case: &Case,
    calibrated: bool,
    wrong: &mut Vec<String>,
) {
    probe.rig.servo.rig().world().clear();
    // a sensor that is plugged in again starts up
    for _ in 0..=biotac::PARTS.power_up_ms {
        probe.rig.servo.tick();
    }
    let mut homed = Ok(());
    for _ in 0..HOMINGS {
        homed = send(probe, Command::Home);
        if homed.is_ok() {
            break;
        }
    }
    if let Err(why) = homed {
        wrong.push(format!("repaired, it does not home: {why}"));
        return;
    }
    // constants that were measured with something broken are measured again
    if calibrated && let Err(why) = send(probe, Command::Calibrate) {
        wrong.push(format!("repaired, it does not calibrate: {why}"));
    }
    if let Err(why) = send(probe, Command::Identify(case.identify())) {
        wrong.push(format!("repaired, it does not identify: {why}"));
    }
    let rig = probe.rig.servo.rig();
    let force_max_n = rig.world().truth().force_max_n;
    if force_max_n > FORCE_LIMIT_N {
        wrong.push(format!("{force_max_n:.3} N on the finger after the repair"));
    }
}
