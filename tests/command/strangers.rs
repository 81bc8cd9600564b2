//! Files of strangers: layouts beside those of [`crate::import`] from the file to the verdict, and what cannot be read.

use tactus_lab::data::recordings::{RecordingSet, npy as arrays};

use crate::import::{TEXTURES, each, npy, recording, verdict, wav};
use crate::{Scratch, assert_says};

/// Text of a table, a row for each sample.
fn rows(x: &[f64], row: impl Fn(usize, f64) -> String) -> String {
    x.iter().enumerate().map(|(n, x)| row(n, *x)).collect()
}

/// The number of a texture.
fn number_of(name: &str) -> usize {
    TEXTURES
        .iter()
        .position(|(known, _)| *known == name)
        .unwrap()
}

#[test]
fn wav_of_field_recorders() {
    let at = Scratch::new();
    each(96_000.0, 0.023, |name, number, x| {
        // a quiet second microphone, 24 bits in the extensible format, with the recorder's own chunk before the samples
        let quiet: Vec<f64> = x.iter().rev().map(|x| x * 0.1).collect();
        let plain = wav(96_000, 24, &[&quiet, x]);
        let mut file = plain[..12].to_vec();
        file.extend(b"bext\x07\0\0\0by hand\0fmt \x28\0\0\0\xfe\xff");
        file.extend(&plain[22..36]);
        file.extend(b"\x16\0\x18\0\x03\0\0\0\x01\0\0\0\0\0\x10\0\x80\0\0\xaa\0\x38\x9b\x71");
        file.extend(&plain[36..]);
        at.write(&format!("data/{name}/take{number:02}.wav"), file);
    });
    // what is no recording is no reason to stop
    at.write("data/notes.txt", "bought at the market\n");
    at.write("data/list.csv", "id,weight_g\n1,20.5\n2,31\n");
    let said = at.printed("import data recordings --dry-run");
    assert_says(
        &said,
        &[
            "28 recordings (WAV), 96000 Hz",
            "channel 2 is the liveliest of 2, 1",
            "left out: data/list.csv: no rate",
            "left out: data/notes.txt: no column of numbers",
        ],
    );
    verdict(&at, "");
}

#[test]
fn tables_of_loggers() {
    // UTF-16 without a header, time in microseconds since a start
    let at = Scratch::new();
    each(6250.0, 0.34, |name, number, x| {
        let text = rows(x, |n, x| format!("{}\t{x:.5}\n", 7_000_000 + n * 160));
        let units = text.encode_utf16().flat_map(u16::to_le_bytes);
        let bytes: Vec<u8> = [0xff, 0xfe].into_iter().chain(units).collect();
        at.write(&format!("data/{name}/{number}.txt"), bytes);
    });
    let said = at.printed("import data recordings --dry-run");
    assert_says(&said, &["6250 Hz", "column 1 is taken for the time in us"]);
    verdict(&at, "");

    // a force that is measured in every tenth row, a few samples that are missing, a rate in a comment
    let at = Scratch::new();
    each(12_000.0, 0.18, |name, number, x| {
        let text = rows(x, |n, x| {
            let force = match n % 10 {
                0 => format!("{:.3}", 0.5 + 0.05 * (n as f64 / 900.0).sin()),
                _ => String::new(),
            };
            match number == 1 && n == 12_000 {
                true => format!("{n},{force},NaN\n"),
                false => format!("{n},{force},{x:.5}\n"),
            }
        });
        at.write(
            &format!("data/{name}/{number}.csv"),
            format!("# sampling rate = 12 kHz\nsample,force_n,vib\n{text}"),
        );
    });
    let said = at.printed("import data recordings --dry-run --pressure force_n");
    assert_says(
        &said,
        &[
            "12000 Hz",
            "channel vib",
            "P_DC from force_n",
            "/1.csv: 1 slide left out, samples are missing",
        ],
    );
    assert!(!said.contains("/2.csv: 1 slide left out"), "{said}");
    let set = verdict(&at, "--pressure force_n --force 0.5 --speed 30");
    assert!(set.load_texture(0).unwrap()[0].pdc.len() > 100);
}

#[test]
fn tables_with_instants() {
    // of a spreadsheet: quotes, decimal commas, Latin letters, lines before the table
    let at = Scratch::new();
    each(800.0, 1.0, |name, number, x| {
        let text = rows(x, |n, x| {
            let (s, ms) = (n * 1250 / 1_000_000, n * 1250 / 1000 % 1000);
            let x = format!("{x:.4}").replace('.', ",");
            format!("\"28.11.2026 10:00:{s:02},{ms:03}\";\"{x}\"\r\n")
        });
        let mut file = b"Ger\xe4t;XY-7\r\nUhrzeit;Beschl\xe4unigung [m/s\xb2]\r\n".to_vec();
        file.extend(text.as_bytes());
        at.write(&format!("data/{name}_{number}.csv"), file);
    });
    let said = at.printed("import data recordings --dry-run");
    assert_says(&said, &["800 Hz", "counts per m/s\u{b2}"]);
    verdict(&at, "");

    // of a robot: ISO 8601, force and speed in the names of the files
    let at = Scratch::new();
    each(100.0, 1.0, |name, number, x| {
        let text = rows(x, |n, x| {
            let (s, ms) = (n / 100, n % 100 * 10);
            format!("2026-11-28T10:00:{s:02}.{ms:03}+01:00|{x:.5}\n")
        });
        at.write(
            &format!("data/{name}_{number}_40_500.log"),
            format!("stamp|z\n{text}"),
        );
    });
    let set = verdict(
        &at,
        "--time stamp --texture '{texture}_{run}_{speed}_{force_mn}.log'",
    );
    let movement = set.movements()[0];
    assert_eq!((movement.force_mn(), movement.speed_um_s()), (500, 40_000));
    assert_eq!(set.slides(0)[1].labels.run, "1");
}

#[test]
fn one_long_table_with_numbers_for_textures() {
    let at = Scratch::new();
    let mut text = String::new();
    each(3200.0, 0.66, |name, number, x| {
        // as several logs put together
        let (label, day) = (number_of(name), number % 2);
        let line = |n, x| format!("{:.5},{day},{label},{x:.4}\n", n as f64 / 3200.0);
        text += &format!("t_s,day,label,z\n{}", rows(x, line));
    });
    at.write("all.csv", text);
    let import = at.printed("import all.csv recordings --texture label --session day");
    assert_says(
        &import,
        &["28 recordings (table), 3200 Hz", "recordings: written"],
    );
    let told = at.json("evaluate --recordings recordings --runs 200", 0);
    assert!(told["verdicts"]["right"].as_f64().unwrap() > 0.9, "{told}");
    let set = RecordingSet::open(&at.path("recordings")).unwrap();
    assert_eq!(set.names(), ["0", "1", "2", "3"]);
    assert_eq!(set.slides(0)[1].labels.session, "1");
}

#[test]
fn an_npz_of_slides_names_and_rate() {
    let at = Scratch::new();
    let (mut all, mut labels) = (Vec::new(), Vec::new());
    each(4000.0, 0.53, |name, _, x| {
        all.extend(x.iter().flat_map(|x| (*x as f32).to_le_bytes()));
        labels.push(name.to_owned());
    });
    let shape = [labels.len(), all.len() / 4 / labels.len()];
    let zip = arrays::zipped(&[
        ("X", arrays::array("<f4", &shape, &all)),
        ("y", arrays::words(labels.iter().map(String::as_str))),
        ("fs", arrays::array("<f8", &[], &4000.0_f64.to_le_bytes())),
    ]);
    at.write("data/slides.npz", zip.unwrap());
    verdict(&at, "");
}

#[test]
fn the_cluster_haptic_texture_dataset_and_a_session_of_a_probe() {
    let at = Scratch::new();
    each(6000.0, 0.35, |name, number, x| {
        let seconds = |n: usize| n as f64 / 6000.0;
        let accel = rows(x, |n, x| {
            format!("{},0.01,{x:.3},-0.96\n", 0.001 + seconds(n))
        });
        let force = |n: usize| 1.0 + 0.1 * (n as f64 / 700.0).sin();
        let force = rows(x, |n, _| format!("{},{:.3}\n", seconds(n), force(n)));
        let file = format!(
            "{}_{}_40_500_{}.csv",
            number_of(name),
            45 * number,
            number % 2
        );
        for (kind, text) in [
            ("accel", format!("time,X,Y,Z\n{accel}")),
            ("force", format!("time,force\n{force}")),
        ] {
            at.write(&format!("data/sensor_data/{kind}/{file}"), text);
        }
    });
    let said = at.printed("import data recordings");
    assert_says(
        &said,
        &["counts per g", "P_DC from force", "recordings: written"],
    );
    let told = at.json("evaluate --recordings recordings --runs 200", 0);
    assert!(told["verdicts"]["right"].as_f64().unwrap() > 0.9, "{told}");
    let set = RecordingSet::open(&at.path("recordings")).unwrap();
    let movement = set.movements()[0];
    assert_eq!((movement.force_mn(), movement.speed_um_s()), (500, 40_000));
    let pdc = &set.load_texture(0).unwrap()[0].pdc;
    assert!(!pdc.is_empty() && pdc.iter().all(|pdc| *pdc > 1000));

    let at = Scratch::new();
    at.log("identify");
    at.printed("convert identify.jsonl --mcap cork.mcap");
    let said = at.printed("import cork.mcap recordings");
    assert_says(
        &said,
        &["(MCAP), 2200 Hz", "channel pac, in counts", "cork"],
    );
    let set = RecordingSet::open(&at.path("recordings")).unwrap();
    let slides = set.load_texture(0).unwrap();
    assert!(!slides.is_empty() && slides.iter().all(|slide| slide.shear_mn().is_some()));
}

#[test]
fn what_cannot_be_read_says_what_to_do() {
    let at = Scratch::new();
    each(1000.0, 1.0, |name, number, x| {
        let text = rows(x, |n, x| format!("{n},{x:.5}\n"));
        at.write(
            &format!("data/{name}/{number}.csv"),
            format!("ms,a\n{text}"),
        );
    });
    for (options, parts) in [
        (
            "--channel b",
            &["no channel or column of numbers \"b\"", "ms, a"][..],
        ),
        ("--time when", &["no channel or column of numbers \"when\""]),
        (
            "--texture '{material}/*.csv'",
            &["{material} is no field", "{texture}, {session}"],
        ),
        ("--texture '{texture}-*.wav'", &["no path in it is like"]),
        (
            "--texture cloth",
            &[
                "no channel or column of numbers \"cloth\"",
                "columns of words are none",
                "put them into a folder of it",
            ],
        ),
        ("--speed 300", &["300000 um/s", "leave it out"]),
        ("--force 70 --speed 30", &["70", "leave it out"]),
        ("--window 5,2", &["FROM,TO in seconds"]),
        (
            "--window 0,0.2",
            &["no sliding was found", "--window FROM,TO"],
        ),
        ("--gain 1e9", &["samples have 32767 at most"]),
        ("--rate 0.5", &["a rate of 0.5 Hz"]),
    ] {
        let why = at.error(&format!("import data recordings {options}"), 1);
        assert_says(&why, parts);
        assert!(!at.path("recordings").exists(), "{options}");
    }
    // too short for a slide: alone an error, beside others a note
    let short = &recording(1, 1, 1000.0, 1.0)[..300];
    let short = format!("ms,a\n{}", rows(short, |n, x| format!("{n},{x}\n")));
    at.write("data/felt/1.csv", short.clone());
    let said = at.printed("import data recordings --dry-run");
    assert_says(&said, &["left out: felt: recordings of 0.3 s"]);
    let at = Scratch::new();
    at.write("data/silk/1.csv", short);
    assert_says(
        &at.error("import data recordings", 1),
        &["0.3 s are too short", "takes 0.5 s"],
    );
}

/// Damaged, empty and boastful files of each kind.
#[test]
fn damaged_files_are_refused_in_a_sentence() {
    let zip = arrays::zipped(&[("X", arrays::array("<i2", &[4, 99], &[1; 792]))]).unwrap();
    let boast = |kind: &str, shape: &str| npy(kind, shape, &[0; 64]);
    let packed = |array: Vec<u8>| arrays::zipped(&[("X", array)]).unwrap();
    let mut rf64 = b"RF64\xff\xff\xff\xffWAVEds64\x10\0\0\0".to_vec();
    rf64.extend([0xff; 16]);
    rf64.extend(&wav(8000, 16, &[&[0.5; 99]])[12..40]);
    rf64.extend([0xff; 9]);
    for (name, bytes, part) in [
        ("1.wav", b"RIFFxxxxWAVE".to_vec(), "damaged WAV"),
        ("1.wav", rf64, "damaged WAV"),
        ("1.npz", zip[..zip.len() / 2].to_vec(), "save it again"),
        ("1.npz", b"PK\x03\x04".to_vec(), "save it again"),
        (
            "1.npz",
            arrays::zipped(&[]).unwrap(),
            "without an array of numpy",
        ),
        (
            "1.npz",
            packed(boast("<f8", "99999999999,")),
            "million numbers",
        ),
        (
            "1.npz",
            packed(boast("<f8", "99,")),
            "another number of elements",
        ),
        (
            "1.npz",
            packed(boast("|O", "8,")),
            "array \"X\": an array of \"O\"",
        ),
        ("1.npy", boast("<U4", "4,"), "an array of words"),
        ("1.npy", boast("<f4", "2, 2, 4"), "3 dimensions"),
        (
            "1.npy",
            b"\x93NUMPY\x02\0\xff\xff\xff\xff{".to_vec(),
            "ends within its header",
        ),
        ("1.mcap", b"\x89MCAP0\r\n".to_vec(), "MCAP"),
        (
            "1.mcap",
            b"\x89MCAP0\r\n\x06\xff\xff\xff\xff\xff\xff\xff\x7f".to_vec(),
            "MCAP",
        ),
        ("1.txt", b"\xff\xfea\0,\0\x00\xd8".to_vec(), "none of WAV"),
        ("1.txt", b"\xff\xfe".to_vec(), "an empty file"),
        ("1.csv", Vec::new(), "an empty file"),
        ("1.csv", b"a,b\nm,s\n".to_vec(), "no column of numbers"),
        ("1.csv", b"t,x\n0,1\n1,2\n2".to_vec(), "line 4: 1 fields"),
    ] {
        let at = Scratch::new();
        at.write(&format!("data/felt/{name}"), bytes);
        let why = at.error("import data recordings --rate 1000", 1);
        assert_says(&why, &[part, name]);
        assert!(why.trim().lines().count() == 1, "{why}");
        assert!(!at.path("recordings").exists(), "{why}");
    }
}
