//! "Is it the same one, but changed?": the power is cut while the probe stores the answer. Judged by the tables that it
//! gave before the answer and after it.

use std::path::Path;

use tactus_core::explorer::Method;
use tactus_core::table::{Name, Table};
use tactus_core::wire::{Event, Identify, Report, Reset};
use tactus_emulator::board::{Emulator, FlashWrite, Options};
use tactus_emulator::host::talk::{TIMEOUT_S, Talk};
use tactus_emulator::host::under_finger::{self, Unknown};
use tactus_lab::sim::collection::Collection;
use tactus_link::{ReadTable, Request};

use crate::common::{boot, elf, with_limits_of_change};
use crate::power_cut::{Cut, Torn, left_by};

/// The texture under the finger, which the table has, and textures of the table.
const TEXTURE: u8 = 47;
const AMONG: u8 = 4;
/// Limits from which on every texture has changed.
const ALL_CHANGED: f32 = -9000.0;
/// Longest exploration, virtual seconds; the store is open by then.
const LONG_S: f64 = 300.0;
const OPEN_S: f64 = 20.0;

fn table(talk: &mut Talk) -> Vec<u8> {
    talk.run(ReadTable::default(), TIMEOUT_S, |_, _| ())
        .unwrap()
}

/// The table that a rig holds which boots on this store; nothing is to be complained about.
pub(crate) fn reboot(elf: &Path, unknown: &Unknown, store: Vec<u8>) -> (Talk, Vec<u8>) {
    let options = Options {
        store: Some(store),
        ..Options::default()
    };
    let mut talk = Talk::new(unknown.start(elf, options).unwrap());
    let hear = |_: &mut Emulator, report: Option<&Report>| {
        if let Some(Event::Trouble(why)) = report.map(|r| &r.event) {
            panic!("trouble: {why}");
        }
    };
    let booted = |event: &Event| match event {
        Event::Booted { reset, .. } => Some(Ok(*reset)),
        _ => None,
    };
    assert_eq!(talk.wait(1.0, hear, booted).unwrap(), Reset::Power);
    // no table is in force before the store is open
    while talk
        .run(Request::status(), TIMEOUT_S, hear)
        .unwrap()
        .textures
        == 0
    {
        assert!(talk.now_ns() < (OPEN_S * 1e9) as u64);
        talk.board().run_ms(10).unwrap();
    }
    let bytes = talk.run(ReadTable::default(), TIMEOUT_S, hear).unwrap();
    (talk, bytes)
}

#[test]
fn an_answer_over_the_link_is_stored_or_not() {
    let Some(elf) = elf() else { return };
    let collection = Collection::new(3, Collection::spread(TEXTURE, AMONG), 3);
    let known = under_finger::simulated(&collection, Method::Fused, &[], || ()).unwrap();
    let unknown = under_finger::mounted(&collection, TEXTURE, 2);
    let mut talk = boot(&elf, &unknown, None);
    let changed = with_limits_of_change(&known.table, ALL_CHANGED);
    talk.teach(&known.calibration, &changed, |_, _| ()).unwrap();
    let verdict = talk.run(Request::identify(Identify::default()), LONG_S, |_, _| ());
    let verdict = verdict.unwrap().verdict;
    assert!(
        verdict.changed && verdict.name == unknown.name.as_str(),
        "{verdict:?}"
    );
    let old = table(&mut talk);
    talk.board().store_writes().unwrap();
    let before = talk.board().store().unwrap();
    let label = Request::label(Name::try_from("another one").unwrap());
    talk.run(label, TIMEOUT_S, |_, _| ()).unwrap();
    let new = table(&mut talk);
    let writes = talk.board().store_writes().unwrap();
    let textures = |table: &[u8]| Table::read(table).unwrap().textures();
    assert_eq!(textures(&new), textures(&old) + 1);
    // spread over the answer, in its last writes, and in every erase
    let last = writes.len() - 1;
    let erase = |(_, write): &(usize, &FlashWrite)| matches!(write, FlashWrite::Erase { .. });
    let erases = writes.iter().enumerate().filter(erase).map(|(at, _)| at);
    let places = (0..3)
        .map(|n| n * (last - 6) / 2)
        .chain(last - 1..=last + 1);
    let (mut left_old, mut left_new) = (0, 0);
    for (n, at) in places.chain(erases).enumerate() {
        let cut = Cut {
            at,
            torn: Torn::ALL[n % Torn::ALL.len()],
            seed: n as u64,
        };
        let (_, found) = reboot(&elf, &unknown, left_by(&before, &writes, cut));
        assert!(found == old || found == new, "{cut:?} of {}", writes.len());
        left_old += usize::from(found == old);
        left_new += usize::from(found == new);
    }
    assert!(left_old >= 3 && left_new > 0, "{left_old} {left_new}");
}
