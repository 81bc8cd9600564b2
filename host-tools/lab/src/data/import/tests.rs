use std::fmt::Write as _;

use tempfile::TempDir;

use super::*;
use crate::data::cells;

/// P_AC of slide `number`, 6 s long.
fn pac(number: u32) -> Vec<i16> {
    let tone = |n: usize| 90.0 * (n as f64 * (0.05 + 0.01 * f64::from(number)) + 0.2).sin();
    (0..13_200).map(|n| tone(n).round() as i16).collect()
}

/// The two files of a slide as the publisher writes them. The force is 1 N + 2 N/s.
fn csv(number: u32, line_end: &str) -> (String, String) {
    let range =
        |name: &str, to: u32| -> String { (1..=to).map(|n| format!(",{name}{n}")).collect() };
    let mut bio = format!(
        "timestamp,tdc,tac,pdc{}{}{line_end}",
        range("pac", 22),
        range("ele", 19)
    );
    let start = 1_581_073_084.69;
    for (row, samples) in pac(number).chunks(22).enumerate() {
        write!(bio, "{:.9},3,100,{row}", start + row as f64 / 100.0).unwrap();
        for x in samples {
            write!(bio, ",{}", x.abs()).unwrap();
        }
        // a comma too many, as in the real files
        write!(bio, "{},{line_end}", ",7".repeat(19)).unwrap();
    }
    let mut cw = format!("timestamp,fx,fy,fz,tx,ty,tz{line_end}");
    // begins after the slide does
    for n in 1..400 {
        let t = f64::from(n) * 0.0151;
        write!(
            cw,
            "{:.9},-1.9,3,{:.6},1.9,1.5,0.2{line_end}",
            start + t,
            1.0 + 2.0 * t
        )
        .unwrap();
    }
    (bio, cw)
}

/// Two slides over mat2 and one over mat10, below raw_data.
fn publisher() -> TempDir {
    publisher_of(&[(2, 10, "\n"), (2, 9, "\r\n"), (10, 1, "\n")])
}

/// Materials, slides and line ends.
fn publisher_of(slides: &[(u32, u32, &str)]) -> TempDir {
    let folder = TempDir::new().unwrap();
    let raw = folder.path().join("raw_data");
    for &(material, number, line_end) in slides {
        let to = raw.join(format!("mat{material}"));
        fs::create_dir_all(&to).unwrap();
        let (bio, cw) = csv(number, line_end);
        fs::write(to.join(format!("mat{material}_{number}_bio.csv")), bio).unwrap();
        fs::write(to.join(format!("mat{material}_{number}_cw.csv")), cw).unwrap();
        // the files beside them are let alone
        fs::write(
            to.join(format!("mat{material}_{number}_jp.csv")),
            "no,table",
        )
        .unwrap();
        fs::write(to.join(format!("mat{material}_{number}.pt")), [0xff; 9]).unwrap();
    }
    fs::create_dir(raw.join("material")).unwrap();
    folder
}

#[track_caller]
fn fails(from: &Path, parts: &[&str]) {
    let to = TempDir::new().unwrap();
    let message = import(from, to.path(), &mut |_, _| ())
        .unwrap_err()
        .to_string();
    for part in parts {
        assert!(message.contains(part), "{part:?} is not in {message:?}");
    }
    assert!(!is_there(to.path()));
}

#[test]
fn the_publishers_files_are_read() {
    let (from, to) = (publisher(), TempDir::new().unwrap());
    let mut calls = Vec::new();
    let done = import(from.path(), to.path(), &mut |n, of| calls.push((n, of))).unwrap();
    let expected = Imported {
        textures: 2,
        slides: 3,
        ..Imported::default()
    };
    assert_eq!(done, expected);
    assert_eq!(calls, [(1, 3), (2, 3), (3, 3)]);

    let set = RecordingSet::open(to.path()).unwrap();
    let names: Vec<_> = set
        .textures()
        .iter()
        .map(|t| (t.id, t.name.as_str()))
        .collect();
    assert_eq!(names, [(2, "mat2"), (10, "mat10")]);
    for (texture, numbers) in [&[9, 10][..], &[1]].into_iter().enumerate() {
        let slides = set.load_texture(texture).unwrap();
        for (slide, &number) in slides.iter().zip(numbers) {
            assert_eq!(slide.number, number);
            assert_eq!(slide.pac(), pac(number));
            assert_eq!(slide.pdc, (0..600).collect::<Vec<i16>>());
            assert_eq!(slide.movement.to_string(), "0.80 N, 25.0 mm/s");
            assert_eq!(
                (slide.pdc_rate_hz, slide.shear_rate_hz, slide.window),
                (100.0, 100.0, (0.5, 5.5))
            );
            // held at the first force before it was measured, else on the line
            let shear = slide.shear_mn().unwrap();
            assert_eq!(shear[..2], [1030, 1030]);
            for (row, mn) in shear.iter().enumerate().skip(2) {
                assert_eq!(*mn, 1000 + 20 * row as i16, "row {row}");
            }
        }
        assert_eq!(slides.len(), numbers.len());
    }
}

#[test]
fn slides_whose_clock_jumps_or_whose_sensor_is_dead_are_left_out_and_named() {
    type Change = fn(&mut Vec<String>);
    let changes: [(&str, &str, Change, &str); 6] = [
        (
            "bio",
            "rows are missing",
            |rows| drop(rows.drain(100..103)),
            "bio.csv:101: column timestamp: +0.040 s",
        ),
        (
            "bio",
            "one row is missing",
            |rows| drop(rows.remove(300)),
            "bio.csv:301: column timestamp: +0.020 s",
        ),
        (
            "bio",
            "the clock goes back",
            |rows| rows.swap(200, 201),
            "bio.csv:201: column timestamp: +0.020 s",
        ),
        (
            "bio",
            "a row comes twice",
            |rows| rows.insert(7, rows[7].clone()),
            "bio.csv:9: column timestamp: +0.000 s",
        ),
        (
            "cw",
            "the clock goes back",
            |rows| rows.swap(50, 51),
            "cw.csv:52: column timestamp: -0.015 s",
        ),
        ("bio", "P_AC hangs", hangs, "P_AC never changed"),
    ];
    for (file, what, change, why) in changes {
        let (from, to) = (publisher(), TempDir::new().unwrap());
        // the folder with the materials themselves will do as well
        let raw = from.path().join("raw_data");
        let path = raw.join(format!("mat2/mat2_9_{file}.csv"));
        let text = fs::read_to_string(&path).unwrap();
        let mut rows: Vec<String> = text.lines().map(str::to_owned).collect();
        change(&mut rows);
        fs::write(&path, rows.join("\n")).unwrap();
        let done = import(&raw, to.path(), &mut |_, _| ()).unwrap();
        let [left_out] = &done.left_out[..] else {
            panic!("{what}: {:?}", done.left_out);
        };
        assert!(left_out.starts_with("slide 9 of mat2: "), "{left_out}");
        assert!(
            left_out.contains(why),
            "{what}: {why:?} is not in {left_out:?}"
        );
        assert_eq!((done.textures, done.slides), (2, 2), "{what}");
        let set = RecordingSet::open(to.path()).unwrap();
        assert_eq!(set.slides(0).len(), 1, "{what}");
    }
    // of a texture with no slide left the reason is said
    let from = publisher_of(&[(2, 9, "\n")]);
    let path = from.path().join("raw_data/mat2/mat2_9_bio.csv");
    let text = fs::read_to_string(&path).unwrap();
    let mut rows: Vec<String> = text.lines().map(str::to_owned).collect();
    hangs(&mut rows);
    fs::write(&path, rows.join("\n")).unwrap();
    fails(
        from.path(),
        &[
            "no slide of mat2 can be used",
            "slide 9 of mat2: P_AC never changed",
        ],
    );
}

/// P_AC from the second second on is that of a sensor that hangs.
#[allow(clippy::ptr_arg)] // as the other changes
fn hangs(rows: &mut Vec<String>) {
    for row in &mut rows[101..] {
        let cells: Vec<&str> = row.split(',').collect();
        let mut cells: Vec<String> = cells.into_iter().map(str::to_owned).collect();
        cells[4..26].fill("2047".to_owned());
        *row = cells.join(",");
    }
}

#[test]
fn what_is_wrong_with_the_publishers_files_is_named() {
    const CASES: &str = r#"
mat2_9_bio.csv | 1 | pac7, | | mat2_9_bio.csv:1:  | no column pac7
mat2_9_bio.csv | 3 | 158 | x158 | mat2_9_bio.csv:3: column timestamp | is not a number
mat2_9_bio.csv | 3 | 1581073084 | 1581073083 | mat2_9_bio.csv:3: column timestamp | -0.990 s after the row before
mat2_9_bio.csv | 4 | ,100,2, | ,100,NaN, | mat2_9_bio.csv:4: column pdc | "NaN" is not a count
mat2_9_bio.csv | 4 | ,100,2, | ,100,2,- | mat2_9_bio.csv:4: column pac1 | is not a count of 0 to 4095
mat2_9_bio.csv | 4 | ,100,2, | ,100,4096, | mat2_9_bio.csv:4: column pdc | 4096 is not a count of 0 to 4095
mat2_9_bio.csv | 601 | ,7,7,7, | | mat2_9_bio.csv:601:  | 42 fields where the header has 45
mat2_9_cw.csv | 1 | ,fz, | ,force, | mat2_9_cw.csv:1:  | no column fz
mat2_9_cw.csv | 9 | -1.9,3, | -1.9,3,inf, | mat2_9_cw.csv:9:  | fields
mat2_9_cw.csv | 5 | ,3,1 | ,3,NaN | mat2_9_cw.csv:5: column fz | is not a
mat2_9_cw.csv | 5 | ,3,1 | ,3,91 | mat2_9_cw.csv:5: column fz | fetch the file again
mat2_9_cw.csv | 5 | 1581073084 | 1581073083 | mat2_9_cw.csv:5: column timestamp | -0.985 s after the row before
"#;
    for [file, line, from, to, place, cause] in cells(CASES) {
        let folder = publisher_of(&[(2, 9, "\n")]);
        let path = folder.path().join("raw_data/mat2").join(file);
        let text = fs::read_to_string(&path).unwrap();
        let line: usize = line.parse().unwrap();
        let mut lines: Vec<String> = text.lines().map(str::to_owned).collect();
        let changed = lines[line - 1].replacen(from, to, 1);
        assert_ne!(
            changed,
            lines[line - 1],
            "nothing to edit in line {line} of {file}"
        );
        lines[line - 1] = changed;
        fs::write(&path, lines.join("\r\n")).unwrap();
        fails(folder.path(), &[place, cause]);
    }
}

#[test]
fn missing_short_and_foreign_files_are_named() {
    let change = |file: &str, contents: Option<&str>, parts: &[&str]| {
        let folder = publisher_of(&[(2, 9, "\n")]);
        let path = folder.path().join("raw_data/mat2").join(file);
        match contents {
            Some(text) => fs::write(&path, text).unwrap(),
            None => fs::remove_file(&path).unwrap(),
        }
        fails(folder.path(), parts);
    };
    change(
        "mat2_9_cw.csv",
        None,
        &["mat2_9_cw.csv:1: ", "No such file"],
    );
    change(
        "mat2_9_bio.csv",
        None,
        &["mat2_9_bio.csv:1: ", "No such file"],
    );
    change(
        "mat2_9_bio.csv",
        Some(""),
        &["mat2_9_bio.csv:1: ", "no column timestamp"],
    );
    let (bio, cw) = csv(9, "\n");
    let lines = |text: &str, n: usize| text.lines().take(n).collect::<Vec<_>>().join("\n");
    change(
        "mat2_9_bio.csv",
        Some(&lines(&bio, 550)),
        &[
            "mat2_9_bio.csv: P_AC (samples: 12078",
            "before the steady window does (5.5 s)",
            "fetch the file again",
        ],
    );
    change(
        "mat2_9_cw.csv",
        Some(&lines(&cw, 1)),
        &["mat2_9_cw.csv: no force at the time"],
    );
    change(
        "mat2_9_cw.csv",
        Some("timestamp,fz\n1681073084.7,1\n1681073084.8,1"),
        &["mat2_9_cw.csv: no force at the time"],
    );

    let empty = TempDir::new().unwrap();
    fails(
        empty.path(),
        &[
            "nothing to import",
            "mat1_1_bio.csv",
            "dexrob/BioTac_slide_20_50",
        ],
    );
    fails(&empty.path().join("nowhere"), &["nowhere: no such folder"]);
}

#[test]
fn a_folder_with_a_manifest_is_copied() {
    let (from, own, copy) = (
        publisher_of(&[(2, 9, "\n"), (10, 1, "\n")]),
        TempDir::new().unwrap(),
        TempDir::new().unwrap(),
    );
    import(from.path(), own.path(), &mut |_, _| ()).unwrap();
    let mut calls = 0;
    let done = import(own.path(), copy.path(), &mut |_, _| calls += 1).unwrap();
    assert_eq!((done.textures, done.slides, calls), (2, 2, 2));
    let (a, b) = (
        RecordingSet::open(own.path()).unwrap(),
        RecordingSet::open(copy.path()).unwrap(),
    );
    assert_eq!(a.textures(), b.textures());
    for texture in 0..2 {
        assert_eq!(
            a.load_texture(texture).unwrap(),
            b.load_texture(texture).unwrap()
        );
    }
    let taken = import(from.path(), copy.path(), &mut |_, _| ())
        .unwrap_err()
        .to_string();
    assert!(taken.contains("already holds recordings"), "{taken}");
}
