//! `tactus device table`.

use tactus_core::sensor::FingerName;

use super::*;

#[test]
fn a_table_is_checked_pushed_and_pulled() {
    let (at, asked) = probe(1000);
    let temp = tempfile::tempdir().unwrap();
    let [pulled, other, bad] = ["pulled", "other", "bad"].map(|name| temp.path().join(name));
    assert_says(
        &printed(&["table", "pull", "--port", &at, path(&pulled)]),
        &["3 textures"],
    );
    assert_eq!(fs::read(&pulled).unwrap(), known().1);
    assert_says(
        &printed(&["table", "show", "--port", &at]),
        &["came with the firmware", "movement 3: "],
    );
    let observed = [0.4f32, 0.6].map(|x| {
        let properties =
            tactus_core::features::Properties::new([Some(x), Some(3.0 + x), Some(5.0 + x)]);
        tactus_core::features::Observation::from(properties)
    });
    let table = tactus_lab::eval::learn::learn(
        Method::Paper,
        None,
        &["a".to_owned(), "b".to_owned()],
        &[Movement::FOR_TRACTION],
        &vec![vec![observed.to_vec()]; 2],
    );
    fs::write(&other, table.unwrap()).unwrap();
    while asked.try_recv().is_ok() {}
    assert_says(
        &printed(&["table", "push", "--port", &at, path(&other)]),
        &["the probe uses it now: 2 textures"],
    );
    assert!(
        asked
            .try_iter()
            .any(|command| command == wire::Command::CommitTable)
    );
    // what is damaged, or of another finger, is never begun
    let good = fs::read(&other).unwrap();
    let mut bytes = good.clone();
    bytes[40] ^= 1;
    fs::write(&bad, bytes).unwrap();
    assert_says(
        &complaint(&["table", "push", "--port", &at, path(&bad)]),
        &["checksum"],
    );
    let mems = tactus_lab::eval::learn::name_finger(&good, FingerCode::MEMS, 20_261_124);
    fs::write(&bad, mems.unwrap()).unwrap();
    assert_says(
        &complaint(&["table", "push", "--port", &at, path(&bad)]),
        &[
            "learned with the finger mems, but the finger here is biotac",
            "Use a table that was learned with biotac",
        ],
    );
    assert!(
        asked
            .try_iter()
            .all(|command| !matches!(command, wire::Command::BeginTable(_)))
    );
    // what was pushed is not replaced without a question, and nobody is there to answer
    let changes = |asked: &mpsc::Receiver<wire::Command>| {
        let changes = |command: &wire::Command| {
            use wire::Command::{BeginTable, FactoryTable, Forget};
            matches!(command, BeginTable(_) | FactoryTable | Forget(_))
        };
        asked.try_iter().filter(changes).count()
    };
    let kept = temp.path().join("kept");
    let keep = ["--port", &at, "--backup", path(&kept)];
    for command in [
        &["table", "factory"][..],
        &["table", "push", path(&pulled)],
        &["forget", "--name", "a"],
        &["forget", "--self-learned"],
    ] {
        let _ = fs::remove_file(&kept);
        assert_says(
            &complaint(&[command, &keep].concat()),
            &["nothing was changed", "--yes"],
        );
        assert_eq!(changes(&asked), 0, "{command:?}");
        assert_eq!(fs::read(&kept).unwrap(), fs::read(&other).unwrap());
    }
    let said = printed(&[&["table", "factory", "--yes"][..], &keep].concat());
    assert_says(
        &said,
        &[
            "No longer known: a, b.",
            "is kept: `tactus device table push",
            "3 textures",
        ],
    );
    // the firmware's own table is never lost, so that nobody is asked; what was kept is in use again
    assert_says(
        &printed(&["table", "push", "--port", &at, path(&kept)]),
        &["the probe uses it now: 2 textures"],
    );
}

/// A table of 24 movements does not fit into the sectors of the shorter ones, and works as they do.
#[test]
fn a_table_that_is_longer_than_a_small_sector_is_used_and_added_to() {
    let (at, asked) = probe(1000);
    let temp = tempfile::tempdir().unwrap();
    let [long, pulled, slides] = ["long", "pulled", "slides"].map(|name| temp.path().join(name));
    let movements: Vec<Movement> = Movement::grid().take(24).collect();
    let (finger, fused) = (FingerName::Biotac, (Method::Fused, None));
    let table = world().learn_with(finger, &movements, fused, known().0, || ());
    let table = table.unwrap();
    assert!(
        table.len() > SECTOR && table.len() < TABLE,
        "{}",
        table.len()
    );
    fs::write(&long, &table).unwrap();
    let done = |arguments: &[&str]| {
        let at = ["--port", &at, "--format", "json"];
        object(&[arguments, &at].concat(), 0)
    };
    done(&["table", "push", path(&long)]);
    done(&["table", "pull", path(&pulled)]);
    assert_eq!(fs::read(&pulled).unwrap(), table);
    let found = done(&["identify", "--seed", "7"]);
    assert_eq!(
        found["verdict"]["texture"],
        texture_name(UNKNOWN),
        "{found}"
    );
    done(&["teach", "my own"]);
    done(&["table", "pull", path(&pulled)]);
    let taught = fs::read(&pulled).unwrap();
    assert!(taught.len() > table.len());
    let taught = Table::read(&taught).unwrap();
    assert_eq!((taught.textures(), taught.movements().len()), (4, 24));
    assert!(taught.find("my own").is_some());
    // one that fits nowhere is refused by the probe, and what it has is kept
    while asked.try_recv().is_ok() {}
    let too_long = longer_than(&table, TABLE);
    fs::write(&slides, &too_long).unwrap();
    let said = complaint(&["table", "push", "--yes", path(&slides), "--port", &at]);
    assert_says(
        &said,
        &[&format!(
            "the table takes {} bytes, and there is room for {TABLE}",
            too_long.len()
        )],
    );
    let commits = |command| command == wire::Command::CommitTable;
    assert!(!asked.try_iter().any(commits));
    let kept = done(&["table", "show"]);
    assert_eq!(kept["textures"].as_array().unwrap().len(), 4);
}

/// A good table of more than `length` bytes: with a section that nobody knows.
fn longer_than(table: &[u8], length: usize) -> Vec<u8> {
    let mut bytes = table[..table.len() - 4].to_vec();
    for kind in 900u16.. {
        if bytes.len() + 4 > length {
            break;
        }
        bytes.extend(kind.to_le_bytes());
        bytes.extend(16_000u16.to_le_bytes());
        bytes.resize(bytes.len() + 16_000, 0);
    }
    with_checksum(bytes)
}

/// The length in the header and the checksum at the end of a table of these bytes.
fn with_checksum(mut bytes: Vec<u8>) -> Vec<u8> {
    let length = bytes.len() as u32 + 4;
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    let mut crc = flate2::Crc::new();
    crc.update(&bytes);
    bytes.extend(crc.sum().to_le_bytes());
    bytes
}

/// A table whose checksum is right, and whose limits are not.
fn with_limits(table: &[u8], first: f32) -> Vec<u8> {
    let limits = Table::read(table).unwrap().limits().unwrap();
    let begin = limits.drifted[0].begin.to_le_bytes();
    let mut places = (0..table.len()).filter(|&at| table[at..].starts_with(&begin));
    let at = places.next_back().unwrap();
    let mut bytes = table.to_vec();
    bytes[at..at + 4].copy_from_slice(&first.to_le_bytes());
    bytes.truncate(bytes.len() - 4);
    with_checksum(bytes)
}

#[test]
fn a_table_with_damaged_limits_is_refused_and_nothing_is_lost() {
    let (at, asked) = probe(1000);
    let temp = tempfile::tempdir().unwrap();
    let [before, after, file] = ["before", "after", "file"].map(|name| temp.path().join(name));
    // something that would be lost
    printed(&["rename", "--port", &at, "Burlap", "my own"]);
    printed(&["table", "pull", "--port", &at, path(&before)]);
    while asked.try_recv().is_ok() {}
    let good = &known().1;
    for damage in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        fs::write(&file, with_limits(good, damage)).unwrap();
        for push in [&["--yes"][..], &[]] {
            let command = ["table", "push", path(&file), "--port", &at];
            let said = complaint(&[&command, push].concat());
            assert_says(
                &said,
                &[
                    path(&file),
                    "its limits of new and changed textures are damaged",
                ],
            );
        }
        assert_eq!(asked.try_iter().count(), 0, "the probe was asked nothing");
    }
    printed(&["table", "pull", "--port", &at, path(&after)]);
    let [before, after] = [before, after].map(|file| fs::read(file).unwrap());
    assert_eq!(before, after);
    assert!(Table::read(&after).unwrap().find("my own").is_some());
    // it was the limits: the same table with other ones is taken
    let limits = Table::read(good).unwrap().limits().unwrap();
    let other = with_limits(good, limits.drifted[0].begin + 0.5);
    assert_ne!(&other, good);
    fs::write(&file, other).unwrap();
    let command = ["table", "push", path(&file), "--port", &at, "--yes"];
    assert_says(&printed(&command), &["the probe uses it now"]);
}
