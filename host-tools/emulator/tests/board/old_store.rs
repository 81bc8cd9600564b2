//! The store of the last image before version 4 of tables, and today's image booted on it: judged by what that image's own code
//! said it holds. And stores that are damaged.

use std::path::{Path, PathBuf};

use serde_json::Value;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::store::StoreError;
use tactus_core::table::{Name, Table, TableError};
use tactus_core::wire::{Command, Event, Failure, Forget, Identify, MemoryError, PART};
use tactus_emulator::board::Options;
use tactus_emulator::host::talk::{TIMEOUT_S, Talk};
use tactus_emulator::host::under_finger::{Unknown, mounted};
use tactus_lab::sim::collection::Collection;
use tactus_link::{PushTable, ReadTable, Request};

use crate::common::{boot, elf, unpacked, with_limits_of_change};

/// What was trained, what was given a name, and what the probe learned more of by itself.
const TRAINED: (u8, &str) = (31, "trained");
const NAMED: (u8, &str) = (100, "named");
const ITSELF: (u8, &str) = (47, "Polyurethane rubber");
/// Longest exploration, virtual seconds.
const LONG_S: f64 = 300.0;

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../tests/golden")
        .join(name)
}

fn store() -> Vec<u8> {
    unpacked(&golden("store-before-4.bin.gz"))
}

fn holds() -> Value {
    let text = std::fs::read_to_string(golden("store-before-4.json")).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// Another trial of a texture of the world that the store is of.
fn under(texture: u8) -> Unknown {
    let world = Collection {
        seed: 3,
        textures: Vec::new(),
        trials: 0,
    };
    mounted(&world, texture, 9)
}

fn table(talk: &mut Talk) -> Vec<u8> {
    talk.run(ReadTable::default(), TIMEOUT_S, |_, _| ())
        .unwrap()
}

/// A board on this store, and what it says until it has homed.
pub(crate) fn troubles(elf: &Path, store: Vec<u8>) -> (Talk, Vec<Failure>) {
    let options = Options {
        store: Some(store),
        ..Options::default()
    };
    let mut talk = Talk::new(under(TRAINED.0).start(elf, options).unwrap());
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
fn everything_that_was_taught_before_version_4_is_kept() {
    let Some(elf) = elf() else { return };
    let holds = holds();
    let mut kept = store();
    for (texture, name) in [TRAINED, NAMED, ITSELF] {
        let mut talk = boot(&elf, &under(texture), Some(kept));
        // what it lists
        let bytes = table(&mut talk);
        assert_eq!(holds["in_force"], hex(&bytes));
        let listed = Table::read(&bytes).unwrap();
        let names: Vec<&str> = listed.names().collect();
        assert_eq!(holds["names"], serde_json::json!(names));
        let tallies = (0..listed.textures()).map(|texture| {
            let tally = listed.tally(texture);
            [tally.factory, tally.user, tally.itself]
        });
        assert_eq!(
            holds["tallies"],
            serde_json::json!(tallies.collect::<Vec<_>>())
        );
        let calibration = talk.run(Request::read_calibration(), TIMEOUT_S, |_, _| ());
        assert_eq!(
            holds["calibration"],
            hex(&RigCalibration::to_bytes(&calibration.unwrap()))
        );
        let status = talk.run(Request::status(), TIMEOUT_S, |_, _| ()).unwrap();
        assert!(!status.factory);
        let worn = holds["skin"]
            .as_array()
            .unwrap()
            .iter()
            .map(|j| j.as_f64().unwrap());
        let (energy, wear) = status.skin_mj;
        for (found, joules) in [energy, wear].into_iter().zip(worn) {
            assert!(
                (f64::from(found) - 1e3 * joules).abs() <= 1.0,
                "{found} {joules}"
            );
        }
        // what it finds under its finger
        let found = talk.run(Request::identify(Identify::default()), LONG_S, |_, _| ());
        let verdict = found.unwrap().verdict;
        assert_eq!(
            (verdict.name.as_str(), verdict.unknown),
            (name, false),
            "{verdict:?}"
        );
        kept = store();
    }
    // it goes on from there: a change makes a table of today, which is kept as well
    let mut talk = boot(&elf, &under(TRAINED.0), Some(kept));
    let [from, to] = [TRAINED.1, "my own"].map(|name| Name::try_from(name).unwrap());
    talk.run(Request::rename(from, to), TIMEOUT_S, |_, _| ())
        .unwrap();
    let unfinished = Forget::Training(Name::try_from("unfinished").unwrap());
    talk.run(Request::forget(unfinished), TIMEOUT_S, |_, _| ())
        .unwrap();
    let (changed, store) = (table(&mut talk), talk.board().store().unwrap());
    drop(talk);
    let (mut talk, told) = troubles(&elf, store);
    assert_eq!((table(&mut talk), told), (changed.clone(), Vec::new()));
    let changed = Table::read(&changed).unwrap();
    let before = holds["names"].as_array().unwrap();
    assert_eq!(usize::from(changed.textures()), before.len());
    assert!(changed.find("my own").is_some());
}

#[test]
fn changed_bits_of_a_header_and_of_a_record_are_put_right() {
    let Some(elf) = elf() else { return };
    let holds = holds();
    let mut changed = store();
    let newest_at = holds["offset"].as_u64().unwrap() as usize;
    changed[newest_at - 32 + 9] ^= 0x10;
    // the newest calibration, a byte behind its head
    let calibration = holds["calibration"].as_str().unwrap();
    let mut places = changed.windows(calibration.len() / 2);
    let at = places.rposition(|bytes| hex(bytes) == calibration).unwrap();
    changed[at + 20] ^= 0x81;
    let (mut talk, told) = troubles(&elf, changed);
    assert_eq!(told, []);
    assert_eq!(holds["in_force"], hex(&table(&mut talk)));
    let kept = talk.run(Request::read_calibration(), TIMEOUT_S, |_, _| ());
    assert_eq!(calibration, hex(&RigCalibration::to_bytes(&kept.unwrap())));
}

#[test]
fn a_damaged_table_is_reported_and_not_replaced_in_silence() {
    let Some(elf) = elf() else { return };
    let whole = store();
    let (mut talk, told) = troubles(&elf, whole.clone());
    assert_eq!(told, []);
    let newest = table(&mut talk);
    drop(talk);
    let newest_at = holds()["offset"].as_u64().unwrap() as usize;
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

/// The PC refuses such a table before it is sent; the probe does not rely on that.
#[test]
fn a_table_with_damaged_limits_is_refused_by_the_probe() {
    let Some(elf) = elf() else { return };
    let factory = std::fs::read(golden("4-force.tact")).unwrap();
    let (mut talk, _) = troubles(&elf, store());
    let before = table(&mut talk);
    for (limits, good) in [(f32::NAN, false), (1e30, false), (2.0, true)] {
        let bytes = with_limits_of_change(&factory, limits);
        assert_eq!(PushTable::new(&bytes).is_ok(), good);
        let mut send = |command| talk.send(command, TIMEOUT_S, |_, _| ());
        send(Command::BeginTable(bytes.len() as u32)).unwrap();
        for (part, offset) in bytes.chunks(PART).zip((0..).step_by(PART)) {
            let bytes = part.iter().copied().collect();
            send(Command::WriteTable { offset, bytes }).unwrap();
        }
        let done = send(Command::CommitTable);
        if good {
            done.unwrap();
            assert_eq!(table(&mut talk), bytes);
        } else {
            let why = done.unwrap_err().to_string();
            let reason = StoreError::Table(TableError::Section(2)).to_string();
            assert!(why.contains(&reason) && reason.contains("limits"), "{why}");
            assert_eq!(table(&mut talk), before);
        }
    }
}
