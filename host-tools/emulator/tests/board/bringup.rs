//! A rig's first evening on the emulated board: `tactus::bringup` with the self-test image, and a person who does what is asked and
//! tells what the world shows. Rigs that are built as they should be pass, and of others the mistake is named.
//!
//! A mistake's evening begins with the step that should find it, as if those before had passed earlier: the journal makes that
//! possible. `every_mistake_is_found_from_the_first_step_on` has whole evenings.

use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use tactus::bringup::judge::Finding;
use tactus::bringup::{
    self, Board, Entry, Journal, Line, MISTAKES, Owner, Person, Report, STEPS, Step, Trouble,
};
use tactus::sim::encoder::Cut;
use tactus::sim::faults::Fault;
use tactus::sim::person::{Hand, Manner};
use tactus::sim::stage::{SUPPLY_V, TRAVEL_MM};
use tactus::sim::wiring::Miswired;
use tactus::sim::world::{Reached, Setup};
use tactus_core::wire::Reset;
use tactus_core::wire::bringup::{Measure, Pin, Saw};
use tactus_emulator::board::{Emulator, Options, pins};

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

/// Does what is asked. Sees the world, never the board.
struct Helper<'r> {
    rig: &'r Rig,
    /// the finger's mount and the stage when they were to be watched, mm
    watched: (f64, f64),
    logic_v: f64,
}

impl Helper<'_> {
    fn truth(&self) -> tactus::sim::world::Truth {
        self.rig.emulator.borrow().rig().world().truth()
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

impl Owner for Helper<'_> {
    fn found(&mut self, _: &Step, entry: &Entry) -> Result<bool, Trouble> {
        Ok(entry.passed)
    }

    fn now(&self) -> String {
        "2026-11-24T20:00:00Z".to_owned()
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

/// An evening that begins with a step; those before have passed.
fn evening(built: &Built, from: usize) -> Option<Evening> {
    let elf = elf_of("TACTUS_SELFTEST_ELF")?;
    let options = Options {
        clock: built.clock,
        brown_out: built.brown_out,
        ..Options::default()
    };
    let mut emulator = Emulator::start(&elf, built.setup, options).unwrap();
    for mistake in &built.mistakes {
        emulator.rig().world().miswire(*mistake);
    }
    for fault in &built.faults {
        emulator.inject(*fault);
    }
    for pin in &built.open {
        emulator.leave_open(*pin).unwrap();
    }
    let rig = Rig {
        emulator: RefCell::new(emulator),
        lets_go_ns: Cell::new(None),
    };
    let mut wire = Wire(&rig, Line::default());
    let mut helper = Helper {
        rig: &rig,
        watched: (0.0, 0.0),
        logic_v: built.logic_v,
    };
    let folder = Folder::new();
    let mut journal = Journal::open(&folder.0.join("journal.jsonl")).unwrap();
    for step in STEPS.iter().take(from) {
        let found = Finding::default().into();
        journal.add(Entry::new(step, helper.now(), &found)).unwrap();
    }
    assert!(wire.hello().unwrap().is_some(), "no answer");
    if STEPS.iter().take(from).any(|step| step.key == "switches") {
        helper.done("Push the stage to its middle").unwrap();
    }
    let passed = bringup::run(&mut wire, &mut helper, &mut journal).unwrap_or_else(|why| {
        let mut emulator = rig.emulator.borrow_mut();
        let resets = emulator.resets().unwrap();
        panic!("{why}: {resets:?}, {}", Report::new(&journal).text())
    });
    let report = Report::new(&journal);
    report.write(&folder.0).unwrap();
    let step = STEPS.iter().rfind(|step| journal.last(step.key).is_some());
    let last = step.and_then(|step| journal.last(step.key)).unwrap();
    // one mistake may be named at two pins
    let named: BTreeSet<String> = last.mistakes.iter().map(|one| one.key.clone()).collect();
    let mut emulator = rig.emulator.into_inner();
    let evening = Evening {
        passed,
        failed: last.step.clone(),
        named: named.into_iter().collect(),
        text: report.text(),
    };
    eprintln!("{}{} s", evening.text, emulator.now_ns() / 1_000_000_000);
    assert_eq!(emulator.violations().unwrap(), []);
    // the squeeze of a hand, and no more
    let force_max_n = emulator.rig().world().truth().force_max_n;
    assert!(force_max_n < 1.0, "{force_max_n} N");
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
        assert!(evening.passed, "seed {seed}: {}", evening.text);
        eprintln!("seed {seed} passed");
    }
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
