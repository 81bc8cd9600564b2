//! What was written before names and places changed still opens: tables, stores, frames of the link, and logs of sessions.
//!
//! `tests/golden/README.md` says which commit wrote which files, and how. They are never made anew: a format that changes gets
//! files of its own, beside these.

use std::convert::Infallible;
use std::fmt::Debug;
use std::fs;
use std::io::Read as _;
use std::path::PathBuf;
use std::process::Command;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use flate2::read::GzDecoder;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use tactus_core::explorer::{Config, Explorer, ExplorerError, Method, ObserveError};
use tactus_core::features::SlideError;
use tactus_core::features::{FeatureSet, Movement, Observation, Properties, Property, PropertySet};
use tactus_core::probe::teach::put_in_force;
use tactus_core::rig::calibration::RigCalibrationError;
use tactus_core::rig::{Fault, Refused, RigError};
use tactus_core::sensor::FingerCode;
use tactus_core::store::{FlashFault, SECTORS, Store, StoreError};
use tactus_core::table::{Action, Against, Contents, EncodeError, Name, Table, TableError};
use tactus_core::wire::{
    Command as Asked, Event, Failure, MAX_FRAME, MemoryError, Rejection, Report, Request, Text,
    TrainingError, decode, encode,
};

fn golden(name: &str) -> PathBuf {
    let here = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    here.join("../../tests/golden").join(name)
}

fn text(name: &str) -> String {
    fs::read_to_string(golden(name)).unwrap()
}

fn json_of(name: &str) -> Value {
    serde_json::from_str(&text(name)).unwrap()
}

fn unpacked(name: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let file = fs::File::open(golden(name)).unwrap();
    GzDecoder::new(file).read_to_end(&mut bytes).unwrap();
    bytes
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn bytes(hex: &Value) -> Vec<u8> {
    let (pairs, _) = hex.as_str().unwrap().as_bytes().as_chunks::<2>();
    let byte = |pair: &[u8; 2]| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap();
    pairs.iter().map(byte).collect()
}

/// Any value in postcard's form, in a frame.
fn frame(message: &impl Serialize) -> String {
    hex(encode(message, &mut [0; MAX_FRAME + 1]).unwrap())
}

/// Every line has a message as JSON, with the names of its day, and its frame, unless the message `was_text`: those have
/// other frames now, and so have those that have another field.
fn assert_frames<M: Serialize + DeserializeOwned + PartialEq + Debug>(
    file: &str,
    wanted: usize,
    was_text: fn(&M) -> bool,
) {
    let lines = text(file);
    for line in lines.lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        let message: M = serde_json::from_value(line["message"].clone())
            .unwrap_or_else(|why| panic!("{}: {why}", line["message"]));
        if was_text(&message) {
            continue;
        }
        assert_eq!(line["frame"], frame(&message), "{message:?}");
        let mut frame = bytes(&line["frame"]);
        assert_eq!(frame.pop(), Some(0));
        assert_eq!(decode::<M>(&mut frame), Ok(message));
    }
    assert_eq!(lines.lines().count(), wanted);
}

#[test]
fn frames_of_every_request_are_what_they_were() {
    // version 5 has one more field
    let has_more = |request: &Request| matches!(request.command, Asked::Identify(_));
    assert_frames("requests.jsonl", 34, has_more);
}

#[test]
fn frames_of_every_report_are_what_they_were() {
    assert_frames::<Report>("reports.jsonl", 65, |report| match &report.event {
        Event::Refused { why, .. } => {
            let busy = Text::try_from("busy: wait, or stop what is being done").unwrap();
            *why == Failure::Said(busy)
        }
        Event::Rejected { why, .. } => {
            *why == Failure::Said(Text::try_from("the slide is too short").unwrap())
        }
        // version 5 has one more field, and versions 6, 7 and 8
        Event::Verdict(_) | Event::Status(_) | Event::Booted { .. } => true,
        _ => false,
    });
}

fn has_more(report: &Report) -> bool {
    matches!(report.event, Event::Status(_) | Event::Booted { .. })
}

/// Version 5 of the messages: all of them, and every reason in every reason.
#[test]
fn frames_of_version_5_are_what_they_were() {
    assert_frames::<Request>("requests-5.jsonl", 37, |_| false);
    // version 6 has one more field, and versions 7 and 8
    assert_frames::<Report>("reports-5.jsonl", 100, has_more);
    assert_frames::<Failure>("reasons-5.jsonl", 263, |_| false);
}

/// Version 6 of the messages.
#[test]
fn frames_of_version_6_are_what_they_were() {
    assert_frames::<Request>("requests-6.jsonl", 42, |_| false);
    // versions 7 and 8 have one more field
    assert_frames::<Report>("reports-6.jsonl", 115, has_more);
    assert_frames::<Failure>("reasons-6.jsonl", 265, |_| false);
    assert_frames::<Failure>("reasons-6-records.jsonl", 15, |_| false);
}

/// Version 7 of the messages.
#[test]
fn frames_of_version_7_are_what_they_were() {
    assert_frames::<Request>("requests-7.jsonl", 44, |_| false);
    // version 8 has one more field
    assert_frames::<Report>("reports-7.jsonl", 135, has_more);
    assert_frames::<Failure>("reasons-7.jsonl", 280, |_| false);
    // without it they are a BioTac's
    for line in text("reports-7.jsonl").lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        let report: Report = serde_json::from_value(line["message"].clone()).unwrap();
        let finger = match report.event {
            Event::Booted { finger, .. } => finger,
            Event::Status(status) => status.finger,
            _ => continue,
        };
        assert_eq!(finger, FingerCode::BIOTAC);
    }
}

/// Version 9 of the messages.
#[test]
fn frames_of_version_9_are_what_they_were() {
    assert_frames::<Report>("reports-9.jsonl", 139, |_| false);
}

/// Version 4 of the messages: every kind of reason, alone in a frame.
#[test]
fn reasons_are_what_they_were_on_the_line() {
    let name = Name::try_from("silk").unwrap();
    let table = TableError::Truncated { got: 3, wanted: 16 };
    let reasons = [
        (
            Failure::Said(Text::try_from("so").unwrap()),
            "010802736f8e5ddffb00",
        ),
        (Failure::Busy, "06011bdf05a500"),
        (
            Failure::Rig(RigError::Fault(Fault::LeverSlips)),
            "0802010d80406f9b00",
        ),
        (
            Failure::Rig(RigError::Refused(Refused::Force(2000))),
            "02020803d00faac223af00",
        ),
        (
            Failure::Explorer(ExplorerError::Candidates),
            "070301aa71f31d00",
        ),
        (
            Failure::Slide(Rejection::Slide(SlideError::Gap(5))),
            "0904010505b622f9a200",
        ),
        (
            Failure::Slide(Rejection::Rig(RigError::Stopped)),
            "02040602e210461600",
        ),
        (
            Failure::NoGoodSlide(Rejection::Observe(ObserveError::Missing(
                Property::Fineness,
            ))),
            "03050206026c9a10fb00",
        ),
        (Failure::Movement(2), "07060255d48df900"),
        (
            Failure::Training(TrainingError::Trials(1)),
            "0807010140ce129400",
        ),
        (Failure::Rejected, "0608bf67d9dc00"),
        (
            Failure::Memory(MemoryError::Unknown(name)),
            "0c09060473696c6bd6bc890600",
        ),
        (
            Failure::Memory(MemoryError::Broken(StoreError::Silent)),
            "0209060b153b426700",
        ),
        (
            Failure::Memory(MemoryError::NoTable(table)),
            "030901070310aeb1144500",
        ),
        (
            Failure::Memory(StoreError::Flash(FlashFault::Work).into()),
            "03090b06025b1e17be00",
        ),
        (
            Failure::Calibration(RigCalibrationError::Points),
            "070a03cfab3f2200",
        ),
        (Failure::CalibrationLength, "060b0536d04500"),
        (Failure::NoSuchByte, "060ca6a3b4db00"),
        (
            Failure::NotLearned(MemoryError::Encode(EncodeError::NoSpace(300))),
            "0a0d0a03ac0258fff5bf00",
        ),
    ];
    for (why, wanted) in reasons {
        assert_eq!(frame(&why), wanted, "{why:?}");
        for event in [
            Event::Refused {
                id: 7,
                why: why.clone(),
            },
            Event::Rejected {
                slide: 7,
                why: why.clone(),
            },
            Event::Trouble(why.clone()),
        ] {
            let logged = serde_json::to_string(&event).unwrap();
            let read: Event = serde_json::from_str(&logged).unwrap();
            assert_eq!(read, event, "{logged}");
        }
    }
    for damaged in [
        r#"{"Refused":{"id":7,"why":{"Nobody":1}}}"#,
        r#"{"Refused":{"id":7,"why":3}}"#,
    ] {
        assert!(serde_json::from_str::<Event>(damaged).is_err());
    }
}

/// What a table holds; of a large one, every thirteenth texture.
fn values(bytes: &[u8]) -> Value {
    let table = Table::read(bytes).unwrap();
    assert_eq!(table.as_bytes(), bytes);
    let every = if table.textures() > 13 { 13 } else { 1 };
    let (set, features) = match table.contents() {
        Contents::Gaussians(_) => (None, 0),
        Contents::Fused(set, features) => (Some(set), features),
    };
    let movements = 0..table.movements().len() as u8;
    let textures = (0..table.textures()).step_by(every).map(|texture| {
        let tally = table.tally(texture);
        let learned = movements.clone().map(|movement| {
            let gaussian = |property| {
                let property = Some(property);
                let gaussian = table.gaussian(texture, Action { movement, property });
                gaussian.map(|gaussian| [gaussian.mean, gaussian.sd])
            };
            let trials = table.trials(texture, movement);
            match set {
                None => json!([
                    trials,
                    Property::ALL.map(gaussian),
                    frame(&table.experience(texture, movement))
                ]),
                Some(_) => {
                    let whitened = table.whitened(texture, movement);
                    let mean = &whitened.mean[..usize::from(features)];
                    json!([trials, whitened.slides, mean])
                }
            }
        });
        json!({
            "factory": tally.factory,
            "user": tally.user,
            "itself": tally.itself,
            "texture": texture,
            "name": table.name(texture),
            "number": table.number(texture),
            "learned": learned.collect::<Vec<_>>(),
        })
    });
    // what the whitening makes of some slide
    let slide: Vec<i16> = (1..=i16::from(features)).map(|n| 700 * n - 3000).collect();
    let whitened = movements.clone().map(|movement| {
        let white = table.whiten(movement, &slide);
        white.map(|white| white.to_vec())
    });
    json!({
        "textures": table.textures(),
        "names": table.names().collect::<Vec<_>>(),
        "movements": table.movements().collect::<Vec<_>>(),
        "features": set.and_then(|set| FeatureSet::ALL.iter().position(|s| *s == set)),
        "dimensions": features,
        "measured": table.measured().bits(),
        "next_number": table.next_number(),
        "lineage": table.lineage(),
        "crc": table.crc(),
        "whitened": whitened.collect::<Vec<_>>(),
        "learned": textures.collect::<Vec<_>>(),
    })
}

#[test]
fn tables_read_to_the_same_values() {
    let tables = [
        "factory",
        "handheld",
        "paper",
        "fused-force",
        "fused-pressure",
        "fused-bands",
        "fused-properties",
    ];
    for name in tables {
        let table = fs::read(golden(&format!("{name}.tact"))).unwrap();
        let values = serde_json::to_string(&values(&table)).unwrap();
        let values: Value = serde_json::from_str(&values).unwrap();
        assert_eq!(values, json_of(&format!("{name}.json")), "{name}");
    }
}

/// Beside what [`values`] says, the sections of a table, and what is decided by them about slides that are as the mean of all
/// textures, and a little off.
fn sections(bytes: &[u8]) -> Value {
    let table = Table::read(bytes).unwrap();
    let limits = table.limits().map(|limits| {
        let tails = [limits.drifted, limits.same];
        let tails = tails.map(|tails| tails.map(|tail| [tail.begin, tail.excess]));
        json!({"false_alarm": limits.false_alarm, "tails": tails})
    });
    let decided = match table.contents() {
        Contents::Gaussians(_) => Vec::new(),
        Contents::Fused(set, features) => [0, 200, -500]
            .map(|off| decided(table, set, features.into(), off))
            .to_vec(),
    };
    json!({"version": bytes[4], "drift": table.drift(), "limits": limits, "decided": decided})
}

fn decided(table: Table<'_>, set: FeatureSet, features: usize, off: i16) -> Value {
    let config = Config {
        method: Method::Fused,
        ..Config::default()
    };
    let mut explorer = Explorer::<128>::new(table, PropertySet::ALL, config).unwrap();
    let all = (0..table.movements().len() as u8).map(|movement| {
        // a whitening begins with the means of its features
        let whitening = table.whitening(movement).unwrap();
        let (means, _) = whitening.as_bytes()[..2 * features].as_chunks();
        let slide: Vec<i16> = means.iter().map(|m| i16::from_le_bytes(*m) + off).collect();
        let (others, bands) = slide.split_at(set.others());
        let properties = match set {
            FeatureSet::Force | FeatureSet::Properties => others,
            FeatureSet::Pressure | FeatureSet::Bands => &[],
        };
        let of = |n| properties.get(n).map(|p: &i16| f32::from(*p) / 1024.0);
        let observation = Observation {
            properties: Properties::new([of(0), of(1), of(2)]),
            bands: bands.iter().copied().collect(),
            pressure: match set {
                FeatureSet::Pressure => Some([others[0], others[1]]),
                _ => None,
            },
            pace: None,
        };
        let action = Action {
            movement,
            property: None,
        };
        explorer.observe(action, &observation).unwrap();
        let visits: Vec<_> = explorer.observed().collect();
        let score = |against| explorer.score_of(&visits, against);
        json!({
            "posterior": explorer.posterior().iter().take(13).collect::<Vec<_>>(),
            "log_odds": explorer.log_odds(),
            "changed": explorer.is_changed(),
            "scores": [score(Against::Drifted), score(Against::Same)],
        })
    });
    all.collect()
}

/// The same but for the last digits of numbers: what is computed may be computed in another order.
fn assert_near(found: &Value, wanted: &Value, what: &str) {
    match (found, wanted) {
        (Value::Number(found), Value::Number(wanted)) => {
            let (found, wanted) = (found.as_f64().unwrap(), wanted.as_f64().unwrap());
            let near = (found - wanted).abs() <= 1e-3 * (1.0 + wanted.abs());
            assert!(near, "{what}: {found}, {wanted}");
        }
        (Value::Array(found), Value::Array(wanted)) => {
            assert_eq!(found.len(), wanted.len(), "{what}");
            let each = found.iter().zip(wanted);
            each.for_each(|(found, wanted)| assert_near(found, wanted, what));
        }
        (Value::Object(found), Value::Object(wanted)) => {
            assert!(found.keys().eq(wanted.keys()), "{what}");
            for (key, found) in found {
                assert_near(found, &wanted[key], &format!("{what}, {key}"));
            }
        }
        _ => assert_eq!(found, wanted, "{what}"),
    }
}

#[test]
fn tables_of_version_4_read_to_the_same_values_and_decide_the_same() {
    for name in [
        "factory",
        "handheld",
        "force",
        "pressure",
        "bands",
        "properties",
        "no-drift",
        "two",
        "paper",
    ] {
        let table = fs::read(golden(&format!("4-{name}.tact"))).unwrap();
        let (mut found, sections) = (values(&table), sections(&table));
        found["sections"] = sections;
        let found = serde_json::to_string(&found).unwrap();
        let wanted = golden(&format!("4-{name}.json"));
        // a new file is written once, and never again
        if !wanted.exists() && std::env::var("TACTUS_GOLDEN").is_ok_and(|set| set == "write") {
            fs::write(
                &wanted,
                found.replace("{\"factory\"", "\n{\"factory\"") + "\n",
            )
            .unwrap();
        }
        let found: Value = serde_json::from_str(&found).unwrap();
        let wanted = json_of(&format!("4-{name}.json"));
        let exact = |value: &Value| {
            let mut value = value.clone();
            value["sections"]["decided"].take();
            value
        };
        assert!(exact(&found) == exact(&wanted), "{name}: {found}");
        assert_near(&found, &wanted, name);
        // limits, and drift in front of them, are in all that can have them
        let limits = &found["sections"]["limits"];
        assert_eq!(limits.is_null(), matches!(name, "two" | "paper"), "{name}");
    }
}

/// The store's sectors, which opening and reading leaves as they are.
struct Sectors(Vec<u8>);

impl ErrorType for Sectors {
    type Error = Infallible;
}

impl ReadNorFlash for Sectors {
    const READ_SIZE: usize = 4;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        bytes.copy_from_slice(&self.0[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Sectors {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = 16 * 1024;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        panic!("erases {from} to {to}")
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        panic!("writes {} bytes to {offset}", bytes.len())
    }
}

#[test]
fn stores_open_and_hold_the_same() {
    for kind in ["fused", "gaussians", "before-4"] {
        let holds = json_of(&format!("store-{kind}.json"));
        let mut image = unpacked(&format!("store-{kind}.bin.gz"));
        // the larger sectors, which nobody used
        image.resize(SECTORS[5].1 as usize * Sectors::ERASE_SIZE, 0xFF);
        let mut store = block_on(Store::open(Sectors(image))).unwrap();
        assert_eq!(store.settings(), Ok(()));
        let calibration = block_on(store.calibration()).unwrap().unwrap();
        assert_eq!(holds["calibration"], hex(&calibration.to_bytes()));
        // its date said that P_DC in the air was measured; its scale is the paper's all the same
        assert!(calibration.air_known && calibration.date != 0, "{kind}");
        assert_eq!(calibration.scale_day(), None, "{kind}");
        let skin = block_on(store.skin()).unwrap();
        assert_eq!(holds["skin"], json!([skin.energy_j(), skin.wear_j()]));
        let stored = store.table().unwrap();
        assert_eq!(holds["offset"], stored.offset);
        assert_eq!(holds["generation"], stored.generation);
        let mut buffer = [0; Sectors::ERASE_SIZE];
        let table = block_on(store.read_table(&mut buffer)).unwrap().unwrap();
        assert_eq!(holds["table"], hex(table.as_bytes()));

        let mut in_force = [0; Sectors::ERASE_SIZE];
        let length = block_on(put_in_force(&table, Some(&mut store), &mut in_force)).unwrap();
        assert_eq!(holds["in_force"], hex(&in_force[..length]));
        let mut learned = Vec::new();
        let mut each = |record| learned.push(frame(&record));
        block_on(store.self_learned(table.lineage(), &mut each)).unwrap();
        assert_eq!(holds["self_taught"], json!(learned));
        let trained = holds["trained"].as_array().unwrap();
        assert!(trained.len() >= 3);
        for record in trained {
            let movement: Movement = serde_json::from_value(record[1].clone()).unwrap();
            let table = record[2].as_u64().map(|crc| crc as u32);
            let found =
                block_on(store.training_record(record[0].as_str().unwrap(), movement, table));
            assert_eq!(record[3], frame(&found.unwrap().unwrap()), "{record}");
        }
    }
}

/// Whether `tactus device log` is content with a log, and what it says.
fn log(command: &str, name: &str) -> (bool, String) {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join(name);
    fs::write(&log, unpacked(&format!("{name}.gz"))).unwrap();
    let mut tactus = Command::new(env!("CARGO_BIN_EXE_tactus"));
    let output = tactus.args(["device", "log", command]).arg(&log).output();
    let output = output.unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.success(), String::from_utf8(said).unwrap())
}

#[test]
fn logs_of_explorations_replay_to_the_same_decisions() {
    for (name, texture) in [
        ("identify.jsonl", "Polyurethane rubber"),
        ("paper.jsonl", "Burlap"),
    ] {
        let (same, said) = log("replay", name);
        assert!(same, "{name}: {said}");
        // the last line counts choices, slides, posteriors and answers
        let last = said.lines().last().unwrap_or_default();
        assert_eq!(
            last.matches(": 1 ").count() + last.matches(", 1 ").count(),
            4,
            "{said}"
        );
        // expected uncertainties of older firmware: its paper's confusion had an exponential in place of a table
        let off = last.rsplit("largest difference ").next().unwrap();
        let off: f64 = off.trim_end_matches('.').parse().unwrap();
        assert!(off <= 1e-4, "{name}: {said}");
        let (shown, said) = log("show", name);
        assert!(shown && said.contains(texture), "{name}: {said}");
    }
}

#[test]
fn logs_of_teaching_are_read() {
    // every line was understood: there is only nothing to replay
    let (_, said) = log("replay", "learning.jsonl");
    assert!(said.contains("no exploration in this log"), "{said}");
}
