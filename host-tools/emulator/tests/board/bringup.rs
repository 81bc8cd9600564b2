//! A rig's first evening on the emulated board: `tactus_link::bringup` with the self-test image, and a person who does
//! what is asked and tells what the world shows. Rigs that are built as they should be pass, and of others the mistake
//! is named.
//!
//! A mistake's evening begins with the step that should find it, as if those before had passed earlier: the journal
//! makes that possible.

mod bare;
mod fingers;
mod mistakes;

use std::cell::{Cell, RefCell};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use tactus_core::sensor::FingerName;
use tactus_core::wire::bringup::{Measure, Pin, Saw};
use tactus_core::wire::{Command, Report as ProbeReport, Reset};
use tactus_emulator::board::{Emulator, Options, Output, pins};
use tactus_emulator::host::talk::{Talk, TalkError};
use tactus_link::Request;
use tactus_link::bringup::judge::Finding;
use tactus_link::bringup::{
    self, Board, Ended, Ends, Entry, Image, Journal, Line, MISTAKES, OTHER_MISTAKES, Operator,
    Person, Probe, Product, Report, STEPS, Step, Trouble,
};
use tactus_world::encoder::Cut;
use tactus_world::faults::Fault;
use tactus_world::parts::PartFault;
use tactus_world::person::{Hand, Manner};
use tactus_world::stage::{SUPPLY_V, TRAVEL_MM};
use tactus_world::wiring::Miswired;
use tactus_world::world::{Reached, Setup, Truth, World};

use self::mistakes::{Case, play};
use crate::common::elf_of;
use crate::silicon_image::cross_kernels;

/// The bench: the emulated board with its rig, and what somebody is about to do with it.
struct Rig {
    built: Built,
    emulator: RefCell<Emulator>,
    /// when the hand lets the finger go, ns
    lets_go_ns: Cell<Option<u64>>,
}

impl Rig {
    fn run_ms(&self, ms: u64) {
        self.emulator.borrow_mut().run_ms(ms).unwrap();
    }

    fn world<T>(&self, act: impl FnOnce(&mut World) -> T) -> T {
        act(self.emulator.borrow().rig().world())
    }

    /// Has the hand press so hard, N.
    fn intend(&self, newton: f64) {
        self.world(|world| {
            if let Some(hand) = world.hand() {
                hand.intend(newton, 0.0);
            }
        });
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
            let lets_go = &self.0.lets_go_ns;
            let now_ns = self.0.emulator.borrow().now_ns();
            if lets_go.get().is_some_and(|at| now_ns >= at) {
                lets_go.set(None);
                self.0.intend(0.0);
            }
            let received = self.0.emulator.borrow_mut().received();
            let bytes: Vec<u8> = received.into_iter().map(|(_, byte)| byte).collect();
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

    fn traffic(&self) -> [u32; 3] {
        self.1.traffic
    }

    fn times_ms(&self) -> [u64; 2] {
        let now_ms = self.0.emulator.borrow().now_ns() as f64 * 1e-6;
        [self.1.at_ms.into(), (now_ms * self.0.built.pc_clock) as u64]
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

const NOW: &str = "2026-11-24T20:00:00Z";

/// Does what is asked. Sees the world, never the board.
struct Helper<'r> {
    /// not there for the rig's own image, with the finger on its mount: that asks for nothing else
    bench: Option<&'r Rig>,
    /// the finger's mount and the stage when they were to be watched, mm
    watched: (f64, f64),
    logic_v: f64,
    /// the potentiometer, from one end to the other
    turned: f64,
}

impl<'r> Helper<'r> {
    fn new(bench: Option<&'r Rig>, logic_v: f64) -> Self {
        Self {
            bench,
            watched: (0.0, 0.0),
            logic_v,
            turned: 0.0,
        }
    }

    fn rig(&self) -> &'r Rig {
        self.bench.expect("the rig's image asks for nobody")
    }

    fn truth(&self) -> Truth {
        self.rig().world(|world| world.truth())
    }

    /// Lays a weight on the finger, N.
    fn weigh(&self, newton: f64) {
        self.rig().intend(newton);
        self.rig().run_ms(2000);
    }

    fn push(&self, to_mm: f64) {
        self.rig().world(|world| world.push_stage(to_mm));
        self.rig().run_ms(3000);
    }

    fn button(&self, high: bool) {
        self.rig().emulator.borrow_mut().press(high).unwrap();
    }

    fn hold(&self, manner: Manner) {
        self.rig().world(|world| world.hold(Hand::new(1, manner)));
        self.rig().run_ms(500);
    }
}

impl Person for Helper<'_> {
    fn done(&mut self, please: &str) -> Result<(), Trouble> {
        let begins = |with: &str| please.starts_with(with);
        if begins("Put the finger on its mount") {
            assert!(self.bench.is_none(), "{please}");
            return Ok(());
        }
        if begins("Push the stage to its middle") {
            self.rig().world(|world| {
                world.release_stop();
                if world.truth().tip_mm > 15.0 {
                    world.turn_knob(-2.0);
                }
            });
            self.push(TRAVEL_MM / 2.0);
        } else if begins("Push the stage by hand to the left") {
            self.push(3.5);
        } else if begins("Push it to the right") {
            self.push(TRAVEL_MM - 3.5);
        } else if begins("Push it back to its middle") {
            self.push(TRAVEL_MM / 2.0);
        } else if begins("Take the finger off") || begins("Lay the finger down as it is") {
            self.hold(Manner::default());
        } else if begins("With the USB plug out") {
            for wire in [
                "1 CS to PD14 (D10)",
                "5 DIN to PB5 (D22)",
                "6 DOUT to PA6 (D12)",
                "7 CLK to PA5 (D13)",
            ] {
                assert!(please.contains(wire), "{please}");
            }
        } else if begins("Leave the button") || begins("Let the button go") {
            self.button(self.rig().built.button.unwrap_or(false));
        } else if begins("Press the button") {
            self.button(self.rig().built.button.unwrap_or(true));
        } else if begins("Connect the stage's motor") {
            self.rig().world(|world| world.replace_motor(None));
        } else if begins("Lay the finger down with its tip up") {
            // what lies on it neither trembles nor wanders
            self.hold(Manner {
                tremor: 0.0,
                wander: 0.0,
                ..Manner::default()
            });
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
        if self.bench.is_some() {
            let truth = self.truth();
            self.watched = (truth.tip_mm, truth.stage_mm);
        }
        Ok(())
    }

    fn show(&mut self, _: &str) -> Result<(), Trouble> {
        self.turned = f64::min(self.turned + 0.05, 1.0);
        let inputs = (self.rig().built.inputs)(self.turned);
        self.rig().world(|world| world.wire_converter(inputs));
        Ok(())
    }

    fn press(&mut self, switch: Pin, pressed: bool) -> Result<(), Trouble> {
        self.rig().world(|world| match switch {
            Pin::StageLeft => world.hold_switch(Reached::Lower, pressed),
            Pin::StageRight => world.hold_switch(Reached::Upper, pressed),
            Pin::LeverTop => world.hold_switch(Reached::Top, pressed),
            _ if pressed => world.inject(Fault::EStop),
            _ => world.release_stop(),
        });
        self.rig().run_ms(100);
        Ok(())
    }

    fn squeeze(&mut self) -> Result<(), Trouble> {
        self.rig().intend(0.5);
        let now_ns = self.rig().emulator.borrow().now_ns();
        self.rig().lets_go_ns.set(Some(now_ns + 3_000_000_000));
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
        } else if question.starts_with("Is the whole display lit") {
            let picture = self.rig().emulator.borrow().rig().display().picture();
            let is_lit = picture.is_some_and(|it| it.bytes().iter().all(|points| *points == 0xFF));
            return Ok(usize::from(!is_lit));
        } else if question.starts_with("Did the buzzer sound") {
            let emulator = self.rig().emulator.borrow();
            let sounds = |(_, output): &(u64, Output)| *output == Output::Buzzer(Some(2000));
            let heard = self.rig().built.buzzer && emulator.rig().trace().any(sounds);
            return Ok(usize::from(!heard));
        } else {
            return Ok(usize::from(
                self.rig().world(|world| world.has_motor_supply()),
            ));
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
            self.rig().world(|world| world.replace_motor(Some(22.0)));
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

/// The end of an evening.
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
    faults: Vec<Fault>,
    mistakes: Vec<Miswired>,
    open: Vec<pins::PinId>,
    clock: bool,
    logic_v: f64,
    brown_out: u8,
    product: Product,
    finger: FingerName,
    /// counts at the converter's inputs where the potentiometer is turned so far
    inputs: fn(f64) -> [u16; 2],
    wrong_kernels: bool,
    parts: Vec<PartFault>,
    display: bool,
    /// level at which the button's pin stays
    button: Option<bool>,
    buzzer: bool,
    /// seconds of the PC's clock in a second
    pc_clock: f64,
}

impl Default for Built {
    /// As the book has it: also the chip's brown-out level is set.
    fn default() -> Self {
        Self {
            faults: Vec::new(),
            mistakes: Vec::new(),
            open: Vec::new(),
            clock: true,
            logic_v: 3.3,
            brown_out: 0,
            product: Product::Rig,
            finger: FingerName::Biotac,
            inputs: |turned| [(4095.0 * turned) as u16, 4095],
            wrong_kernels: false,
            parts: Vec::new(),
            display: true,
            button: None,
            buzzer: true,
            pc_clock: 1.0,
        }
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
    let setup = Setup {
        finger: built.finger,
        ..Setup::default()
    };
    let mut emulator = Emulator::start(elf, setup, options).unwrap();
    if built.wrong_kernels {
        cross_kernels(elf, &mut emulator);
    }
    emulator.rig().display_mut().plug(built.display);
    for fault in &built.parts {
        emulator.rig().world().break_part(*fault);
    }
    if built.product == Product::Bare {
        emulator.rig().world().wire_converter((built.inputs)(0.0));
    }
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
        built: built.clone(),
        emulator: RefCell::new(start(elf, built, None)),
        lets_go_ns: Cell::new(None),
    };
    let mut wire = Wire(&rig, Line::default());
    let mut helper = Helper::new(Some(&rig), built.logic_v);
    assert!(wire.hello().unwrap().is_some(), "no answer");
    if journal.has_passed("switches") {
        helper.done("Push the stage to its middle").unwrap();
    }
    let ended = bringup::run(
        built.product,
        Ends::SelfTest(&mut wire),
        &mut helper,
        journal,
    );
    let ended = ended.unwrap_or_else(|why| {
        let mut emulator = rig.emulator.borrow_mut();
        let resets = emulator.resets().unwrap();
        panic!(
            "{why}: {resets:?}, {}",
            Report::new(built.product, journal).text()
        )
    });
    // weights, and the squeeze of a hand, and no more
    let force_max_n = rig.world(|world| world.truth().force_max_n);
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
    let ended = bringup::run(
        built.product,
        Ends::Rig(&mut linked),
        &mut Helper::new(None, built.logic_v),
        journal,
    );
    let ended =
        ended.unwrap_or_else(|why| panic!("{why}: {}", Report::new(built.product, journal).text()));
    let board = linked.0.into_board();
    let force_max_n = board.rig().world().truth().force_max_n;
    assert!(force_max_n < 2.2, "{force_max_n} N");
    (ended, board)
}

/// An evening that begins with a step; those before have passed.
fn evening(built: &Built, from: usize) -> Option<Evening> {
    let self_test = elf_of("TACTUS_SELFTEST_ELF")?;
    let rig = elf_of("TACTUS_ELF")?;
    static EVENINGS: AtomicU32 = AtomicU32::new(0);
    let number = EVENINGS.fetch_add(1, Relaxed);
    let name = format!("tactus-bringup-{}-{number}", std::process::id());
    let folder = std::env::temp_dir().join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let mut journal = Journal::open(&folder.join("journal.jsonl")).unwrap();
    for step in built.product.steps().into_iter().take(from) {
        let found = Finding::default();
        journal
            .add(Entry::new(step, NOW.to_owned(), &found))
            .unwrap();
    }
    let (mut ended, mut store) = (Ended::Flash(Image::Rig), None);
    let mut boards = Vec::new();
    if bringup::next_image(built.product, &journal) == Some(Image::SelfTest) {
        let (how, mut board) = with_self_test(&self_test, built, &mut journal);
        (ended, store) = (how, Some(board.store().unwrap()));
        boards.push(board);
    }
    if ended == Ended::Flash(Image::Rig) {
        let (how, board) = with_rig(&rig, built, store, &mut journal);
        ended = how;
        boards.push(board);
    }
    let report = Report::new(built.product, &journal);
    report.write(&folder).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    let step = built
        .product
        .steps()
        .into_iter()
        .rfind(|step| journal.last(step.key).is_some());
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

/// A rig as in the book passes from this step on.
fn passes(from: &str) {
    let from = STEPS.iter().position(|step| step.key == from).unwrap();
    if let Some(evening) = evening(&Built::default(), from) {
        assert!(evening.passed, "{}", evening.text);
    }
}

#[test]
fn a_rig_as_in_the_book_passes_from_its_zero_on() {
    passes("zero");
}

#[test]
#[ignore = "long"]
fn a_rig_as_in_the_book_passes() {
    passes(STEPS[0].key);
}
