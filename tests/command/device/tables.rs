//! `tactus device table` and `tactus device train`.

use std::fs;

use tactus_core::explorer::Method;
use tactus_core::features::{Movement, Observation, Properties};
use tactus_core::sensor::FingerCode;
use tactus_core::table::Table;
use tactus_core::wire::Command;
use tactus_lab::sim::collection::texture_name;
use tactus_lab::sim::flash::{SECTOR, TABLE};

use super::software::{Bench, UNKNOWN, known, world};
use crate::assert_says;

#[test]
fn a_table_is_checked_pushed_and_pulled() {
    let bench = Bench::new(1000);
    assert_says(&bench.printed("table pull pulled"), &["3 textures"]);
    assert_eq!(bench.at.read("pulled"), known().1);
    let shown = bench.printed("table show");
    assert_says(&shown, &["came with the firmware", "movement 3: "]);
    let observed = [0.4f32, 0.6]
        .map(|x| Observation::from(Properties::new([Some(x), Some(3.0 + x), Some(5.0 + x)])));
    let names = ["a", "b"].map(str::to_owned);
    let slides = vec![vec![observed.to_vec()]; 2];
    let movements = [Movement::FOR_TRACTION];
    let other = tactus_lab::eval::learn::learn(Method::Paper, None, &names, &movements, &slides);
    let other = other.unwrap();
    bench.at.write("other", &other);
    bench.asked();
    assert_says(
        &bench.printed("table push other"),
        &["the probe uses it now: 2 textures"],
    );
    assert!(bench.asked().contains(&Command::CommitTable));
    // what is damaged, or of another finger, is never begun
    let mut damaged = other.clone();
    damaged[40] ^= 1;
    bench.at.write("bad", damaged);
    assert_says(&bench.error("table push bad"), &["checksum"]);
    let mems = tactus_lab::eval::learn::name_finger(&other, FingerCode::MEMS, 20_261_124, "");
    bench.at.write("bad", mems.unwrap());
    let said = bench.error("table push bad");
    assert_says(
        &said,
        &["learned with the finger mems, but the finger here is biotac"],
    );
    assert_says(&said, &["Use a table that was learned with biotac"]);
    let begins = |command: &Command| matches!(command, Command::BeginTable(_));
    assert!(!bench.asked().iter().any(begins));
    // what was pushed is not replaced without a question, and nobody is there to answer
    let changes = |command: &Command| {
        matches!(
            command,
            Command::BeginTable(_) | Command::FactoryTable | Command::Forget(_)
        )
    };
    for line in [
        "table factory",
        "table push pulled",
        "forget --name a",
        "forget --self-learned",
    ] {
        let _ = fs::remove_file(bench.at.path("kept"));
        let said = bench.error(&format!("{line} --backup kept"));
        assert_says(&said, &["nothing was changed", "--yes"]);
        assert!(!bench.asked().iter().any(changes), "{line}");
        assert_eq!(bench.at.read("kept"), other);
    }
    // no file of a user is in the way of a copy, and a copy can be read again; else nothing is changed
    bench.at.write("mine", "mine");
    for (line, why) in [
        ("forget --name a --yes --backup mine", "--force"),
        (
            "table factory --yes --backup /dev/null",
            "another file with --backup",
        ),
        ("table factory --yes --backup -", "name a file"),
        ("table factory --yes --backup no/such/kept", "no/such/kept"),
        ("table pull mine", "--force"),
    ] {
        assert_says(&bench.error(line), &[why]);
        assert!(!bench.asked().iter().any(changes), "{line}");
        assert_eq!(bench.at.read("mine"), b"mine");
    }
    // of its own name, by the SHA-256 of its bytes, there is one copy of one table
    let hash = tactus_lab::data::recordings::files::sha256(&other);
    let said = bench.error("table factory");
    let name = format!("tactus/backups/table-{hash}.tact");
    assert_says(&said, &["nothing was changed"]);
    let copy = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    assert_eq!(fs::read(&copy).unwrap(), other);
    fs::write(&copy, "damaged").unwrap();
    let why = bench.error("table factory --yes");
    assert_says(
        &why,
        &["is not the table that it is named for", "move it away"],
    );
    assert!(!bench.asked().iter().any(changes));
    fs::remove_file(&copy).unwrap();
    let said = bench.printed("table factory --yes --backup kept");
    assert_says(
        &said,
        &[
            "No longer known: a, b.",
            "is kept: `tactus device table push",
            "3 textures",
        ],
    );
    let why = bench.error("table push kept --yes --backup kept --force");
    assert_says(&why, &["kept: is read by this command"]);
    // the firmware's own table is never lost, so that nobody is asked; what was kept is in use again
    assert_says(
        &bench.printed("table push kept"),
        &["the probe uses it now: 2 textures"],
    );
}

/// A file notes which slides it was learned from; a probe gets the table without, and what comes back says so.
#[test]
fn a_probe_gets_no_note_of_slides() {
    let bench = Bench::new(1000);
    bench
        .at
        .printed("learn --recordings SIMULATED --train-slides 2 --out noted");
    let noted = bench.at.read("noted");
    let table = Table::read(&noted).unwrap();
    // the hash of a slide, and those of eight of its windows
    let hashes = 6 * 3 * 2 * (1 + 8);
    assert_eq!(table.learned_slides().hashes.len(), hashes);
    bench.printed("table push noted --yes");
    bench.printed("table pull pulled");
    let pulled = bench.at.read("pulled");
    assert_eq!(noted.len() - pulled.len(), 4 + 1 + 6 * hashes);
    assert_eq!(pulled, tactus_link::for_probe(&table));
    let identify = "identify --recordings SIMULATED --material Burlap --table";
    let told = bench.at.printed(&format!("{identify} noted"));
    assert_says(
        &told,
        &["3 slides not learned from", "6 slides are left out"],
    );
    let told = bench.at.printed(&format!("{identify} pulled"));
    assert_says(
        &told,
        &[
            "9 slides (seed",
            "does not say which slides it was learned from",
        ],
    );
    assert!(!told.contains("not learned from"), "{told}");
}

/// A table of 24 movements does not fit into the sectors of the shorter ones, and works as they do.
#[test]
fn a_table_that_is_longer_than_a_small_sector_is_used_and_added_to() {
    let bench = Bench::new(1000);
    let movements: Vec<Movement> = Movement::grid().take(24).collect();
    let fused = (Method::Fused, None);
    let table = world().learn_at(&movements, fused, &[], known().0, || ());
    let table = table.unwrap();
    assert!(
        (SECTOR + 1..TABLE).contains(&table.len()),
        "{}",
        table.len()
    );
    bench.at.write("long", &table);
    bench.printed("table push long");
    bench.printed("table pull pulled");
    assert_eq!(bench.at.read("pulled"), table);
    let found = bench.json("identify --seed 7", 0);
    assert_eq!(
        found["verdict"]["texture"],
        texture_name(UNKNOWN),
        "{found}"
    );
    bench.printed("teach mine");
    bench.printed("table pull taught");
    let taught = bench.at.read("taught");
    assert!(taught.len() > table.len());
    let taught = Table::read(&taught).unwrap();
    assert_eq!((taught.textures(), taught.movements().len()), (4, 24));
    assert!(taught.find("mine").is_some());
    // one that fits nowhere is refused by the probe, and what it has is kept
    bench.asked();
    let too_long = longer_than(&table, TABLE);
    bench.at.write("too-long", &too_long);
    let why = format!(
        "the table takes {} bytes, and there is room for {TABLE}",
        too_long.len()
    );
    assert_says(&bench.error("table push --yes too-long"), &[&why]);
    assert!(!bench.asked().contains(&Command::CommitTable));
    bench.printed("table pull kept");
    assert_eq!(bench.at.read("kept"), bench.at.read("taught"));
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

#[test]
fn a_table_with_damaged_limits_is_refused_and_nothing_is_lost() {
    let bench = Bench::new(1000);
    // something that would be lost
    bench.printed("rename Burlap mine");
    bench.printed("table pull before");
    let good = &known().1;
    let begin = Table::read(good).unwrap().limits().unwrap().drifted[0].begin;
    let places = 0..good.len();
    let mut places = places.filter(|&at| good[at..].starts_with(&begin.to_le_bytes()));
    let at = places.next_back().unwrap();
    // a table whose checksum is right, and whose limits are others
    let with_limits = |begin: f32| {
        let mut bytes = good[..good.len() - 4].to_vec();
        bytes[at..at + 4].copy_from_slice(&begin.to_le_bytes());
        with_checksum(bytes)
    };
    bench.asked();
    for damage in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        bench.at.write("file", with_limits(damage));
        let said = bench.error("table push --yes file");
        assert_says(
            &said,
            &["file", "its limits of new and changed textures are damaged"],
        );
    }
    assert_eq!(bench.asked(), [], "the probe was asked nothing");
    bench.printed("table pull after");
    assert_eq!(bench.at.read("before"), bench.at.read("after"));
    // it was the limits: the same table with other ones is taken
    bench.at.write("file", with_limits(begin + 0.5));
    assert_says(
        &bench.printed("table push --yes file"),
        &["the probe uses it now"],
    );
}

/// A terminal at which somebody answers each question with the next of these; what was printed.
#[cfg(unix)]
fn answered(bench: &Bench, line: &str, answers: &[&str]) -> String {
    use serialport::{SerialPort as _, TTYPort};
    use std::io::{Read as _, Write as _};
    use std::process::Stdio;
    let (mut terminal, slave) = TTYPort::pair().unwrap();
    let stdin = fs::OpenOptions::new()
        .read(true)
        .write(true)
        .open(slave.name().unwrap());
    let mut command = bench.command(line);
    command
        .stdin(stdin.unwrap())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut stderr = child.stderr.take().unwrap();
    let (mut said, mut answers) = (Vec::new(), answers.iter());
    let mut byte = [0];
    while stderr.read(&mut byte).unwrap() > 0 {
        said.push(byte[0]);
        if said.ends_with(b"(n: it stays): ") {
            let answer = answers.next().expect("one question too many");
            terminal.write_all(answer.as_bytes()).unwrap();
        }
    }
    assert!(answers.next().is_none(), "a question too few");
    let out = child.wait_with_output().unwrap();
    assert!(
        out.status.success(),
        "{line}: {}",
        String::from_utf8_lossy(&said)
    );
    String::from_utf8(out.stdout).unwrap()
}

#[cfg(unix)]
#[test]
fn a_training_asks_to_move_the_sample_and_the_table_says_so() {
    let bench = Bench::new(1000);
    let moved = |name: &str| {
        let table = bench.json("table show", 0);
        let textures = crate::array(&table["textures"]);
        let texture = textures.iter().find(|t| t["name"] == name).unwrap();
        assert!(
            texture["movements"][2]["trials"].as_u64() >= Some(3),
            "{texture}"
        );
        texture["sample_moved"].as_bool()
    };
    // name, options, answers; what is said, how often the probe is asked, and what the table says then
    for (name, options, answers, said, parts, told) in [
        (
            "moved",
            "",
            &["\n", "\n"][..],
            "was moved between trials",
            3,
            Some(true),
        ),
        (
            "stayed",
            "",
            &["n\n", "n\n"],
            "was not moved: slides on the same",
            3,
            Some(false),
        ),
        ("both", "", &["\n", "n\n"], "does not know whether", 3, None),
        // who says so beforehand is not asked
        ("turned", "--moved", &[], "9 slides made", 1, Some(true)),
        ("flat", "--same-spot", &[], "9 slides made", 1, Some(false)),
    ] {
        bench.asked();
        let train = format!("train {name} --trials 3 --seed 4 {options}");
        assert_says(&answered(&bench, &train, answers), &["9 slides made", said]);
        let trains = |command: &&Command| matches!(command, Command::Train(_));
        let trained = bench.asked().iter().filter(trains).count();
        assert_eq!((trained, moved(name)), (parts, told), "{name}");
    }
    // a script is not asked either
    let said = bench.printed("train script --trials 3");
    assert_says(&said, &["9 slides made", "does not know whether"]);
    // more trials of a texture that was moved: not known any more, unless they were, too
    bench.printed("train turned --trials 4 --moved");
    assert_eq!(moved("turned"), Some(true));
    bench.printed("train turned --trials 5");
    assert_eq!(moved("turned"), None);
    // what the probe learns and deletes otherwise leaves it as it is
    bench.printed("identify --seed 7");
    bench.printed("teach else");
    bench.printed("forget --name script --yes");
    assert_eq!(moved("flat"), Some(false));
    bench.printed("table pull pulled");
    let at_one_spot = "Learned at one spot: stayed, flat.";
    assert_says(
        &bench.at.printed("table pulled"),
        &["always at the same spot", at_one_spot],
    );
    assert_says(
        &bench.at.printed("report pulled --out page.html"),
        &[at_one_spot],
    );
    let page = String::from_utf8(bench.at.read("page.html")).unwrap();
    assert_says(&page, &["sample moved", at_one_spot, "<td>not known</td>"]);
}
