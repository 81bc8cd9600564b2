//! Tables, stores, messages, logs and recordings of version 1: each has the bytes of its golden file, and any other
//! version is refused with a word on what to do. `docs/src/wire.md` says when golden files may be written anew, by
//! `TACTUS_GOLDEN=write`.

use std::fmt::Debug;
use std::fs;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};

use embassy_futures::block_on;
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Value, json};
use tactus_core::dsp::Plan;
use tactus_core::features::{
    FeatureSet, MAX_FEATURES, Movement, Properties, Property, PropertySet,
};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::skin::SkinCare;
use tactus_core::sensor::FingerCode;
use tactus_core::sensor::pressure::Calibration;
use tactus_core::store::{SelfLearnedRecord, Store, TrainingRecord};
use tactus_core::table::{
    self, Action, Change, Contents, Drift, Experience, Gaussian, Limits, Name, Pace, Population,
    Sections, Shorter, Slope, Slopes, Table, TableError, Tail, TrainingStats, Whitened, Whitening,
};
use tactus_core::wire::{Command, Event, Failure, MAX_FRAME, PROTOCOL, Report, Request};
use tactus_core::wire::{decode, encode};
use tactus_lab::data::recording::Labels;
use tactus_lab::data::recordings::{RecordingSet, files_of};
use tactus_lab::sim::flash::{RamFlash, SECTOR};
use tactus_link::follow::Follower;
use tactus_link::log::{self, Line, TableParts};

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("golden")
        .join(name)
}

fn writes() -> bool {
    std::env::var("TACTUS_GOLDEN").as_deref() == Ok("write")
}

/// The bytes of a golden file, unpacked where its name ends in "gz".
fn there(name: &str) -> Vec<u8> {
    let bytes = fs::read(golden(name)).unwrap_or_else(|why| panic!("{name}: {why}"));
    if !name.ends_with("gz") {
        return bytes;
    }
    let mut unpacked = Vec::new();
    GzDecoder::new(&bytes[..])
        .read_to_end(&mut unpacked)
        .unwrap();
    unpacked
}

/// Asserts that a golden file has these bytes, or writes it.
fn assert_golden(name: &str, bytes: &[u8]) {
    if writes() && name.ends_with("gz") {
        let file = fs::File::create(golden(name)).unwrap();
        let mut packed = GzEncoder::new(file, Compression::best());
        packed.write_all(bytes).unwrap();
        packed.finish().unwrap();
    } else if writes() {
        fs::write(golden(name), bytes).unwrap();
    }
    let there = there(name);
    let differs = there.iter().zip(bytes).position(|(a, b)| a != b);
    assert_eq!((differs, bytes.len()), (None, there.len()), "{name}");
}

const TEXTURES: [&str; 3] = ["felt", "cotton, washed", "Böse Überraschung"];
const MOVEMENTS: [Movement; 2] = [Movement::FOR_ROUGHNESS, Movement::FOR_FINENESS];
const FEATURES: usize = 4;
const DRIFT: Drift = Drift {
    bands: 0.1,
    traction: 0.04,
};
const FINGER: (FingerCode, u32) = (FingerCode::MEMS, 20_261_121);

/// A number of a made-up table, 0 to 199.
fn number(of: usize) -> i16 {
    (of * 89 % 200) as i16
}

fn whitenings(salt: usize) -> Vec<Whitening> {
    let of_movement = |movement: usize| {
        let salt = salt + 10 * movement;
        let means = (0..FEATURES).flat_map(|f| (40 * number(f + salt)).to_le_bytes());
        let places = (0..FEATURES).map(|f| 9 + f as u8);
        let weights = (0..FEATURES * FEATURES).flat_map(|at| {
            let own = if at % (FEATURES + 1) == 0 { 9000 } else { 0 };
            (own + number(at + salt)).to_le_bytes()
        });
        let bytes: Vec<u8> = means.chain(places).chain(weights).collect();
        Whitening::read(&bytes, FEATURES).unwrap()
    };
    (0..MOVEMENTS.len()).map(of_movement).collect()
}

fn learned(texture: usize, salt: usize) -> Vec<Whitened> {
    let of_movement = |movement: usize| {
        let mut mean = [0; MAX_FEATURES];
        for (at, mean) in mean.iter_mut().take(FEATURES).enumerate() {
            *mean = 20 * number(at + 7 * texture + 31 * movement + salt) - 1500;
        }
        let slides = (texture + movement + 3) as u8;
        Whitened { slides, mean }
    };
    (0..MOVEMENTS.len()).map(of_movement).collect()
}

fn limits() -> Limits {
    let tail = |at: u8| Tail {
        begin: f32::from(at) - 4.5,
        excess: 0.25 * f32::from(at),
    };
    Limits {
        false_alarm: 0.02,
        drifted: [1, 2, 3].map(tail),
        same: [4, 5, 6].map(tail),
    }
}

fn paces() -> Vec<Pace> {
    let pace = |movement: usize| {
        let mut pooled = Slope::default();
        pooled[..2].copy_from_slice(&[number(movement), -number(movement + 5)]);
        Pace {
            mean: -17,
            variance: 0.0625,
            pooled,
        }
    };
    (0..MOVEMENTS.len()).map(pace).collect()
}

fn slope(texture: usize, movement: usize) -> Slope {
    let mut slope = Slope::default();
    slope[..FEATURES].copy_from_slice(&[1, 2, 3, 4].map(|n| number(n + texture) - movement as i16));
    slope
}

/// The populations of the golden table: how they are computed is not the format's.
fn populations() -> Vec<Population> {
    if writes() {
        let known: Vec<_> = (0..TEXTURES.len()).map(|t| learned(t, 0)).collect();
        let of_movement = |movement: usize| {
            let means = known.iter().map(|row| &row[movement]);
            Population::new(FEATURES, means.map(|cell| (cell.slides, &cell.mean[..]))).unwrap()
        };
        return (0..MOVEMENTS.len()).map(of_movement).collect();
    }
    let bytes = there("fused.tact");
    let table = Table::read(&bytes).unwrap();
    table.populations().unwrap().into_iter().collect()
}

/// A fused table of all that a table may have beside lengths and a finger; these have a table of their own.
fn fused(salt: usize, slopes: bool) -> Vec<u8> {
    let known: Vec<_> = (0..TEXTURES.len()).map(|t| learned(t, salt)).collect();
    let movements: Vec<_> = MOVEMENTS.into_iter().zip(whitenings(salt)).collect();
    let textures = TEXTURES.into_iter().zip(known.iter().map(Vec::as_slice));
    let mut plain = [0; 4096];
    let plain = table::encode_fused(&mut plain, FeatureSet::Force, &movements, textures).unwrap();
    let mut drifts = [[0.0; table::PAIRS]; MOVEMENTS.len()];
    drifts[0][..2].copy_from_slice(&[0.5, 0.125]);
    drifts[1][..2].copy_from_slice(&[1.5, 0.0]);
    let populations = populations();
    let (paces, of_textures) = (paces(), (0..TEXTURES.len()));
    let of_textures: Vec<Slope> = of_textures
        .flat_map(|t| (0..MOVEMENTS.len()).map(move |m| slope(t, m)))
        .collect();
    let sections = Sections {
        drift: (DRIFT, &drifts),
        novelty: Some((limits(), &populations)),
        slopes: slopes.then_some(Slopes {
            paces: &paces,
            slopes: &of_textures,
        }),
    };
    let mut bytes = vec![0; 1 << 16];
    let table = table::with_sections(&mut bytes, &plain, &sections).unwrap();
    table.as_bytes().to_vec()
}

/// A fused table of a finger, whose samples were moved or not, with what half a second of a slide says.
fn lengths() -> Vec<u8> {
    let (whole, first) = (fused(0, false), fused(40, false));
    let [whole, first] = [&whole, &first].map(|bytes| Table::read(bytes).unwrap());
    let shorter = [Shorter {
        ms: 500,
        table: first,
        movements: 0b01,
    }];
    let mut buffers = [(); 3].map(|()| vec![0; 2 * whole.as_bytes().len()]);
    let [lengths, moved, named] = &mut buffers;
    let lengths = table::with_lengths(lengths, &whole, &shorter).unwrap();
    let moved = table::with_moved(moved, &lengths, |texture| {
        [None, Some(false), Some(true)][usize::from(texture)]
    });
    let (finger, day) = FINGER;
    let named = table::with_finger(named, &moved.unwrap(), finger, day, "").unwrap();
    named.as_bytes().to_vec()
}

fn gaussians() -> Vec<u8> {
    let measured: PropertySet = [Property::Traction, Property::Fineness]
        .into_iter()
        .collect();
    let experience = |texture: usize, movement: usize| {
        let mut experience = Experience::default();
        for trial in 0..4_u8 {
            let x = 0.5 * f32::from(trial) + texture as f32 - movement as f32;
            let trial = Properties::new([Some(0.25 * x), None, Some(2.0 + x)]);
            experience.learn(measured, &trial).unwrap();
        }
        experience
    };
    let known: Vec<Vec<Experience>> = (0..TEXTURES.len())
        .map(|texture| {
            (0..MOVEMENTS.len())
                .map(|m| experience(texture, m))
                .collect()
        })
        .collect();
    let textures = TEXTURES.into_iter().zip(&known);
    let textures = textures.map(|(name, known)| (name, &known[..]));
    let mut bytes = [0; 1024];
    let table = table::encode(&mut bytes, measured, &MOVEMENTS, textures);
    table.unwrap().as_bytes().to_vec()
}

fn assert_fused(table: &Table<'_>) {
    assert_eq!(
        table.contents(),
        Contents::Fused(FeatureSet::Force, FEATURES as u8)
    );
    for (movement, whitening) in (0..).zip(whitenings(0)) {
        assert_eq!(table.whitening(movement), Some(whitening));
        for (texture, number) in (0..).zip(0..TEXTURES.len()) {
            let known = learned(number, 0)[usize::from(movement)];
            assert_eq!(table.whitened(texture, movement), known);
        }
    }
    assert_eq!(
        (table.drift(), table.limits()),
        (Some(DRIFT), Some(limits()))
    );
}

#[test]
fn tables_have_the_golden_bytes() {
    let named = |table: &Table<'_>| {
        assert!(table.names().eq(TEXTURES) && table.movements().eq(MOVEMENTS));
    };
    let bytes = fused(0, false);
    assert_golden("fused.tact", &bytes);
    let table = Table::read(&bytes).unwrap();
    named(&table);
    assert_fused(&table);
    assert_eq!(
        (table.finger(), table.calibrated()),
        (FingerCode::BIOTAC, 0)
    );

    let bytes = fused(0, true);
    assert_golden("slopes.tact", &bytes);
    let table = Table::read(&bytes).unwrap();
    named(&table);
    assert_fused(&table);
    for (movement, pace) in (0..).zip(paces()) {
        assert_eq!(table.slope(None, movement), pace.pooled);
        assert_eq!(table.slope(Some(2), movement), slope(2, movement.into()));
        assert_eq!(
            table.pace_of(movement, &Properties::new([None; 3]).into()),
            pace.mean
        );
    }

    let bytes = lengths();
    assert_golden("lengths.tact", &bytes);
    let table = Table::read(&bytes).unwrap();
    named(&table);
    assert_fused(&table);
    assert!(table.lengths_ms().eq([500]));
    assert_eq!(
        [0, 1, 2].map(|t| table.moved(t)),
        [None, Some(false), Some(true)]
    );
    assert_eq!((table.finger(), table.calibrated()), FINGER);

    let bytes = gaussians();
    assert_golden("gaussians.tact", &bytes);
    let table = Table::read(&bytes).unwrap();
    named(&table);
    let found = table
        .gaussian(2, Action::of(1, Property::Fineness))
        .unwrap();
    let Gaussian { mean, sd } = found;
    assert!(
        (mean - 3.75).abs() < 0.01 && (sd - 0.6455).abs() < 0.01,
        "{found:?}"
    );
    assert_eq!(table.gaussian(2, Action::of(1, Property::Roughness)), None);
    assert_eq!((table.trials(2, 1), table.tally(2).factory), (4, 8));
}

#[test]
fn tables_of_other_versions_are_refused() {
    for good in [gaussians(), lengths(), fused(0, true)] {
        for version in (0..=300).filter(|version| *version != table::VERSION) {
            let mut bytes = good.clone();
            bytes[4..6].copy_from_slice(&version.to_le_bytes());
            let end = bytes.len() - 4;
            let crc = crc32(&bytes[..end]);
            bytes[end..].copy_from_slice(&crc);
            let why = Table::read(&bytes).unwrap_err();
            assert_eq!(why, TableError::Version(version));
            assert_eq!(
                why.to_string(),
                format!(
                    "version {version}, and this program reads version 1: learn the table anew, or use the program \
                     that wrote it"
                )
            );
        }
    }
}

fn crc32(bytes: &[u8]) -> [u8; 4] {
    let mut crc = flate2::Crc::new();
    crc.update(bytes);
    crc.sum().to_le_bytes()
}

/// The tables of the golden store: one of the factory, and the one that a user made of it.
fn stored_tables() -> [Vec<u8>; 2] {
    let older = fused(0, false);
    let mut newer = vec![0; 2 * older.len()];
    let change = Change::Rename {
        texture: 0,
        name: "renamed",
    };
    let newer = table::amend(&mut newer, &Table::read(&older).unwrap(), change);
    let newer = newer.unwrap().as_bytes().to_vec();
    [older, newer]
}

fn calibration() -> RigCalibration {
    RigCalibration {
        pressure: Calibration {
            force_mn_per_count: 11.25,
            pac_pa_per_count: 0.968_75,
            ..Calibration::PAPER
        },
        unloaded_a: (0.037, 0.001),
        newton_per_ampere: 16.5,
        date: 20_261_121,
        air_known: false,
        turned: 1,
        serial: *b"BT-0000000000001",
    }
}

fn training() -> TrainingRecord {
    TrainingRecord {
        name: Name::try_from("unfinished").unwrap(),
        movement: MOVEMENTS[1],
        table: Some(7),
        stats: TrainingStats::Fused(learned(1, 3)[0]),
    }
}

fn self_learned(table: &Table<'_>) -> SelfLearnedRecord {
    SelfLearnedRecord {
        lineage: table.lineage(),
        number: table.number(2),
        movements: [(1, 2, learned(2, 5)[1])].into_iter().collect(),
    }
}

/// Stores one of everything.
async fn store() -> RamFlash {
    let mut store = Store::open(RamFlash::<SECTOR>::blank()).await.unwrap();
    let mut buffer = vec![0; SECTOR];
    for table in stored_tables() {
        buffer[..table.len()].copy_from_slice(&table);
        store.replace_table(&mut buffer, table.len()).await.unwrap();
    }
    let [_, newer] = stored_tables();
    let learned = self_learned(&Table::read(&newer).unwrap());
    store.set_calibration(&calibration()).await.unwrap();
    store
        .set_skin(&SkinCare::after(1234.5, 67.25))
        .await
        .unwrap();
    store.set_false_alarm(Some(0.05)).await.unwrap();
    store.set_high_force(true).await.unwrap();
    store.set_training_record(&training()).await.unwrap();
    store.set_self_learned(&learned).await.unwrap();
    store.close()
}

#[test]
fn a_store_has_the_golden_bytes_and_holds_what_was_stored() {
    let stored = block_on(store());
    assert_golden("store.bin.gz", &stored.bytes);
    block_on(async {
        let mut store = Store::open(stored).await.unwrap();
        store.mend().await.unwrap();
        assert_eq!((store.settings(), store.damaged_table()), (Ok(()), None));
        let mut buffer = vec![0; SECTOR];
        let [_, newer] = stored_tables();
        let table = store.read_table(&mut buffer).await.unwrap().unwrap();
        assert_eq!(table.as_bytes(), newer);
        assert_eq!(store.calibration().await, Ok(Some(calibration())));
        let skin = store.skin().await.unwrap();
        assert_eq!((skin.energy_j(), skin.wear_j()), (1234.5, 67.25));
        assert_eq!(store.false_alarm().await, Ok(Some(0.05)));
        assert_eq!(store.high_force().await, Ok(true));
        let TrainingRecord {
            name,
            movement,
            table: of,
            stats,
        } = training();
        let found = store.training_record(&name, movement, of).await;
        assert_eq!(found, Ok(Some(stats)));
        let mut learned = Vec::new();
        let mut each = |record| learned.push(record);
        store
            .self_learned(table.lineage(), &mut each)
            .await
            .unwrap();
        assert_eq!(learned, [self_learned(&table)]);
    });
}

/// The settings of another version: `store::tests::damaged_settings_are_reported_and_erased_without_the_tables`.
#[test]
fn a_table_slot_of_another_version_is_told_and_the_table_before_it_is_in_force() {
    let mut bytes = there("store.bin.gz");
    let newest = block_on(Store::open(RamFlash::<SECTOR>::of(bytes.clone())));
    let newest = newest.unwrap().table().unwrap();
    let header = newest.offset as usize - 32;
    bytes[header + 4..header + 8].copy_from_slice(&2_u32.to_le_bytes());
    let crc = crc32(&bytes[header..header + 20]);
    bytes[header + 20..header + 24].copy_from_slice(&crc);
    let store = block_on(Store::open(RamFlash::<SECTOR>::of(bytes))).unwrap();
    assert_eq!(store.damaged_table(), Some(TableError::Version(2)));
    assert_eq!(store.table().unwrap().generation, newest.generation - 1);
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// Asserts that each message has the frame in its line, and that the frame is read as the message.
fn assert_frames<M: Serialize + DeserializeOwned + PartialEq + Debug>(name: &str, wanted: usize) {
    let (mut lines, mut read) = (String::new(), 0);
    for line in String::from_utf8(there(name)).unwrap().lines() {
        let line: Value = serde_json::from_str(line).unwrap();
        let message: M = serde_json::from_value(line["message"].clone())
            .unwrap_or_else(|why| panic!("{}: {why}", line["message"]));
        let mut buffer = [0; MAX_FRAME + 1];
        let frame = encode(&message, &mut buffer).unwrap();
        lines += &format!(
            "{}\n",
            json!({"frame": hex(frame), "message": line["message"]})
        );
        let mut frame = frame.to_vec();
        assert_eq!(frame.pop(), Some(0));
        assert_eq!(decode::<M>(&mut frame), Ok(message));
        read += 1;
    }
    assert_golden(name, lines.as_bytes());
    assert_eq!(read, wanted);
}

/// A probe of another version: `link::tests::a_restart_is_noticed`.
#[test]
fn messages_have_the_golden_frames() {
    assert_frames::<Request>("requests.jsonl", 38);
    assert_frames::<Report>("reports.jsonl", 85);
    assert_frames::<Failure>("failures.jsonl", 150);
}

/// The table of a log, and what follows on the request to identify.
fn explored(log: &[u8]) -> (Vec<u8>, Vec<Command>, Vec<Event>) {
    let (mut parts, mut table) = (TableParts::default(), Vec::new());
    let (mut asked, mut told) = (Vec::new(), Vec::new());
    log::read(log, |line| match line {
        Line::Session { .. } => {}
        Line::Command(command) => asked.push(command.into_owned()),
        Line::Report(report) => match report.into_owned().event {
            Event::TablePart {
                offset,
                length,
                bytes,
            } => table.extend(parts.take(offset, length, &bytes).into_iter().flatten()),
            event => told.push(event),
        },
    })
    .unwrap();
    (table, asked, told)
}

#[test]
fn logs_are_read_and_replay_to_the_same_decisions() {
    for name in ["identify.jsonl.gz", "paper.jsonl.gz"] {
        let (table, asked, told) = explored(&there(name));
        let table = Table::read(&table).unwrap();
        let identify = asked.iter().find_map(|command| match command {
            Command::Identify(identify) => Some(identify),
            _ => None,
        });
        let plan = Plan::new();
        let mut follower =
            Follower::new(table, PropertySet::ALL, identify.unwrap(), &plan).unwrap();
        let explores = told
            .iter()
            .skip_while(|event| !matches!(event, Event::Chosen { .. }));
        for event in explores {
            follower.hear(event).unwrap();
        }
        let agreement = follower.agreement();
        assert!(agreement.agrees(), "{name}: {agreement:?}");
        assert_eq!(
            (agreement.slides, agreement.choices, agreement.verdicts),
            (1, 1, 1)
        );
    }
    let (_, asked, told) = explored(&there("learning.jsonl.gz"));
    for wanted in [
        |c: &Command| matches!(c, Command::Label(_)),
        |c: &Command| matches!(c, Command::Train(_)),
        |c: &Command| matches!(c, Command::Rename { .. }),
        |c: &Command| matches!(c, Command::Forget(_)),
    ] {
        assert!(asked.iter().any(wanted));
    }
    let slides = told
        .iter()
        .filter(|event| matches!(event, Event::TrainingSlide { .. }));
    assert_eq!(slides.count(), 3);
}

#[test]
fn a_log_of_other_versions_is_refused() {
    let text = String::from_utf8(there("identify.jsonl.gz")).unwrap();
    for version in (0..=u8::MAX).filter(|version| *version != PROTOCOL) {
        let other = text.replace("\"protocol\":1,", &format!("\"protocol\":{version},"));
        let why = log::read(other.as_bytes(), |_| ()).unwrap_err();
        assert_eq!(
            why.to_string(),
            format!(
                "written with version {version} of the messages, this program reads version 1: replay it with the \
                 tactus that wrote it"
            )
        );
    }
}

/// The version of a manifest: `recordings::tests::own_manifest_errors_name_line_and_column`.
#[test]
fn recordings_are_written_again_with_the_same_bytes() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../host-tools/recordings/simulated");
    let set = RecordingSet::open(&folder).unwrap();
    let manifest = fs::read_to_string(folder.join("manifest.csv")).unwrap();
    for (at, texture) in set.textures().iter().enumerate() {
        let labels = set.slides(at).iter().map(|key| key.labels.clone());
        let slides: Vec<(_, Labels)> = set
            .load_texture(at)
            .unwrap()
            .into_iter()
            .zip(labels)
            .collect();
        for (name, bytes) in files_of(texture, &slides).unwrap() {
            if name == "manifest.csv" {
                let written = String::from_utf8(bytes).unwrap();
                assert_eq!(written.lines().count(), slides.len() + 1);
                for line in written.lines() {
                    assert!(manifest.lines().any(|there| there == line), "{line}");
                }
            } else {
                assert!(bytes == fs::read(folder.join(&name)).unwrap(), "{name}");
            }
        }
    }
}
