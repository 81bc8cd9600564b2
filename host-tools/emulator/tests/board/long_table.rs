//! A table that does not fit into the 16 KB sectors: stored in a larger one, and read in place from it.

use tactus_core::explorer::Method;
use tactus_core::features::Movement;
use tactus_core::wire::{Command, PART};
use tactus_emulator::board::FlashWrite;
use tactus_emulator::host::talk::{TIMEOUT_S, Talk};
use tactus_emulator::host::under_finger;
use tactus_lab::sim::collection::{Collection, calibrated};
use tactus_link::{PushTable, ReadTable};

use crate::common::{boot, elf};

/// The texture under the finger, which the table has.
const TEXTURE: u8 = 47;
/// Bytes of the longest table in a sector of 16 KB, and in the larger ones.
const SHORT: usize = (16 << 10) - 32;
const LONG: usize = (64 << 10) - 32;

fn world() -> Collection {
    Collection::new(3, Collection::spread(TEXTURE, 4), 5)
}

/// A table of 24 movements.
fn long_table() -> Vec<u8> {
    let movements: Vec<Movement> = Movement::grid().take(24).collect();
    let calibration = calibrated(world().setup(world().textures[0], 0)).unwrap();
    let fused = (Method::Fused, None);
    let long = world().learn_at(&movements, fused, &[], calibration, || ());
    let long = long.unwrap();
    assert!(long.len() > SHORT && long.len() < LONG);
    long
}

fn table(talk: &mut Talk) -> Vec<u8> {
    talk.run(ReadTable::default(), TIMEOUT_S, |_, _| ())
        .unwrap()
}

/// Does something, and gives the sectors of tables that were erased for it.
fn erased(talk: &mut Talk, what: impl FnOnce(&mut Talk)) -> Vec<usize> {
    talk.board().store_writes().unwrap();
    what(talk);
    let writes = talk.board().store_writes().unwrap();
    let erases = writes.iter().filter_map(|write| match write {
        FlashWrite::Erase { sector } if !matches!(sector, 2 | 3) => Some(*sector),
        _ => None,
    });
    erases.collect()
}

fn push(talk: &mut Talk, table: &[u8]) {
    talk.run(PushTable::new(table).unwrap(), TIMEOUT_S, |_, _| ())
        .unwrap();
}

/// The watchdog waits for 2 s, and the longest erase of the 128 KB takes as long: the tasks go on meanwhile, and the
/// probe says what it is doing.
#[test]
#[ignore = "long"]
fn no_erase_costs_the_watchdogs_patience() {
    let Some(elf) = elf() else { return };
    let long = long_table();
    let mut talk = boot(&elf, &under_finger::mounted(&world(), TEXTURE, 9), None);
    talk.board().slow_erases().unwrap();
    for sector in [4, 5] {
        let from_ns = talk.now_ns();
        // the first bytes say that a table comes: only then is anything erased
        let first = Command::WriteTable {
            offset: 0,
            bytes: long[..PART].iter().copied().collect(),
        };
        for command in [Command::BeginTable(long.len() as u32), first] {
            talk.send(command, TIMEOUT_S, |_, _| ()).unwrap();
        }
        let took_ms = (talk.now_ns() - from_ns) / 1_000_000;
        let wanted_ms = if sector == 4 { 1200 } else { 2000 };
        assert!((wanted_ms..wanted_ms + 300).contains(&took_ms), "{took_ms}");
        assert_eq!(erased(&mut talk, |talk| push(talk, &long)), [sector]);
        assert!(table(&mut talk) == long);
    }
    assert_eq!(talk.board().resets().unwrap(), []);
}
