//! A rig's first evening on the emulated board: `tactus_link::bringup` with the self-test image, and a person who does what is asked and
//! tells what the world shows. Rigs that are built as they should be pass, and of others the mistake is named.
//!
//! A mistake's evening begins with the step that should find it, as if those before had passed earlier: the journal makes that
//! possible. `every_mistake_is_found_from_the_first_step_on` has whole evenings.

use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use tactus_core::wire::bringup::{Measure, Pin, Saw};
use tactus_core::wire::{Command, Report as ProbeReport, Reset};
use tactus_emulator::board::{Emulator, Options, pins};
use tactus_emulator::host::talk::{Talk, TalkError};
use tactus_link::Request;
use tactus_link::bringup::judge::Finding;
use tactus_link::bringup::{
    self, Board, Ended, Ends, Entry, Image, Journal, Line, MISTAKES, Operator, Person, Probe,
    Report, STEPS, Step, Trouble,
};
use tactus_world::encoder::Cut;
use tactus_world::faults::Fault;
use tactus_world::person::{Hand, Manner};
use tactus_world::stage::{SUPPLY_V, TRAVEL_MM};
use tactus_world::wiring::Miswired;
use tactus_world::world::{Reached, Setup};

use crate::common::elf_of;

/// The bench: the emulated board with its rig, and what somebody is about to do with it.
struct Rig {
    emulator: RefCell<Emulator>,
    /// when the hand lets the finger go, ns
    lets_go_ns: Cell<Option<u64>>,
}

impl Rig {
    fn run_ms(&self, ms: u64) {
        self.emulator.borrow_mut().run_ms(ms).unwrap();
    }
}

struct Wire<'r>(&'r Rig, Line);

impl Wire<'_> {
    fn say(&mut self, measure: Measure) -> Result<(), Trouble> {
        let question = self.1.question(measure)?;
        self.0.emulator.borrow_mut().send(&question);
        Ok(())
    }

    fn hear(&mut self, ms: u64) -> Result<Option<Saw>, Trouble> {
        for _ in 0..ms {
            self.0.run_ms(1);
            let mut emulator = self.0.emulator.borrow_mut();
            if self
                .0
                .lets_go_ns
                .get()
                .is_some_and(|at| emulator.now_ns() >= at)
            {
                self.0.lets_go_ns.set(None);
                if let Some(hand) = emulator.rig().world().hand() {
                    hand.intend(0.0, 0.0);
                }
            }
            let bytes: Vec<u8> = emulator
                .received()
                .into_iter()
                .map(|(_, byte)| byte)
                .collect();
            if let Some(saw) = self.1.receive(&bytes)? {
                return Ok(Some(saw));
            }
        }
        Ok(None)
    }

    fn hello(&mut self) -> Result<Option<Reset>, Trouble> {
        for _ in 0..50 {
            self.say(Measure::Hello)?;
            if let Some(Saw::Hello { reset, .. }) = self.hear(200)? {
                return Ok(Some(reset));
            }
        }
        Ok(None)
    }
}

impl Board for Wire<'_> {
    fn ask(&mut self, measure: Measure) -> Result<Saw, Trouble> {
        self.say(measure)?;
        self.hear(40_000)?.ok_or(Trouble::Silent)
    }

    fn restart(&mut self, measure: Measure) -> Result<Option<Reset>, Trouble> {
        self.say(measure)?;
        self.hello()
    }
}

/// The rig's firmware at the other end of the link.
struct Linked(Talk);

impl Probe for Linked {
    fn ask(
        &mut self,
        command: Command,
        each: &mut dyn FnMut(&ProbeReport),
    ) -> Result<Result<(), String>, Trouble> {
        let done = self.0.run(Request::command(command), 120.0, |_, report| {
            if let Some(report) = report {
                each(report);
            }
        });
        match done {
            Ok(()) => Ok(Ok(())),
            Err(TalkError::Refused(why)) => Ok(Err(why)),
            Err(why) => Err(Trouble::Unexpected(why.to_string())),
        }
    }
}

/// Who mounts the finger and looks.
struct Onlooker;

impl Person for Onlooker {
    fn done(&mut self, please: &str) -> Result<(), Trouble> {
        // the simulated world has its finger on the mount
        assert!(
            please.starts_with("Put the finger on its mount"),
            "{please}"
        );
        Ok(())
    }

    fn watch(&mut self, _: &str) -> Result<(), Trouble> {
        Ok(())
    }

    fn press(&mut self, switch: Pin, _: bool) -> Result<(), Trouble> {
        panic!("nobody presses {switch:?}")
    }

    fn squeeze(&mut self) -> Result<(), Trouble> {
        panic!("the finger is on its mount")
    }

    fn choose(&mut self, question: &str, _: &[&str]) -> Result<usize, Trouble> {
        panic!("{question}")
    }

    fn number(&mut self, question: &str, _: &str) -> Result<f64, Trouble> {
        panic!("{question}")
    }
}

impl Operator for Onlooker {
    fn found(&mut self, _: &Step, entry: &Entry) -> Result<bool, Trouble> {
        Ok(entry.passed)
    }

    fn now(&self) -> String {
        NOW.to_owned()
    }
}

const NOW: &str = "2026-11-24T20:00:00Z";

/// Does what is asked. Sees the world, never the board.
struct Helper<'r> {
    rig: &'r Rig,
    /// the finger's mount and the stage when they were to be watched, mm
    watched: (f64, f64),
    logic_v: f64,
}

impl Helper<'_> {
    fn truth(&self) -> tactus_world::world::Truth {
        self.rig.emulator.borrow().rig().world().truth()
    }

    /// Lays a weight on the finger, N.
    fn weigh(&self, newton: f64) {
        if let Some(hand) = self.rig.emulator.borrow().rig().world().hand() {
            hand.intend(newton, 0.0);
        }
        self.rig.run_ms(2000);
    }

    fn push(&self, to_mm: f64) {
        self.rig.emulator.borrow().rig().world().push_stage(to_mm);
        self.rig.run_ms(3000);
    }
}

impl Person for Helper<'_> {
    fn done(&mut self, please: &str) -> Result<(), Trouble> {
        let begins = |with: &str| please.starts_with(with);
        if begins("Push the stage to its middle") {
            {
                let emulator = self.rig.emulator.borrow();
                let mut rig = emulator.rig();
                rig.world().release_stop();
                if rig.world().truth().tip_mm > 15.0 {
                    rig.world().turn_knob(-2.0);
                }
            }
            self.push(TRAVEL_MM / 2.0);
        } else if begins("Push the stage by hand to the left") {
            self.push(3.5);
        } else if begins("Push it to the right") {
            self.push(TRAVEL_MM - 3.5);
        } else if begins("Push it back to its middle") {
            self.push(TRAVEL_MM / 2.0);
        } else if begins("Take the finger off") {
            let hand = Hand::new(1, Manner::default());
            self.rig.emulator.borrow().rig().world().hold(hand);
            self.rig.run_ms(500);
        } else if begins("Connect the stage's motor") {
            self.rig.emulator.borrow().rig().world().replace_motor(None);
        } else if begins("Lay the finger down with its tip up") {
            // what lies on it neither trembles nor wanders
            let still = Manner {
                tremor: 0.0,
                wander: 0.0,
                ..Manner::default()
            };
            self.rig
                .emulator
                .borrow()
                .rig()
                .world()
                .hold(Hand::new(1, still));
            self.rig.run_ms(500);
        } else if begins("Take the weight away") {
            self.weigh(0.0);
        } else {
            // the simulated world has no foam, and nothing touches its finger
            assert!(
                begins("Lay the finger") || begins("Put a block") || begins("Take the foam"),
                "{please}"
            );
        }
        Ok(())
    }

    fn watch(&mut self, _: &str) -> Result<(), Trouble> {
        let truth = self.truth();
        self.watched = (truth.tip_mm, truth.stage_mm);
        Ok(())
    }

    fn press(&mut self, switch: Pin, pressed: bool) -> Result<(), Trouble> {
        {
            let emulator = self.rig.emulator.borrow();
            let mut rig = emulator.rig();
            let world = rig.world();
            match switch {
                Pin::StageLeft => world.hold_switch(Reached::Lower, pressed),
                Pin::StageRight => world.hold_switch(Reached::Upper, pressed),
                Pin::LeverTop => world.hold_switch(Reached::Top, pressed),
                _ if pressed => world.inject(Fault::EStop),
                _ => world.release_stop(),
            }
        }
        self.rig.run_ms(100);
        Ok(())
    }

    fn squeeze(&mut self) -> Result<(), Trouble> {
        let emulator = self.rig.emulator.borrow();
        if let Some(hand) = emulator.rig().world().hand() {
            hand.intend(0.5, 0.0);
        }
        self.rig
            .lets_go_ns
            .set(Some(emulator.now_ns() + 3_000_000_000));
        Ok(())
    }

    fn choose(&mut self, question: &str, answers: &[&str]) -> Result<usize, Trouble> {
        let truth = self.truth();
        let (tip_mm, stage_mm) = self.watched;
        // what the first answer says, mm
        let went_mm = if question.starts_with("The lever went") {
            let up_mm = truth.tip_mm - tip_mm;
            if answers[0] == "up" { up_mm } else { -up_mm }
        } else if question.starts_with("The stage went") {
            truth.stage_mm - stage_mm
        } else {
            let powered = self.rig.emulator.borrow().rig().world().has_motor_supply();
            return Ok(usize::from(powered));
        };
        Ok(match went_mm {
            0.2.. => 0,
            ..-0.2 => 1,
            _ => 2,
        })
    }

    fn number(&mut self, question: &str, _: &str) -> Result<f64, Trouble> {
        Ok(if question.contains("3V3") {
            self.logic_v
        } else if question.contains("supply") {
            SUPPLY_V
        } else if let Some(grams) = question.strip_prefix("Put some ") {
            let (grams, _) = grams.split_once(" g ").unwrap();
            let grams: f64 = grams.parse().unwrap();
            self.weigh(grams * 9.806_65e-3);
            grams
        } else if question.contains("ohm") {
            self.rig
                .emulator
                .borrow()
                .rig()
                .world()
                .replace_motor(Some(22.0));
            22.0
        } else {
            // a caliper says twentieths of a mm
            (self.truth().tip_mm * 20.0).round() / 20.0
        })
    }
}

impl Operator for Helper<'_> {
    fn found(&mut self, _: &Step, entry: &Entry) -> Result<bool, Trouble> {
        Ok(entry.passed)
    }

    fn now(&self) -> String {
        NOW.to_owned()
    }
}

/// How an evening ended.
struct Evening {
    passed: bool,
    /// the step that failed, and the mistakes that it names
    failed: String,
    named: Vec<String>,
    text: String,
}

/// A rig, and what is wrong with it.
#[derive(Clone)]
struct Built {
    setup: Setup,
    faults: Vec<Fault>,
    mistakes: Vec<Miswired>,
    open: Vec<pins::PinId>,
    clock: bool,
    logic_v: f64,
    brown_out: u8,
}

impl Default for Built {
    /// As the book has it: also the chip's brown-out level is set.
    fn default() -> Self {
        Self {
            setup: Setup::default(),
            faults: Vec::new(),
            mistakes: Vec::new(),
            open: Vec::new(),
            clock: true,
            logic_v: 3.3,
            brown_out: 0,
        }
    }
}

/// A folder that is gone afterwards.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Relaxed);
        let name = format!("tactus-bringup-{}-{number}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).unwrap();
        Self(folder)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// A board with an image on it, and the rig as it was built.
fn start(elf: &Path, built: &Built, store: Option<Vec<u8>>) -> Emulator {
    let options = Options {
        clock: built.clock,
        brown_out: built.brown_out,
        store,
        ..Options::default()
    };
    let mut emulator = Emulator::start(elf, built.setup, options).unwrap();
    for mistake in &built.mistakes {
        emulator.rig().world().miswire(*mistake);
    }
    for fault in &built.faults {
        emulator.inject(*fault);
    }
    for pin in &built.open {
        emulator.leave_open(*pin).unwrap();
    }
    emulator
}

/// The steps with the self-test image; the board afterwards.
fn with_self_test(elf: &Path, built: &Built, journal: &mut Journal) -> (Ended, Emulator) {
    let rig = Rig {
        emulator: RefCell::new(start(elf, built, None)),
        lets_go_ns: Cell::new(None),
    };
    let mut wire = Wire(&rig, Line::default());
    let mut helper = Helper {
        rig: &rig,
        watched: (0.0, 0.0),
        logic_v: built.logic_v,
    };
    assert!(wire.hello().unwrap().is_some(), "no answer");
    if journal.has_passed("switches") {
        helper.done("Push the stage to its middle").unwrap();
    }
    let ended = bringup::run(Ends::SelfTest(&mut wire), &mut helper, journal);
    let ended = ended.unwrap_or_else(|why| {
        let mut emulator = rig.emulator.borrow_mut();
        let resets = emulator.resets().unwrap();
        panic!("{why}: {resets:?}, {}", Report::new(journal).text())
    });
    // weights, and the squeeze of a hand, and no more
    let force_max_n = rig.emulator.borrow().rig().world().truth().force_max_n;
    assert!(force_max_n < 1.6, "{force_max_n} N");
    (ended, rig.emulator.into_inner())
}

/// The steps with the rig's own image, its store as it was left.
fn with_rig(
    elf: &Path,
    built: &Built,
    store: Option<Vec<u8>>,
    journal: &mut Journal,
) -> (Ended, Emulator) {
    let healthy = Built {
        faults: Vec::new(),
        ..built.clone()
    };
    let mut talk = Talk::new(start(elf, &healthy, store));
    assert_eq!(talk.ready(|_, _| ()).unwrap(), None);
    // what broke meanwhile
    for fault in &built.faults {
        talk.board().inject(*fault);
    }
    let mut linked = Linked(talk);
    let ended = bringup::run(Ends::Rig(&mut linked), &mut Onlooker, journal);
    let ended = ended.unwrap_or_else(|why| panic!("{why}: {}", Report::new(journal).text()));
    let board = linked.0.into_board();
    let force_max_n = board.rig().world().truth().force_max_n;
    assert!(force_max_n < 2.2, "{force_max_n} N");
    (ended, board)
}

/// An evening that begins with a step; those before have passed.
fn evening(built: &Built, from: usize) -> Option<Evening> {
    let self_test = elf_of("TACTUS_SELFTEST_ELF")?;
    let rig = elf_of("TACTUS_ELF")?;
    let folder = Folder::new();
    let mut journal = Journal::open(&folder.0.join("journal.jsonl")).unwrap();
    for step in STEPS.iter().take(from) {
        let found = Finding::default();
        journal
            .add(Entry::new(step, NOW.to_owned(), &found))
            .unwrap();
    }
    let (mut ended, mut store) = (Ended::Flash(Image::Rig), None);
    let mut boards = Vec::new();
    if bringup::next_image(&journal) == Some(Image::SelfTest) {
        let (how, mut board) = with_self_test(&self_test, built, &mut journal);
        (ended, store) = (how, Some(board.store().unwrap()));
        boards.push(board);
    }
    if ended == Ended::Flash(Image::Rig) {
        let (how, board) = with_rig(&rig, built, store, &mut journal);
        ended = how;
        boards.push(board);
    }
    let report = Report::new(&journal);
    report.write(&folder.0).unwrap();
    let step = STEPS.iter().rfind(|step| journal.last(step.key).is_some());
    let last = step.and_then(|step| journal.last(step.key)).unwrap();
    // one mistake may be named at two pins
    let named: BTreeSet<String> = last.mistakes.iter().map(|one| one.key.clone()).collect();
    let evening = Evening {
        passed: ended == Ended::Passed,
        failed: last.step.clone(),
        named: named.into_iter().collect(),
        text: report.text(),
    };
    eprintln!("{}", evening.text);
    for mut board in boards {
        eprintln!("{} s", board.now_ns() / 1_000_000_000);
        assert_eq!(board.violations().unwrap(), []);
    }
    Some(evening)
}

#[test]
fn a_rig_as_in_the_book_passes() {
    let Some(evening) = evening(&Built::default(), 0) else {
        return;
    };
    assert!(evening.passed, "{}", evening.text);
}

/// Seeds of finger, world and trial: TACTUS_SEEDS of them, from TACTUS_SEED on.
#[test]
#[ignore = "long: an evening for each seed"]
fn rigs_of_other_seeds_pass() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse().ok());
    let first = number("TACTUS_SEED").unwrap_or(2);
    let count = number("TACTUS_SEEDS").unwrap_or(1);
    let mut failed = Vec::new();
    for seed in first..first + count {
        let setup = Setup {
            texture: (seed % 117 + 1) as u8,
            world_seed: seed,
            trial_seed: seed,
            finger_seed: seed,
            ..Setup::default()
        };
        let built = Built {
            setup,
            ..Built::default()
        };
        let Some(evening) = evening(&built, 0) else {
            return;
        };
        if !evening.passed {
            eprintln!("{}", evening.text);
            failed.push(seed);
        }
        eprintln!("seed {seed}: {}", evening.failed);
    }
    assert!(
        failed.is_empty(),
        "failed: {failed:?}, of {count} from {first} on"
    );
}

/// A mistake of whoever built a rig, the step that finds it, and its name.
struct Case(&'static str, &'static str, Built);

/// Plays cases, and asserts that each is named where it should be, with what to do about it.
fn play(cases: &[Case], whole: bool) {
    for Case(step, mistake, built) in cases {
        let from = STEPS.iter().position(|one| one.key == *step).unwrap();
        let Some(evening) = evening(built, if whole { 0 } else { from }) else {
            return;
        };
        let text = &evening.text;
        assert!(!evening.passed, "{mistake}: {text}");
        assert_eq!(
            (evening.failed.as_str(), &evening.named[..]),
            (*step, &[(*mistake).to_owned()][..]),
            "{text}"
        );
        let known = MISTAKES.iter().find(|one| one.key == *mistake).unwrap();
        assert!(
            text.contains(known.what) && text.contains(known.remedy),
            "{text}"
        );
    }
}

fn miswired(mistake: Miswired) -> Built {
    Built {
        mistakes: vec![mistake],
        ..Built::default()
    }
}

fn broken(fault: Fault) -> Built {
    Built {
        faults: vec![fault],
        ..Built::default()
    }
}

fn open(pin: pins::PinId) -> Built {
    Built {
        open: vec![pin],
        ..Built::default()
    }
}

fn of_board() -> Vec<Case> {
    let built = Built::default;
    vec![
        Case(
            "supply",
            "supply",
            Built {
                logic_v: 2.9,
                ..built()
            },
        ),
        Case(
            "chip",
            "clock",
            Built {
                clock: false,
                ..built()
            },
        ),
        // as delivered
        Case(
            "chip",
            "brown-out",
            Built {
                brown_out: 3,
                ..built()
            },
        ),
        Case("pins", "pull-missing", open(pins::LEVER_ENABLE)),
        Case("pins", "pull-missing", open(pins::STAGE_ENABLE)),
        Case("pins", "pull-missing", open(pins::SENSOR_CS)),
        Case("pins", "encoder-line", broken(Fault::EncoderCut(Cut::A))),
        Case("pins", "encoder-line", broken(Fault::EncoderCut(Cut::B))),
        Case(
            "pins",
            "encoder-silent",
            broken(Fault::EncoderCut(Cut::Both)),
        ),
        Case("pins", "data-exchanged", miswired(Miswired::DataExchanged)),
    ]
}

fn of_sensor() -> Vec<Case> {
    vec![
        Case("sensor", "sensor-silent", miswired(Miswired::SelectOpen)),
        Case("sensor", "sensor-silent", broken(Fault::SensorUnplugged)),
        Case(
            "sensor",
            "miso-stuck",
            broken(Fault::MisoStuck { high: false }),
        ),
        Case("sensor", "words", broken(Fault::BitFlips { share: 0.01 })),
        Case("noise", "sensor-still", broken(Fault::SensorFrozen)),
        Case("finger", "finger-dead", broken(Fault::PdcStuck)),
    ]
}

fn of_switches() -> Vec<Case> {
    let left = |closed| {
        broken(Fault::StageLimitStuck {
            upper: false,
            closed,
        })
    };
    let upper = Miswired::LimitNormallyOpen { upper: true };
    vec![
        Case(
            "switches",
            "switches-exchanged",
            miswired(Miswired::LimitsExchanged),
        ),
        Case("switches", "switch-kind", miswired(upper)),
        Case(
            "switches",
            "switch-kind",
            miswired(Miswired::TopNormallyOpen),
        ),
        Case("switches", "switch-open", left(true)),
        Case("switches", "switch-closed", left(false)),
        Case(
            "switches",
            "switch-closed",
            miswired(Miswired::EStopBridged),
        ),
        Case("stop", "stop-supply", miswired(Miswired::EStopKeepsSupply)),
        Case("hand", "encoder-exchanged", broken(Fault::EncoderSwapped)),
        Case(
            "hand",
            "encoder-lines",
            miswired(Miswired::EncoderLines(0.25)),
        ),
    ]
}

fn of_lever() -> Vec<Case> {
    vec![
        Case("lever-sense", "lever-dir", broken(Fault::LeverDirInverted)),
        Case(
            "lever-sense",
            "lever-still",
            miswired(Miswired::LeverCoilOpen),
        ),
        Case(
            "lever-scale",
            "lever-scale",
            miswired(Miswired::LeverMicrosteps(2)),
        ),
        // as many are lost on the way down as on the way up: only the caliper sees it
        Case(
            "lever-scale",
            "lever-steps",
            broken(Fault::LeverLosesSteps { share: 0.1 }),
        ),
    ]
}

fn of_stage() -> Vec<Case> {
    vec![
        Case("current", "current-open", miswired(Miswired::CurrentOpen)),
        Case("current", "current-open", broken(Fault::CurrentSaturated)),
        Case(
            "current",
            "current-offset",
            broken(Fault::CurrentOffset { amperes: 0.2 }),
        ),
        Case(
            "stage-sense",
            "stage-still",
            miswired(Miswired::BridgeEnableOpen),
        ),
        Case(
            "stage-sense",
            "stage-reversed",
            miswired(Miswired::MotorReversed),
        ),
        Case(
            "stage-sense",
            "bridge-exchanged",
            miswired(Miswired::PwmDirExchanged),
        ),
        Case("stage-sense", "stage-stuck", broken(Fault::StageJammed)),
        Case(
            "stage-sense",
            "current-reversed",
            miswired(Miswired::CurrentGain(-1.0)),
        ),
        Case("bridge", "bridge-decay", broken(Fault::FastDecay)),
        Case(
            "resistor",
            "current-gain",
            miswired(Miswired::CurrentGain(2.5)),
        ),
    ]
}

fn of_weights() -> Vec<Case> {
    vec![
        Case("scale", "scale-far", broken(Fault::PdcWeak { gain: 0.3 })),
        Case("scale", "finger-dead", broken(Fault::PdcStuck)),
        Case(
            "scale",
            "finger-leaks",
            broken(Fault::SkinLeaks { seconds: 20.0 }),
        ),
    ]
}

fn of_finger_and_stage() -> Vec<Case> {
    vec![
        Case(
            "zero",
            "zero-drifts",
            broken(Fault::PdcDrift { counts_per_s: 0.4 }),
        ),
        Case("zero", "fault", broken(Fault::StageJammed)),
        Case("speed", "fault", broken(Fault::BridgeOff)),
        Case("slide", "fault", broken(Fault::StageJammed)),
        Case("slide", "fault", broken(Fault::BitFlips { share: 2e-4 })),
    ]
}

#[test]
fn mistakes_that_weights_show_are_named() {
    play(&of_weights(), false);
}

#[test]
fn mistakes_that_the_rigs_firmware_sees_are_named() {
    play(&of_finger_and_stage(), false);
}

#[test]
fn mistakes_of_the_board_are_named() {
    play(&of_board(), false);
}

#[test]
fn mistakes_of_the_sensor_are_named() {
    play(&of_sensor(), false);
}

#[test]
fn mistakes_of_switches_and_encoder_are_named() {
    play(&of_switches(), false);
}

#[test]
fn mistakes_of_the_lever_are_named() {
    play(&of_lever(), false);
}

#[test]
fn mistakes_of_the_stages_motor_are_named() {
    play(&of_stage(), false);
}

#[test]
#[ignore = "long: whole evenings for all mistakes"]
fn every_mistake_is_found_from_the_first_step_on() {
    for cases in [
        of_board(),
        of_sensor(),
        of_switches(),
        of_lever(),
        of_stage(),
    ] {
        play(&cases, true);
    }
}
