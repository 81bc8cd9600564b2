//! Features against their definitions.

use super::*;
use crate::dsp::Plan;
use crate::features::{Block, Movement, Slide};
use crate::table::tests::whitening::Noise;
use std::vec;
use std::vec::Vec as List;

fn observation() -> Observation {
    let bands: List<i16> = (1..=12).map(|n| 100 * n).collect();
    Observation {
        properties: Properties::new([Some(0.5), Some(-2.0), Some(5.25)]),
        bands: Vec::from_slice(&bands).unwrap(),
        pressure: Some([7, 8]),
        pace: None,
    }
}

#[test]
fn every_set_has_its_features_in_their_order() {
    let slide = observation();
    let bands = &slide.bands[..];
    let vector = |set, length| slide.vector(set, length).map(|v| v.to_vec());
    for set in FeatureSet::ALL {
        let (expected, least) = match set {
            FeatureSet::Force => ([&[512], bands].concat(), 2),
            FeatureSet::Pressure => ([&[7, 8], bands].concat(), 3),
            FeatureSet::Bands => (bands.to_vec(), 1),
            FeatureSet::Properties => (vec![512, -2048, 5376], 3),
        };
        let length = expected.len();
        assert_eq!(vector(set, length), Some(expected));
        for wrong in (0..20).filter(|&n| n != length) {
            assert_eq!(vector(set, wrong), None, "{set:?} {wrong}");
        }
        let allowed: List<usize> = (0..20).filter(|&n| set.allows(n)).collect();
        assert_eq!(allowed, (least..=length).collect::<List<_>>(), "{set:?}");
    }
}

#[test]
fn a_missing_feature_is_missed_where_it_is_needed() {
    use FeatureSet::{Bands, Force, Pressure};
    let there = |slide: &Observation| {
        let lengths = [13, 14, 12, 3];
        let sets = FeatureSet::ALL.into_iter().zip(lengths);
        let there = sets.filter(|&(set, n)| slide.vector(set, n).is_some());
        there.map(|(set, _)| set).collect::<List<_>>()
    };
    assert_eq!(there(&observation()), FeatureSet::ALL);
    assert_eq!(there(&Observation::default()), []);
    let all = [Some(0.5), Some(-2.0), Some(5.25)];
    assert_eq!(
        there(&Properties::new(all).into()),
        [FeatureSet::Properties]
    );
    for value in [
        None,
        Some(f32::NAN),
        Some(f32::INFINITY),
        Some(f32::NEG_INFINITY),
    ] {
        for at in 0..3 {
            let mut some = all;
            some[at] = value;
            let slide = Observation {
                properties: Properties::new(some),
                ..observation()
            };
            let left = if at == 0 {
                vec![Pressure, Bands]
            } else {
                vec![Force, Pressure, Bands]
            };
            assert_eq!(there(&slide), left, "{at} {value:?}");
        }
    }
    let no_pressure = Observation {
        pressure: None,
        ..observation()
    };
    assert_eq!(there(&no_pressure), [Force, Bands, FeatureSet::Properties]);
    let mut short = observation();
    short.bands.pop();
    assert_eq!(there(&short), [FeatureSet::Properties]);
    assert_eq!(short.vector(Bands, 11).unwrap(), short.bands);
}

#[test]
fn features_end_at_the_ends_of_their_numbers() {
    assert_eq!(
        (fixed(0.0), fixed(1.0), fixed(-1.0)),
        (Some(0), Some(1024), Some(-1024))
    );
    assert_eq!(fixed(0.6 / 1024.0), Some(1));
    assert_eq!(fixed(-0.6 / 1024.0), Some(-1));
    assert_eq!(fixed(0.4 / 1024.0), Some(0));
    for far in [31.9996, 32.0, 1e9, f32::MAX] {
        assert_eq!(fixed(far), Some(i16::MAX));
        assert_eq!(fixed(-far - 0.001), Some(i16::MIN));
    }
    for none in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        assert_eq!(fixed(none), None);
    }
    let far = Observation::from(Properties::new([Some(1e6), Some(-1e6), Some(0.0)]));
    let vector = far.vector(FeatureSet::Properties, 3).unwrap();
    assert_eq!(vector, [i16::MAX, i16::MIN, 0]);
}

#[test]
fn what_a_rig_measures_decides_which_sets_it_has() {
    let of = |bits| {
        let measured = PropertySet::from_bits(bits).unwrap();
        let sets = FeatureSet::ALL.into_iter();
        sets.filter(|set| set.measured_by(measured))
            .collect::<List<_>>()
    };
    use FeatureSet::{Bands, Force, Pressure};
    assert_eq!(of(0b110), [Pressure, Bands], "no force sensing");
    assert_eq!(of(0b001), [Force, Pressure, Bands]);
    assert_eq!(of(0b111), FeatureSet::ALL);
    assert_eq!(of(0), [Pressure, Bands]);
}

/// Powers of bands by the recipe's edges and its 0.1, from the spectrum that the slide has.
#[test]
fn a_slide_says_its_bands_and_pressure() {
    const EDGES: [usize; 13] = [4, 6, 8, 11, 16, 22, 31, 43, 60, 84, 118, 166, 233];
    let plan = Plan::new();
    let noise = &mut Noise(5);
    for amplitude in [0.4, 3.0, 40.0, 900.0] {
        let mut slide = Slide::new(&plan, Movement::FOR_FINENESS);
        slide.set_background(2.0);
        let mut last = 0.0;
        let samples: List<i16> = (0..3000)
            .map(|_| {
                // more power in low bands than in high ones
                last = 0.8 * last + amplitude * noise.normal();
                f64::round(last) as i16
            })
            .collect();
        for block in Block::cut(&[], 0..3000, &samples, &[250, 750]) {
            slide.take(&block);
        }
        let pdc: List<i16> = (0..300).map(|n| 90 + (n * 7 % 40) as i16).collect();
        slide.push_pdc(&pdc);
        let measured = slide.finish().unwrap();
        let observation = Observation::from(&measured);
        assert_eq!(observation.properties, measured.properties);
        assert_eq!(observation.bands.len(), 12);
        for (edges, band) in EDGES.windows(2).zip(&observation.bands) {
            let bins = &measured.spectrum.psd()[edges[0]..edges[1]];
            let mean = bins.iter().map(|p| f64::from(*p)).sum::<f64>() / bins.len() as f64;
            let steps = (mean + 0.1).ln() * 1024.0;
            assert!((f64::from(*band) - steps).abs() < 0.52, "{band} {steps}");
        }
        let n = pdc.len() as f64;
        let mean = pdc.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
        let squares: f64 = pdc.iter().map(|x| (f64::from(*x) - mean).powi(2)).sum();
        let [m, sd] = observation.pressure.unwrap();
        assert!((f64::from(m) - mean * 10.24).abs() < 0.51, "{m} {mean}");
        let expected = (squares / (n - 1.0)).sqrt();
        assert!((f64::from(sd) - expected * 10.24).abs() < 0.51, "{sd}");
        assert!(observation.vector(FeatureSet::Pressure, 14).is_some());
        assert_eq!(observation.vector(FeatureSet::Force, 13).unwrap()[0], 512);
    }
}
