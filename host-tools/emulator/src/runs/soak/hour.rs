//! The hour: the real firmware on the emulated board, over one boot; then restarts that it must report.

use std::path::Path;

use rand::seq::IndexedRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::table::{Name, Table};
use tactus_core::wire::{Command, Counts, Event, Forget, Report, Reset, Status};
use tactus_lab::sim::collection::{calibrated, texture_name};
use tactus_link::{ReadTable, Request};
use tactus_world::mount::Mount;

use super::episodes::{HOMINGS, Plan, world};
use super::hour_report::{Hour, HourError, Restart, missed};
use crate::board::{Error, FlashWrite, Options, ResetCause, StackLayout};
use crate::host::exploration::{Exploration, ExploreError, explore};
use crate::host::talk::{TIMEOUT_S, Talk, TalkError};
use crate::host::under_finger;

/// Slots a second: the timer of the firmware's `acquire`.
const SLOTS_HZ: f64 = 84e6 / 19_091.0;
/// A texture is deleted after so many episodes.
const FORGETS_EVERY: u32 = 15;
/// A firmware that hangs is reset within this, ns: 2 s until that is noticed, 8 s for the lever's whole way up, and the
/// watchdog; looked for so often.
const LONGEST_NS: u64 = 12_000_000_000;
/// See [`LONGEST_NS`].
const STEP_NS: u64 = 100_000;

/// What is done to the firmware in the end.
struct OnPurpose {
    what: &'static str,
    /// The function by the name that it exports, and what its first instruction is instead; the reset pin without any.
    code: Option<(&'static str, [u8; 2])>,
}

/// A branch to itself, and an undefined instruction.
const HANGS: [u8; 2] = [0xFE, 0xE7];
/// See [`HANGS`].
const CRASHES: [u8; 2] = [0x00, 0xDE];

const ON_PURPOSE: [OnPurpose; 4] = [
    OnPurpose {
        what: "the tasks of thread mode hang",
        code: Some(("tactus_check_in", HANGS)),
    },
    OnPurpose {
        what: "the servo hangs",
        code: Some(("tactus_servo_tick", HANGS)),
    },
    OnPurpose {
        what: "the servo crashes",
        code: Some(("tactus_servo_tick", CRASHES)),
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
        if let Event::Booted {
            reset, last_words, ..
        } = &report.event
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

/// Explores texture after texture for so many virtual seconds on an emulated board; `each` gets the time.
pub(super) fn hour(
    elf: &Path,
    virtual_s: f64,
    seed: u64,
    each: &mut dyn FnMut(f64),
) -> Result<Hour, HourError> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let texture = random.random_range(1..=117);
    let calibration = calibrated(world().setup(1, 0))?;
    let unknown = under_finger::mounted(&world(), texture, 1 + seed);
    let mut emulator = unknown.start(elf, Options::default())?;
    emulator.rig().world().mount(Mount::SPRUNG);
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
    let write = Request::write_calibration(&calibration).map_err(TalkError::from);
    let written = write.and_then(|write| soak.talk.run(write, TIMEOUT_S, |_, _| ()));
    soak.talked(written)?;
    let first = soak.tally()?;
    let mut stack = Vec::new();
    while soak.now_s() < virtual_s {
        soak.run_episode()?;
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

    fn send(&mut self, command: Command) -> Result<Result<(), String>, HourError> {
        let ear = &mut self.ear;
        let asked = self.talk.send(command, TIMEOUT_S, |board, report| {
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
        let status = self.talk.run(Request::status(), TIMEOUT_S, |_, _| ());
        self.talked(status)
    }

    fn tally(&mut self) -> Result<Tally, HourError> {
        let before = self.talk.board().rig().sensor_commands();
        let counts = self.status()?.counts;
        let after = self.talk.board().rig().sensor_commands();
        let (damaged, missing) = self.talk.losses();
        Ok(Tally {
            counts,
            commands: (before, after),
            now_s: self.now_s(),
            lost_reports: damaged + missing,
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
            match self.send(Command::Home)? {
                Ok(()) => return Ok(()),
                Err(why) => refused = why,
            }
            self.talk.board().run_ms(1000)?;
        }
        let why = TalkError::Refused(format!("it does not home: {refused}"));
        self.talked(Err(why))
    }

    /// An exploration of what the seed draws, and what is learned from it.
    fn run_episode(&mut self) -> Result<(), HourError> {
        let drawn = Plan::draw(&mut self.random);
        self.place(drawn.texture)?;
        let truth = texture_name(drawn.texture);
        let read = self.talk.run(ReadTable::default(), TIMEOUT_S, |_, _| ());
        let bytes = self.talked(read)?;
        let before = self.tally()?;
        let resets = self.talk.board().resets()?.len();
        let began_ns = self.talk.now_ns();
        if let Some((at_ns, fault)) = drawn.fault {
            self.talk.board().schedule(began_ns + at_ns, fault);
        }
        self.hour.episodes.made += 1;
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
                    if let Event::Rejected { why, .. } = &report.event {
                        rejected.push(why.to_string());
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
            self.hour.episodes.broke(fault, explored.is_none());
        } else {
            let rejected = rejected
                .iter()
                .map(|why| format!("{at_s:.0} s: {truth}: {why}"));
            self.hour.episodes.rejected.extend(rejected);
        }
        if drawn.fault.is_some() || explored.is_none() {
            self.recover()?;
        }
        if let (Some(explored), None) = (explored, came) {
            self.sound(since(explored, &before, resets), &drawn, truth)?;
        }
        if self.hour.episodes.made.is_multiple_of(FORGETS_EVERY) {
            self.forget(&bytes)?;
        }
        Ok(())
    }

    /// An episode in which nothing broke.
    fn sound(&mut self, explored: Exploration, drawn: &Plan, truth: &str) -> Result<(), HourError> {
        let at_s = self.now_s();
        let found = &explored.found;
        let named = (!found.unknown).then_some(found.name.as_str());
        let episodes = &mut self.hour.episodes;
        episodes.judge(at_s, truth, explored.known, named, found.sure);
        episodes.learned.1 += u32::from(explored.learned > 0);
        self.hour.missed_slots += explored.missed_slots() as u64;
        let missed = explored.missed().into_iter();
        let missed = missed.map(|what| format!("{at_s:.0} s: {truth}: {what}"));
        self.hour.missed.extend(missed);
        // what it has learned by itself has changed the table: a label would come too late
        if drawn.answer && explored.learned == 0 {
            let name = Name::try_from(truth).unwrap_or_default();
            let learned = self.talk.run(Request::label(name), TIMEOUT_S, |_, _| ());
            match learned {
                Ok(_) => self.hour.episodes.learned.0 += 1,
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
            Forget::SelfLearned
        } else {
            Forget::Texture(name.unwrap_or_default().try_into().unwrap_or_default())
        };
        match self.send(Command::Forget(what.clone()))? {
            Ok(()) => self.hour.episodes.forgotten += 1,
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
            self.run_episode()?;
        }
        Ok(())
    }

    /// Adds up what the firmware has counted, before a restart clears it or at the end.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clock_that_goes_wrong_is_told_from_a_report_that_waits() {
        let report = |at_ms| Report {
            number: 0,
            at_ms,
            event: Event::Done(1),
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
