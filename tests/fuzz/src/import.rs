//! Files of any sensor, as `tactus import` takes them.

use std::fs;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use tactus_lab::data::import::foreign::Survey;
use tactus_lab::data::import::settings::{SETTINGS, Settings};
use tactus_lab::data::import::signals::Signals;
use tactus_lab::data::recordings::{RecordingSet, npy};

use crate::folder::{Folder, RULE};

/// The bytes of a file: as they are, or packed, once to four times one after the other. The first byte says which.
fn file(data: &[u8]) -> Vec<u8> {
    let Some((&mode, body)) = data.split_first() else {
        return Vec::new();
    };
    if mode & 1 == 0 {
        return body.to_vec();
    }
    let mut packer = GzEncoder::new(Vec::new(), Compression::fast());
    for _ in 0..=mode >> 1 & 3 {
        packer.write_all(body).expect("memory");
    }
    packer.finish().expect("memory")
}

/// A file of signals.
pub fn signals(data: &[u8]) {
    let Ok(signals) = Signals::of(&file(data)) else {
        return;
    };
    let samples = signals.channels[0].1.len();
    for (_, channel) in &signals.channels {
        assert_eq!(channel.len(), samples, "sampled together");
        assert!(channel.iter().all(|x| x.is_finite()));
    }
    for (name, missing) in &signals.missing {
        assert!(signals.channel(name).is_some() && missing.is_sorted_by(|a, b| a < b));
        assert!(missing.last().is_none_or(|row| *row < samples));
    }
    let mut end = 0;
    for piece in &signals.pieces {
        assert!(
            piece.rows.start == end && piece.rows.end > end,
            "side by side"
        );
        end = piece.rows.end;
    }
    assert!(signals.pieces.is_empty() || end == samples);
    for (_, words) in &signals.words {
        let ends: Vec<usize> = words.iter().map(|(_, end)| *end).collect();
        assert!(ends.is_sorted_by(|a, b| a < b));
        assert!(words.is_empty() || ends.last() == Some(&samples));
    }
}

/// A folder with `import.toml`, and behind a line `---` the file of [`signals`].
pub fn import(data: &[u8]) {
    drop(imported(data));
}

/// Why it is refused. What is written is read again.
fn imported(data: &[u8]) -> Result<(), String> {
    let at = data.windows(RULE.len()).position(|w| w == RULE);
    let (settings, rest) = match at {
        Some(at) => (&data[..at], &data[at + RULE.len()..]),
        None => (&[][..], data),
    };
    let folder = Folder::new();
    let (from, to) = (folder.0.join("from"), folder.0.join("to"));
    let put = |path: &Path, bytes: &[u8]| {
        fs::create_dir_all(path.parent().expect("a folder")).expect("a folder in RAM");
        fs::write(path, bytes).expect("a file in RAM");
    };
    put(&from.join(SETTINGS), settings);
    // a name by which a pattern can say all that it can say
    put(&from.join("day1/felt/a_1_25_0.5.dat"), &file(rest));
    let said = |why: tactus_lab::data::recordings::RecordingError| why.to_string();
    let survey = Survey::of(&from, Settings::default(), &|_, _| ()).map_err(said)?;
    let left_out = survey.write(&to, &|_, _| ()).map_err(said)?;
    let set = RecordingSet::open(&to).expect("what was written is read");
    let slides: usize = (0..set.textures().len()).map(|t| set.slides(t).len()).sum();
    assert_eq!(slides + left_out.len(), survey.slides());
    assert_eq!(set.textures().len(), survey.textures.len());
    drop(set.load_texture(0).map_err(said)?);
    let again = Settings::default().with_file(&to).expect("our own file");
    assert_eq!(again, survey.settings());
    Ok(())
}

/// A WAV file of 16 bits.
fn wav(rate_hz: u32, channels: &[&[i16]]) -> Vec<u8> {
    let samples = channels[0].len();
    let frame = 2 * channels.len() as u32;
    let length = frame * samples as u32;
    let mut file = b"RIFF".to_vec();
    file.extend((36 + length).to_le_bytes());
    file.extend(b"WAVEfmt \x10\0\0\0\x01\0");
    file.extend((channels.len() as u16).to_le_bytes());
    file.extend(rate_hz.to_le_bytes());
    file.extend((rate_hz * frame).to_le_bytes());
    file.extend((frame as u16).to_le_bytes());
    file.extend(b"\x10\0data");
    file.extend(length.to_le_bytes());
    let all = (0..samples).flat_map(|n| channels.iter().map(move |channel| channel[n]));
    file.extend(all.flat_map(i16::to_le_bytes));
    file
}

/// The same in the other layouts: RF64, UTF-16 with units and instants, arrays with labels.
fn others(wave: &[i16], bytes: &[u8]) -> Vec<(&'static str, u8, Vec<u8>)> {
    let plain = wav(1000, &[wave]);
    let mut rf64 = b"RF64\xff\xff\xff\xffWAVEds64\x10\0\0\0\0\0\0\0\0\0\0\0".to_vec();
    rf64.extend((bytes.len() as u64).to_le_bytes());
    rf64.extend(&plain[12..40]);
    rf64.extend(b"\xff\xff\xff\xff");
    rf64.extend(bytes);
    let row = |(n, x): (usize, &i16)| {
        let force = if n % 9 == 0 { "1,5" } else { "" };
        format!("0:0:0{:.3};{x};{force}\n", n as f64 / 500.0)
    };
    let rows: String = wave.iter().take(260).enumerate().map(row).collect();
    let text = format!("Sampling rate: 500 Hz;\nUhrzeit;x;f\ns;m/s2;N\n{rows}");
    let units = text.encode_utf16().flat_map(u16::to_le_bytes);
    let slides = npy::zipped(&[
        ("X", npy::array("<i2", &[2, 1200], bytes)),
        ("y", npy::words(["felt", "silk"].into_iter())),
        ("day", npy::array("|u1", &[2], &[1, 2])),
        ("fs", npy::array("|u1", &[], &[200])),
    ]);
    let column = npy::array("<i2", &[2400], bytes);
    let columns = npy::zipped(&[
        ("x", column),
        ("what", npy::words(wave.iter().map(|_| "felt"))),
    ]);
    vec![
        (
            "texture = \"{texture}_{run}_{speed}_{force}.dat\"\n",
            0,
            rf64,
        ),
        (
            "channel = \"x\"\n",
            0,
            [0xff, 0xfe].into_iter().chain(units).collect(),
        ),
        ("", 0, slides.expect("memory")),
        (
            "rate = 800\ntexture = \"what\"\n",
            1,
            columns.expect("memory"),
        ),
    ]
}

/// Files of so many bytes that are right, with settings that make much of them: long ones, many slides, many textures,
/// slides that are all copies.
pub fn many_slides(bytes: usize) -> Vec<Vec<u8>> {
    let mut state = 1_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 20) as i16 - 2048
    };
    let wave: Vec<i16> = (0..bytes / 2).map(|_| noise()).collect();
    let little = |wave: &[i16]| -> Vec<u8> { wave.iter().flat_map(|x| x.to_le_bytes()).collect() };
    let again = wave[..1500].repeat(wave.len() / 1500);
    let rows = |every: usize| -> Vec<u8> {
        let rows = wave.iter().take(bytes / 16).enumerate();
        let row = |(n, x): (usize, &i16)| format!("{:.3},{x},{}\n", n as f64 / 500.0, n / every);
        let rows: String = rows.map(row).collect();
        ("time,x,what\n".to_owned() + &rows).into_bytes()
    };
    let npy = |wave: &[i16]| npy::array("<i2", &[wave.len()], &little(wave));
    let all = [
        ("length = 0.6\n", wav(44_100, &[&wave])),
        (
            "length = 0.6\n",
            wav(192_000, &[&wave[..bytes / 4], &wave[bytes / 4..]]),
        ),
        (
            "rate = 800\nlength = 0.5\nunit = \"counts\"\ngain = 0.5\n",
            npy(&wave),
        ),
        ("rate = 800\nlength = 0.5\n", npy(&again)),
        ("rate = 20\nlength = 60\n", npy(&wave)),
        ("texture = \"what\"\n", rows(700)),
        ("session = \"what\"\n", rows(700)),
    ];
    let all = all.map(|(settings, file)| [settings.as_bytes(), RULE, &[0][..], &file].concat());
    for (place, one) in all.iter().enumerate() {
        assert_eq!(imported(one), Ok(()), "{place}");
    }
    all.into()
}

/// Files of each kind that are right, long enough for a slide and of 8 KB at most; `import` has settings before them.
pub(crate) fn seeds(with_settings: bool) -> Vec<Vec<u8>> {
    let wave: Vec<i16> = (0..2400)
        .map(|n: i32| ((n * n * 37 % 1999 / 9 - 111) * if n < 2000 { 9 } else { 1 }) as i16)
        .collect();
    let bytes: Vec<u8> = wave.iter().flat_map(|x| x.to_le_bytes()).collect();
    let rows = |mark: &str| -> String {
        let row = |(n, x): (usize, &i16)| {
            let name = if n < 280 { "a" } else { "b" };
            format!("{}.{:03}{mark}{x}{mark}{name}\n", n / 500, n % 500 * 2)
        };
        wave.iter().take(560).enumerate().map(row).collect()
    };
    let all = [
        (
            "speed = 20.0\nforce = 0.4\n",
            0,
            wav(500, &[&wave[..1000], &wave[..1000]]),
        ),
        ("rate = 510.5\n", 0, npy::array("<i2", &[2400], &bytes)),
        (
            "rate = 20\nwindow = \"0.5,60\"\n",
            1,
            npy::array("<i2", &[1200, 2], &bytes),
        ),
        (
            "texture = \"what\"\n",
            0,
            ("time,x,what\n".to_owned() + &rows(",")).into_bytes(),
        ),
        (
            "rate = 500\ntexture = \"day*/{texture}/{session}_*.dat\"\nlength = 0.5\n",
            1,
            rows("\t").into_bytes(),
        ),
        (
            "rate = 500\npressure = \"1\"\nchannel = \"2\"\nfinger = \"mic\"\n",
            1,
            rows(";").into_bytes(),
        ),
    ];
    let others = others(&wave, &bytes);
    let seeds = all.into_iter().chain(others).map(|(settings, mode, file)| {
        let head = if with_settings {
            [settings.as_bytes(), RULE].concat()
        } else {
            Vec::new()
        };
        [&head, &[mode][..], &file].concat()
    });
    let seeds: Vec<_> = seeds.collect();
    if with_settings {
        for seed in &seeds {
            assert_eq!(imported(seed), Ok(()), "{}", String::from_utf8_lossy(seed));
        }
    }
    seeds
}
