//! What silicon does that a model forgives: peripherals that a disturbance has switched off,
//! an erase that never ends, a stack that grows into the variables, a task that does not start.

use std::path::Path;

use tactus_core::rig::Fault as Seen;
use tactus_core::wire::{Event, Reset};
use tactus_emulator::board::referee::Rule;
use tactus_emulator::board::{Emulator, Options, Output, Switch};
use tactus_emulator::host::talk::{Talk, TalkError};
use tactus_world::world::Setup;

use crate::broken_code::NOWHERE;
use crate::common::{elf, elf_of, ready};
use crate::faults::{When, board, board_with, identify, is_time};

const RCC_CR: u64 = 0x4002_3800;
const HSEON: u32 = 1 << 16;

fn images() -> impl Iterator<Item = std::path::PathBuf> {
    ["TACTUS_ELF", "TACTUS_HANDHELD_ELF"]
        .into_iter()
        .filter_map(elf_of)
}

/// A driver of a stepper that has just got current wants a while before its first step.
#[test]
#[ignore = "long"]
fn the_lever_waits_between_current_and_its_first_step() {
    let Some(elf) = elf() else { return };
    let options = Options {
        trace_s: 60,
        // a whole exploration under the guard of the stack
        mpu: true,
        ..Options::default()
    };
    let board = Emulator::start(&elf, Setup::default(), options.clone()).unwrap();
    let mut talk = Talk::new(board);
    ready(&mut talk);
    talk.send(identify(1), 120.0, |_, _| ()).unwrap();
    let mut rig = talk.board().rig();
    let (mut enabled_ns, mut steps) = (None, 0);
    for &(at_ns, output) in rig.trace() {
        match output {
            Output::LeverEnable(on) => enabled_ns = on.then_some(at_ns),
            Output::LeverStep(true) => {
                // without current it is the end of a pulse that was under way
                let Some(enabled_ns) = enabled_ns else {
                    continue;
                };
                let after_ms = (at_ns - enabled_ns) as f64 * 1e-6;
                assert!(after_ms >= 10.0, "a step {after_ms} ms after its current");
                steps += 1;
            }
            _ => {}
        }
    }
    assert!(steps > 100, "{steps}");
    rig.world().clear();
}

/// The outcome of an exploration in which a switch went off while the finger slid.
#[derive(Debug)]
struct Outcome {
    ended: Result<(), TalkError>,
    seen: Option<Seen>,
    rebooted: Option<(Reset, Option<String>)>,
    force_max_n: f64,
    /// On the finger, in the end.
    force_n: f64,
    /// From the upset until the stage has no duty for good, ms.
    braked_ms: Option<f64>,
}

impl Outcome {
    fn assert_lifted(&self) {
        assert!(self.force_max_n < 2.2 && self.force_n < 0.02, "{self:?}");
    }
}

fn upset(elf: &Path, switch: Switch, lasting: bool) -> Outcome {
    let mut talk = board(elf, 81, 30);
    talk.board().rig().world().reset_extremes();
    let mut upset_ns = None;
    let (mut seen, mut rebooted) = (None, None);
    let ended = talk.send(identify(1), 120.0, |board, report| match report {
        Some(report) => match &report.event {
            Event::Fault(fault) => seen = Some(*fault),
            Event::Booted {
                reset, last_words, ..
            } => rebooted = Some((*reset, last_words.as_ref().map(|w| w.as_str().to_owned()))),
            _ => {}
        },
        None if upset_ns.is_none() && is_time(When::Sliding, board) => {
            upset_ns = Some(board.now_ns());
            board.upset(switch, lasting).unwrap();
        }
        None => {}
    });
    let upset_ns = upset_ns.expect("it never slid");
    let braked_ms = {
        let rig = talk.board().rig();
        let after = rig.trace().filter(|(at_ns, _)| *at_ns >= upset_ns);
        let stops = after.filter(|(_, output)| *output == Output::StageDuty(0.0));
        stops
            .map(|(at_ns, _)| (at_ns - upset_ns) as f64 * 1e-6)
            .next()
    };
    let rested_ns = talk.board().now_ns() + 8_000_000_000;
    while talk.board().now_ns() < rested_ns {
        for report in talk.step().unwrap() {
            match report.event {
                Event::Fault(fault) => seen = seen.or(Some(fault)),
                Event::Booted {
                    reset, last_words, ..
                } => rebooted = Some((reset, last_words.map(|w| w.as_str().to_owned()))),
                _ => {}
            }
        }
    }
    let truth = talk.board().rig().world().truth();
    let outcome = Outcome {
        ended,
        seen,
        rebooted,
        force_max_n: truth.force_max_n,
        force_n: truth.force_n,
        braked_ms,
    };
    eprintln!("{switch:?}, lasting {lasting}: {outcome:?}");
    outcome
}

/// A frame that does not come is a lost word.
#[test]
#[ignore = "long"]
fn a_bus_that_goes_off_costs_a_word_and_not_the_watchdogs_patience() {
    let Some(elf) = elf() else { return };
    let once = upset(&elf, Switch::Spi1, false);
    assert_eq!(once.rebooted, None, "it hung");
    assert!(once.ended.is_ok(), "{:?}", once.ended);
    once.assert_lifted();
    let lasting = upset(&elf, Switch::Spi1, true);
    assert_eq!(lasting.rebooted, None, "it hung");
    assert_eq!(lasting.seen, Some(Seen::SensorSilent));
    assert!(lasting.braked_ms.is_some_and(|ms| ms < 14.0));
    lasting.assert_lifted();
}

/// A converter that stops, or its DMA, is started anew and costs samples; where that does not help the motor is not
/// driven on.
#[test]
#[ignore = "long"]
fn a_converter_that_goes_off_costs_a_sample_and_not_the_watchdogs_patience() {
    let Some(elf) = elf() else { return };
    for switch in [Switch::Adc1, Switch::Dma2] {
        let once = upset(&elf, switch, false);
        assert_eq!(once.rebooted, None, "it hung");
        assert!(once.ended.is_ok(), "{:?}", once.ended);
        once.assert_lifted();
        let lasting = upset(&elf, switch, true);
        let words = lasting
            .rebooted
            .as_ref()
            .and_then(|(_, words)| words.as_ref());
        assert!(
            words.is_some_and(|words| words.contains("current")),
            "it hung"
        );
        assert!(lasting.braked_ms.is_some_and(|ms| ms < 14.0));
        lasting.assert_lifted();
    }
}

/// The store is opened while the finger is lifted and homed, and waits for an erase that is never over. A write to the
/// flash's control register would have the core wait, too.
#[test]
#[ignore = "long"]
fn an_erase_that_never_ends_is_left_to_itself() {
    // a power cut while a page was erased: the store goes on with it when it is opened
    let mut store = vec![0xFF; 64 << 10];
    store[0xBFF0..0xBFF4].copy_from_slice(b"eras");
    let options = Options {
        store: Some(store),
        ..Options::default()
    };
    for elf in images() {
        let mut board = Emulator::start(&elf, Setup::default(), options.clone()).unwrap();
        board.lose_flash_interrupts().unwrap();
        board.stick_flash().unwrap();
        board.run_ms(12_000).unwrap();
        assert_eq!(
            board.resets().unwrap(),
            [],
            "the core stands or starts anew"
        );
        let found = board.violations().unwrap();
        let stands = found.iter().any(|found| found.rule == Rule::FlashBusy);
        assert!(!stands, "the core stands: {found:?}");
    }
}

/// The stack's end is guarded: what grows beyond it is stopped before it writes to variables.
#[test]
fn a_stack_that_overflows_is_stopped_at_its_guard() {
    overflows(When::Pressing);
}

#[test]
#[ignore = "long"]
fn a_stack_that_overflows_while_it_slides_is_stopped_at_its_guard() {
    overflows(When::Sliding);
}

fn overflows(when: When) {
    let Some(elf) = elf() else { return };
    let options = Options {
        mpu: true,
        ..Options::default()
    };
    let mut talk = board_with(&elf, 82, 30, options);
    let mut words = None;
    let mut planted = false;
    let ended = talk.send(identify(1), 120.0, |board, report| {
        if let Some(Event::Booted { last_words, .. }) = report.map(|report| &report.event) {
            words = last_words.as_ref().map(|words| words.as_str().to_owned());
        }
        if !planted && is_time(when, board) {
            planted = true;
            // push {r0-r7}, and again
            board.write(NOWHERE, &[0xFF, 0xB4, 0xFD, 0xE7]).unwrap();
            let (task, _) = board.symbol("tactus_check_in").unwrap();
            let task = task & !1;
            // ldr.w pc, [pc], and the address behind; nop first, where it would not be a multiple of 4
            let mut code = vec![0xDF, 0xF8, 0x00, 0xF0];
            if !task.is_multiple_of(4) {
                code.splice(0..0, [0x00, 0xBF]);
            }
            code.extend((NOWHERE as u32 | 1).to_le_bytes());
            let whole = board.read(task, code.len() as u64).unwrap();
            board.write(task, &code).unwrap();
            board.run_ms(10).unwrap();
            board.write(task, &whole).unwrap();
        }
    });
    eprintln!("{when:?}: {ended:?}: {words:?}");
    assert!(planted);
    assert!(
        words.is_some_and(|words| words.contains("stack")),
        "no word of it"
    );
    ready(&mut talk);
    let force_max_n = talk.board().rig().world().truth().force_max_n;
    assert!(force_max_n < 2.2, "{force_max_n} N");
}

/// Where a task's memory says that it runs, from its beginning on: found on a board where it does.
fn runs_at(elf: &Path, task: &str) -> u64 {
    let mut board = Emulator::start(elf, Setup::default(), Options::default()).unwrap();
    board.run_ms(500).unwrap();
    let (pool, _) = board.symbol(task).unwrap();
    let header = board.read(pool, 64).unwrap();
    let words = header.as_chunks::<4>().0.iter();
    let state = words.map(|word| u32::from_le_bytes(*word));
    // spawned, and perhaps in its executor's queue
    let at = state.into_iter().position(|word| word & !0x100 == 1);
    4 * at.expect("it does not run") as u64
}

/// A task that cannot be started stops the boot, and says so by the red LED: the motors stay off.
#[test]
#[ignore = "long"]
fn a_task_that_does_not_start_stops_the_boot() {
    for (variable, task) in [
        ("TACTUS_ELF", "::servo::servo::POOL"),
        ("TACTUS_ELF", "::probe::probe::POOL"),
        ("TACTUS_HANDHELD_ELF", "::hand::hand::POOL"),
    ] {
        let Some(elf) = elf_of(variable) else { return };
        let mut board = Emulator::start(&elf, Setup::default(), Options::default()).unwrap();
        // the variables are zeroed, the clocks not yet set
        while board.register(RCC_CR).unwrap() & HSEON == 0 {
            board.run_until(board.now_ns() + 10_000).unwrap();
        }
        let (pool, _) = board.symbol(task).unwrap();
        let state = pool + runs_at(&elf, task);
        assert_eq!(board.read(state, 4).unwrap(), [0; 4], "{task}");
        // it runs already
        board.write(state, &[1]).unwrap();
        board.run_ms(1500).unwrap();
        assert_eq!(
            board.leds().unwrap(),
            [false, false, true],
            "the red LED is off: {task}"
        );
        assert_eq!(board.resets().unwrap(), [], "{task}");
        let log = board.log().unwrap();
        assert!(
            log.iter().any(|(_, line)| line.contains("not started")),
            "{log:?}"
        );
        let mut rig = board.rig();
        let moved = rig.trace().any(|(_, output)| {
            matches!(
                output,
                Output::LeverEnable(true) | Output::StageEnable(true)
            )
        });
        assert!(!moved, "{task}");
        assert_eq!(rig.world().truth().force_max_n, 0.0);
    }
}
