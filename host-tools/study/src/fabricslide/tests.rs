//! Folders of fabrics, whole and damaged, and the features of known slides.
use std::f64::consts::PI;
use std::fs;
use std::io::Write as _;

use flate2::Compression;
use flate2::write::GzEncoder;
use proptest::prelude::*;
use serde_json::{Value, json};
use tactus_lab::data::recordings::files::sha256;
use tempfile::TempDir;

use super::features::SHORTEST;
use super::*;

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

/// Length of a recording, rows.
const LONG: usize = 100;

/// A folder of the fabrics A and B, whose start is loud and whose manifest was changed.
fn folder(change: impl FnOnce(&mut Value)) -> TempDir {
    let folder = TempDir::new().unwrap();
    let files = [("A", 0), ("B", 1000)].map(|(name, seed)| {
        let mut slides = Vec::new();
        for (setpoint, um_s) in movements() {
            for rep in [0, 1] {
                slides.push(json!({
                    "pressure_setpoint": setpoint, "speed_mm_s": f64::from(um_s) * 1e-3, "direction": -1, "rep": rep,
                    "n": LONG, "t_ticks": LONG * 28, "offset_values": slides.len() * LONG * TAXELS,
                }));
            }
        }
        let loud = |t: usize, taxel: usize| match t % LONG {
            0..6 => 60_000 * (t % 2) as u16,
            _ => noise(seed)(t, taxel),
        };
        let raw = rows(slides.len() * LONG, loud);
        let packed = gzip(&raw);
        let file = format!("{name}.u16le.gz");
        fs::write(folder.path().join(&file), &packed).unwrap();
        json!({
            "file": file, "fabric": name, "slides": slides,
            "sha256_gz": sha256(&packed), "sha256_raw": sha256(&raw),
        })
    });
    let mut json = json!({ "title": "synthetic", "files": files });
    change(&mut json);
    fs::write(folder.path().join(MANIFEST), json.to_string()).unwrap();
    folder
}

#[test]
fn two_halves_of_both_repetitions_come_in_order_without_the_start() {
    let set = FabricSet::open(folder(|_| ()).path()).unwrap();
    assert_eq!(set.fabrics, ["A", "B"]);
    assert_eq!(set.movements.len(), 15);
    let found = set
        .slides
        .iter()
        .map(|s| (s.fabric, s.movement, s.repetition));
    let expected = (0..2).flat_map(|fabric| (0..15).map(move |movement| (fabric, movement)));
    let expected = expected.flat_map(|(f, m)| [0, 0, 1, 1].map(|repetition| (f, m, repetition)));
    assert!(found.eq(expected));
    assert!(
        set.slides.is_sorted_by(|a, b| a.ln_bands != b.ln_bands),
        "each is of its own samples"
    );
    assert!(set.slides.iter().all(|s| s.properties[0] < 7.0));
    // the order of recordings in the manifest does not matter, and others are left out
    let other = folder(|json| {
        let slides = json["files"][0]["slides"].as_array_mut().unwrap();
        let mut odd = slides[0].clone();
        (odd["pressure_setpoint"], odd["rep"]) = (json!(90), json!(7));
        slides.push(odd);
        slides.reverse();
    });
    assert_eq!(FabricSet::open(other.path()).unwrap(), set);
    // 6 % of 212 are 12.7 rows; 201 rows remain when the recording has one row more
    assert_eq!(cut(&(1000..1212)), [1012..1112, 1112..1212]);
    assert_eq!(cut(&(0..213)), [12..112, 112..212]);
    assert_eq!(cut(&(5..6)), [5..5, 5..5]);
}

#[test]
fn every_fault_is_told_with_its_place() {
    type Case = (&'static str, Value, &'static str);
    let cases: [Case; 11] = [
        ("/files", json!(3), "manifest.json: invalid type: integer"),
        ("/files/0", json!({}), "missing field `file`"),
        (
            "/files/0/file",
            json!("../A.u16le.gz"),
            "not inside this folder",
        ),
        (
            "/files/1/file",
            json!("C.u16le.gz"),
            "C.u16le.gz: No such file",
        ),
        (
            "/files/0/sha256_gz",
            json!("00"),
            "A.u16le.gz: SHA-256 of the gzip file",
        ),
        (
            "/files/0/sha256_raw",
            json!("00"),
            "A.u16le.gz: SHA-256 of the unpacked samples",
        ),
        (
            "/files/0/slides/29/n",
            json!(99),
            "unpacks to 95969 or more bytes",
        ),
        (
            "/files/0/slides/29/n",
            json!(u64::MAX),
            "unpacks to 96000 bytes",
        ),
        (
            "/files/1/slides/3/rep",
            json!(2),
            "B.u16le.gz: set-point 120 at 20000 um/s, rep 1: the",
        ),
        (
            "/files/1/slides/3/direction",
            json!(1),
            "the manifest lists no such recording",
        ),
        (
            "/files/1/slides/3/n",
            json!(66),
            "rep 1: a slide of fewer than 32 samples",
        ),
    ];
    for (place, value, message) in cases {
        let folder = folder(|json| *json.pointer_mut(place).unwrap() = value);
        let said = FabricSet::open(folder.path()).unwrap_err().to_string();
        assert!(said.contains(message), "{place}: {said}");
    }
    let said = FabricSet::open(Path::new("/nowhere"))
        .unwrap_err()
        .to_string();
    assert!(
        said.contains("/nowhere/manifest.json: No such file"),
        "{said}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Well-formed, but any number anywhere.
    #[test]
    fn misleading_manifests_never_panic(
        changes in proptest::collection::vec((
            0_usize..2, 0_usize..30,
            prop::sample::select(vec!["pressure_setpoint", "speed_mm_s", "direction", "rep", "n", "offset_values"]),
            prop_oneof![
                any::<u64>().prop_map(|x| json!(x)),
                any::<i64>().prop_map(|x| json!(x)),
                any::<f64>().prop_map(|x| json!(x)),
                (0_u32..400).prop_map(|x| json!(x)),
            ],
        ), 1..4),
    ) {
        let folder = folder(|json| {
            for (file, slide, field, value) in changes {
                json["files"][file]["slides"][slide][field] = value;
            }
        });
        let _ = FabricSet::open(folder.path());
    }

    /// Any samples, of any length: refused or finite.
    #[test]
    fn figures_are_finite(
        length in 1_usize..400, loud: bool, taxels in any::<u16>(), seed in 0_usize..1000,
    ) {
        let value = |t: usize, taxel: usize| {
            let x = noise(seed)(t, taxel);
            if taxels >> taxel & 1 == 0 { 9 } else if loud { x.wrapping_mul(1021) } else { x % 2 }
        };
        if let Ok((bands, properties)) = Meter::default().measure(&rows(length, value)) {
            prop_assert!(bands.iter().chain(&properties).all(|x| x.is_finite()));
        }
    }
}

#[test]
fn a_sine_is_in_its_band() {
    // 16 bins of a frame up and down; half of the taxels the other way round
    let wave = |t: usize, taxel: usize| {
        let phase = 2.0 * PI * 16.0 * t as f64 / 256.0 + PI * (taxel % 2) as f64;
        // a trend, too, that is to be removed
        (1000.0 + 500.0 * phase.cos() + t as f64).round() as u16
    };
    let (bands, properties) = Meter::default().measure(&rows(512, wave)).unwrap();
    // A^2 N / 4 in three bins of the eight of this band
    let expected = (500.0_f32 * 500.0 * 256.0 / 4.0 / 8.0).ln();
    assert!((bands[4] - expected).abs() < 1e-3, "{bands:?}");
    for band in [0, 1, 2, 6, 7] {
        assert!(bands[band] < 5.0, "band {band} of {bands:?}");
    }
    let [power, centroid, decorrelation] = properties;
    assert!((power - 125_000_f32.ln()).abs() < 1e-3, "{properties:?}");
    assert!((centroid - 16_f32.ln()).abs() < 1e-2, "{properties:?}");
    // 56 pairs of 120 with correlation 1, 64 with -1
    let expected = (1.0 + 8.0 / 120.0_f32).ln();
    assert!((decorrelation - expected).abs() < 1e-4, "{properties:?}");
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
        let (bands, properties) = Meter::default().measure(&rows(samples, value)).unwrap();
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
            let found = f64::from(bands[band]);
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
        assert!((f64::from(properties[1]) - centroid.ln()).abs() < 1e-5);
    }
}

#[test]
fn flat_taxels_and_rigid_fingers_have_finite_properties() {
    let finite = |value: &dyn Fn(usize, usize) -> u16| {
        let (bands, properties) = Meter::default().measure(&rows(SHORTEST, value)).unwrap();
        assert!(
            bands.iter().chain(&properties).all(|x| x.is_finite()),
            "{properties:?}"
        );
        properties[2]
    };
    let one = finite(&|t, taxel| if taxel == 3 { noise(0)(t, 0) } else { 7 });
    assert!(one.abs() < 1e-6, "one taxel correlates with none: {one}");
    assert!(finite(&|t, _| noise(0)(t, 0)) < -13.0);
    finite(&|t, taxel| u16::MAX * u16::from(t == 5 && taxel == 0));
    finite(&|t, taxel| u16::from(t == 5 && taxel == 0));
    let dead = Meter::default().measure(&rows(200, |t, _| t as u16));
    assert!(dead.unwrap_err().starts_with("no taxel moves"));
}
