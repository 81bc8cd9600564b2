//! The hour: the real firmware on the emulated board, over one boot; then restarts that it must report.

use std::path::Path;

use rand::seq::IndexedRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rigless::device::ResetCause;
use serde_json::{Value, json};
use tactus::collection::{calibrated, texture_name};
use tactus::link::{Question, ReadTable};
use tactus::simulated::SimError;
use tactus_core::table::{Table, TableError};
use tactus_core::wire::{Ask, Counts, Forget, Name, Report, Reset, Status, Tell};

use super::{HOMINGS, MOST_N, Plan, Visits, world};
use crate::FlashWrite;
use crate::board::{Error, Options};
use crate::exploration::{Exploration, ExploreError, explore};
use crate::lessons;
use crate::stack::StackLayout;
use crate::talk::{PATIENCE_S, Talk, TalkError};

/// Slots a second: the timer of the firmware's `acquire`.
const SLOTS_HZ: f64 = 84e6 / 19_091.0;
/// Slots that may lie between a count and the time at which it arrives.
const SLOTS_OFF: f64 = 10.0;
/// Reports say whole milliseconds, and are looked for every one.
const DRIFT_MS: f64 = 2.0;
/// Bytes by which the high-water mark may rise: the exception frames of two interrupts that came when the stack was deepest, which is
/// a matter of luck. What leaks does so at every visit.
const FRAMES: u32 = 2 * 108;
/// Visits that an hour is for; of a shorter time, its share.
const VISITS: f64 = 30.0;
/// Something is forgotten after so many visits.
const FORGETS_EVERY: u32 = 15;
/// A firmware that hangs is reset within this, ns: 2 s until that is noticed, 8 s for the lever's whole way up, and the watchdog;
/// looked for so often.
const LONGEST_NS: u64 = 12_000_000_000;
/// See [`LONGEST_NS`].
const STEP_NS: u64 = 100_000;

/// Why there is no hour to judge.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HourError {
    /// The board.
    #[error(transparent)]
    Emulator(#[from] Error),
    /// The firmware.
    #[error("at {at_s:.0} virtual s: {why}")]
    Talk {
        /// When.
        at_s: f64,
        /// Why.
        why: TalkError,
    },
    /// The exploration.
    #[error("at {at_s:.0} virtual s: {why}")]
    Explore {
        /// When.
        at_s: f64,
        /// Why.
        why: ExploreError,
    },
    /// The rig's constants.
    #[error("the simulated rig: {0}")]
    Rig(#[from] SimError),
    /// The table.
    #[error("the table in force: {0}")]
    Table(#[from] TableError),
}

/// A reset of the chip, and what the firmware said of it.
#[derive(Clone, PartialEq, Debug)]
pub struct Restart {
    /// What was done to it; nothing for one that nobody wanted.
    pub done: Option<&'static str>,
    /// Why it started, by its own account.
    pub reset: Reset,
    /// What it said before it gave up.
    pub last_words: Option<String>,
}

/// What became of an hour.
#[derive(Clone, Debug, Default)]
pub struct Hour {
    /// Virtual seconds over one boot, before the restarts on purpose.
    pub virtual_s: f64,
    /// The visits.
    pub visits: Visits,
    /// How far the firmware's clock has gone from the emulator's, ms.
    pub drift_ms: f64,
    /// Slots by the firmware's count, by the time, and sample commands that the sensor got.
    pub slots: (u64, f64, u64),
    /// What the firmware counted, over all boots.
    pub late_slots: u64,
    /// See [`Hour::late_slots`].
    pub lost_samples: u64,
    /// See [`Hour::late_slots`].
    pub lost_reports: u64,
    /// Slots of slides in which the sensor was not asked, by the sensor.
    pub missed_slots: u64,
    /// Most bytes of stack at each quarter of the time.
    pub stack: Vec<u32>,
    /// Resets that the emulator saw.
    pub resets: usize,
    /// What the firmware told of them.
    pub restarts: Vec<Restart>,
    /// Most force on the finger, N.
    pub force_max_n: f64,
    /// Sectors of the store that were erased.
    pub erases: usize,
    /// What is not as it must be.
    pub missed: Vec<String>,
}

impl Hour {
    /// For programs.
    pub fn json(&self) -> Value {
        let restart = |restart: &Restart| {
            json!({
                "done_to_it": restart.done,
                "reset": format!("{:?}", restart.reset),
                "last_words": restart.last_words,
            })
        };
        let mut json = self.visits.json();
        json["virtual_seconds"] = self.virtual_s.into();
        json["drift_ms"] = self.drift_ms.into();
        json["slots_firmware"] = self.slots.0.into();
        json["slots_due"] = self.slots.1.into();
        json["slots_sensor"] = self.slots.2.into();
        json["late_slots"] = self.late_slots.into();
        json["lost_samples"] = self.lost_samples.into();
        json["lost_reports"] = self.lost_reports.into();
        json["missed_slots_true"] = self.missed_slots.into();
        json["stack_bytes_at_quarters"] = json!(self.stack);
        json["resets"] = self.resets.into();
        json["restarts_told"] = self.restarts.iter().map(restart).collect();
        json["force_max_n"] = self.force_max_n.into();
        json["sectors_erased"] = self.erases.into();
        json["missed"] = json!(self.missed);
        json
    }

    /// For people.
    pub fn text(&self) -> String {
        let told: Vec<String> = self
            .restarts
            .iter()
            .map(|r| format!("{:?}", r.reset))
            .collect();
        format!(
            "emulated board: {:.3} virtual hours over one boot\n  {}\n  clock {:.2} ms off; {} slots of {:.1} ({} by the sensor), {} \
             late, {} missed, {} samples and {} reports lost\n  stack {} bytes at the quarters; {} sectors erased; force {:.3} N at most\n  \
             {} resets, all on purpose: {}",
            self.virtual_s / 3600.0,
            self.visits.text(),
            self.drift_ms,
            self.slots.0,
            self.slots.1,
            self.slots.2,
            self.late_slots,
            self.missed_slots,
            self.lost_samples,
            self.lost_reports,
            self.stack
                .iter()
                .map(u32::to_string)
                .collect::<Vec<_>>()
                .join(", "),
            self.erases,
            self.force_max_n,
            self.resets,
            told.join(", ")
        )
    }
}

/// What is done to the firmware in the end.
struct OnPurpose {
    what: &'static str,
    /// The function by its mangled name, and what its first instruction is instead; the reset pin without any.
    code: Option<(&'static str, [u8; 2])>,
}

/// A branch to itself, and an undefined instruction.
const HANGS: [u8; 2] = [0xFE, 0xE7];
/// See [`HANGS`].
const CRASHES: [u8; 2] = [0x00, 0xDE];

const ON_PURPOSE: [OnPurpose; 4] = [
    OnPurpose {
        what: "the tasks of thread mode hang",
        code: Some(("___watch_task_inner_function0E4poll", HANGS)),
    },
    OnPurpose {
        what: "the servo hangs",
        code: Some(("___servo_task_inner_function0E4poll", HANGS)),
    },
    OnPurpose {
        what: "the servo crashes",
        code: Some(("___servo_task_inner_function0E4poll", CRASHES)),
    },
    OnPurpose {
        what: "the reset pin",
        code: None,
    },
];

/// What the firmware says of its time and its restarts.
#[derive(Default)]
struct Ear {
    /// How late reports came, ms: the least since the last look. A report may wait, it cannot come early.
    late_ms: Option<f64>,
    /// The first and the last look.
    looks: Option<(f64, f64)>,
    booted: Vec<(Reset, Option<String>)>,
}

impl Ear {
    fn hear(&mut self, now_ns: u64, report: &Report) {
        if let Tell::Booted {
            reset, last_words, ..
        } = &report.tell
        {
            let words = last_words.as_ref().map(|words| words.as_str().to_owned());
            self.booted.push((*reset, words));
        }
        let late_ms = now_ns as f64 * 1e-6 - f64::from(report.at_ms);
        self.late_ms = Some(self.late_ms.map_or(late_ms, |least| least.min(late_ms)));
    }

    fn look(&mut self) {
        if let Some(late_ms) = self.late_ms.take() {
            let first = self.looks.map_or(late_ms, |(first, _)| first);
            self.looks = Some((first, late_ms));
        }
    }

    fn drift_ms(&self) -> f64 {
        self.looks.map_or(0.0, |(first, last)| last - first)
    }
}

/// What the firmware has counted at a moment, beside what is so.
#[derive(Clone, Copy)]
struct Tally {
    counts: Counts,
    /// Sample commands before and after it was asked.
    commands: (u64, u64),
    now_s: f64,
    lost_reports: u64,
}

struct Soak<'a> {
    talk: Talk,
    ear: Ear,
    hour: Hour,
    random: ChaCha8Rng,
    each: &'a mut dyn FnMut(f64),
}

/// Visits texture after texture for so many virtual seconds on an emulated board; `each` hears of the time.
///
/// # Errors
/// See [`HourError`].
pub fn hour(
    elf: &Path,
    virtual_s: f64,
    seed: u64,
    each: &mut dyn FnMut(f64),
) -> Result<Hour, HourError> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let texture = random.random_range(1..=117);
    let calibration = calibrated(world().setup(1, 0))?;
    let unknown = lessons::mounted(&world(), texture, 1 + seed);
    let mut emulator = unknown.start(elf, Options::default())?;
    // only how deep it gets in all, which costs nothing
    emulator.measure_stack(StackLayout {
        levels: Vec::new(),
        ..StackLayout::of(elf)?
    })?;
    let mut soak = Soak {
        talk: Talk::new(emulator),
        ear: Ear::default(),
        hour: Hour::default(),
        random,
        each,
    };
    soak.ready()?;
    let write = Question::write_calibration(&calibration).map_err(TalkError::from);
    let written = write.and_then(|write| soak.talk.run(write, PATIENCE_S, |_, _| ()));
    soak.talked(written)?;
    let first = soak.tally()?;
    let mut stack = Vec::new();
    while soak.now_s() < virtual_s {
        soak.visit()?;
        let quarters = 4.0 * soak.now_s() / virtual_s;
        if quarters >= (stack.len() + 1) as f64 && stack.len() < 4 {
            stack.push(soak.stack()?);
        }
    }
    // what the firmware does when it gives up comes after this, and has a depth of its own
    stack.push(soak.stack()?);
    soak.hour.stack = stack;
    soak.hour.virtual_s = soak.now_s();
    let last = soak.tally()?;
    soak.hour.slots = (
        u64::from(last.counts.slots - first.counts.slots),
        (last.now_s - first.now_s) * SLOTS_HZ,
        last.commands.0 - first.commands.1,
    );
    soak.hour.drift_ms = soak.ear.drift_ms();
    soak.restarts()?;
    soak.over()?;
    let mut hour = soak.hour;
    let missed = missed(&hour, virtual_s);
    hour.missed.extend(missed);
    Ok(hour)
}

impl Soak<'_> {
    fn now_s(&self) -> f64 {
        self.talk.now_ns() as f64 * 1e-9
    }

    /// Says when something failed.
    fn talked<T>(&self, done: Result<T, TalkError>) -> Result<T, HourError> {
        let at_s = self.now_s();
        done.map_err(|why| HourError::Talk { at_s, why })
    }

    fn stack(&mut self) -> Result<u32, Error> {
        let used = self.talk.board().stack_use()?;
        Ok(used.map_or(0, |used| used.used))
    }

    fn ask(&mut self, ask: Ask) -> Result<Result<(), String>, HourError> {
        let ear = &mut self.ear;
        let asked = self.talk.ask(ask, PATIENCE_S, |board, report| {
            if let Some(report) = report {
                ear.hear(board.now_ns(), report);
            }
        });
        match asked {
            Err(TalkError::Refused(why)) => Ok(Err(why)),
            asked => self.talked(asked).map(Ok),
        }
    }

    fn ready(&mut self) -> Result<(), HourError> {
        let ear = &mut self.ear;
        let ready = self.talk.ready(|board, report| {
            if let Some(report) = report {
                ear.hear(board.now_ns(), report);
            }
        });
        match self.talked(ready)? {
            None => Ok(()),
            Some(fault) => {
                let at_s = self.now_s();
                let missed = format!("{at_s:.0} s: {fault} while homing");
                self.hour.missed.push(missed);
                Ok(())
            }
        }
    }

    fn status(&mut self) -> Result<Status, HourError> {
        let status = self.talk.run(Question::status(), PATIENCE_S, |_, _| ());
        self.talked(status)
    }

    fn tally(&mut self) -> Result<Tally, HourError> {
        let before = self.talk.board().rig().sensor_commands();
        let counts = self.status()?.counts;
        let after = self.talk.board().rig().sensor_commands();
        let session = self.talk.session();
        Ok(Tally {
            counts,
            commands: (before, after),
            now_s: self.now_s(),
            lost_reports: session.damaged() + session.missing(),
        })
    }

    /// Puts a texture under the finger.
    fn place(&mut self, texture: u8) -> Result<(), HourError> {
        let placed = self.talk.board().rig().world().place(texture);
        if placed.is_err() {
            // a thick sample, and a finger that is not all the way up
            self.recover()?;
            let again = self.talk.board().rig().world().place(texture);
            if let Err(why) = again {
                let missed = format!("{:.0} s: {why}", self.now_s());
                self.hour.missed.push(missed);
            }
        }
        Ok(())
    }

    /// Repairs the rig and has it find its switches.
    fn recover(&mut self) -> Result<(), HourError> {
        self.talk.board().rig().world().clear();
        // the sensor starts up
        let waited = self.talk.board().run_ms(200);
        waited?;
        let mut refused = String::new();
        for _ in 0..HOMINGS {
            match self.ask(Ask::Home)? {
                Ok(()) => return Ok(()),
                Err(why) => refused = why,
            }
            self.talk.board().run_ms(1000)?;
        }
        let why = TalkError::Refused(format!("it does not home: {refused}"));
        self.talked(Err(why))
    }

    /// An exploration of what the seed draws, and what is learned from it.
    fn visit(&mut self) -> Result<(), HourError> {
        let drawn = Plan::draw(&mut self.random);
        self.place(drawn.texture)?;
        let truth = texture_name(drawn.texture);
        let read = self.talk.run(ReadTable::default(), PATIENCE_S, |_, _| ());
        let bytes = self.talked(read)?;
        let before = self.tally()?;
        let resets = self.talk.board().resets()?.len();
        let began_ns = self.talk.now_ns();
        if let Some((at_ns, fault)) = drawn.fault {
            self.talk.board().schedule(began_ns + at_ns, fault);
        }
        self.hour.visits.made += 1;
        let (ear, each) = (&mut self.ear, &mut self.each);
        let mut rejected = Vec::new();
        let explored = explore(
            &mut self.talk,
            &bytes,
            drawn.identify.clone(),
            truth,
            |board, report| match report {
                Some(report) => {
                    ear.hear(board.now_ns(), report);
                    if let Tell::Rejected { why, .. } = &report.tell {
                        rejected.push(why.as_str().to_owned());
                    }
                }
                None => each(board.now_ns() as f64 * 1e-9),
            },
        );
        self.ear.look();
        let at_s = self.now_s();
        let came = drawn
            .fault
            .filter(|(at_ns, _)| began_ns + at_ns <= self.talk.now_ns());
        let explored = match explored {
            Ok(explored) => Some(explored),
            Err(ExploreError::Talk(TalkError::Refused(why))) => {
                if came.is_none() {
                    self.hour
                        .missed
                        .push(format!("{at_s:.0} s: {truth}: {why}"));
                }
                None
            }
            Err(why) => return Err(HourError::Explore { at_s, why }),
        };
        if let Some((_, fault)) = came {
            self.hour.visits.broke(fault, explored.is_none());
        } else {
            let rejected = rejected
                .iter()
                .map(|why| format!("{at_s:.0} s: {truth}: {why}"));
            self.hour.visits.rejected.extend(rejected);
        }
        if drawn.fault.is_some() || explored.is_none() {
            self.recover()?;
        }
        if let (Some(explored), None) = (explored, came) {
            self.sound(since(explored, &before, resets), &drawn, truth)?;
        }
        if self.hour.visits.made.is_multiple_of(FORGETS_EVERY) {
            self.forget(&bytes)?;
        }
        Ok(())
    }

    /// A visit in which nothing broke.
    fn sound(&mut self, explored: Exploration, drawn: &Plan, truth: &str) -> Result<(), HourError> {
        let at_s = self.now_s();
        let found = &explored.found;
        let named = (!found.unknown).then_some(found.name.as_str());
        let visits = &mut self.hour.visits;
        visits.judge(at_s, truth, explored.known, named, found.sure);
        visits.taught.1 += u32::from(found.learned > 0);
        self.hour.missed_slots += explored.missed_slots() as u64;
        let missed = explored.missed().into_iter();
        let missed = missed.map(|what| format!("{at_s:.0} s: {truth}: {what}"));
        self.hour.missed.extend(missed);
        // what it has learned by itself has changed the table: an answer would come too late
        if drawn.answer && found.learned == 0 {
            let name = Name::try_from(truth).unwrap_or_default();
            let taught = self.talk.run(Question::answer(name), PATIENCE_S, |_, _| ());
            match taught {
                Ok(_) => self.hour.visits.taught.0 += 1,
                Err(TalkError::Refused(why)) => {
                    self.hour
                        .missed
                        .push(format!("{at_s:.0} s: {truth}: {why}"));
                }
                Err(why) => return Err(HourError::Talk { at_s, why }),
            }
        }
        Ok(())
    }

    fn forget(&mut self, table: &[u8]) -> Result<(), HourError> {
        let names: Vec<String> = Table::read(table)?.names().map(str::to_owned).collect();
        let name = names.choose(&mut self.random).map(String::as_str);
        let what = if self.random.random_range(0..3) == 0 {
            Forget::SelfTaught
        } else {
            Forget::Texture(name.unwrap_or_default().try_into().unwrap_or_default())
        };
        match self.ask(Ask::Forget(what.clone()))? {
            Ok(()) => self.hour.visits.forgotten += 1,
            Err(why) => self.hour.missed.push(format!("{what:?}: {why}")),
        }
        Ok(())
    }

    /// Breaks the firmware, and has it reset by its pin: it must say so, and work again as it did.
    fn restarts(&mut self) -> Result<(), HourError> {
        for OnPurpose { what, code } in ON_PURPOSE {
            let table = self.status()?.table_crc;
            self.over()?;
            let heard = self.ear.booted.len();
            match code {
                Some((function, code)) => {
                    let board = self.talk.board();
                    let (address, _) = board.symbol(function)?;
                    let whole = board.read(address & !1, 2)?;
                    board.write(address & !1, &code)?;
                    let (resets, began_ns) = (board.resets()?.len(), board.now_ns());
                    // whole again before the start-up comes to it
                    while board.resets()?.len() == resets && board.now_ns() < began_ns + LONGEST_NS
                    {
                        board.run_until(board.now_ns() + STEP_NS)?;
                    }
                    board.write(address & !1, &whole)?;
                    if board.resets()?.len() == resets {
                        self.hour.missed.push(format!("{what}: no reset"));
                    }
                }
                None => self.talk.board().reset()?,
            }
            self.ready()?;
            if let Some((reset, last_words)) = self.ear.booted.get(heard).cloned() {
                self.hour.restarts.push(Restart {
                    done: Some(what),
                    reset,
                    last_words,
                });
            }
            if self.status()?.table_crc != table {
                self.hour.missed.push(format!("{what}: another table"));
            }
            self.visit()?;
        }
        Ok(())
    }

    /// Takes in what the firmware has counted, before it forgets it or when all is over.
    fn over(&mut self) -> Result<(), HourError> {
        let tally = self.tally()?;
        let hour = &mut self.hour;
        hour.late_slots += u64::from(tally.counts.late_slots);
        hour.lost_samples += u64::from(tally.counts.lost_samples);
        hour.lost_reports =
            hour.lost_reports.max(tally.lost_reports) + u64::from(tally.counts.lost_reports);
        let erased = |write: &FlashWrite| matches!(write, FlashWrite::Erase { .. });
        let writes = self.talk.board().store_writes()?;
        hour.erases += writes.iter().filter(|write| erased(write)).count();
        hour.force_max_n = self.talk.board().rig().world().truth().force_max_n;
        let resets = self.talk.board().resets()?;
        self.hour.resets = resets
            .iter()
            .filter(|reset| reset.cause != ResetCause::PowerOn)
            .count();
        Ok(())
    }
}

/// An exploration with what was counted in it only.
fn since(explored: Exploration, before: &Tally, resets: usize) -> Exploration {
    let (now, then) = (explored.counts, before.counts);
    let counts = Counts {
        slots: now.slots.wrapping_sub(then.slots),
        late_slots: now.late_slots - then.late_slots,
        parity_errors: now.parity_errors - then.parity_errors,
        error_frames: now.error_frames - then.error_frames,
        lost_samples: now.lost_samples - then.lost_samples,
        lost_reports: now.lost_reports - then.lost_reports,
        damaged_frames: now.damaged_frames - then.damaged_frames,
    };
    let (from, to) = explored.commands;
    Exploration {
        counts,
        // the firmware's count was taken somewhere between the sensor's
        commands: (from - before.commands.1, to - before.commands.0),
        resets: explored.resets - resets,
        lost_reports: explored.lost_reports - before.lost_reports,
        ..explored
    }
}

/// What an hour must be; an empty list is good.
fn missed(hour: &Hour, virtual_s: f64) -> Vec<String> {
    let mut missed = Vec::new();
    let mut check = |good: bool, what: String| {
        if !good {
            missed.push(what);
        }
    };
    let wanted = VISITS * virtual_s / 3600.0;
    check(
        f64::from(hour.visits.sound) >= wanted.floor(),
        format!(
            "{} visits without a fault, {wanted:.0} wanted",
            hour.visits.sound
        ),
    );
    check(
        hour.drift_ms.abs() <= DRIFT_MS,
        format!("the clock has gone {:.2} ms off", hour.drift_ms),
    );
    let (told, due, seen) = hour.slots;
    check(
        (told as f64 - due).abs() <= SLOTS_OFF && (seen as f64 - told as f64).abs() <= SLOTS_OFF,
        format!("{told} slots are told, {due:.1} are due, the sensor saw {seen}"),
    );
    let lost = [
        (hour.late_slots, "slots late"),
        (hour.missed_slots, "slots missed by the sensor"),
        (hour.lost_samples, "samples lost"),
        (hour.lost_reports, "reports lost"),
    ];
    for (count, what) in lost {
        check(count == 0, format!("{count} {what}"));
    }
    let grown = hour.stack.first().zip(hour.stack.last());
    check(
        grown.is_some_and(|(first, last)| *last <= first + FRAMES),
        format!("the stack has grown: {:?} bytes", hour.stack),
    );
    check(
        hour.force_max_n <= MOST_N,
        format!("{:.3} N on the finger", hour.force_max_n),
    );
    check(
        hour.resets == hour.restarts.len(),
        format!(
            "{} resets, {} are told and on purpose",
            hour.resets,
            hour.restarts.len()
        ),
    );
    for restart in &hour.restarts {
        let said = |words: &str| {
            let last = restart.last_words.as_ref();
            last.is_some_and(|last| last.contains(words))
        };
        let why = match restart.done {
            Some("the tasks of thread mode hang") => {
                restart.reset == Reset::Watchdog && said("check in")
            }
            Some("the servo hangs") => restart.reset == Reset::Watchdog,
            Some("the servo crashes") => restart.reset == Reset::Software && said("hard fault"),
            Some(_) => restart.reset == Reset::Pin,
            None => false,
        };
        check(
            why,
            format!("it does not say why it restarted: {restart:?}"),
        );
    }
    missed
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As it must be.
    fn good() -> Hour {
        let restart = |done, reset, words: Option<&str>| Restart {
            done: Some(done),
            reset,
            last_words: words.map(str::to_owned),
        };
        let mut hour = Hour {
            drift_ms: 0.4,
            slots: (15_839_920, 15_839_924.4, 15_839_921),
            stack: vec![9000, 9000, 9000],
            resets: 4,
            restarts: vec![
                restart(
                    "the tasks of thread mode hang",
                    Reset::Watchdog,
                    Some("the tasks in thread mode did not check in for 2 s"),
                ),
                restart("the servo hangs", Reset::Watchdog, None),
                restart(
                    "the servo crashes",
                    Reset::Software,
                    Some("hard fault at 0x08001234"),
                ),
                restart("the reset pin", Reset::Pin, None),
            ],
            force_max_n: 2.19,
            ..Hour::default()
        };
        hour.visits.sound = 30;
        hour
    }

    #[test]
    fn every_bar_can_be_missed() {
        assert_eq!(missed(&good(), 3600.0), [""; 0]);
        let breaks: [fn(&mut Hour); 11] = [
            |hour| hour.visits.sound = 29,
            |hour| hour.drift_ms = -2.1,
            |hour| hour.slots.0 -= 11,
            |hour| hour.late_slots = 1,
            |hour| hour.missed_slots = 1,
            |hour| hour.lost_samples = 1,
            |hour| hour.lost_reports = 1,
            |hour| hour.stack[2] = 9217,
            |hour| hour.force_max_n = 2.21,
            // one that nobody told of
            |hour| hour.resets = 5,
            |hour| hour.restarts[2].last_words = None,
        ];
        for (number, change) in breaks.into_iter().enumerate() {
            let mut hour = good();
            change(&mut hour);
            assert_eq!(missed(&hour, 3600.0).len(), 1, "{number}");
        }
    }

    #[test]
    fn a_clock_that_goes_wrong_is_told_from_a_report_that_waits() {
        let report = |at_ms| Report {
            number: 0,
            at_ms,
            tell: Tell::Done(1),
        };
        let mut ear = Ear::default();
        let mut hear = |reports: &[(u64, u32)]| {
            for (now_ms, at_ms) in reports {
                ear.hear(now_ms * 1_000_000, &report(*at_ms));
            }
            ear.look();
            ear.drift_ms()
        };
        assert_eq!(hear(&[(105, 100), (230, 200)]), 0.0);
        assert_eq!(hear(&[(1090, 1000), (1105, 1100)]), 0.0);
        // 10 ms in a second
        assert_eq!(hear(&[(2115, 2100), (2300, 2200)]), 10.0);
    }
}
