//! A panic while the finger slides, on a lever whose DIR has come loose meanwhile: judged by the world's force.

use tactus_core::wire::Reset;
use tactus_emulator::host::talk::TalkError;
use tactus_world::faults::Fault;

use crate::broken_code::{Instead, break_code};
use crate::common::elf;
use crate::faults::{When, board, identify, is_time};

#[test]
fn a_lift_that_presses_is_ended_by_the_force() {
    let Some(elf) = elf() else { return };
    let mut talk = board(&elf, 83, 30);
    let (mut pressed_n, mut broken) = (None, None);
    let ended = talk.send(identify(1), 120.0, |board, report| {
        if report.is_some() {
            return;
        }
        if pressed_n.is_none() && is_time(When::Sliding, board) {
            pressed_n = Some(board.rig().world().truth().force_n);
            board.rig().world().reset_extremes();
            // up is down
            board.inject(Fault::LeverDirInverted);
            let whole = break_code(board, "tactus_check_in", Instead::Panics);
            broken = Some((board.now_ns() + 10_000_000, whole));
        }
        if let Some((_, (address, code))) = broken.take_if(|(due, _)| board.now_ns() >= *due) {
            board.write(address, &code).unwrap();
        }
    });
    assert!(
        matches!(ended, Err(TalkError::Rebooted(Reset::Software))),
        "{ended:?}"
    );
    // the start lifts again
    let until_ns = talk.now_ns() + 3_000_000_000;
    while talk.now_ns() < until_ns {
        talk.step().unwrap();
    }
    let most_n = talk.board().rig().world().truth().force_max_n;
    eprintln!("{pressed_n:?} N, at most {most_n:.2} N");
    // half a newton, three looks, and the start's own look
    assert!(pressed_n.is_some_and(|n| most_n < n + 0.8), "{most_n} N");
}
