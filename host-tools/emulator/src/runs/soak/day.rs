//! The day: a simulated probe, asked as a host would ask it.

use std::cell::RefCell;

use embassy_futures::block_on;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde_json::{Value, json};
use tactus_core::dsp;
use tactus_core::sensor::pressure::SLOTS_HZ;
use tactus_core::store::{Store, StoreError};
use tactus_core::wire::{Command, Event, Forget, Identify, MemoryError, Text, Verdict, text};
use tactus_lab::sim::collection::{calibrated, texture_name};
use tactus_lab::sim::flash::{RamFlash, TABLE};
use tactus_lab::sim::probe::{Host, SimProbe, switch_off_and_on, switch_on};
use tactus_lab::sim::rig::{SimError, SimRig};
use tactus_world::mount::Mount;

use super::episodes::{Episodes, FACTORY, HOMINGS, MOST_N, Plan, world};

/// The last exchange with the sensor may end after the tick in which it began, and the world's time with it: by less than a
/// slot.
const SLOT_NS: i64 = 1_000_000_000 / SLOTS_HZ as i64;
/// The power is off for a moment after so many episodes.
const RESTARTED_EVERY: u32 = 10;
/// A texture, or all that the probe learned by itself, is deleted after so many episodes.
const FORGETS_EVERY: u32 = 15;

/// Why there is no day to judge.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DayError {
    #[error("the simulated rig: {0}")]
    Rig(#[from] SimError),
    #[error("the store: {0}")]
    Store(#[from] StoreError),
    #[error("the table: {0}")]
    Table(#[from] MemoryError),
    #[error("at {at_s:.0} s: {why}")]
    Probe { at_s: f64, why: String },
}

/// What became of a day.
#[derive(Clone, Debug, Default)]
pub(crate) struct Day {
    /// Virtual seconds.
    pub(crate) virtual_s: f64,
    /// The episodes.
    pub(crate) episodes: Episodes,
    /// Slots that were served, and those that the time had.
    pub(crate) slots: (u64, u64),
    /// How far the rig's clock is from the world's at the end, ns.
    pub(crate) drift_ns: i64,
    /// Most force on the finger, N.
    pub(crate) force_max_n: f64,
    /// Times that the store was opened again, and erases of its sectors.
    pub(crate) restarts: u32,
    pub(crate) erases: u32,
    /// Skins that were worn out.
    pub(crate) skins: u32,
    /// What is not as it must be.
    pub(crate) missed: Vec<String>,
}

impl Day {
    pub(crate) fn json(&self) -> Value {
        let mut json = self.episodes.json();
        json["virtual_seconds"] = self.virtual_s.into();
        json["slots"] = self.slots.0.into();
        json["slots_due"] = self.slots.1.into();
        json["drift_ns"] = self.drift_ns.into();
        json["force_max_n"] = self.force_max_n.into();
        json["store_opened_again"] = self.restarts.into();
        json["sectors_erased"] = self.erases.into();
        json["skins_worn_out"] = self.skins.into();
        json["missed"] = json!(self.missed);
        json
    }

    pub(crate) fn text(&self) -> String {
        format!(
            "PC rig: {:.2} virtual hours\n  {}\n  slots {} of {}, drift {} ns, force {:.3} N at most; store opened again {} times, \
             {} sectors erased, {} skins worn out",
            self.virtual_s / 3600.0,
            self.episodes.text(),
            self.slots.0,
            self.slots.1,
            self.drift_ns,
            self.force_max_n,
            self.restarts,
            self.erases,
            self.skins
        )
    }
}

/// What the probe reports in an episode.
#[derive(Default)]
struct Heard {
    verdict: Option<Verdict>,
    rejected: Vec<String>,
    /// The probe has learned.
    learned: bool,
}

impl Host for Heard {
    fn tell(&mut self, event: Event) {
        match event {
            Event::Verdict(verdict) => self.verdict = Some(verdict),
            Event::Rejected { why, .. } => self.rejected.push(why.to_string()),
            Event::TextureLearned(_) => self.learned = true,
            _ => {}
        }
    }
}

type Probe<'p> = SimProbe<'p, Heard>;

/// Explores texture after texture for so many virtual seconds; `each` gets the time.
///
/// # Errors
/// See [`DayError`].
pub(crate) fn day(virtual_s: f64, seed: u64, mut each: impl FnMut(f64)) -> Result<Day, DayError> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let setup = world().setup(1, 1 + seed);
    let mut rig = SimRig::new(setup);
    // as the list of parts has it
    rig.world().mount(Mount::SPRUNG);
    let calibration = calibrated(setup)?;
    rig.control()
        .calibrate(calibration)
        .map_err(SimError::from)?;
    rig.home()?;
    let (host, plan) = (RefCell::default(), dsp::Plan::new());
    let mut buffer = vec![0; TABLE];
    let flash = RamFlash::blank();
    let mut probe = switch_on(rig, flash, FACTORY, &mut buffer, &plan, &host)?;
    block_on(store(&mut probe).set_calibration(&calibration))?;
    let mut day = Day::default();
    while now_s(&mut probe) < virtual_s {
        day.episodes.made += 1;
        run_episode(&mut day, &mut probe, &host, Plan::draw(&mut random))?;
        if day.episodes.made.is_multiple_of(FORGETS_EVERY) {
            let table = probe.memory.table()?;
            let texture = random.random_range(0..table.textures());
            let name = table.name(texture).unwrap_or_default();
            let what = if random.random_range(0..3) == 0 {
                Forget::SelfLearned
            } else {
                Forget::Texture(name.try_into().unwrap_or_default())
            };
            match send(&mut probe, Command::Forget(what.clone())) {
                Ok(()) => day.episodes.forgotten += 1,
                Err(why) => day.missed.push(format!("{what:?}: {why}")),
            }
        }
        if day.episodes.made.is_multiple_of(RESTARTED_EVERY) {
            probe = restarted(probe, &mut day)?;
        }
        each(now_s(&mut probe));
    }
    let rig = probe.rig.servo.rig();
    day.virtual_s = rig.now().as_secs_f64();
    let now_ns = rig.now().as_nanos();
    day.slots = (
        rig.slots(),
        (now_ns * u128::from(SLOTS_HZ)).div_ceil(1_000_000_000) as u64,
    );
    day.drift_ns = (now_ns as i128 - i128::from(rig.world().now_ns())) as i64;
    day.force_max_n = rig.world().truth().force_max_n;
    let (store, ..) = probe.memory.close();
    day.erases = store.map_or(0, |store| store.close().erases);
    if day.slots.0 != day.slots.1 {
        let (served, due) = day.slots;
        day.missed.push(format!("slots served: {served} of {due}"));
    }
    if day.drift_ns.abs() >= SLOT_NS {
        day.missed.push(format!("clock off by {} ns", day.drift_ns));
    }
    if day.force_max_n > MOST_N {
        day.missed.push(format!("{:.3} N", day.force_max_n));
    }
    Ok(day)
}

/// Sends the probe a command, as a host would; the error says why it refuses.
fn send(probe: &mut Probe<'_>, command: Command) -> Result<(), Box<Text>> {
    block_on(probe.perform(&command))
        .map(drop)
        .map_err(|why| Box::new(text(why)))
}

fn now_s(probe: &mut Probe<'_>) -> f64 {
    probe.rig.servo.rig().now().as_secs_f64()
}

/// The store, which is never broken.
fn store<'p>(probe: &'p mut Probe<'_>) -> &'p mut Store<RamFlash> {
    probe.memory.store().expect("it was opened")
}

/// An exploration, and what is learned from it.
fn run_episode(
    day: &mut Day,
    probe: &mut Probe<'_>,
    host: &RefCell<Heard>,
    drawn: Plan,
) -> Result<(), DayError> {
    if probe.rig.servo.rig().place(drawn.texture).is_err() {
        // a thick sample, and a finger that is not all the way up
        recover(day, probe)?;
        probe.rig.servo.rig().place(drawn.texture)?;
    }
    let rig = probe.rig.servo.rig();
    let began_ns = rig.now().as_nanos() as u64;
    if let Some((at_ns, fault)) = drawn.fault {
        rig.world().schedule(began_ns + at_ns, fault);
    }
    let truth = texture_name(drawn.texture);
    let known = probe.memory.table()?.find(truth).is_some();
    // of two ways to learn it takes one, and none where something may break
    let learn = drawn.identify.learn && !drawn.answer && drawn.fault.is_none();
    let identify = Identify {
        learn,
        ..drawn.identify
    };
    let done = send(probe, Command::Identify(identify));
    let heard = host.take();
    let rig = probe.rig.servo.rig();
    let at_s = rig.now().as_secs_f64();
    let came = drawn
        .fault
        .filter(|(at_ns, _)| began_ns + at_ns <= rig.now().as_nanos() as u64);
    match (came, &done) {
        (Some((_, fault)), done) => day.episodes.broke(fault, done.is_err()),
        (None, Ok(())) => {
            let sure = heard.verdict.as_ref().is_some_and(|verdict| verdict.sure);
            let found = heard.verdict.filter(|verdict| !verdict.unknown);
            let found = found.as_ref().map(|verdict| verdict.name.as_str());
            day.episodes.judge(at_s, truth, known, found, sure);
        }
        (None, Err(why)) => day.missed.push(format!("{at_s:.0} s: {truth}: {why}")),
    }
    if came.is_none() {
        let rejected = heard.rejected.iter();
        let rejected = rejected.map(|why| format!("{at_s:.0} s: {truth}: {why}"));
        day.episodes.rejected.extend(rejected);
    }
    day.episodes.learned.1 += u32::from(heard.learned);
    if came.is_none() && done.is_ok() && drawn.answer {
        let name = truth.try_into().unwrap_or_default();
        send(probe, Command::Label(name)).map_err(|why| DayError::Probe {
            at_s,
            why: why.to_string(),
        })?;
        day.episodes.learned.0 += 1;
    }
    if drawn.fault.is_some() || done.is_err() {
        recover(day, probe)?;
    }
    if probe.rig.servo.rig().control().skin().is_worn() {
        recover(day, probe)?;
        let rig = probe.rig.servo.rig();
        if rig.world().replace_skin().is_ok() {
            rig.control().skin().replaced();
            day.skins += 1;
        }
    }
    Ok(())
}

/// Repairs the rig and has it find its switches.
fn recover(day: &mut Day, probe: &mut Probe<'_>) -> Result<(), DayError> {
    probe.rig.servo.rig().world().clear();
    let mut last = Ok(());
    for _ in 0..HOMINGS {
        last = send(probe, Command::Home);
        if last.is_ok() {
            return Ok(());
        }
    }
    let at_s = now_s(probe);
    last.map_err(|why| {
        let why = format!("the rig does not home: {why}");
        day.missed.push(why.clone());
        DayError::Probe { at_s, why }
    })
}

/// The power is off for a moment: all that was stored is there.
fn restarted<'p>(mut probe: Probe<'p>, day: &mut Day) -> Result<Probe<'p>, DayError> {
    let skin = block_on(store(&mut probe).skin())?;
    let calibration = block_on(store(&mut probe).calibration())?;
    let in_force = probe.memory.in_force().to_vec();
    let mut probe = switch_off_and_on(probe)?;
    day.restarts += 1;
    if probe.memory.in_force() != in_force {
        day.missed
            .push(format!("restart {}: another table", day.restarts));
    }
    let store = store(&mut probe);
    if block_on(store.calibration())? != calibration || block_on(store.skin())? != skin {
        day.missed
            .push(format!("restart {}: other settings", day.restarts));
    }
    Ok(probe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tactus_core::rig::skin::SkinCare;
    use tactus_core::table::{Change, Table, amend};

    #[test]
    fn minutes_of_a_day_are_as_they_must_be() {
        let day = day(400.0, 5, |_| ()).unwrap();
        eprintln!("{}\n{:?}", day.text(), day.episodes);
        assert_eq!(day.missed, [""; 0]);
        assert!(day.episodes.sound > 5 && day.episodes.broken().came > 0);
        let (known, right) = day.episodes.known;
        assert!(right * 10 >= known * 9);
    }

    #[test]
    fn a_restart_notices_what_the_flash_lost() {
        let mut rig = SimRig::new(world().setup(1, 1));
        rig.home().unwrap();
        let (host, plan) = (RefCell::default(), dsp::Plan::new());
        let mut buffer = vec![0; TABLE];
        let flash = RamFlash::blank();
        let probe = switch_on(rig, flash, FACTORY, &mut buffer, &plan, &host);
        let mut probe = probe.unwrap();
        block_on(store(&mut probe).set_skin(&SkinCare::after(1.0, 1.0))).unwrap();
        let mut day = Day::default();
        let mut probe = restarted(probe, &mut day).unwrap();
        assert_eq!(day.missed, [""; 0]);
        // the store has a table that the probe has not put in force
        let store = store(&mut probe);
        let mut renamed = vec![0; TABLE];
        let table = Table::read(FACTORY).unwrap();
        let change = Change::Forget(0);
        let length = amend(&mut renamed, &table, change)
            .unwrap()
            .as_bytes()
            .len();
        block_on(store.replace_table(&mut renamed, length)).unwrap();
        restarted(probe, &mut day).unwrap();
        assert_eq!(day.missed, ["restart 2: another table"]);
    }
}
