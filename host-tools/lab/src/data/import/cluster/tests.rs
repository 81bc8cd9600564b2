use std::f64::consts::TAU;
use std::fs;

use tactus_tests::cluster::{EXAMPLE, Slide};
use tempfile::TempDir;

use super::*;
use crate::data::recordings::RecordingSet;

fn dataset(slides: &[Slide]) -> TempDir {
    let folder = TempDir::new().unwrap();
    slides
        .iter()
        .for_each(|slide| slide.write(folder.path()).unwrap());
    folder
}

fn imported(from: &TempDir) -> (Imported, Vec<Recording>) {
    let to = TempDir::new().unwrap();
    let done = import(from.path(), to.path(), &mut |_, _| ()).unwrap();
    let set = RecordingSet::open(to.path()).unwrap();
    let slides = (0..done.textures).flat_map(|texture| set.load_texture(texture).unwrap());
    (done, slides.collect())
}

/// Amplitude of the tone of `hz` in the middle of P_AC, counts rms, and what else is there.
fn tone(pac: &[i16], hz: f64) -> (f64, f64) {
    let middle = &pac[pac.len() / 4..pac.len() * 3 / 4];
    let n = middle.len() as f64;
    let [mut re, mut im, mut all] = [0.0; 3];
    for (k, x) in middle.iter().enumerate() {
        let (x, angle) = (f64::from(*x), TAU * hz * k as f64 / f64::from(PAC_RATE_HZ));
        re += x * angle.cos();
        im += x * angle.sin();
        all += x * x;
    }
    let tone = 2.0 * (re * re + im * im) / (n * n);
    (tone.sqrt(), (all / n - tone).max(0.0).sqrt())
}

/// Whole cycles in the half of a slide that [`tone`] looks at are not needed: leakage of a tone over seconds is below a count.
#[test]
fn a_tone_keeps_its_strength_at_every_rate_and_what_is_above_the_band_is_gone() {
    // jitter of a third, as in the description's example
    for (rate, jitter) in [(6000.0, 0.0), (6000.0, 0.3), (26_700.0, 0.0), (5317.3, 0.0)] {
        for (hz, g) in [(100.0, 0.1), (200.0, 0.5), (500.0, 0.2)] {
            let slide = Slide {
                rate,
                jitter,
                hz,
                g,
                ..EXAMPLE
            };
            let (_, slides) = imported(&dataset(&[slide]));
            let (found, rest) = tone(&slides[0].pac(), hz);
            let wanted = g / G_PER_COUNT / 2.0_f64.sqrt();
            // the high-pass takes 0.5 % of 100 Hz; jittered times lose by the lines between them
            let lost = if jitter > 0.0 {
                (hz / rate).powi(2) * 4.0
            } else {
                0.0
            };
            assert!(
                (found / wanted - 1.0).abs() < 0.007 + lost,
                "{rate} {jitter} {hz}: {found}, {wanted}"
            );
            let noise = if jitter > 0.0 { 0.03 } else { 0.002 };
            assert!(
                rest < 1.5 + noise * wanted,
                "{rate} {jitter} {hz}: {rest} beside {wanted}"
            );
        }
        if jitter == 0.0 {
            // they would fold into the band
            for hz in [1250.0, 2000.0, 2400.0] {
                let slide = Slide {
                    rate,
                    hz,
                    g: 1.0,
                    ..EXAMPLE
                };
                let (_, slides) = imported(&dataset(&[slide]));
                let (_, rest) = tone(&slides[0].pac(), 100.0);
                assert!(rest < 1.0, "{rate} {hz}: {rest}");
            }
        }
    }
}

#[test]
fn slides_have_their_names_forces_windows_and_numbers() {
    let firm = Slide {
        mn: 1000,
        mm_s: 20,
        degrees: 0,
        ..EXAMPLE
    };
    let again = Slide {
        repetition: 1,
        ..firm
    };
    let other = Slide {
        surface: 117,
        ..firm
    };
    let from = dataset(&[other, again, EXAMPLE, firm]);
    let (done, slides) = imported(&from);
    assert_eq!((done.textures, done.slides, done.left_out), (2, 4, 0));
    let of = |slide: &Recording| (slide.texture, slide.number, slide.movement.to_string());
    let said: Vec<_> = slides.iter().map(of).collect();
    let name = |texture, number, movement: &str| (texture, number, movement.to_owned());
    let wanted = [
        name(0, 2, "1.00 N, 20.0 mm/s"),
        name(0, 35, "0.50 N, 40.0 mm/s"),
        name(0, 82, "1.00 N, 20.0 mm/s"),
        name(1, 2, "1.00 N, 20.0 mm/s"),
    ];
    assert_eq!(said, wanted);
    for slide in &slides {
        assert_eq!(slide.shear_mn(), None);
        let mn = f32::from(slide.movement.force_mn());
        // 9.35 mN a count
        let counts = (mn / 9.3523).round() as i16;
        assert!(
            slide.pdc.iter().all(|pdc| *pdc == counts),
            "{:?}",
            slide.pdc
        );
        // at rest for 0.3 s, then 90 mm, of which 9 to 81 count
        let mm_s = f32::from(u16::try_from(slide.movement.speed_um_s() / 1000).unwrap());
        let [from, to] = [9.0, 81.0].map(|mm| 0.3 + mm / mm_s - 0.001);
        let (begin, end) = slide.window;
        assert!(
            (begin - from).abs() < 0.02 && (end - to).abs() < 0.02,
            "{begin} {end}"
        );
    }
}

#[test]
fn an_import_that_was_interrupted_goes_on() {
    let from = dataset(&[
        EXAMPLE,
        Slide {
            repetition: 1,
            ..EXAMPLE
        },
    ]);
    let to = TempDir::new().unwrap();
    let force = from.path().join("sensor_data/force/0/0_135_40_500_1.csv");
    let text = fs::read(&force).unwrap();
    fs::remove_file(&force).unwrap();
    import(from.path(), to.path(), &mut |_, _| ()).unwrap_err();
    fs::write(&force, text).unwrap();
    let done = import(from.path(), to.path(), &mut |_, _| ()).unwrap();
    assert_eq!(done.slides, 2);
}

/// Changes a file of the example.
fn damaged(kind: &str, damage: impl Fn(&str) -> String) -> TempDir {
    let from = dataset(&[EXAMPLE]);
    let path = from
        .path()
        .join("sensor_data")
        .join(kind)
        .join(EXAMPLE.file());
    let text = fs::read_to_string(&path).unwrap();
    fs::write(&path, damage(&text)).unwrap();
    from
}

fn without_lines(text: &str, from: usize, to: usize) -> String {
    let kept = text
        .lines()
        .enumerate()
        .filter(|(n, _)| !(from..to).contains(n));
    kept.map(|(_, line)| format!("{line}\n")).collect()
}

#[test]
fn a_slide_in_which_the_sensor_paused_is_left_out_and_counted() {
    for (kind, rows, left_out) in [("accel", 50, 0), ("accel", 70, 1), ("force", 70, 1)] {
        let from = damaged(kind, |text| without_lines(text, 5000, 5000 + rows));
        Slide {
            repetition: 1,
            ..EXAMPLE
        }
        .write(from.path())
        .unwrap();
        let (done, slides) = imported(&from);
        assert_eq!(done.left_out, left_out, "{kind} {rows}");
        assert_eq!((done.slides, slides.len()), (2 - left_out, 2 - left_out));
    }
}

#[test]
fn what_is_damaged_is_named() {
    let fails = |from: &TempDir, parts: &[&str]| {
        let to = TempDir::new().unwrap();
        let error = import(from.path(), to.path(), &mut |_, _| ())
            .unwrap_err()
            .to_string();
        for part in parts {
            assert!(error.contains(part), "{part:?} is not in {error:?}");
        }
    };
    let file = "0_135_40_500_0.csv";
    for kind in ["force", "position"] {
        let from = dataset(&[EXAMPLE]);
        fs::remove_file(
            from.path()
                .join("sensor_data")
                .join(kind)
                .join(EXAMPLE.file()),
        )
        .unwrap();
        fails(&from, &[kind, file, "No such file"]);
    }
    for kind in ["accel", "force", "position"] {
        let header = |text: &str| text.lines().next().unwrap_or_default().to_owned();
        fails(
            &damaged(kind, |_| String::new()),
            &[kind, file, "no column"],
        );
        fails(&damaged(kind, header), &[kind, file, "too short"]);
        fails(
            &damaged(kind, |text| format!("{text}1.5\n")),
            &[kind, file, "fields where the header has"],
        );
        fails(
            &damaged(kind, |text| text.replacen("time", "t", 1)),
            &[kind, file, "no column time"],
        );
        fails(
            &damaged(kind, |text| format!("{text}{text}")),
            &[kind, file],
        );
        let nan = |text: &str| {
            text.lines()
                .enumerate()
                .map(|(n, line)| {
                    let (head, _) = line.rsplit_once(',').unwrap();
                    if n == 7 {
                        format!("{head},NaN\n")
                    } else {
                        format!("{line}\n")
                    }
                })
                .collect()
        };
        fails(
            &damaged(kind, nan),
            &[kind, file, ":8", "not a finite number"],
        );
    }
    // cut off: before the way ends, and in the middle of it
    fails(
        &damaged("accel", |text| without_lines(text, 9000, usize::MAX)),
        &[file, "ends before the steady window does"],
    );
    fails(
        &damaged("force", |text| without_lines(text, 9000, usize::MAX)),
        &[file, "force", "ends"],
    );
    // one row in ten: no rate for P_AC
    let tenth = |text: &str| {
        text.lines()
            .enumerate()
            .filter(|(n, _)| n % 10 == 0)
            .map(|(_, line)| format!("{line}\n"))
            .collect()
    };
    fails(&damaged("accel", tenth), &[file, "a rate of"]);
    let slow = |text: &str| text.replace(",45.0000", ",450000");
    fails(
        &damaged("position", slow),
        &[file, "where the file's name says 40"],
    );
    let still = |text: &str| {
        text.lines()
            .enumerate()
            .map(|(n, line)| {
                let (time, _) = line.split_once(',').unwrap();
                if n == 0 {
                    format!("{line}\n")
                } else {
                    format!("{time},0,45\n")
                }
            })
            .collect()
    };
    fails(
        &damaged("position", still),
        &[file, "where the file's name says 40"],
    );
    fails(
        &damaged("force", |text| text.replace(",0.500", ",50")),
        &[file, "tear the finger off"],
    );
}

#[test]
fn folders_and_names_of_another_layout_are_refused() {
    let fails = |from: &TempDir, part: &str| {
        let to = TempDir::new().unwrap();
        let error = import(from.path(), to.path(), &mut |_, _| ())
            .unwrap_err()
            .to_string();
        assert!(error.contains(part), "{part:?} is not in {error:?}");
    };
    let empty = TempDir::new().unwrap();
    fails(&empty, "no slide of the Cluster Haptic Texture Dataset");
    let accel = empty.path().join("sensor_data/accel/3");
    fs::create_dir_all(&accel).unwrap();
    fs::write(accel.join("3_0_20_500_0.parquet"), "PAR1").unwrap();
    fails(&empty, ".parquet is not");
    for (name, part) in [
        ("119_0_20_500_0.csv", "no surface 119"),
        ("3_0_20_500.csv", "the name is not"),
        ("3_30_20_500_0.csv", "the name is not"),
        ("3_0_25_500_0.csv", "the name is not"),
        ("3_0_20_700_0.csv", "the name is not"),
        ("3_0_20_500_2.csv", "the name is not"),
        ("03_0_20_500_0.csv", "the name is not"),
    ] {
        fs::write(accel.join(name), "").unwrap();
        fails(&empty, part);
        fs::remove_file(accel.join(name)).unwrap();
    }
}
