//! The properties of all public slides against values that scipy computed, and the spectrum against an f64 one.

use std::f64::consts::PI;

use rustfft::{FftPlanner, num_complex::Complex};
use tactus_core::dsp::BAND_PASS;
use tactus_core::dsp::Plan;
use tactus_core::dsp::{BIN_HZ, FRAME, HOP};
use tactus_core::features::{BAND_EDGES, Property};
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::{measure, measure_all};
use tactus_tests::data;

#[test]
fn all_public_slides_have_the_golden_values() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let observed = measure_all(&set, |_| ()).unwrap();
    let mut golden = csv::Reader::from_path(folder.join("features.csv")).unwrap();
    let columns = golden.headers().unwrap().clone();
    let column = |name: &str| columns.iter().position(|c| c == name).unwrap();
    let mut worst = [0f64; 4];
    let mut rows = 0;
    for row in golden.records() {
        let row = row.unwrap();
        let value = |name: &str| row[column(name)].parse::<f64>().unwrap();
        let material = set
            .textures()
            .iter()
            .position(|t| f64::from(t.id) == value("material"))
            .unwrap();
        let slide = observed[material]
            .iter()
            .find(|s| f64::from(s.number) == value("slide"))
            .unwrap();
        let properties = slide.measurement.properties;
        let off = |p, golden: &str| (f64::from(properties.get(p).unwrap()) - value(golden)).abs();
        worst[0] = worst[0].max(off(Property::Traction, "traction_n"));
        worst[1] = worst[1].max(off(Property::Roughness, "roughness_ln"));
        worst[2] = worst[2].max(off(Property::Fineness, "fineness_unfiltered_ln"));
        for (band, ln) in slide.measurement.ln_bands().into_iter().enumerate() {
            worst[3] = worst[3].max((f64::from(ln) - value(&format!("ln_psd_band{band}"))).abs());
        }
        rows += 1;
    }
    println!(
        "{rows} slides; furthest off: traction {:.1e} N, roughness {:.1e}, fineness {:.1e}, bands {:.1e}",
        worst[0], worst[1], worst[2], worst[3]
    );
    assert_eq!(rows, observed.iter().map(Vec::len).sum::<usize>());
    assert!(rows >= 20);
    assert!(
        worst[0] < 1e-3 && worst[1..].iter().all(|&w| w < 2e-3),
        "{worst:?}"
    );
}

#[test]
fn coefficients_are_scipys_to_half_a_step() {
    let Some(folder) = data("biotac") else { return };
    let manifest: serde_json::Value =
        serde_json::from_reader(std::fs::File::open(folder.join("manifest.json")).unwrap())
            .unwrap();
    let golden = manifest["features"]["fir_taps"].as_array().unwrap();
    assert_eq!(golden.len(), BAND_PASS.len());
    for (golden, &tap) in golden.iter().zip(&BAND_PASS) {
        assert!((golden.as_f64().unwrap() * 32768.0 - f64::from(tap)).abs() < 0.5001);
    }
}

/// Averaged power spectrum in f64, straight from the definition: the mean removed first, then window and transform.
fn oracle(samples: &[i16]) -> Vec<f64> {
    let mean = samples.iter().map(|&x| f64::from(x)).sum::<f64>() / samples.len() as f64;
    let window: Vec<f64> = (0..FRAME)
        .map(|n| 0.5 - 0.5 * (2.0 * PI * n as f64 / FRAME as f64).cos())
        .collect();
    let fft = FftPlanner::new().plan_fft_forward(FRAME);
    let mut psd = vec![0.0; FRAME / 2 + 1];
    let frames = samples.windows(FRAME).step_by(HOP);
    let count = frames.len() as f64;
    for frame in frames {
        let mut x: Vec<Complex<f64>> = frame
            .iter()
            .zip(&window)
            .map(|(&x, w)| Complex::new((f64::from(x) - mean) * w, 0.0))
            .collect();
        fft.process(&mut x);
        for (sum, x) in psd.iter_mut().zip(&x) {
            *sum += x.norm_sqr();
        }
    }
    let power: f64 = window.iter().map(|w| w * w).sum();
    psd.iter().map(|p| p / count / power).collect()
}

fn assert_near_oracle(samples: &[i16], spectrum: &tactus_core::dsp::Spectrum, what: &str) {
    let oracle = oracle(samples);
    let total: f64 = oracle.iter().sum();
    let mean = samples.iter().map(|&x| f64::from(x)).sum::<f64>() / samples.len() as f64;
    // power that the mean alone would have in bin 0: Hann's bin 0 is N/2, its squares sum to 3N/8
    let removed = mean * mean * FRAME as f64 * 2.0 / 3.0;
    for (k, (&psd, exact)) in spectrum.psd().iter().zip(&oracle).enumerate() {
        // f32 sums: relative to the bin, to the whole where a bin is almost empty, and to what the mean took away
        let bound = 1e-5 * exact + 1e-8 * total + if k < 2 { 1e-6 * removed } else { 0.0 };
        assert!(
            (f64::from(psd) - exact).abs() < bound,
            "{what}, bin {k}: {psd} {exact}"
        );
    }
    let centroid = oracle
        .iter()
        .enumerate()
        .map(|(k, p)| k as f64 * p)
        .sum::<f64>()
        / total
        * f64::from(BIN_HZ);
    let ours = f64::from(spectrum.centroid_hz().unwrap());
    assert!(
        (ours / centroid - 1.0).abs() < 1e-5,
        "{what}: {ours} {centroid}"
    );
    for edges in BAND_EDGES.windows(2) {
        let exact = oracle[edges[0]..edges[1]].iter().sum::<f64>() / (edges[1] - edges[0]) as f64;
        assert!(
            (f64::from(spectrum.band(edges[0]..edges[1])) / exact - 1.0).abs() < 1e-5,
            "{what}"
        );
    }
}

#[test]
fn spectra_of_recorded_slides_are_those_of_f64() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let plan = Plan::new();
    for texture in 0..set.textures().len() {
        // every seventh: each material, early and late
        for slide in set.load_texture(texture).unwrap().iter().step_by(7) {
            let steady = slide.pac()[slide.steady(2200)].to_vec();
            let what = format!("{}, slide {}", set.textures()[texture].name, slide.number);
            assert_near_oracle(&steady, &measure(&plan, slide).unwrap().spectrum, &what);
        }
    }
}

#[test]
fn spectra_of_made_up_signals_are_those_of_f64() {
    // no recordings needed: a chirp and noise on an offset, of any length
    let mut x = 3u32;
    for (length, offset) in [(512, 0.0), (513, 40.0), (3000, -100.0), (11_000, 300.0)] {
        let samples: Vec<i16> = (0..length)
            .map(|n| {
                x = x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let t = n as f64 / 2200.0;
                (offset + 400.0 * (2.0 * PI * (30.0 + 60.0 * t) * t).sin()) as i16
                    + (x >> 25) as i16
                    - 64
            })
            .collect();
        let mut sum = tactus_core::dsp::SpectrumSum::default();
        sum.push(&tactus_core::dsp::Plan::new(), &samples);
        assert_near_oracle(
            &samples,
            &sum.finish().unwrap(),
            &format!("{length} samples about {offset}"),
        );
    }
}
