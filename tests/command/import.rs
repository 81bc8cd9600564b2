//! Files of any sensor, from the file to the verdict by two commands.

use std::fmt::Write as _;
use std::io::Write as _;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_lab::data::recordings::RecordingSet;

use crate::{Scratch, assert_says};

pub(crate) const TEXTURES: [(&str, f64); 4] = [
    ("cork", 0.02),
    ("denim", 0.045),
    ("silk", 0.1),
    ("suede", 0.17),
];
const EACH: usize = 7;

/// A recording: still, a slide in which a resonance that is the texture's rings, still. `octave` says how far below the
/// rate all of it is.
pub(crate) fn recording(texture: usize, number: usize, rate_hz: f64, octave: f64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64((texture * 100 + number) as u64);
    let seconds = if rate_hz < 500.0 { 44.0 } else { 2.4 };
    let samples = (seconds * rate_hz) as usize;
    let turns = TEXTURES[texture].1 * octave;
    let (near, pole) = (
        2.0 * (std::f64::consts::TAU * turns).cos(),
        1.0 - 0.3 * turns,
    );
    let (mut one, mut two) = (0.0, 0.0);
    let mut sample = |n: usize| {
        let place = n as f64 / samples as f64;
        let strength = if (0.2..0.9).contains(&place) {
            1.0
        } else {
            0.01
        };
        let drive = strength * random.random_range(-1.0..1.0);
        let out = drive + pole * near * one - pole * pole * two;
        (two, one) = (one, out);
        out
    };
    let all: Vec<f64> = (0..samples).map(&mut sample).collect();
    let peak = all.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    all.into_iter().map(|x| x / peak).collect()
}

/// All recordings, as this layout has each: the texture's name, its number, and the samples.
pub(crate) fn each(rate_hz: f64, octave: f64, mut put: impl FnMut(&str, usize, &[f64])) {
    for (texture, (name, _)) in TEXTURES.iter().enumerate() {
        for number in 0..EACH {
            put(name, number, &recording(texture, number, rate_hz, octave));
        }
    }
}

pub(crate) fn wav(rate: u32, bits: u16, channels: &[&[f64]]) -> Vec<u8> {
    let float = bits == 32;
    let bytes = usize::from(bits / 8);
    let mut data = Vec::new();
    for n in 0..channels[0].len() {
        for channel in channels {
            // a fifth of full scale is plenty
            let x = channel[n] * 0.2;
            match float {
                true => data.extend((x as f32).to_le_bytes()),
                false => {
                    let full = f64::from(1_u32 << (bits - 1));
                    data.extend(&((x * full) as i32).to_le_bytes()[..bytes]);
                }
            }
        }
    }
    let frame = channels.len() * bytes;
    let mut file = b"RIFF".to_vec();
    file.extend((36 + data.len() as u32).to_le_bytes());
    file.extend(b"WAVEfmt \x10\0\0\0");
    file.extend(if float { 3_u16 } else { 1 }.to_le_bytes());
    file.extend((channels.len() as u16).to_le_bytes());
    file.extend(rate.to_le_bytes());
    file.extend((rate * frame as u32).to_le_bytes());
    file.extend((frame as u16).to_le_bytes());
    file.extend(bits.to_le_bytes());
    file.extend(b"data");
    file.extend((data.len() as u32).to_le_bytes());
    file.extend(data);
    file
}

pub(crate) fn npy(kind: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({shape}), }}");
    let header = format!("{header:<117}\n");
    [b"\x93NUMPY\x01\0\x76\0", header.as_bytes(), data].concat()
}

/// Imports, and has the evaluation say how many of the names are right.
pub(crate) fn verdict(at: &Scratch, options: &str) -> RecordingSet {
    let import = at.printed(&format!("import data recordings {options}"));
    assert_says(&import, &["cork", "suede", "recordings: written, "]);
    let said = at.printed("evaluate --recordings recordings --train-slides 4 --runs 200");
    let line = said
        .lines()
        .find(|line| line.contains("most probable one right"));
    let share = line.and_then(|line| line.split_whitespace().rev().nth(1)?.parse::<f64>().ok());
    assert!(share.unwrap() > 95.0, "{options}: {said}");
    RecordingSet::open(&at.path("recordings")).unwrap()
}

#[test]
fn wav_files_of_folders_and_of_names() {
    let at = Scratch::new();
    each(44_100.0, 0.05, |name, number, x| {
        at.write(
            &format!("data/{name}/take {number}.wav"),
            wav(44_100, 16, &[x]),
        );
    });
    let set = verdict(&at, "");
    // the still part is the background
    assert!(
        set.load_texture(0)
            .unwrap()
            .iter()
            .all(|s| s.still().len() > 300 && s.pdc.is_empty())
    );

    let at = Scratch::new();
    each(8000.0, 0.28, |name, number, x| {
        let silence = vec![0.0; x.len()];
        at.write(
            &format!("data/{name}_{number}.wav"),
            wav(8000, 32, &[&silence, x]),
        );
    });
    verdict(&at, "");

    let at = Scratch::new();
    each(192_000.0, 0.0115, |name, number, x| {
        at.write(
            &format!("data/x-{name}-{number}.wav"),
            wav(192_000, 24, &[x]),
        );
    });
    verdict(&at, "--texture x-{texture}-*.wav");
}

#[test]
fn tables_with_time_and_without() {
    let at = Scratch::new();
    each(1000.0, 1.0, |name, number, x| {
        let mut text = "time_s,ax,ay\n".to_owned();
        for (n, x) in x.iter().enumerate() {
            let _ = writeln!(text, "{:.4},{:.5},{:.5}", n as f64 / 1000.0, 9.81, x);
        }
        at.write(&format!("data/{name}/{number}.csv"), text);
    });
    let set = verdict(&at, "--finger 'glued accelerometer'");
    assert_eq!(set.sensor().unwrap().to_string(), "glued accelerometer");
    assert_eq!(set.load_texture(0).unwrap()[0].highest_hz, Some(500.0));

    let at = Scratch::new();
    each(2000.0, 0.9, |name, number, x| {
        let mut text = "# von Hand\nZeit;Beschleunigung\n".to_owned();
        for (n, x) in x.iter().enumerate() {
            let line = format!("{:.5};{:.5}", n as f64 / 2000.0, x);
            let _ = writeln!(text, "{}", line.replace('.', ","));
        }
        at.write(
            &format!("data/tag1/{name}/{number}.csv"),
            format!("\u{feff}{text}"),
        );
    });
    verdict(&at, "");

    let at = Scratch::new();
    each(3000.0, 0.7, |name, number, x| {
        let lines: String = x.iter().map(|x| format!("7\t{x:.5}\n")).collect();
        at.write(&format!("data/{name}/{number}.tsv"), lines);
    });
    let why = at.error("import data recordings", 1);
    assert_says(&why, &["no rate", "--rate HZ", "--time COLUMN"]);
    verdict(&at, "--rate 3000");
}

#[test]
fn arrays_and_one_long_table() {
    let at = Scratch::new();
    each(2200.0, 1.0, |name, number, x| {
        let data: Vec<u8> = x.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
        at.write(
            &format!("data/{name}/{number}.npy"),
            npy("<f4", &format!("{},", x.len()), &data),
        );
    });
    at.write("data/import.toml", "rate = 2200\n");
    verdict(&at, "");

    let at = Scratch::new();
    each(10_000.0, 0.22, |name, number, x| {
        let data: Vec<u8> = x
            .iter()
            .flat_map(|x| [0.5, *x])
            .flat_map(f64::to_be_bytes)
            .collect();
        at.write(
            &format!("data/{name}/{number}.npy"),
            npy(">f8", &format!("{}, 2", x.len()), &data),
        );
    });
    verdict(&at, "--rate 10000 --channel 2 --speed 40 --force 0.8");

    // a robot's slow log, packed, with a column that names the ground
    let at = Scratch::new();
    let mut text = "t_ms,z,ground\n".to_owned();
    let mut n = 0;
    each(100.0, 1.0, |name, _, x| {
        for x in x {
            let _ = writeln!(text, "{},{x:.5},{name}", n * 10);
            n += 1;
        }
        // nothing between two of them
        for _ in 0..3 {
            let _ = writeln!(text, "{},0,", n * 10);
            n += 1;
        }
    });
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packed.write_all(text.as_bytes()).unwrap();
    at.write("data/log.csv.gz", packed.finish().unwrap());
    verdict(&at, "--texture ground");

    // time in microseconds, pressure and shear beside it, sessions as folders
    let at = Scratch::new();
    each(5000.0, 0.42, |name, number, x| {
        let mut text = "timestamp (us),acc,press,drag_n\n".to_owned();
        for (n, x) in x.iter().enumerate() {
            let slow = (n as f64 / 400.0).sin();
            let _ = writeln!(
                text,
                "{},{x:.5},{:.3},{:.3}",
                n * 200,
                3.0 + 0.1 * slow,
                0.4
            );
        }
        at.write(&format!("data/day{}/{name}/{number}.csv", number % 2), text);
    });
    let set = verdict(&at, "--pressure press --shear drag_n");
    let slide = &set.load_texture(0).unwrap()[0];
    assert!(slide.pdc.iter().all(|p| *p > 1500) && slide.shear_mn().unwrap().contains(&400));
    assert_eq!(set.slides(0)[0].labels.session, "day0");
}

#[test]
fn a_gap_leaves_its_slide_out_and_is_named() {
    let at = Scratch::new();
    each(1000.0, 1.0, |name, number, x| {
        let mut text = "time_s,a\n".to_owned();
        for (n, x) in x.iter().enumerate() {
            // in the middle of the first one the clock jumps by half a second
            let jump = if number == 0 && n > 1300 { 0.5 } else { 0.0 };
            let _ = writeln!(text, "{:.4},{x:.5}", n as f64 / 1000.0 + jump);
        }
        at.write(&format!("data/{name}/{number}.csv"), text);
    });
    let said = at.printed("import data recordings --dry-run");
    assert_says(
        &said,
        &["cork/0.csv: 1 slide left out, samples are missing"],
    );
    assert!(!at.path("recordings").exists());
    assert!(!said.contains("cork/1.csv: 1 slide left out"));
}

/// A day on which all is half as loud, imported at a gain of its own and at that of the first day.
#[test]
fn another_day_is_imported_like_the_first() {
    let at = Scratch::new();
    for (texture, (name, _)) in TEXTURES.iter().enumerate() {
        for number in 0..EACH {
            let first = recording(texture, number, 2200.0, 1.0);
            at.write(
                &format!("one/{name}/{number}.wav"),
                wav(2200, 32, &[&first]),
            );
            let second = recording(texture, number + EACH, 2200.0, 1.0);
            let second: Vec<f64> = second.iter().map(|x| 0.5 * x).collect();
            at.write(
                &format!("two/{name}/{number}.wav"),
                wav(2200, 32, &[&second]),
            );
        }
    }
    at.printed("import one recordings");
    at.printed("import two apart");
    let evaluate = "evaluate --recordings recordings --runs 100 --test";
    assert_says(
        &at.error(&format!("{evaluate} apart"), 1),
        &["counts per unit", "--like ", "recordings`"],
    );
    at.printed("import two more --like recordings");
    at.printed(&format!("{evaluate} more"));
    let loudness = |folder: &str| {
        let set = RecordingSet::open(&at.path(folder)).unwrap();
        let slides = set.load_texture(0).unwrap();
        let pac = slides[0].pac();
        let steady = &pac[slides[0].steady(2200)];
        let squares = steady.iter().map(|x| f64::from(*x).powi(2));
        (squares.sum::<f64>() / steady.len() as f64).sqrt()
    };
    let gain = |folder: &str| {
        let text = String::from_utf8(at.read(&format!("{folder}/import.toml"))).unwrap();
        let line = text.lines().find_map(|line| line.strip_prefix("gain = "));
        let value = line.and_then(|line| line.split_whitespace().next());
        value.unwrap().parse::<f64>().unwrap()
    };
    let [one, apart, more] = ["recordings", "apart", "more"].map(gain);
    assert!(one == more && apart > 1.5 * one, "{one} {apart} {more}");
    let ratio = loudness("more") / loudness("apart");
    assert!((ratio / (more / apart) - 1.0).abs() < 0.01, "{ratio}");
    assert_says(
        &at.error("import two again --like two", 1),
        &["import.toml: no such file"],
    );
}

#[test]
fn a_first_look_writes_what_can_be_corrected() {
    let at = Scratch::new();
    each(2200.0, 1.0, |name, number, x| {
        at.write(&format!("data/{name}/{number}.wav"), wav(2200, 16, &[x]));
    });
    at.printed("import data --template");
    let text = String::from_utf8(at.read("data/import.toml")).unwrap();
    assert_says(&text, &["rate = 2200.0", "gain = ", "# texture = "]);
    assert_says(
        &at.error("import data --template", 1),
        &["import.toml", "is there already"],
    );
    verdict(&at, "");
    assert_says(
        &at.error("import data recordings", 1),
        &["already holds recordings"],
    );
    let nothing = Scratch::new();
    nothing.write("data/readme.md", "no data");
    assert_says(
        &nothing.error("import data recordings", 1),
        &["no file in it ends with wav"],
    );
}

/// The walk of own-data.md with the extract of a robot's recordings that is in the repository.
#[test]
fn a_robots_terrains_are_imported_and_evaluated_as_the_page_says() {
    let at = Scratch::new();
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/borealtc");
    let page = include_str!("../../docs/src/own-data.md");
    let pattern = "{texture}/imu_*.csv";
    assert!(page.contains(&format!("--texture '{pattern}' --finger husky-imu")));
    let said = at.printed(&format!(
        "import {data} terrains --texture {pattern}* --finger husky-imu"
    ));
    assert_says(&said, &["100 Hz", "SANDY_LOAM", "terrains: written"]);
    let told = at.json("evaluate --recordings terrains --runs 400", 0);
    let share = |name: &str| told["verdicts"][name].as_f64().unwrap();
    // a minute of each run at most is in the extract: of asphalt there is too little, which is said
    assert_says(&told["notes"].to_string(), &["too few slides: ASPHALT"]);
    assert_eq!(told["textures"], 4, "{told}");
    // four terrains do not show that a fifth one is noticed: names are not told as sure
    let wrong = share("most_like") - share("most_like_right");
    assert!(share("right") + share("wrong") == 0.0, "{told}");
    assert!(share("most_like_right") > 0.5 && wrong < 0.12, "{told}");
}

/// One recording that was cut into two files is one slide, whatever the rate, and whatever the second is called.
#[test]
fn a_copy_that_is_shifted_is_left_out_and_named() {
    for (rate, first, second) in [
        (44_100, "cork/1.wav", "cork/1 again.wav"),
        (2200, "cork/1.wav", "suede/3.wav"),
        (180, "cork/2.wav", "silk/0.wav"),
    ] {
        let at = Scratch::new();
        each(
            f64::from(rate),
            2200.0 / f64::from(rate.max(2200)),
            |name, number, x| {
                at.write(&format!("data/{name}/{number}.wav"), wav(rate, 16, &[x]));
            },
        );
        let whole = at.read(&format!("data/{first}"));
        // a fifth of the slide is missing
        let from = 44 + whole.len() / 2 * 33 / 100 / 2 * 2;
        let mut copy = wav(rate, 16, &[&vec![0.0; (whole.len() - from) / 2]]);
        copy.truncate(44);
        copy.extend(&whole[from..]);
        at.write(&format!("data/{second}"), copy);
        let said = at.printed("import data recordings");
        let left_out = said.lines().filter(|line| line.starts_with("left out: "));
        let left_out: Vec<&str> = left_out.collect();
        // those of a slow clock are divided
        assert_eq!(left_out.len(), if rate == 180 { 2 } else { 1 }, "{said}");
        for line in left_out {
            assert_says(line, &["% of its P_AC is that of slide ", first, second]);
        }
        let rows = at.printed("features --recordings recordings --format csv");
        let slides = rows.lines().count() - 1;
        assert_says(&said, &[&format!("recordings: written, {slides} slides")]);
    }
}

/// Whatever files and settings say, one sentence says what is wrong, and nothing is written.
#[test]
fn hostile_files_settings_and_names_are_refused() {
    let table = |name: &str| {
        let mut text = "time,x,what\n".to_owned();
        for (n, x) in recording(0, 0, 500.0, 1.0).iter().enumerate() {
            let _ = writeln!(text, "{:.3},{x:.5},{name}", n as f64 / 500.0);
        }
        text
    };
    let stars = format!("texture = \"{}\"", "*".repeat(60_000));
    let settings = [
        (stars.as_str(), "--texture has more than 256 bytes"),
        ("length = inf", "slides of inf s"),
        ("length = 1e300", "--length is more than 0"),
        ("gain = nan", "a gain of NaN is impossible"),
        ("gain = 1e-320", "is impossible"),
        ("force = nan\nspeed = 20", "force"),
        ("rate = inf", "a rate of inf Hz"),
        ("window = \"0,1e999\"", "is not FROM,TO"),
        ("texture = \"what\"\nfinger = \"a\\u001b[31mb\"", "U+001B"),
        (
            "finger = \"0123456789012345678901234567890123456789more\"",
            "40",
        ),
        ("session = \"\\u202emonday\"", "U+202E"),
        ("channel = \"2\"\nrate = [1", "import.toml: line 2"),
    ];
    for (settings, why) in settings {
        let at = Scratch::new();
        at.write("data/felt/1.csv", table("felt"));
        at.write("data/import.toml", settings);
        assert_says(&at.error("import data recordings", 1), &[why]);
        assert!(!at.path("recordings").exists(), "{why}");
    }
    let packed = |bytes: &[u8]| {
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        packed.write_all(bytes).unwrap();
        packed.finish().unwrap()
    };
    let zeros = npy("|u1", "13000000,", &vec![0; 13_000_000]);
    let labels: String = (0..3000)
        .map(|n| format!("{n},{},word {n}\n", n % 7))
        .collect();
    let files = [
        (
            "felt/1.csv.gz",
            packed(&vec![b'1'; 40 << 20]),
            "unpacks to more than 32 MB",
        ),
        (
            "felt/1.npy.gz",
            packed(&zeros),
            "more than 12 million numbers",
        ),
        (
            "felt/1.wav",
            {
                let mut cut = wav(2200, 16, &[&[0.5; 99]]);
                cut.truncate(99);
                cut
            },
            "damaged WAV",
        ),
        (
            "felt/1.csv",
            b"1e308,2\n-1e308,1\n".repeat(600),
            "not a number that was measured",
        ),
        ("felt/1.csv", labels.into_bytes(), "too many words"),
        ("felt/1.csv", vec![b','; 2 << 20], "no row of a table"),
        (
            "\u{1b}]0;title\u{7}/1.csv",
            table("felt").into_bytes(),
            "U+001B",
        ),
        ("felt/1.csv", table("si\u{202e}lk").into_bytes(), "U+202E"),
    ];
    for (name, bytes, why) in files {
        let at = Scratch::new();
        at.write(&format!("data/{name}"), bytes);
        let column = if name.contains('\u{1b}') {
            ""
        } else {
            "--texture 3"
        };
        let named = if why == "U+202E" {
            "--texture what"
        } else {
            column
        };
        let said = at.error(&format!("import data recordings --rate 500 {named}"), 1);
        assert_says(&said, &[why]);
        assert!(
            !said.contains('\u{1b}') && !at.path("recordings").exists(),
            "{said}"
        );
    }
    // settings stay in their folder
    let at = Scratch::new();
    at.write("data/felt/1.csv", table("felt"));
    at.write("elsewhere.toml", "secret = 1");
    std::os::unix::fs::symlink(at.path("elsewhere.toml"), at.path("data/import.toml")).unwrap();
    let said = at.error("import data recordings", 1);
    assert_says(&said, &["leads out of this folder"]);
    assert!(!said.contains("secret"), "{said}");
}
