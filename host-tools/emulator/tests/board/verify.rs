//! "The same as this one?" by the real ELF, judged by what lies under its finger; and the output that follows the
//! answer.

use tactus_core::explorer::{Answer, Strategy};
use tactus_core::table::Table;
use tactus_core::wire::{Command, Event, Identify};
use tactus_emulator::host::talk::{TIMEOUT_S, Talk};
use tactus_emulator::host::under_finger;
use tactus_link::Request;

use crate::common::{boot, elf};
use crate::explore::world;

/// A verification, virtual seconds.
const VERIFICATION_S: f64 = 600.0;

fn verify(texture: u16) -> Request<()> {
    Request::command(Command::Verify(Identify {
        among: std::iter::once(texture).collect(),
        strategy: Strategy::Cycling,
        seed: 7,
        ..Identify::default()
    }))
}

/// The answer, and the output's levels from the first word of the probe to its last, each once.
fn ask(talk: &mut Talk, texture: u16) -> (Answer, Vec<bool>) {
    let (mut answer, mut levels, mut begun) = (None, Vec::new(), false);
    talk.run(verify(texture), VERIFICATION_S, |board, report| {
        begun |= report.is_some_and(|report| matches!(report.event, Event::Chosen { .. }));
        if let Some(report) = report
            && let Event::Verified { now, .. } = report.event
        {
            answer = Some(now.answer);
        }
        let level = board.go().unwrap();
        if begun && levels.last() != Some(&level) {
            levels.push(level);
        }
    })
    .unwrap();
    (answer.expect("an answer"), levels)
}

#[test]
#[ignore = "long"]
fn the_output_is_high_while_the_last_answer_is_the_same() {
    let Some(elf) = elf() else { return };
    let (collection, known) = world();
    let table = Table::read(&known.table).unwrap();
    assert!(table.limits().is_some());
    let unknown = under_finger::mounted(collection, collection.textures[1], 1);
    let (same, other) = (table.find(&unknown.name).unwrap(), 3);
    assert_ne!(same, other);
    let mut talk = boot(&elf, &unknown, None);
    assert!(!talk.board().go().unwrap());
    talk.teach(&known.calibration, &known.table, |_, _| ())
        .unwrap();

    assert_eq!(ask(&mut talk, same), (Answer::Same, vec![false, true]));
    // whatever is asked in between
    talk.send(Command::Home, TIMEOUT_S, |_, _| ()).unwrap();
    assert!(talk.board().go().unwrap());
    assert_eq!(ask(&mut talk, other), (Answer::Different, vec![false]));
    assert_eq!(ask(&mut talk, same), (Answer::Same, vec![false, true]));
    // one that the probe refuses says nothing of the sample
    let refused = talk.run(verify(99), TIMEOUT_S, |_, _| ());
    assert!(refused.is_err());
    assert!(!talk.board().go().unwrap());
}
