//! Features against their definitions.

use super::*;
use crate::dsp::Plan;
use crate::features::{Block, Movement, Slide};
use crate::table::tests::whitening::Noise;
use std::vec;
use std::vec::Vec as List;

fn observation() -> Observation {
    let bands: List<i16> = (1..=26).map(|n| 100 * n).collect();
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
    let pairs = (0..12).map(|n| 350 + 200 * n);
    let coarse: List<i16> = [100, 200].into_iter().chain(pairs).collect();
    let vector = |set, length| slide.vector(set, length).map(|v| v.to_vec());
    for set in FeatureSet::ALL {
        let (others, bands, least) = match set {
            FeatureSet::Force => (vec![512], [bands, &coarse], 2),
            FeatureSet::Pressure => (vec![7, 8], [bands, &coarse], 3),
            FeatureSet::Bands => (vec![], [bands, &coarse], 1),
            FeatureSet::Properties => (vec![512, -2048, 5376], [&[][..]; 2], 3),
        };
        let expected = bands.map(|bands| [&others, bands].concat());
        let lengths = [expected[0].len(), expected[1].len()];
        for (length, expected) in lengths.into_iter().zip(expected) {
            assert_eq!(vector(set, length), Some(expected));
        }
        for wrong in (0..40).filter(|n| !lengths.contains(n)) {
            assert_eq!(vector(set, wrong), None, "{set:?} {wrong}");
        }
        let allowed: List<usize> = (0..40).filter(|&n| set.allows(n)).collect();
        assert_eq!(
            allowed,
            (least..=lengths[0]).collect::<List<_>>(),
            "{set:?}"
        );
    }
}

#[test]
fn coarse_bands_are_those_of_whoever_has_no_more() {
    let of = |bands: usize| Observation {
        bands: observation().bands.into_iter().take(bands).collect(),
        ..Observation::default()
    };
    let coarse = of(26).with_coarse_bands();
    assert_eq!(coarse.bands[..4], [100, 200, 350, 550]);
    assert_eq!(coarse.clone().with_coarse_bands(), coarse);
    assert_eq!(coarse.vector(FeatureSet::Bands, 14).unwrap(), coarse.bands);
    assert_eq!(of(26).vector(FeatureSet::Bands, 9), None);
    // as of a sensor that is sampled slowly: of 17 bands there are 9 coarse ones
    assert_eq!(of(17).numbers_of_bands(), [17, 9]);
    assert_eq!(of(17).vector(FeatureSet::Bands, 9).unwrap().len(), 9);
    assert_eq!(coarse.numbers_of_bands(), [14, 14]);
}

#[test]
fn a_missing_feature_is_missed_where_it_is_needed() {
    use FeatureSet::{Bands, Force, Pressure};
    let there = |slide: &Observation| {
        let lengths = [27, 28, 26, 3];
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
    assert_eq!(short.vector(Bands, 25).unwrap(), short.bands);
    assert_eq!(short.vector(Bands, 13).unwrap()[..3], [100, 200, 350]);
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

const EDGES: [usize; 27] = [
    1, 2, 4, 5, 6, 7, 8, 9, 11, 13, 16, 19, 22, 26, 31, 37, 43, 51, 60, 71, 84, 100, 118, 140, 166,
    197, 233,
];

/// Mean over frames of ln(mean power of the band + 0.1), from the definition: Hann windows of 512 samples, 256 apart,
/// the weighted mean of each removed.
fn mean_logarithms(samples: &[i16]) -> [f64; 26] {
    let turn: List<[f64; 2]> = (0..512)
        .map(|n| {
            (f64::from(n) * core::f64::consts::TAU / 512.0)
                .sin_cos()
                .into()
        })
        .collect();
    let window: List<f64> = turn.iter().map(|[_, cos]| 1.0 - cos).collect();
    let frames: List<&[i16]> = samples.windows(512).step_by(256).collect();
    let mut sums = [0.0; 26];
    for frame in &frames {
        let x: List<f64> = frame.iter().map(|x| f64::from(*x)).collect();
        let mean = x.iter().zip(&window).map(|(x, w)| x * w).sum::<f64>() / 512.0;
        let power = |bin: usize| {
            let mut sum = [0.0; 2];
            for (n, (x, w)) in x.iter().zip(&window).enumerate() {
                let [sin, cos] = turn[bin * n % 512];
                sum = [sum[0] + (x - mean) * w * cos, sum[1] + (x - mean) * w * sin];
            }
            (sum[0] * sum[0] + sum[1] * sum[1]) / (1.5 * 512.0)
        };
        for (sum, edges) in sums.iter_mut().zip(EDGES.windows(2)) {
            let bins = edges[0]..edges[1];
            let many = bins.len() as f64;
            *sum += (bins.map(power).sum::<f64>() / many + 0.1).ln();
        }
    }
    sums.map(|sum| sum / frames.len() as f64)
}

/// Standard deviation about the parabola that fits best, by taking one direction out after the other.
fn about_a_parabola(samples: &[i16]) -> f64 {
    let mut rest: List<f64> = samples.iter().map(|x| f64::from(*x)).collect();
    let n = rest.len();
    let mut taken: List<List<f64>> = vec![];
    for power in 0..3 {
        let mut along: List<f64> = (0..n)
            .map(|t| (t as f64 / n as f64 - 0.5).powi(power))
            .collect();
        let take = |from: &mut List<f64>, along: &List<f64>| {
            let dot =
                |a: &List<f64>, b: &List<f64>| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let share = dot(from, along) / dot(along, along);
            from.iter_mut()
                .zip(along)
                .for_each(|(x, a)| *x -= share * a);
        };
        taken.iter().for_each(|before| take(&mut along, before));
        take(&mut rest, &along);
        taken.push(along);
    }
    (rest.iter().map(|x| x * x).sum::<f64>() / (n - 3) as f64).sqrt()
}

#[test]
fn a_slide_says_its_bands_and_pressure() {
    let plan = Plan::new();
    let noise = &mut Noise(5);
    for amplitude in [0.4, 3.0, 40.0, 900.0] {
        let mut slide = Slide::new(&plan, Movement::FOR_FINENESS);
        slide.set_background(2.0);
        let mut last = 0.0;
        let samples: List<i16> = (0..3000)
            .map(|n| {
                // more power in low bands than in high ones, about a mean that a burst has moved
                last = 0.8 * last + amplitude * noise.normal();
                let burst = if (1000..1200).contains(&n) {
                    700.0
                } else {
                    30.0
                };
                f64::round(last + burst).clamp(-2048.0, 2047.0) as i16
            })
            .collect();
        for block in Block::cut(&[], 0..3000, &samples, &[250, 750]) {
            slide.take(&block);
        }
        let pdc: List<i16> = (0..300)
            .map(|n| (1500 + n * n / 60 - 2 * n + n * 7 % 40) as i16)
            .collect();
        slide.push_pdc(&pdc);
        let measured = slide.finish().unwrap();
        let observation = Observation::from(&measured);
        assert_eq!(observation.properties, measured.properties);
        assert_eq!(observation.bands.len(), 26);
        for (band, ln) in observation.bands.iter().zip(mean_logarithms(&samples)) {
            let steps = ln * 1024.0;
            assert!((f64::from(*band) - steps).abs() < 0.6, "{band} {steps}");
        }
        let n = pdc.len() as f64;
        let mean = pdc.iter().map(|x| f64::from(*x)).sum::<f64>() / n;
        let [m, scatter] = observation.pressure.unwrap();
        assert!((f64::from(m) - mean * 10.24).abs() < 0.51, "{m} {mean}");
        let expected = (about_a_parabola(&pdc) + 0.5).ln() * 1024.0;
        assert!(
            (f64::from(scatter) - expected).abs() < 0.52,
            "{scatter} {expected}"
        );
        for bands in [26usize, 14] {
            let vector = |set, others: usize| observation.vector(set, others + bands);
            assert!(vector(FeatureSet::Pressure, 2).is_some());
            assert_eq!(vector(FeatureSet::Force, 1).unwrap()[0], 512);
        }
    }
}

/// A finger that is pressed harder as it slides, slower than any texture, has the scatter of one that is not.
#[test]
fn what_p_dc_does_slowly_is_no_scatter() {
    let plan = Plan::new();
    let scatter = |slow: fn(i32) -> i32, samples: i32| {
        let mut slide = Slide::new(&plan, Movement::FOR_FINENESS);
        let pdc: List<i16> = (0..samples)
            .map(|n| (slow(n) + n * 7 % 41) as i16)
            .collect();
        slide.push_pdc(&pdc);
        slide.pdc.mean_and_sd().map(|(_, sd)| sd)
    };
    let still = scatter(|_| 0, 300).unwrap();
    for slow in [|n| 3 * n, |n| 1000 - n, |n| (n - 100) * (n - 100) / 20] {
        let moved = scatter(slow, 300).unwrap();
        assert!((moved / still - 1.0).abs() < 0.03, "{moved} {still}");
    }
    assert_eq!(
        (scatter(|_| 0, 3), scatter(|n| n * n, 4).is_some()),
        (None, true)
    );
    // an hour of the largest
    assert!(scatter(|_| 30_000, 400_000).unwrap() > 1.0);
}
