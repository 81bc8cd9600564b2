//! One case on the emulated board: the firmware, unmodified, is asked for something over its link while the rig, the
//! link or the chip breaks. Judged by the world, by the pins and by what the flash holds.

use std::path::Path;

use rand::seq::IndexedRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::rig::Fault as Named;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::sensor::biotac;
use tactus_core::wire::{Command, Event, Identify, Phase, Report};
use tactus_lab::sim::fault_case::naming;
use tactus_lab::sim::fault_case::{
    Activity, Case, HOMINGS, LIFTED_N, Outcome, SHARE, STILL_MM, STILL_MS, frees_the_finger, world,
};
use tactus_lab::sim::rig::FORCE_LIMIT_N;
use tactus_link::Request;
use tactus_world::faults::Fault;
use tactus_world::mount::Mount;

use crate::board::{Emulator, Error, Options, Output, Reset, ResetCause};
use crate::host::talk::{TIMEOUT_S, Talk, TalkError};

/// Stream of the seeds that what breaks on a board is drawn from.
const STREAM: u64 = 0xb0a2_d000_0000;
/// Of so many faults one is of the board, not of the rig.
const ONE_IN: u32 = 4;
/// How far the board runs between two looks, ms.
const LOOK_MS: u64 = 10;
/// A rig is at rest at the latest after this, virtual s: homing takes a fraction of it.
const REST_S: u64 = 60;
/// No request takes longer than so many times what it usually takes, and this, virtual ms: with a torn skin each
/// movement is tried twice, with homing and a search for the sample between, and the rig on the PC answers after four
/// minutes.
const SLOWER: u64 = 4;
/// See [`SLOWER`].
const SLOWER_MS: u64 = 240_000;
/// The knob is turned so far at once, mm, and so often at most: the whole travel.
const KNOB_MM: f64 = 0.1;
const KNOB_TURNS: u32 = 180;
/// What a repaired rig is asked for takes no longer than this, virtual s.
const REPAIRED_S: f64 = 180.0;
/// A request without an end.
const SILENT: &str = "no answer";
/// A lever that stands does so for this long, ns.
const STILL_NS: u64 = STILL_MS as u64 * 1_000_000;
/// A stage whose motor is driven takes more current, A.
const DRIVEN_A: f64 = 0.01;
/// Slides that show that a repaired rig works.
const SLIDES: u8 = 2;
/// The firmware has its store open by then: two erases and the lever's way up, virtual s.
const OPEN_S: u64 = 20;

/// What breaks on a board, and cannot on the PC's rig.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Upset {
    /// Bytes on the line to the host have a wrong bit or are lost, for so long.
    LinkNoise {
        /// Of the bytes, 0 to 1.
        share: f64,
        /// How long.
        ms: u64,
    },
    /// A debugger halts the core; its tool has stopped the watchdog, or not.
    Halt {
        /// How long.
        ms: u64,
        /// True if the watchdog stands, too.
        watchdog_stands: bool,
    },
    /// The supply of chip and motors is gone for so long: the chip starts anew.
    BrownOut {
        /// How long.
        ms: u64,
    },
    /// Somebody presses the board's button.
    Button {
        /// How long.
        ms: u64,
    },
}

impl Upset {
    fn draw(random: &mut ChaCha8Rng) -> Self {
        let kinds = [
            Self::LinkNoise {
                share: 10_f64.powf(random.random_range(-4.0..-0.3)),
                ms: random.random_range(10..10_000),
            },
            Self::Halt {
                ms: random.random_range(1..1_500),
                watchdog_stands: random.random(),
            },
            Self::BrownOut {
                ms: random.random_range(1..500),
            },
            Self::Button {
                ms: random.random_range(1..1_000),
            },
        ];
        kinds.choose(random).copied().unwrap_or(kinds[0])
    }

    /// True if the chip may start anew by it, or an answer be lost.
    fn interrupts(self) -> bool {
        !matches!(self, Self::Button { .. })
    }
}

/// A case, and what breaks of the board, when, ms.
#[derive(Clone, PartialEq, Debug)]
pub struct BoardCase {
    /// What happens to the rig, the store and the firmware.
    pub case: Case,
    /// What breaks of the board, and when, ms.
    pub upsets: Vec<(u64, Upset)>,
}

impl BoardCase {
    /// The case of a seed: of the rig's faults of the PC's case, some are the board's instead.
    pub fn draw(seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ STREAM);
        let mut case = Case::draw(seed);
        let mut upsets = Vec::new();
        case.faults.retain(|(at_ms, _)| {
            let stays = random.random_range(0..ONE_IN) != 0;
            if !stays {
                upsets.push((*at_ms, Upset::draw(&mut random)));
            }
            stays
        });
        Self { case, upsets }
    }

    fn interrupts(&self) -> bool {
        self.upsets.iter().any(|(_, upset)| upset.interrupts())
    }
}

/// What the firmware holds, by its own account.
#[derive(Clone, PartialEq, Debug)]
struct Kept {
    table: (u32, u32),
    textures: u16,
    calibration: RigCalibration,
    false_alarm: Option<f32>,
}

impl Kept {
    fn of(talk: &mut Talk, ear: &mut Ear) -> Result<Self, TalkError> {
        let status = talk.run(Request::status(), TIMEOUT_S, |b, r| ear.hear(b, r))?;
        let read = Request::read_calibration();
        let calibration = talk.run(read, TIMEOUT_S, |b, r| ear.hear(b, r))?;
        Ok(Self {
            table: (status.table_crc, status.table_bytes),
            textures: status.textures,
            calibration,
            false_alarm: status.false_alarm,
        })
    }
}

/// What is heard of the firmware, and what is done to it meanwhile.
#[derive(Default)]
struct Ear {
    /// Latest first, ns.
    upsets: Vec<(u64, Upset)>,
    seed: u64,
    named: Vec<(u64, Named)>,
    troubles: Vec<String>,
    learned: bool,
    ready: bool,
    failed: Option<Error>,
}

impl Ear {
    fn hear(&mut self, board: &mut Emulator, report: Option<&Report>) {
        let Some(report) = report else {
            self.upset(board);
            return;
        };
        match &report.event {
            Event::Fault(fault) if self.named.last().map(|(_, last)| last) != Some(fault) => {
                self.named.push((board.now_ns(), *fault));
            }
            Event::Phase(phase) => self.ready = *phase == Phase::Ready,
            Event::TextureLearned(_) => self.learned = true,
            Event::Trouble(why) => self.troubles.push(why.to_string()),
            _ => {}
        }
    }

    /// Does to the board what is due.
    fn upset(&mut self, board: &mut Emulator) {
        let now_ns = board.now_ns();
        while let Some((_, upset)) = self.upsets.pop_if(|(at_ns, _)| *at_ns <= now_ns) {
            if let Err(why) = self.perform(board, upset) {
                self.failed = Some(why);
            }
        }
    }

    fn perform(&self, board: &mut Emulator, upset: Upset) -> Result<(), Error> {
        match upset {
            Upset::LinkNoise { share, ms } => {
                let until_ns = board.now_ns() + ms * 1_000_000;
                board.rig().disturb_line(share, until_ns, self.seed);
            }
            Upset::Halt {
                ms,
                watchdog_stands,
            } => {
                board.halt(watchdog_stands)?;
                board.run_ms(ms)?;
                board.go_on()?;
            }
            Upset::BrownOut { ms } => {
                board.inject(Fault::SupplyDip { ms });
                board.reset()?;
            }
            Upset::Button { ms } => {
                board.press(true)?;
                board.run_ms(ms)?;
                board.press(false)?;
            }
        }
        Ok(())
    }
}

/// What all cases begin with.
pub struct BoardBench<'e> {
    elf: &'e Path,
    store: Vec<u8>,
    kept: Kept,
}

impl<'e> BoardBench<'e> {
    /// A board that was given a calibration and a share of false alarms; it has the firmware's own table.
    pub fn new(elf: &'e Path, calibration: &RigCalibration) -> Result<Self, TalkError> {
        let emulator = Emulator::start(elf, world().setup(1, 1), Options::default())?;
        let mut talk = Talk::new(emulator).look_every(LOOK_MS);
        talk.ready(|_, _| ())?;
        let write = Request::write_calibration(calibration)?;
        talk.run(write, TIMEOUT_S, |_, _| ())?;
        let share = Command::SetFalseAlarm(Some(SHARE));
        talk.send(share, TIMEOUT_S, |_, _| ())?;
        let kept = Kept::of(&mut talk, &mut Ear::default())?;
        let store = talk.board().store()?;
        Ok(Self { elf, store, kept })
    }

    fn start(&self, case: &Case, store: Vec<u8>) -> Result<Talk, TalkError> {
        let options = Options {
            store: Some(store),
            ..Options::default()
        };
        let emulator = Emulator::start(self.elf, world().setup(case.texture, case.seed), options)?;
        if !case.stiff {
            emulator.rig().world().mount(Mount::SPRUNG);
        }
        Ok(Talk::new(emulator).look_every(LOOK_MS))
    }

    /// Has a case happen. Errors: The emulator, or a board that does not start before anything broke.
    pub fn run(&self, drawn: &BoardCase) -> Result<Outcome, TalkError> {
        let case = &drawn.case;
        let mut wrong = Vec::new();
        let mut talk = self.start(case, self.store.clone())?;
        let mut ear = Ear {
            seed: case.seed,
            ..Ear::default()
        };
        if case.activity != Activity::Homing
            && let Some(fault) = talk.ready(|board, report| ear.hear(board, report))?
        {
            wrong.push(format!("{fault} before anything broke"));
        }
        let began_ns = talk.now_ns();
        let at_ns = |at_ms: u64| began_ns + at_ms * 1_000_000;
        for (at_ms, fault) in &case.faults {
            talk.board().schedule(at_ns(*at_ms), *fault);
        }
        ear.upsets = drawn
            .upsets
            .iter()
            .map(|(at_ms, upset)| (at_ns(*at_ms), *upset))
            .collect();
        ear.upsets
            .sort_by_key(|(at_ns, _)| std::cmp::Reverse(*at_ns));
        let asked = ask(&mut talk, &mut ear, case)?;
        // what was to break breaks
        listen_until(&mut talk, &mut ear, at_ns(case.activity.takes_ms()))?;
        if asked == Err(SILENT.to_owned()) && !drawn.interrupts() {
            wrong.push(SILENT.into());
        }
        rest(&mut talk, &mut ear, &mut wrong)?;
        let force_max_n = talk.board().rig().world().truth().force_max_n;
        let named: Vec<Named> = ear.named.iter().map(|(_, named)| *named).collect();
        let rig_ms = case.faults.iter().map(|(ms, _)| *ms);
        let broke_ms = rig_ms.chain(drawn.upsets.iter().map(|(ms, _)| *ms)).min();
        let too_early = |named_ns: u64| broke_ms.is_none_or(|broke_ms| named_ns < at_ns(broke_ms));
        if ear.named.first().is_some_and(|(ns, _)| too_early(*ns)) {
            wrong.push(format!("{named:?} before anything broke"));
        }
        let broke = case.faults.iter().map(|(_, fault)| fault);
        let naming = naming::judge(broke, &named, asked.is_err());
        let resets = talk.board().resets()?;
        let on_power = |reset: &&Reset| reset.cause == ResetCause::PowerOn;
        let resets = resets.len() - resets.iter().filter(on_power).count();
        if resets > 0 && !drawn.interrupts() {
            wrong.push(format!("the chip started anew {resets} times"));
        }
        repair(&mut talk, &ear)?;
        // a repaired rig is calibrated again
        let after = Kept::of(&mut talk, &mut ear)?;
        let is_done = asked.is_ok() || drawn.interrupts();
        let learned = match case.activity {
            Activity::Train | Activity::Label => is_done || ear.learned,
            _ => false,
        };
        let measured = case.activity == Activity::Calibrate && is_done;
        // a table that has learned has one texture more
        let before = &self.kept;
        let kept = [
            (after.table, after.textures) == (before.table, before.textures)
                || (learned && after.textures == before.textures + 1),
            measured || after.calibration == before.calibration,
            after.false_alarm == before.false_alarm,
        ];
        Outcome::judge_kept(kept, &mut wrong);
        let drifts = |(_, fault): &(u64, Fault)| matches!(fault, Fault::PdcDrift { .. });
        if case.faults.iter().any(drifts) {
            // a finger is exchanged with the power off: a P_DC that is right again at once is one that is pressed
            let store = talk.board().store()?;
            talk = self.start(case, store)?;
            talk.ready(|board, report| ear.hear(board, report))?;
        }
        repaired(&mut talk, &mut ear, case, &mut wrong)?;
        let after = Kept::of(&mut talk, &mut ear)?;
        self.restarted(&mut talk, case, &after, &mut wrong)?;
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
    fn restarted(
        &self,
        talk: &mut Talk,
        case: &Case,
        before: &Kept,
        wrong: &mut Vec<String>,
    ) -> Result<(), TalkError> {
        let mut store = talk.board().store()?;
        for bit in &case.bits {
            if let Some(byte) = store.get_mut(bit / 8) {
                *byte ^= 1 << (bit % 8);
            }
        }
        let mut talk = self.start(case, store)?;
        let mut ear = Ear::default();
        let booted = |event: &Event| matches!(event, Event::Booted { .. }).then_some(Ok(()));
        talk.wait(TIMEOUT_S, |board, report| ear.hear(board, report), booted)?;
        let mut after = Kept::of(&mut talk, &mut ear)?;
        // no table is in force before the store is open; what is wrong with it is said afterwards
        while talk.now_ns() < OPEN_S * 1_000_000_000
            && (after.textures == 0 || (after != *before && ear.troubles.is_empty()))
        {
            let soon_ns = talk.now_ns() + STILL_NS;
            listen_until(&mut talk, &mut ear, soon_ns)?;
            after = Kept::of(&mut talk, &mut ear)?;
        }
        Outcome::judge_store(case, after == *before, &ear.troubles, wrong);
        Ok(())
    }
}

fn listen_until(talk: &mut Talk, ear: &mut Ear, until_ns: u64) -> Result<(), TalkError> {
    while talk.now_ns() < until_ns {
        for report in talk.step()? {
            ear.hear(talk.board(), Some(&report));
        }
        ear.hear(talk.board(), None);
        if let Some(why) = ear.failed.take() {
            return Err(why.into());
        }
    }
    Ok(())
}

/// Asks for something; why it was not done, in the words of either end of the link.
fn send(
    talk: &mut Talk,
    ear: &mut Ear,
    command: Command,
    timeout_s: f64,
) -> Result<Result<(), String>, TalkError> {
    let sent = talk.send(command, timeout_s, |board, report| ear.hear(board, report));
    if let Some(why) = ear.failed.take() {
        return Err(why.into());
    }
    match sent {
        Ok(()) => Ok(Ok(())),
        Err(TalkError::Silent(_)) => Ok(Err(SILENT.into())),
        Err(why @ TalkError::Emulator(_)) => Err(why),
        Err(why) => Ok(Err(why.to_string())),
    }
}

/// What the case asks for. Homing is that of the board's start.
fn ask(talk: &mut Talk, ear: &mut Ear, case: &Case) -> Result<Result<(), String>, TalkError> {
    let timeout_ms = SLOWER * case.activity.takes_ms() + SLOWER_MS;
    if case.activity == Activity::Homing {
        let ends_ns = talk.now_ns() + timeout_ms * 1_000_000;
        while !ear.ready && ear.named.is_empty() {
            if talk.now_ns() > ends_ns {
                return Ok(Err(SILENT.into()));
            }
            let soon_ns = talk.now_ns() + STILL_NS;
            listen_until(talk, ear, soon_ns)?;
        }
        return Ok(match ear.named.first() {
            None => Ok(()),
            Some((_, fault)) => Err(fault.to_string()),
        });
    }
    for command in case.commands() {
        let asked = send(talk, ear, command, timeout_ms as f64 * 1e-3)?;
        if asked.is_err() {
            return Ok(asked);
        }
    }
    Ok(Ok(()))
}

/// The rig comes to rest, with its motors off and its finger lifted.
fn rest(talk: &mut Talk, ear: &mut Ear, wrong: &mut Vec<String>) -> Result<(), TalkError> {
    let ends_ns = talk.now_ns() + REST_S * 1_000_000_000;
    let (mut tip_mm, mut is_driven) = (f64::NAN, true);
    while talk.now_ns() < ends_ns {
        let began_ns = talk.now_ns();
        listen_until(talk, ear, began_ns + STILL_NS)?;
        let mut rig = talk.board().rig();
        let truth = rig.world().truth();
        let steps = |(at_ns, output): &(u64, Output)| {
            *at_ns >= began_ns && *output == Output::LeverStep(true)
        };
        is_driven = rig.trace().any(steps) || truth.current_a.abs() > DRIVEN_A;
        let before_mm = std::mem::replace(&mut tip_mm, truth.tip_mm);
        let is_lifted = truth.force_n <= LIFTED_N || !ear.named.is_empty();
        if is_lifted && !is_driven && (tip_mm - before_mm).abs() < STILL_MM {
            break;
        }
    }
    if is_driven {
        wrong.push("a motor is still driven".into());
    }
    let truth = talk.board().rig().world().truth();
    let named: Vec<Named> = ear.named.iter().map(|(_, named)| *named).collect();
    Outcome::judge_rest(&truth, &named, wrong);
    Ok(())
}

/// Everything is repaired. Where a fault asks for it, somebody turns the lever's knob until the finger is free.
fn repair(talk: &mut Talk, ear: &Ear) -> Result<(), TalkError> {
    talk.board().rig().world().clear();
    talk.board().rig().disturb_line(0.0, 0, 0);
    if ear.named.iter().any(|(_, named)| frees_the_finger(*named)) {
        for _ in 0..KNOB_TURNS {
            let mut rig = talk.board().rig();
            let world = rig.world();
            if world.truth().force_n <= LIFTED_N || !world.turn_knob(KNOB_MM) {
                break;
            }
            drop(rig);
            talk.board().run_ms(10)?;
        }
    }
    // a sensor that is plugged in again starts up
    talk.board()
        .run_ms(u64::from(biotac::PARTS.power_up_ms) + 100)
        .map_err(Into::into)
}

/// The repaired rig homes, and does what it is asked for.
fn repaired(
    talk: &mut Talk,
    ear: &mut Ear,
    case: &Case,
    wrong: &mut Vec<String>,
) -> Result<(), TalkError> {
    let mut homed = Ok(());
    for _ in 0..HOMINGS {
        homed = send(talk, ear, Command::Home, TIMEOUT_S)?;
        if homed.is_ok() {
            break;
        }
        talk.board().run_ms(1_000)?;
    }
    if let Err(why) = homed {
        wrong.push(format!("repaired, it does not home: {why}"));
        return Ok(());
    }
    let mut commands = vec![Command::Identify(Identify {
        max_slides: SLIDES,
        ..case.identify()
    })];
    if case.activity == Activity::Calibrate {
        // constants that were measured with something broken are measured again
        commands.insert(0, Command::Calibrate);
    }
    for command in commands {
        if let Err(why) = send(talk, ear, command.clone(), REPAIRED_S)? {
            wrong.push(format!("repaired, it refuses {command:?}: {why}"));
        }
    }
    let force_max_n = talk.board().rig().world().truth().force_max_n;
    if force_max_n > FORCE_LIMIT_N {
        wrong.push(format!("{force_max_n:.3} N on the finger after the repair"));
    }
    Ok(())
}
