//! What the fuzz targets do with their bytes. A target fails by a panic, an overflow, unbounded memory, or an assertion
//! that what was accepted makes sense.
//!
//! Checksums would keep all mutations out: where a format has one, the target puts the right one behind the bytes,
//! unless the first byte says to leave them as they are.

mod flash;
mod folder;
mod import;
pub mod memory;

use crc::{CRC_32_ISO_HDLC, Crc};
use embassy_futures::block_on;
use serde::Serialize;
use serde::de::DeserializeOwned;
use tactus_core::explorer::{Config, Explorer, Method, Strategy};
use tactus_core::features::{FUSED_BANDS, Observation, Properties};
use tactus_core::probe::teach::put_in_force;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::store::{SelfLearnedRecord, Store};
use tactus_core::table::{Change, Table, amend};
use tactus_core::wire::{Command, Event, MAX_FRAME, Receiver, Report, Request};
use tactus_lab::data::quality::SlideMarks;
use tactus_lab::data::recordings::npy;
use tactus_lab::eval::learn::know_lengths;
use tactus_lab::eval::learned::note_learned;
use tactus_lab::remote::Remote;
use tactus_link::log::{Line, TableParts};

pub use flash::{Flash, images};
pub use folder::{many_rows, recordings};
pub use import::{import, many_slides, signals};

const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
/// More textures than any table for the probe has.
const TEXTURES: usize = 128;

/// Bytes from the wire, on both ends.
pub fn wire(data: &[u8]) {
    let Some((&mode, body)) = data.split_first() else {
        return;
    };
    if mode & 1 == 0 {
        // as they come
        let mut receiver = Receiver::new();
        body.iter()
            .filter_map(|&byte| receiver.push::<Request>(byte))
            .flatten()
            .for_each(heard);
        tactus_link::Session::default().receive(body);
        return;
    }
    // a frame that is whole
    let mut whole = body.to_vec();
    whole.extend(CRC32.checksum(body).to_le_bytes());
    let mut frame = cobs_of(&whole);
    frame.push(0);
    let mut receiver = Receiver::new();
    let requests = frame.iter().filter_map(|&b| receiver.push::<Request>(b));
    let requests: Vec<_> = requests.collect();
    assert!(requests.len() <= 1, "one 0, one frame");
    requests.into_iter().flatten().for_each(heard);
    for report in tactus_link::Session::default().receive(&frame) {
        said_again(&report);
        if let Event::SlideReport { observed, .. } = &report.event {
            observed.observation();
        }
    }
}

fn heard(request: Request) {
    said_again(&request);
    if let Command::WriteCalibration(bytes) = &request.command
        && let Ok(calibration) = RigCalibration::from_bytes(bytes)
    {
        calibration.check().expect("what is read has been checked");
    }
}

/// A message that was understood can be said, and is understood again.
fn said_again<M>(message: &M)
where
    M: Serialize + DeserializeOwned,
{
    let mut buffer = [0; MAX_FRAME + 1];
    // a message may be longer in its canonical form than it came, but not longer than any
    let Ok(frame) = tactus_core::wire::encode(message, &mut buffer) else {
        return;
    };
    let mut receiver = Receiver::new();
    let again: Vec<_> = frame
        .iter()
        .filter_map(|&byte| receiver.push::<M>(byte))
        .collect();
    // by their bytes: a NaN is not equal to itself
    let [Ok(again)] = again.as_slice() else {
        panic!("not understood again");
    };
    let mut other = [0; MAX_FRAME + 1];
    assert_eq!(tactus_core::wire::encode(again, &mut other), Ok(frame));
}

fn cobs_of(bytes: &[u8]) -> Vec<u8> {
    let mut buffer = vec![0; cobs::max_encoding_length(bytes.len())];
    let length = cobs::encode(bytes, &mut buffer);
    buffer.truncate(length);
    buffer
}

/// A session's log.
pub fn log(data: &[u8]) {
    let mut tables = TableParts::default();
    // whatever is wrong with it: what comes before that is used
    let _ = tactus_link::log::read(data, |line| {
        if let Line::Report(report) = &line
            && let Event::TablePart {
                offset,
                length,
                bytes,
            } = &report.event
        {
            drop(tables.take(*offset, *length, bytes));
        }
    });
}

/// A file of samples, and what is in it as P_AC.
pub fn samples(data: &[u8]) {
    if let Ok(samples) = npy::read(data) {
        let file = npy::write(&samples);
        assert_eq!(npy::read(&file), Ok(samples), "what is read is written");
    }
}

/// What comes from the line of a page's probe, while the page asks for something.
pub fn page(data: &[u8]) {
    let mut remote = Remote::default();
    remote.ask(r#"{"do":"connect","port":"fuzz","now_ms":0}"#);
    for (now, part) in (1..).zip(data.chunks(4096)) {
        let received = serde_json::to_string(part).expect("numbers");
        let reply = remote.ask(&format!(
            r#"{{"do":"step","now_ms":{},"received":{received}}}"#,
            20 * now
        ));
        assert!(serde_json::from_str::<serde_json::Value>(&reply).is_ok());
    }
    remote.ask(r#"{"do":"closed"}"#);
}

/// A texture table: read, explored, and amended.
pub fn table(data: &[u8]) {
    let Some((&mode, body)) = data.split_first() else {
        return;
    };
    let mut bytes = body.to_vec();
    if mode & 1 == 1 {
        bytes.extend(CRC32.checksum(body).to_le_bytes());
    }
    let Ok(table) = Table::read(&bytes) else {
        return;
    };
    look_at(&table);
    for method in [
        Method::Paper,
        Method::Student,
        Method::StudentAll,
        Method::Fused,
    ] {
        explore(&table, method, &bytes, mode);
    }
    let mut buffer = vec![0; bytes.len() + 64];
    let change = match mode >> 1 & 1 {
        0 => Change::Forget(u16::from(mode >> 2)),
        _ => Change::Rename {
            texture: u16::from(mode >> 2),
            name: "another",
        },
    };
    if let Ok(changed) = amend(&mut buffer, &table, change) {
        look_at(&changed);
        let gone = u16::from(matches!(change, Change::Forget(_)));
        assert_eq!(changed.textures() + gone, table.textures());
    }
}

/// Reads all that a table holds; its parts agree with each other.
fn look_at(table: &Table<'_>) {
    let names: Vec<&str> = table.names().collect();
    assert_eq!(names.len(), usize::from(table.textures()));
    for (texture, name) in (0..).zip(names) {
        assert_eq!(table.find(name), Some(texture));
        assert_eq!(table.numbered(table.number(texture)), Some(texture));
        for movement in 0..table.movements().len() as u8 {
            table.experience(texture, movement);
            table.whitened(texture, movement);
        }
        for action in table.actions() {
            if let Some(gaussian) = table.gaussian(texture, action) {
                assert!(gaussian.mean.is_finite() && gaussian.sd > 0.0);
            }
        }
        table.tally(texture);
    }
    let figures = table.open_set();
    assert!(figures.is_none_or(|of| (0.0..=1.0).contains(&of.new_named.share)));
    let learned = table.learned_slides();
    assert!(learned.hashes.iter().all(|hash| learned.has(hash)));
}

/// An exploration to its end, with slides made of the bytes.
fn explore(table: &Table<'_>, method: Method, bytes: &[u8], mode: u8) {
    let config = Config {
        method,
        strategy: [Strategy::Bayesian, Strategy::Cycling, Strategy::Random][usize::from(mode % 3)],
        max_slides: 3,
        open: mode & 4 == 0,
        ..Config::default()
    };
    let Ok(mut explorer) = Explorer::<TEXTURES>::new(*table, table.measured(), config) else {
        return;
    };
    let mut observed = bytes.iter().rev().copied().cycle();
    let mut number =
        || i16::from_le_bytes([observed.next().unwrap_or(0), observed.next().unwrap_or(0)]);
    while explorer.verdict().is_none() {
        let expected = explorer.expected_outcomes();
        let action = explorer.choose(&expected, number() as u16 as u32);
        let mut value = || Some(f32::from(number()) / 1024.0);
        let slide = Observation {
            properties: Properties::new([value(), value(), value()]),
            bands: (0..FUSED_BANDS).map(|_| number()).collect(),
            pressure: Some([number(), number()]),
            pace: None,
        };
        let before = explorer.posterior().to_vec();
        if let Ok(Some(look)) = explorer.look(action, 1, &slide) {
            assert!((0.0..=1.001).contains(&look.doubt), "{method:?}: {look:?}");
        }
        assert_eq!(explorer.posterior(), before, "a look changes nothing");
        if explorer.observe(action, &slide).is_err() {
            return;
        }
        let sum: f32 = explorer.posterior().iter().sum();
        assert!((sum - 1.0).abs() < 1e-3, "{method:?}: {sum}");
    }
}

/// The store's flash, as a wild program or a worn cell may leave it: opened, used, and opened again.
///
/// The first byte names one of the [`images`], or blank flash; three bytes each say what is changed in it; the rest is
/// what is done.
pub fn store(data: &[u8]) {
    let &[image, changes, ref rest @ ..] = data else {
        return;
    };
    let mut flash = Flash::blank();
    let images = images();
    if let Some(image) = images.get(usize::from(image) % (images.len() + 1)) {
        flash.bytes.copy_from_slice(image);
    }
    let changes = usize::from(changes) * 3;
    let (changed, todo) = rest.split_at(changes.min(rest.len()));
    for change in changed.as_chunks::<3>().0 {
        let at = usize::from(u16::from_le_bytes([change[0], change[1]])) % flash.bytes.len();
        flash.bytes[at] ^= change[2];
    }
    let Ok(mut store) = block_on(Store::open(flash)) else {
        return;
    };
    // whatever has changed, the store goes on
    let _ = block_on(store.mend());
    let mut buffer = vec![0; Store::<Flash>::MAX_TABLE];
    // more say nothing new
    for step in todo.as_chunks::<2>().0.iter().take(1000) {
        used(&mut store, *step, &mut buffer);
    }
    let before = said(&mut store, &mut buffer);
    let Ok(mut again) = block_on(Store::open(store.close())) else {
        panic!("a store that was opened opens again");
    };
    let after = said(&mut again, &mut buffer);
    if changed.is_empty() {
        assert_eq!(before, after, "as it was");
        return;
    }
    // bits that changed by themselves may cost the settings, and be noticed late; but never for good
    let calibration = flash::calibration();
    block_on(async {
        again.erase_settings().await.expect("settings afresh");
        again.set_calibration(&calibration).await.expect("room");
        let Ok(mut again) = Store::open(again.close()).await else {
            panic!("a store with new settings opens");
        };
        assert_eq!(again.calibration().await, Ok(Some(calibration)));
    });
}

/// What a store holds, in words.
fn said(store: &mut Store<Flash>, buffer: &mut [u8]) -> String {
    let settings = store.settings();
    let table = block_on(store.read_table(buffer));
    let table = table.map(|table| table.map(|table| table.crc()));
    let calibration = block_on(store.calibration());
    let skin = block_on(store.skin());
    format!("{settings:?} {table:?} {calibration:?} {skin:?}")
}

fn used(store: &mut Store<Flash>, [what, how]: [u8; 2], buffer: &mut [u8]) {
    let calibration = RigCalibration {
        date: how.into(),
        ..flash::calibration()
    };
    // whatever comes of it: no flash fails, so that the next operation finds the store in order
    match what % 8 {
        0 => {
            let _ = block_on(store.set_calibration(&calibration));
        }
        1 => {
            let _ = block_on(store.factory_table());
        }
        2 => {
            let bytes = flash::tables();
            let bytes = &bytes[usize::from(how) % bytes.len()];
            let _ = block_on(async {
                store.begin_table(bytes.len()).await?;
                store.write_table(0, bytes).await?;
                store.commit_table(None, buffer).await.map(|_| ())
            });
        }
        3 => {
            let record = SelfLearnedRecord {
                lineage: how.into(),
                number: (how % 4).into(),
                movements: Default::default(),
            };
            let _ = block_on(store.set_self_learned(&record));
        }
        4 => {
            let _ = block_on(store.erase_settings());
        }
        5 => {
            let _ = block_on(store.delete_training_records("felt"));
        }
        6 => {
            let base = flash::tables();
            let base = Table::read(&base[0]).expect("our own table");
            let _ = block_on(put_in_force(&base, Some(store), buffer));
        }
        _ => {
            let _ = block_on(store.begin_table(usize::from(how) * 64));
        }
    }
}

/// Writes what a target begins with to the folder that `TACTUS_SEEDS` names, and ends; without it, nothing.
///
/// # Panics
/// The folder cannot be written.
pub fn write_seeds(target: &str) {
    let Some(folder) = std::env::var_os("TACTUS_SEEDS").map(std::path::PathBuf::from) else {
        return;
    };
    std::fs::create_dir_all(&folder).expect("a folder for the seeds");
    for (seed, number) in seeds(target).iter().zip(0..) {
        std::fs::write(folder.join(format!("seed-{number}")), seed).expect("a file for a seed");
    }
    std::process::exit(0);
}

/// A target: its name, and what it does with bytes.
pub type Target = (&'static str, fn(&[u8]));

/// All targets.
pub const TARGETS: [Target; 9] = [
    ("wire", wire),
    ("table", table),
    ("store", store),
    ("recordings", recordings),
    ("log", log),
    ("samples", samples),
    ("signals", signals),
    ("import", import),
    ("page", page),
];

/// Inputs that are right, made anew so that they stay so.
///
/// # Panics
/// There is no such target.
pub fn seeds(target: &str) -> Vec<Vec<u8>> {
    let behind = |mode: u8, bytes: &[u8]| [&[mode], bytes].concat();
    match target {
        "wire" => {
            let commands = [
                Command::Status,
                Command::Identify(tactus_core::wire::Identify {
                    among: [1, 2].into_iter().collect(),
                    threshold: 0.99,
                    max_slides: 10,
                    method: None,
                    strategy: Strategy::Bayesian,
                    open: true,
                    learn: true,
                    seed: 1,
                    false_alarm: Some(0.02),
                }),
                Command::WriteCalibration(flash::calibration().to_bytes()),
                Command::WriteTable {
                    offset: 256,
                    bytes: (0..40).collect(),
                },
            ];
            let mut seeds = Vec::new();
            for (id, command) in (0..).zip(commands) {
                let mut buffer = [0; MAX_FRAME + 1];
                let frame = tactus_core::wire::encode(&Request { id, command }, &mut buffer);
                let frame = frame.expect("room for a frame");
                seeds.push(behind(0, frame));
                let mut whole = frame[..frame.len() - 1].to_vec();
                let length = cobs::decode_in_place(&mut whole).expect("our own frame");
                // without its checksum
                seeds.push(behind(1, &whole[..length - 4]));
            }
            seeds
        }
        "table" => {
            let with_length = |table: &Vec<u8>| {
                let shorter = [(1000, table.clone(), u64::MAX)];
                know_lengths(table, &shorter).expect("a table of two lengths")
            };
            let tables = flash::tables();
            let noted = |table: &Vec<u8>| {
                let slides = [[7; 6], [9; 6]].map(SlideMarks::from);
                let slides: Vec<&SlideMarks> = slides.iter().collect();
                note_learned(table, true, &slides).expect("a table that notes two slides")
            };
            let tables = tables.iter().cloned().chain(tables.iter().map(with_length));
            let tables = tables.chain(flash::tables().iter().map(noted));
            tables
                .map(|table| behind(1, &table[..table.len() - 4]))
                .collect()
        }
        "store" => (0..=images().len() as u8)
            .map(|image| vec![image, 1, 0, 9, 4, 0, 3, 2, 1, 3, 7, 1, 0, 6, 0, 4, 0])
            .collect(),
        "recordings" => folder::seeds(),
        "signals" => import::seeds(false),
        "import" => import::seeds(true),
        "log" => vec![
            concat!(
                r#"{"session":{"tactus":"0.2.0","protocol":PROTOCOL,"port":"x"}}"#,
                "\n",
                r#"{"command":"Status"}"#,
                "\n",
                r#"{"report":{"number":1,"at_ms":50,"event":{"Done":1}}}"#,
                "\n"
            )
            .replace("PROTOCOL", &tactus_core::wire::PROTOCOL.to_string())
            .into_bytes(),
        ],
        "samples" => vec![npy::write(&(0..500).collect::<Vec<i16>>())],
        "page" => {
            let mut frames = Vec::new();
            for (number, event) in (0..).zip([Event::Done(1), Event::Done(2)]) {
                let mut buffer = [0; MAX_FRAME + 1];
                let report = Report {
                    number,
                    at_ms: 50,
                    event,
                };
                let frame = tactus_core::wire::encode(&report, &mut buffer);
                frames.extend_from_slice(frame.expect("room for a frame"));
            }
            vec![frames]
        }
        other => panic!("no target {other}"),
    }
}
