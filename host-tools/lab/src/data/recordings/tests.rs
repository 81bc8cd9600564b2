//! Every way in which a folder of recordings can be wrong, each with the message that it must give.
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use tactus_core::features::Movement;
use tactus_core::sensor::FingerCode;
use tempfile::TempDir;

use super::files::*;
use super::*;
use crate::data::cells;
use crate::data::recording::Labels;

mod biotac_layout;
mod random;
mod writing;

/// A short slide; its samples tell texture and number.
fn slide(texture: usize, number: u32) -> Recording {
    let base = texture as i16 * 1000 + number as i16 * 10;
    let pac: Vec<i16> = (0..220).map(|i| base - i).collect();
    let slide = Recording {
        texture,
        number,
        movement: Movement::FOR_FINENESS,
        window: (0.02, 0.1),
        blocks: Vec::new(),
        background: Some(2.2),
        pdc: vec![base; 10],
        pdc_rate_hz: 100.0,
        outside_mn: None,
        pace: None,
        shear_rate_hz: 110.0,
        highest_hz: None,
    };
    slide.cut(&[], &pac, Some(&[-base; 11])).unwrap()
}

fn texture(id: u32, name: &str) -> Texture {
    Texture {
        id,
        name: name.to_owned(),
    }
}

fn write_own(folder: &Path, slides: &[Recording]) {
    let textures = vec![texture(7, "cotton, washed"), texture(3, "felt")];
    let mut writer = RecordingWriter::begin(folder, textures, "test").unwrap();
    for slide in slides {
        writer.write(slide).unwrap();
    }
    writer.finish().unwrap();
}

/// Two textures with the slides 1 and 4, the first one without shear and with a still record.
fn own() -> (TempDir, Vec<Recording>) {
    let folder = TempDir::new().unwrap();
    let mut slides = vec![slide(0, 1), slide(0, 4), slide(1, 1), slide(1, 4)];
    let first = Recording {
        background: None,
        movement: Movement::FOR_ROUGHNESS,
        ..slide(0, 1)
    };
    let pac = first.pac();
    slides[0] = first.cut(&[1, -1, i16::MAX, i16::MIN], &pac, None).unwrap();
    write_own(folder.path(), &slides);
    (folder, slides)
}

fn edit(path: &Path, from: &str, to: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(from), "nothing to edit in {}", path.display());
    fs::write(path, text.replacen(from, to, 1)).unwrap();
}

fn load(folder: &Path) -> Result<Vec<Recording>> {
    let set = RecordingSet::open(folder)?;
    let mut slides = Vec::new();
    for index in 0..set.textures().len() {
        slides.extend(set.load_texture(index)?);
    }
    Ok(slides)
}

/// The message of the error that reading `folder` gives must have all of `parts`.
#[track_caller]
fn fails(folder: &Path, parts: &[&str]) {
    let message = load(folder).expect_err("must be refused").to_string();
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
}

#[test]
fn own_format_gives_back_what_was_written() {
    let (folder, slides) = own();
    let set = RecordingSet::open(folder.path()).unwrap();
    assert_eq!(
        set.textures(),
        [texture(7, "cotton, washed"), texture(3, "felt")]
    );
    assert_eq!(
        set.slides(1).iter().map(|k| k.number).collect::<Vec<_>>(),
        [1, 4]
    );
    assert_eq!(
        set.movements(),
        [Movement::FOR_ROUGHNESS, Movement::FOR_FINENESS]
    );
    assert_eq!(load(folder.path()).unwrap(), slides);
}

#[test]
fn slides_come_in_the_order_of_numbers_whatever_the_order_of_rows() {
    let folder = TempDir::new().unwrap();
    let mut slides = vec![slide(1, 4), slide(0, 9), slide(1, 1), slide(0, 2)];
    write_own(folder.path(), &slides);
    // the texture of the first row is the first one
    slides.sort_by_key(|s| (1 - s.texture, s.number));
    let loaded = load(folder.path()).unwrap();
    let pac = |slides: &[Recording]| slides.iter().map(Recording::pac).collect::<Vec<_>>();
    assert_eq!(pac(&loaded), pac(&slides));
}

#[test]
fn a_folder_that_is_missing_or_empty_says_where_recordings_are() {
    let folder = TempDir::new().unwrap();
    fails(
        &folder.path().join("nowhere"),
        &[
            "nowhere: no such folder",
            "https://github.com/dexrob/BioTac_slide_20_50",
            "tactus import",
        ],
    );
    fails(
        folder.path(),
        &[
            &folder.path().display().to_string(),
            "neither manifest.csv nor manifest.json",
            "tactus import",
        ],
    );
}

#[test]
fn own_manifest_errors_name_line_and_column() {
    const CASES: &str = r#"
pac_rate_hz | rate | manifest.csv:1: | no column pac_rate_hz in
pac_sha256 | pac_file | manifest.csv:1: | two columns pac_file
0.200 | NaN | manifest.csv:2: column force_n | not a finite number
0.200 | -inf | manifest.csv:2: column force_n | not a finite number
0.200 | 9 | manifest.csv:2: | contact force 9000 mN is outside
7, | seven, | manifest.csv:2: column texture | "seven" is not the number of a texture
,4, | ,-4, | manifest.csv:3: column slide | "-4" is not the number of a slide
,2200, | ,100.5, | column pac_rate_hz: 100.5 Hz, and | `tactus import FOLDER NEW --rate 100.5`
,2200, | ,nan, | column pac_rate_hz: nan | not a finite number
,100, | ,0, | manifest.csv: line 2 | 0 Hz for P_DC is impossible
0.02,0.1, | 0.1,0.1, | manifest.csv: line 2 | is not a stretch of time
0.02,0.1, | 0.02,0.2, | manifest.csv: line 2 | P_AC (samples: 220
,2.2, | ,-1, | manifest.csv: line 3 | background power of -1
,,t007_s001_still | ,1,t007_s001_still | column background_power | there is a background_file too
t007_s001_pdc.npy | | manifest.csv:2: column pdc_file | a hash, but no file
cotton, washed",4 | silk",4 | manifest.csv: texture 7 | give each texture one number
",4, | ",1, | manifest.csv: line 3 | slide 1 of texture 7 is listed twice
t007_s001_pdc.npy | ../x.npy | manifest.csv: names the file "../x.npy" | not inside this folder
t007_s001_pdc.npy | /etc/passwd | "/etc/passwd" | not inside this folder
t007_s001_pdc.npy | x.npy | x.npy:  | No such file
biotac,,,1 | biotac,,,2 | manifest.csv:2: column version | version 2, and this program reads version 1: write
"#;
    for [from, to, place, cause] in cells(CASES) {
        let (folder, _) = own();
        edit(&folder.path().join(OWN_MANIFEST), from, to);
        fails(folder.path(), &[place, cause]);
    }
}

/// A manifest with some columns alone; those of `emptied` stay, without what they hold.
fn with_columns(path: &Path, keep: impl Fn(&str) -> bool, emptied: bool) {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let header = reader.headers().unwrap().clone();
    let mut written = csv::Writer::from_writer(Vec::new());
    let rows = std::iter::once(header.clone()).chain(reader.records().map(|row| row.unwrap()));
    for (line, row) in rows.enumerate() {
        let cells = header.iter().zip(&row);
        let cells = cells.filter(|(column, _)| emptied || keep(column));
        let cells = cells.map(|(column, cell)| if line == 0 || keep(column) { cell } else { "" });
        written.write_record(cells).unwrap();
    }
    fs::write(path, written.into_inner().unwrap()).unwrap();
}

#[test]
fn each_column_but_three_may_be_missing_or_empty() {
    let needed = ["name", "pac_file", "pac_rate_hz"];
    let pairs = [
        ("pac_sha256", ""),
        ("pdc_file", "pdc_sha256"),
        ("shear_file", "shear_sha256"),
        ("background_file", "background_sha256"),
    ];
    for column in own::COLUMNS.into_iter().chain(own::LABELS) {
        // without a file there is no hash of it
        let pair = pairs.iter().find(|(file, _)| *file == column);
        let gone = |name: &str| name == column || pair.is_some_and(|(_, hash)| *hash == name);
        for emptied in [false, true] {
            let (folder, slides) = own();
            let path = folder.path().join(OWN_MANIFEST);
            with_columns(&path, |name| !gone(name), emptied);
            if needed.contains(&column) && !(emptied && column == "name") {
                fails(folder.path(), &["manifest.csv:", column]);
                continue;
            }
            let loaded = load(folder.path()).unwrap();
            let pac = |slides: &[Recording]| slides.iter().map(Recording::pac).collect::<Vec<_>>();
            if column != "name" {
                assert_eq!(pac(&loaded), pac(&slides), "{column}");
            }
        }
    }
    // one that has nothing else: rows are in the order of time
    let (folder, slides) = own();
    let path = folder.path().join(OWN_MANIFEST);
    with_columns(&path, |name| needed.contains(&name), false);
    let set = RecordingSet::open(folder.path()).unwrap();
    assert_eq!(
        set.textures(),
        [texture(1, "cotton, washed"), texture(2, "felt")]
    );
    let loaded = load(folder.path()).unwrap();
    for (slide, whole) in loaded.iter().zip(&slides) {
        assert_eq!(slide.pac(), whole.pac());
        assert_eq!(slide.window, (0.0, 0.1));
        assert_eq!(slide.movement, Movement::UNKNOWN);
        assert_eq!((slide.background, &slide.pdc[..]), (Some(0.0), &[][..]));
        assert_eq!(slide.outside_mn, None);
    }
    assert_eq!(
        loaded.iter().map(|slide| slide.number).collect::<Vec<_>>(),
        [1, 2, 1, 2]
    );
}

#[test]
fn a_force_alone_a_speed_alone_and_rates_that_are_no_whole_numbers_are_kept() {
    let (folder, _) = own();
    let path = folder.path().join(OWN_MANIFEST);
    // 10 samples of P_DC are 0.1 s
    edit(&path, ",0.502,25.119,", ",,25.119,");
    edit(&path, ",0.502,25.119,", ",0.502,,");
    edit(&path, "t007_s004_pdc.npy,100,", "t007_s004_pdc.npy,100.5,");
    edit(&path, "t003_s001_pdc.npy,100,", "t003_s001_pdc.npy,,");
    let slides = load(folder.path()).unwrap();
    let told: Vec<_> = slides.iter().map(|s| s.movement.to_string()).collect();
    assert_eq!(
        told[1..],
        ["25.1 mm/s", "0.50 N", "0.50 N, 25.1 mm/s"],
        "{told:?}"
    );
    assert_eq!(
        (slides[1].pdc_rate_hz, slides[2].pdc_rate_hz),
        (100.5, 100.0)
    );
    // and they are written as they were read
    let copy = TempDir::new().unwrap();
    write_own(copy.path(), &slides);
    assert_eq!(load(copy.path()).unwrap(), slides);
}

#[test]
fn p_ac_of_another_rate_is_resampled() {
    let tone = |rate_hz: f64, n: usize| {
        let phase = std::f64::consts::TAU * 90.0 * n as f64 / rate_hz;
        (1000.0 * phase.sin()).round() as i16
    };
    for (rate, highest) in [("1000", Some(500.0)), ("48000", None), ("2200.0", None)] {
        let rate_hz: f64 = rate.parse().unwrap();
        let folder = TempDir::new().unwrap();
        let samples: Vec<i16> = (0..rate_hz as usize).map(|n| tone(rate_hz, n)).collect();
        fs::write(folder.path().join("a.npy"), npy::write(&samples)).unwrap();
        let manifest = format!("name,pac_file,pac_rate_hz\nfelt,a.npy,{rate}\n");
        fs::write(folder.path().join(OWN_MANIFEST), manifest).unwrap();
        let slide = load(folder.path()).unwrap().remove(0);
        let pac = slide.pac();
        assert_eq!((pac.len(), slide.highest_hz), (2200, highest), "{rate}");
        // the ends are those of a filter
        for (n, x) in pac.iter().enumerate().take(1800).skip(400) {
            assert!(x.abs_diff(tone(2200.0, n)) <= 3, "{rate}: {n} {x}");
        }
    }
}

#[test]
fn a_manifest_without_rows_or_that_is_no_text_is_refused() {
    let (folder, _) = own();
    let manifest = folder.path().join(OWN_MANIFEST);
    fs::write(&manifest, own::COLUMNS.join(",")).unwrap();
    fails(
        folder.path(),
        &["manifest.csv: line 1", "no slide is listed"],
    );
    fs::write(
        &manifest,
        [own::COLUMNS.join(",").as_bytes(), b"\n\xff\xfe\n"].concat(),
    )
    .unwrap();
    fails(folder.path(), &["manifest.csv:2:", "not UTF-8"]);
}

#[test]
fn damaged_npy_files_are_refused() {
    let header = |text: &str| {
        [
            b"\x93NUMPY\x01\0",
            &[text.len() as u8, 0][..],
            text.as_bytes(),
        ]
        .concat()
    };
    let good = npy::write(&[1, 2, 3]);
    let with = |from: &str, to: &str| {
        let text = good.iter().map(|b| char::from(*b)).collect::<String>();
        assert!(text.contains(from));
        text.replace(from, to)
            .chars()
            .map(|c| c as u8)
            .collect::<Vec<_>>()
    };
    for (bytes, cause) in [
        (b"PK\x03\x04".to_vec(), "not a .npy file"),
        (with("NUMPY\x01", "NUMPY\x09"), "version 9.0"),
        (with("<i2", ">i2"), "the type is not '<i2'"),
        (with("<i2", "<f2"), "the type is not '<i2'"),
        (with("False", "True "), "the order is not C"),
        (with("(3,", "(3,1,"), "the shape is not one number"),
        (with("(3,", "("), "the shape is not one number"),
        (
            with("(3,", "(9,"),
            "samples by the .npy header: 9; in the file: 3",
        ),
        (
            good[..good.len() - 1].to_vec(),
            "5 bytes of samples are an odd number",
        ),
        (good[..40].to_vec(), "ends within its header"),
        (
            b"\x93NUMPY\x02\0\xff\xff\xff\xff".to_vec(),
            "ends within its header",
        ),
        (
            header("{'descr': '<i2', 'fortran_order': False, 'shape': (18446744073709551615,), }"),
            "samples by the .npy header: 18446744073709551615;",
        ),
        (header(&"{[(".repeat(60)), "the .npy header is {[("),
    ] {
        // with a manifest that has the right hash of the wrong file
        let (folder, _) = own();
        let path = folder.path().join("t003_s004_pdc.npy");
        let old = sha256(&fs::read(&path).unwrap());
        edit(&folder.path().join(OWN_MANIFEST), &old, &sha256(&bytes));
        fs::write(&path, &bytes).unwrap();
        fails(folder.path(), &["t003_s004_pdc.npy: ", cause]);
    }
}

#[test]
fn a_changed_byte_is_a_wrong_hash() {
    let (folder, _) = own();
    let path = folder.path().join("t003_s004_pac.npy");
    let mut bytes = fs::read(&path).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    fs::write(&path, bytes).unwrap();
    fails(
        folder.path(),
        &["t003_s004_pac.npy: SHA-256", "damaged or changed"],
    );
}

#[test]
fn labels_come_back_and_may_be_missing() {
    let folder = tempfile::tempdir().unwrap();
    let given = Labels {
        session: "monday".to_owned(),
        run: "7".to_owned(),
        sensor: String::new(),
        lot: "7, front".to_owned(),
        operator: "Ánna \"A\"".to_owned(),
        note: String::new(),
        moved: Some(false),
        finger: FingerCode(200),
        calibrated: 20_261_121,
    };
    let texture = |id: u32| Texture {
        id,
        name: format!("t{id}"),
    };
    let textures = vec![texture(1), texture(2)];
    let writer = RecordingWriter::begin(folder.path(), textures, "test").unwrap();
    let mut writer = writer.labelled(given.clone());
    let measured = Recording {
        pace: Some(-341),
        ..slide(0, 1)
    };
    writer.write(&measured).unwrap();
    let mut writer = writer.labelled(Labels::default());
    writer.write(&slide(1, 1)).unwrap();
    writer.finish().unwrap();
    let labels = |texture| {
        let set = RecordingSet::open(folder.path()).unwrap();
        set.slides(texture)[0].labels.clone()
    };
    assert_eq!([labels(0), labels(1)], [given, Labels::default()]);
    let pace = |folder, texture| {
        RecordingSet::open(folder)
            .unwrap()
            .load_texture(texture)
            .unwrap()[0]
            .pace
    };
    let paces = [0, 1].map(|texture| pace(folder.path(), texture));
    assert_eq!(paces, [Some(-341), None]);
    // a value that is neither yes nor no is unknown
    let manifest = folder.path().join("manifest.csv");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(&manifest, text.replace(",,no,", ",,maybe,")).unwrap();
    let why = RecordingSet::open(folder.path()).unwrap_err().to_string();
    assert!(
        why.contains("moved") && why.contains("\"maybe\" is not yes, no or nothing"),
        "{why}"
    );
    fs::write(&manifest, &text).unwrap();
    // and an import keeps them
    let copy = tempfile::tempdir().unwrap();
    let to = copy.path().join("to");
    crate::data::import::import(folder.path(), &to, &mut |_, _| ()).unwrap();
    let copied = RecordingSet::open(&to).unwrap();
    assert_eq!(copied.slides(0)[0].labels, labels(0));
    assert_eq!(pace(&to, 0), Some(-341));
    // written by hand, without labels
    let manifest = folder.path().join("manifest.csv");
    let text = fs::read_to_string(&manifest).unwrap();
    let bare = text.replace(
        ",lot,operator,note,moved,finger,calibrated,pace,version,session,run,highest_hz",
        "",
    );
    let bare = bare.replace(
        ",\"7, front\",\"Ánna \"\"A\"\"\",,no,finger-200,20261121,-341,1,monday,7,",
        "",
    );
    let bare: String = bare
        .lines()
        .map(|line| {
            format!(
                "{}\n",
                line.strip_suffix(",,,,,biotac,,,1,,,").unwrap_or(line)
            )
        })
        .collect();
    fs::write(&manifest, bare).unwrap();
    assert_eq!(
        [labels(0), labels(1)],
        [Labels::default(), Labels::default()]
    );
}

#[test]
fn many_rows_and_names_are_read_in_little_time() {
    let folder = TempDir::new().unwrap();
    let mut manifest = own::COLUMNS.join(",");
    let mut table = "texture,movement,trial,set,traction,roughness,fineness".to_owned();
    for row in 0..400_000 {
        let (texture, slide, set) = (
            row % 100_000,
            row / 100_000,
            ["train", "validate"][row / 300_000],
        );
        let speed_um_s = 5000 + row % 100_000;
        manifest += &format!(
            "\n{texture},name {texture},{slide},0.5,{}e-3,0,1,2,,,{row}.npy,2200,a,{row}.npy,2200,b,,1000,",
            speed_um_s
        );
        table += &format!("\nname {texture},1,{slide},{set},1,2,3");
    }
    fs::write(folder.path().join(OWN_MANIFEST), manifest).unwrap();
    let file = folder.path().join("table.csv");
    fs::write(&file, table).unwrap();
    let before = ticks();
    let set = RecordingSet::open(folder.path()).unwrap();
    assert_eq!(
        (set.textures().len(), set.movements().len()),
        (100_000, 100_000)
    );
    let table = crate::data::properties::PropertyTable::read(&file).unwrap();
    assert_eq!(
        (table.textures.len(), table.train[99_999][0].len()),
        (100_000, 3)
    );
    // 2 s of this thread alone, whatever else the machine does
    assert!(ticks() - before < 1000, "{} ticks", ticks() - before);
}

/// What this thread has computed so far, in hundredths of a second; 0 where Linux does not say it.
fn ticks() -> u64 {
    let stat = fs::read_to_string("/proc/thread-self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default();
    // user and system time, behind the name
    let times = fields.split_whitespace().skip(11).take(2);
    times.filter_map(|ticks| ticks.parse::<u64>().ok()).sum()
}

#[test]
fn what_is_in_memory_at_once_is_bounded_and_stays_in_its_order() {
    use std::sync::atomic::{AtomicU64, Ordering::SeqCst};
    let (now, most) = (AtomicU64::new(0), AtomicU64::new(0));
    let work = |item: &u64| {
        most.fetch_max(now.fetch_add(*item, SeqCst) + item, SeqCst);
        std::thread::sleep(std::time::Duration::from_millis(2));
        now.fetch_sub(*item, SeqCst);
        Ok::<_, ()>(*item)
    };
    let mut items: Vec<u64> = (0..40).map(|n| (n % 5 * 50) << 20).collect();
    assert_eq!(
        each_in_flight(&items, |item| *item, work).as_ref(),
        Ok(&items)
    );
    assert!((200 << 20..=IN_FLIGHT).contains(&most.load(SeqCst)));
    // one that is more than the limit comes alone
    items[7] = 400 << 20;
    assert_eq!(
        each_in_flight(&items, |item| *item, work).as_ref(),
        Ok(&items)
    );
    assert_eq!(most.into_inner(), 400 << 20);
}
