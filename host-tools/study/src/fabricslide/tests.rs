//! Folders of fabrics, whole and damaged, and the features of known slides.
use std::f64::consts::PI;
use std::fs;
use std::io::Write as _;
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use serde_json::{Value, json};
use tactus_core::features::Movement;
use tempfile::TempDir;

use super::features::{Meter, SHORTEST};
use super::*;

mod damage;

/// (set-point, speed in mm/s, direction, rep, rows)
type Recording = (u16, u32, i8, u8, usize);

/// Both repetitions of every one of `movements` in every one of `directions`.
fn recordings_of(movements: &[(u16, u32)], directions: &[i8]) -> Vec<Recording> {
    let mut list = Vec::new();
    for &(setpoint, speed) in movements {
        for &direction in directions {
            for rep in [0, 1] {
                list.push((setpoint, speed, direction, rep, 300));
            }
        }
    }
    list
}

/// Rows of 16 taxels with the value `f(time, taxel)`.
fn rows(count: usize, f: impl Fn(usize, usize) -> u16) -> Vec<u8> {
    (0..count)
        .flat_map(|t| (0..TAXELS).map(move |taxel| (t, taxel)))
        .flat_map(|(t, taxel)| f(t, taxel).to_le_bytes())
        .collect()
}

/// Noise about 100 counts that is the same in every run.
fn noise(seed: usize) -> impl Fn(usize, usize) -> u16 {
    move |t, taxel| {
        let x = (t * TAXELS + taxel + seed * 7919) as u64;
        100 + (x.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 58) as u16
    }
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut gz = GzEncoder::new(Vec::new(), Compression::fast());
    gz.write_all(bytes).unwrap();
    gz.finish().unwrap()
}

/// Writes the file of a fabric; gives back its entry in the manifest.
fn fabric(folder: &Path, name: &str, recordings: &[Recording], raw: &[u8]) -> Value {
    let packed = gzip(raw);
    let file = format!("{name}.u16le.gz");
    fs::write(folder.join(&file), &packed).unwrap();
    let mut offset = 0;
    let mut slides = Vec::new();
    for &(setpoint, speed, direction, rep, n) in recordings {
        slides.push(json!({
            "pressure_setpoint": setpoint, "speed_mm_s": speed, "direction": direction, "rep": rep,
            "n": n, "t_ticks": n * 28, "offset_values": offset,
        }));
        offset += n * TAXELS;
    }
    json!({
        "file": file, "fabric": name, "slides": slides,
        "sha256_gz": tactus_lab::data::recordings::files::sha256(&packed),
        "sha256_raw": tactus_lab::data::recordings::files::sha256(raw),
    })
}

fn manifest(folder: &Path, fabrics: &[Value]) {
    let json = json!({ "title": "synthetic", "files": fabrics });
    fs::write(
        folder.join(MANIFEST),
        serde_json::to_vec_pretty(&json).unwrap(),
    )
    .unwrap();
}

/// A folder of fabrics named A, B, ... that all feel like noise.
fn folder(fabrics: &[Vec<Recording>]) -> TempDir {
    let folder = TempDir::new().unwrap();
    let entries: Vec<Value> = fabrics
        .iter()
        .enumerate()
        .map(|(k, recordings)| {
            let count = recordings.iter().map(|r| r.4).sum();
            let name = char::from(b'A' + k as u8).to_string();
            fabric(
                folder.path(),
                &name,
                recordings,
                &rows(count, noise(k * 1000)),
            )
        })
        .collect();
    manifest(folder.path(), &entries);
    folder
}

/// Two fabrics of two movements.
fn small() -> TempDir {
    let list = recordings_of(&[(120, 10), (120, 20)], &[-1]);
    folder(&[list.clone(), list])
}

fn movements(list: &[(u16, u32)]) -> Vec<Movement> {
    list.iter()
        .map(|&(setpoint, speed)| Movement::new(setpoint, speed * 1000).unwrap())
        .collect()
}

#[test]
fn two_halves_of_both_repetitions_come_in_order() {
    let set = FabricSet::open(small().path()).unwrap();
    assert_eq!(set.fabrics, ["A", "B"]);
    assert_eq!(set.movements, movements(&[(120, 10), (120, 20)]));
    let found: Vec<_> = set
        .slides
        .iter()
        .map(|s| (s.fabric, s.movement, s.repetition))
        .collect();
    let mut expected = Vec::new();
    for fabric in 0..2 {
        for movement in 0..2 {
            for repetition in [0, 0, 1, 1] {
                expected.push((fabric, movement, repetition));
            }
        }
    }
    assert_eq!(found, expected);
    let different = set
        .slides
        .windows(2)
        .all(|w| w[0].ln_bands != w[1].ln_bands);
    assert!(different, "every slide is of its own samples");
}

#[test]
fn the_order_of_recordings_in_the_manifest_does_not_matter() {
    let folder = small();
    let set = FabricSet::open(folder.path()).unwrap();
    let path = folder.path().join(MANIFEST);
    let mut json: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    for file in json["files"].as_array_mut().unwrap() {
        file["slides"].as_array_mut().unwrap().reverse();
    }
    fs::write(&path, json.to_string()).unwrap();
    assert_eq!(FabricSet::open(folder.path()).unwrap(), set);
}

#[test]
fn the_start_of_a_recording_is_dropped_and_the_rest_halved() {
    // 6 % of 212 are 12.7 rows; 201 rows remain when the recording has one row more
    assert_eq!(cut(&(1000..1212)), [1012..1112, 1112..1212]);
    assert_eq!(cut(&(0..213)), [12..112, 112..212]);
    assert_eq!(cut(&(5..6)), [5..5, 5..5]);

    // the dropped part is not measured
    let recordings = [(120, 10, 1, 0, 300), (120, 10, 1, 1, 300)];
    let folder = TempDir::new().unwrap();
    let loud = |t: usize, taxel: usize| match t % 300 {
        0..18 => 60_000 * (t % 2) as u16,
        t => noise(0)(t, taxel),
    };
    let entry = fabric(folder.path(), "A", &recordings, &rows(600, loud));
    manifest(folder.path(), &[entry]);
    let set = FabricSet::open(folder.path()).unwrap();
    let power = set.slides.iter().map(|s| s.properties[0]);
    assert!(
        power.clone().all(|p| p < 7.0),
        "{:?}",
        power.collect::<Vec<_>>()
    );
}

#[test]
fn movements_are_those_that_every_fabric_has_with_both_repetitions() {
    let all = [(120, 10), (120, 20), (150, 10), (150, 20)];
    let full = recordings_of(&all, &[-1, 1]);
    // no direction 1, another movement, and 20 mm/s with 150 in one repetition only
    let mut part = recordings_of(&[all[0], all[1], all[2], (180, 10)], &[-1]);
    part.push((150, 20, -1, 0, 300));
    let set = FabricSet::open(folder(&[full.clone(), part]).path()).unwrap();
    assert_eq!(set.movements, movements(&[(120, 10), (150, 10)]));
    assert_eq!(set.slides.len(), 2 * 2 * 2 * 2);

    // where all fabrics have both directions, both are taken
    let set = FabricSet::open(folder(&[full.clone(), full]).path()).unwrap();
    assert_eq!(set.movements, movements(&all));
    assert_eq!(set.slides.len(), 2 * 4 * 2 * 4);
}

#[test]
fn a_stray_recording_the_other_way_takes_nothing_away() {
    let all = [(120, 10), (120, 20), (150, 10), (150, 20)];
    let full = recordings_of(&all, &[-1, 1]);
    let mut part = recordings_of(&all, &[-1]);
    part.extend(recordings_of(&all[..1], &[1]));
    let set = FabricSet::open(folder(&[full, part]).path()).unwrap();
    assert_eq!(set.movements, movements(&all));
    assert_eq!(set.slides.len(), 2 * 4 * 2 * 2);
}

/// The shape of data/fabricslide: 17 movements are shared, 15 are a whole grid.
#[test]
fn the_grid_of_movements_is_whole() {
    let mut shared = Vec::new();
    for setpoint in [120, 150, 180] {
        for speed in [10, 20, 50, 100, 120, 150] {
            shared.push((setpoint, speed));
        }
    }
    let full = recordings_of(&shared, &[-1]);
    shared.pop();
    let set = FabricSet::open(folder(&[full, recordings_of(&shared, &[-1])]).path()).unwrap();
    shared.retain(|m| m.1 != 150);
    assert_eq!(shared.len(), 15);
    assert_eq!(set.movements, movements(&shared));
}

#[test]
fn a_sine_is_in_its_band() {
    // 16 bins of a frame up and down; half of the taxels the other way round
    let wave = |t: usize, taxel: usize| {
        let phase = 2.0 * PI * 16.0 * t as f64 / 256.0 + PI * (taxel % 2) as f64;
        // a trend, too, that is to be removed
        (1000.0 + 500.0 * phase.cos() + t as f64).round() as u16
    };
    let observed = Meter::default().measure(&rows(512, wave)).unwrap();
    // A^2 N / 4 in three bins of the eight of this band
    let expected = (500.0_f32 * 500.0 * 256.0 / 4.0 / 8.0).ln();
    assert!(
        (observed.ln_bands[4] - expected).abs() < 1e-3,
        "{observed:?}"
    );
    for band in [0, 1, 2, 6, 7] {
        assert!(observed.ln_bands[band] < 5.0, "band {band} of {observed:?}");
    }
    let [power, centroid, decorrelation] = observed.properties;
    assert!((power - 125_000_f32.ln()).abs() < 1e-3, "{observed:?}");
    assert!((centroid - 16_f32.ln()).abs() < 1e-2, "{observed:?}");
    // 56 pairs of 120 with correlation 1, 64 with -1
    let expected = (1.0 + 8.0 / 120.0_f32).ln();
    assert!((decorrelation - expected).abs() < 1e-4, "{observed:?}");
}

#[test]
fn bands_are_those_of_a_plain_transform_also_in_short_slides() {
    let hann: Vec<f64> = (0..256)
        .map(|n| (PI * f64::from(n) / 256.0).sin().powi(2))
        .collect();
    let squares: f64 = hann.iter().map(|w| w * w).sum();
    // 401: the third frame would need 512
    for (samples, starts) in [(83, vec![0]), (256, vec![0]), (401, vec![0, 128])] {
        // as much up as down about the middle, so that there is no trend
        let value = |t: usize, taxel: usize| noise(taxel)(t.min(samples - 1 - t), taxel);
        let observed = Meter::default().measure(&rows(samples, value)).unwrap();
        let mut bins = [0.0; 129];
        for taxel in 0..TAXELS {
            let series: Vec<f64> = (0..samples).map(|t| f64::from(value(t, taxel))).collect();
            let mean = series.iter().sum::<f64>() / samples as f64;
            for start in &starts {
                let frame = series[*start..].iter().zip(&hann);
                for (k, bin) in bins.iter_mut().enumerate() {
                    let (mut re, mut im) = (0.0, 0.0);
                    for (n, (x, w)) in frame.clone().enumerate() {
                        let (sin, cos) = (2.0 * PI * (k * n) as f64 / 256.0).sin_cos();
                        re += (x - mean) * w * cos;
                        im -= (x - mean) * w * sin;
                    }
                    *bin += (re * re + im * im) / squares / (TAXELS * starts.len()) as f64;
                }
            }
        }
        for (band, edges) in BAND_EDGES.windows(2).enumerate() {
            let mean = bins[edges[0]..edges[1]].iter().sum::<f64>() / (edges[1] - edges[0]) as f64;
            let expected = (mean + 0.1).ln();
            let found = f64::from(observed.ln_bands[band]);
            assert!(
                (found - expected).abs() < 1e-5,
                "{samples} samples, band {band}: {found}, {expected}"
            );
        }
        let power: f64 = bins[1..].iter().sum();
        let centroid = bins[1..]
            .iter()
            .zip(1..)
            .map(|(p, k)| p * f64::from(k))
            .sum::<f64>()
            / power;
        assert!((f64::from(observed.properties[1]) - centroid.ln()).abs() < 1e-5);
    }
}

#[test]
fn flat_taxels_and_rigid_fingers_have_finite_properties() {
    let finite = |value: &dyn Fn(usize, usize) -> u16| {
        let observed = Meter::default().measure(&rows(SHORTEST, value)).unwrap();
        let all = observed.ln_bands.iter().chain(&observed.properties);
        assert!(all.clone().all(|x| x.is_finite()), "{observed:?}");
        observed
    };
    let one = finite(&|t, taxel| if taxel == 3 { noise(0)(t, 0) } else { 7 });
    assert!(
        one.properties[2].abs() < 1e-6,
        "one taxel correlates with none: {one:?}"
    );
    let rigid = finite(&|t, _| noise(0)(t, 0));
    assert!(rigid.properties[2] < -13.0, "{rigid:?}");
    finite(&|t, taxel| u16::MAX * u16::from(t == 5 && taxel == 0));
    finite(&|t, taxel| u16::from(t == 5 && taxel == 0));
}
