//! Stores that are damaged. Each begins as the golden store of `tests/core/formats.rs`: a table of the factory, a newer
//! one, and a record of each kind.

use std::path::Path;

use embassy_futures::block_on;
use tactus_core::probe::teach::put_in_force;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::store::Store;
use tactus_core::table::TableError;
use tactus_core::wire::{Event, Failure, MemoryError};
use tactus_emulator::board::Options;
use tactus_emulator::host::talk::{TIMEOUT_S, Talk};
use tactus_emulator::host::under_finger::mounted;
use tactus_lab::sim::collection::Collection;
use tactus_lab::sim::flash::{RamFlash, SECTOR};
use tactus_link::{PushTable, ReadTable, Request};

use crate::common::{elf, unpacked};

fn store() -> Vec<u8> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    unpacked(&here.join("../../tests/golden/store.bin.gz"))
}

/// What the golden store holds.
struct Held {
    /// Where the newest table begins.
    newest_at: usize,
    /// That table with what the probe learned by itself.
    in_force: Vec<u8>,
    calibration: RigCalibration,
}

fn held() -> Held {
    block_on(async {
        let mut store = Store::open(RamFlash::<SECTOR>::of(store())).await.unwrap();
        let newest_at = store.table().unwrap().offset as usize;
        let calibration = store.calibration().await.unwrap().unwrap();
        let (mut buffer, mut in_force) = (vec![0; SECTOR], vec![0; SECTOR]);
        let table = store.read_table(&mut buffer).await.unwrap().unwrap();
        let length = put_in_force(&table, Some(&mut store), &mut in_force).await;
        in_force.truncate(length.unwrap());
        assert!(in_force != table.as_bytes());
        Held {
            newest_at,
            in_force,
            calibration,
        }
    })
}

fn table(talk: &mut Talk) -> Vec<u8> {
    talk.run(ReadTable::default(), TIMEOUT_S, |_, _| ())
        .unwrap()
}

/// A board on this store, and what it says until it has homed.
fn troubles(elf: &Path, store: Vec<u8>) -> (Talk, Vec<Failure>) {
    let options = Options {
        store: Some(store),
        ..Options::default()
    };
    let world = Collection::new(3, Vec::new(), 0);
    let mut talk = Talk::new(mounted(&world, 31, 9).start(elf, options).unwrap());
    let mut told = Vec::new();
    let ready = talk.ready(|_, report| {
        if let Some(Event::Trouble(why)) = report.map(|report| &report.event) {
            told.push(why.clone());
        }
    });
    assert_eq!(ready.unwrap(), None);
    (talk, told)
}

#[test]
fn changed_bits_of_a_header_and_of_a_record_are_put_right() {
    let Some(elf) = elf() else { return };
    let held = held();
    let mut changed = store();
    changed[held.newest_at - 32 + 9] ^= 0x10;
    // the calibration, a byte behind its head
    let calibration = held.calibration.to_bytes();
    let mut places = changed.windows(calibration.len());
    let at = places.position(|bytes| *bytes == calibration).unwrap();
    changed[at + 20] ^= 0x81;
    let (mut talk, told) = troubles(&elf, changed);
    assert_eq!(told, []);
    assert_eq!(table(&mut talk), held.in_force);
    let kept = talk.run(Request::read_calibration(), TIMEOUT_S, |_, _| ());
    assert_eq!(kept.unwrap(), held.calibration);
}

#[test]
#[ignore = "long"]
fn a_damaged_table_is_reported_and_not_replaced_in_silence() {
    let Some(elf) = elf() else { return };
    let whole = store();
    let (mut talk, told) = troubles(&elf, whole.clone());
    assert_eq!(told, []);
    let newest = table(&mut talk);
    drop(talk);
    let newest_at = held().newest_at;
    let older_at = (newest_at + (16 << 10)) % (32 << 10);
    // a bit of the newest one: the one before it is in force
    let mut damaged = whole;
    damaged[newest_at + 100] ^= 0x10;
    let (mut talk, told) = troubles(&elf, damaged.clone());
    assert!(
        matches!(
            told[..],
            [Failure::Memory(MemoryError::NewestTable(
                TableError::Crc { .. }
            ))]
        ),
        "{told:?}"
    );
    let older = table(&mut talk);
    let status = talk.run(Request::status(), TIMEOUT_S, |_, _| ()).unwrap();
    assert!(older != newest && !status.factory);
    drop(talk);
    // and one of that: the firmware's is
    damaged[older_at + 100] ^= 0x10;
    let (mut talk, told) = troubles(&elf, damaged);
    assert!(
        matches!(
            told[..],
            [Failure::Memory(MemoryError::StoredTable(
                TableError::Crc { .. }
            ))]
        ),
        "{told:?}"
    );
    let status = talk.run(Request::status(), TIMEOUT_S, |_, _| ()).unwrap();
    assert!(status.factory);
    // whatever is stored next ends it
    talk.run(PushTable::new(&older).unwrap(), TIMEOUT_S, |_, _| ())
        .unwrap();
    let store = talk.board().store().unwrap();
    drop(talk);
    let (mut talk, told) = troubles(&elf, store);
    assert_eq!((table(&mut talk), told), (older, Vec::new()));
}
