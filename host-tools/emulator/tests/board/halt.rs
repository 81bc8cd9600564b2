//! A debugger halts the core in the middle of a movement: judged by the lever's pins and by the world.

use tactus_core::wire::Command;
use tactus_emulator::board::{Emulator, Output};
use tactus_emulator::host::talk::TalkError;

use crate::common::elf;
use crate::faults::{When, board, identify, is_time};

/// Duration of the halt, ms.
const HALTED_MS: u64 = 700;

/// When the lever made steps, ns.
fn steps(board: &Emulator) -> Vec<u64> {
    let rig = board.rig();
    let rises = rig
        .trace()
        .filter(|(_, output)| *output == Output::LeverStep(true));
    rises.map(|(at_ns, _)| *at_ns).collect()
}

/// A moment before the lever's next pulse, if it makes steps: its timer has been told to make it, and would make it
/// again and again.
fn before_a_pulse(board: &Emulator) -> Option<u64> {
    let steps = steps(board);
    let [.., before, last] = steps[..] else {
        return None;
    };
    let every_ns = last - before;
    let next_ns = last + every_ns - 100_000;
    (every_ns < 10_000_000 && next_ns > board.now_ns()).then_some(next_ns)
}

/// Halts the core once in each of so many movements: the steps made in halts, and the greatest force.
fn steps_in_halts(when: When, watchdog_stands: bool, times: u32) -> Option<(usize, f64)> {
    let elf = &elf()?;
    let mut talk = board(elf, 61, 30);
    talk.board().rig().world().reset_extremes();
    let mut made = 0;
    for _ in 0..times {
        let mut halted = false;
        // a halt costs the movement: slots are missed
        let ended = talk.send(identify(1), 120.0, |board, report| {
            if report.is_some() || halted || !is_time(when, board) {
                return;
            }
            // while it slides the lever makes none
            let at_ns = match when {
                When::Sliding => board.now_ns() + 1,
                _ => before_a_pulse(board).unwrap_or_default(),
            };
            if at_ns == 0 {
                return;
            }
            halted = true;
            board.run_until(at_ns).unwrap();
            board.halt(watchdog_stands).unwrap();
            board.run_ms(HALTED_MS).unwrap();
            made += steps(board)
                .iter()
                .filter(|&&step_ns| step_ns > at_ns)
                .count();
            board.go_on().unwrap();
        });
        eprintln!("{when:?}: {made} steps, {ended:?}");
        assert!(halted, "its time never came: {ended:?}");
        // whatever was reported meanwhile
        let rested_ns = talk.board().now_ns() + 12_000_000_000;
        while talk.board().now_ns() < rested_ns {
            talk.step().unwrap();
        }
        let force_n = talk.board().rig().world().truth().force_n;
        assert_eq!(force_n, 0.0, "the finger is not lifted");
        talk.send(Command::Home, 40.0, |_, _| ()).unwrap();
    }
    let force_max_n = talk.board().rig().world().truth().force_max_n;
    Some((made, force_max_n))
}

/// With a tool that stops the watchdog nothing but the timer's own halt ends the pulses.
fn no_steps(when: When, times: u32) {
    if let Some((steps, force_max_n)) = steps_in_halts(when, true, times) {
        assert_eq!(steps, 0, "steps in a halt: {force_max_n:.2} N");
        assert!(force_max_n < 1.4, "{force_max_n} N");
    }
}

#[test]
fn no_step_is_made_in_a_halt() {
    no_steps(When::Pressing, 1);
}

#[test]
#[ignore = "long"]
fn no_step_is_made_in_halts_at_other_times() {
    no_steps(When::Approaching, 2);
    no_steps(When::Pressing, 2);
}

/// Without such a tool the chip starts again, 100 ms into the halt.
#[test]
#[ignore = "long"]
fn a_halt_that_the_watchdog_ends_presses_no_further() {
    if let Some((_, force_max_n)) = steps_in_halts(When::Sliding, false, 2) {
        assert!(force_max_n < 2.2, "{force_max_n} N");
    }
}

/// A tool that is gone has left DBGMCU so that the watchdog stands in a halt.
#[test]
fn the_watchdog_goes_on_in_a_halt_after_a_tool_stopped_it() {
    let Some(elf) = elf() else { return };
    let mut talk = board(&elf, 62, 30);
    let halts = [(true, 10), (false, HALTED_MS)];
    for (watchdog_stands, ms) in halts {
        talk.board().halt(watchdog_stands).unwrap();
        talk.board().run_ms(ms).unwrap();
        talk.board().go_on().unwrap();
        talk.board().run_ms(10).unwrap();
    }
    assert_eq!(talk.board().resets().unwrap().len(), 1);
}

/// A debugger comes while the finger slides, and halts nothing yet.
#[test]
fn with_a_debugger_no_motor_moves() {
    let Some(elf) = elf() else { return };
    let mut talk = board(&elf, 63, 30);
    let mut came_ns = None;
    let ended = talk.send(identify(1), 120.0, |board, report| {
        if report.is_none() && came_ns.is_none() && is_time(When::Sliding, board) {
            let (address, _) = board.symbol("tactus_is_debugged").unwrap();
            // movs r0, #1; bx lr
            board
                .write(address & !1, &[0x01, 0x20, 0x70, 0x47])
                .unwrap();
            came_ns = Some(board.now_ns());
        }
    });
    assert!(matches!(ended, Err(TalkError::Refused(_))), "{ended:?}");
    let refused = talk.send(Command::Home, 40.0, |_, _| ());
    assert!(refused.is_err(), "homed under a debugger");
    talk.board().run_ms(1000).unwrap();
    let braked_ns = {
        let rig = talk.board().rig();
        let duties = rig.trace().filter_map(|(at_ns, output)| match output {
            Output::StageDuty(duty) => Some((*at_ns, *duty)),
            _ => None,
        });
        let last = duties.last();
        assert!(last.is_none_or(|(_, duty)| duty == 0.0), "{last:?}");
        last.map(|(at_ns, _)| at_ns)
    };
    let late_ms = braked_ns.map(|at_ns| at_ns.saturating_sub(came_ns.unwrap()) / 1_000_000);
    assert!(
        late_ms.is_none_or(|ms| ms < 9),
        "braked after {late_ms:?} ms"
    );
    assert!(
        steps(talk.board())
            .iter()
            .all(|at_ns| at_ns + 500_000_000 < talk.board().now_ns())
    );
    assert_eq!(talk.board().rig().world().truth().force_n, 0.0);
}
