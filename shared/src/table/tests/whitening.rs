//! The whitening by its properties; tests/core/fused_recipe.rs has the recipe in f64.

use crate::features::{FeatureSet, MAX_FEATURES, Vector};
use crate::table::{Drift, Scatter, WhitenError, Whitened, Whitening, white, whiten_drifting};
use std::vec;
use std::vec::Vec as List;

/// Random numbers, the same in every run.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    /// From 0 to 1, without 1.
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Mean 0, standard deviation 1 (Box and Muller).
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (2.0 * std::f64::consts::PI * self.uniform()).cos()
    }

    /// A whole number below `n`.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        (self.uniform() * n as f64) as usize
    }
}

/// Textures whose slides scatter in a correlated way, not the same at every movement.
pub(crate) struct World {
    /// Of every movement: what independent noise is mixed by, lower triangular, in units of the features.
    mixing: List<List<List<f64>>>,
    /// Of every movement and texture, in units of the features.
    means: List<List<List<f64>>>,
}

impl World {
    pub(crate) fn new(
        noise: &mut Noise,
        textures: usize,
        movements: usize,
        features: usize,
    ) -> Self {
        let mut mixing = List::new();
        let mut means = List::new();
        for _ in 0..movements {
            let rows = (0..features).map(|i| {
                let scale = 0.1 + 0.5 * noise.uniform();
                let row = (0..=i).map(|j| {
                    let part = if i == j {
                        0.7
                    } else {
                        0.8 * noise.normal() / (features as f64).sqrt()
                    };
                    scale * part
                });
                row.collect()
            });
            mixing.push(rows.collect());
            let of = (0..textures).map(|_| (0..features).map(|_| 2.0 * noise.normal()).collect());
            means.push(of.collect());
        }
        Self { mixing, means }
    }

    /// Features of one slide.
    pub(crate) fn slide(&self, noise: &mut Noise, texture: usize, movement: usize) -> Vector {
        let mean = &self.means[movement][texture];
        let own: List<f64> = mean.iter().map(|_| noise.normal()).collect();
        let rows = self.mixing[movement].iter().zip(mean);
        rows.map(|(row, mean)| {
            let x = mean + row.iter().zip(&own).map(|(a, e)| a * e).sum::<f64>();
            (x * 1024.0).round().clamp(-32768.0, 32767.0) as i16
        })
        .collect()
    }

    /// So many slides of every texture at every movement.
    pub(crate) fn slides(&self, noise: &mut Noise, each: usize) -> List<List<List<Vector>>> {
        let of = |movement: usize, noise: &mut Noise| {
            let textures = 0..self.means[movement].len();
            textures
                .map(|t| (0..each).map(|_| self.slide(noise, t, movement)).collect())
                .collect()
        };
        (0..self.mixing.len()).map(|m| of(m, noise)).collect()
    }
}

fn whiten(scatters: &[Scatter]) -> Result<List<Whitening>, WhitenError> {
    let learned = whiten_drifting(scatters, FeatureSet::Bands, Drift::NONE)?;
    Ok(learned
        .into_iter()
        .map(|(whitening, _)| whitening)
        .collect())
}

/// Learned as a table is: movement by movement, texture by texture.
pub(crate) fn learned(slides: &[List<List<Vector>>]) -> List<Whitening> {
    let scatters: List<Scatter> = slides
        .iter()
        .map(|textures| {
            let mut scatter = Scatter::new(textures[0][0].len());
            for slides in textures {
                scatter.push(slides).unwrap();
            }
            scatter
        })
        .collect();
    whiten(&scatters).unwrap()
}

/// A singular covariance is no reason to fail: a feature that never changes counts by its rounding, one that follows
/// another by a thousandth of itself.
#[test]
fn features_without_scatter_of_their_own_are_bounded() {
    let slide = |a: i16, e: i16| Vector::from_slice(&[a + e, 7, 2 * (a + e)]).unwrap();
    let textures: List<List<Vector>> = (0..40)
        .map(|a| (-2..=2).map(|e| slide(100 * a, 50 * e)).collect())
        .collect();
    let whitening = learned(&[textures]).remove(0);
    let z = whitening.apply(&slide(2000, 0));
    let other = whitening.apply(&slide(2000, 100));
    let apart = |a: &[i16], b: &[i16]| {
        let squares = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2));
        squares.sum::<f64>().sqrt() / 256.0
    };
    // 100 steps of a standard deviation of 50 sqrt(10/4), and what follows them says hardly more
    let apart_1 = f64::from(other[0] - z[0]) / 256.0;
    let alone = 100.0 / (50.0 * 2.5f64.sqrt());
    assert!((1.0..1.03).contains(&(apart_1 / alone)), "{apart_1}");
    let off = whitening.apply(&[2000, 8, 4000]);
    // one step of a standard deviation of sqrt(1/12)
    let apart_2 = apart(&off, &z);
    assert!((apart_2 - 12f64.sqrt()).abs() < 0.1, "{apart_2}");
}

/// Distances of textures in one canonical variate are independent of the others, and the first has the largest.
#[test]
fn canonical_variates_of_textures_are_uncorrelated() {
    for (seed, textures, features) in [(7, 117, 14), (8, 20, 13), (9, 6, 13), (10, 2, 3)] {
        let noise = &mut Noise(seed);
        let world = World::new(noise, textures, 1, features);
        let slides = world.slides(noise, 5);
        let whitening = learned(&slides).remove(0);
        let means: List<List<f64>> = slides[0]
            .iter()
            .map(|slides| {
                let turned: List<Vector> = slides.iter().map(|x| whitening.apply(x)).collect();
                let mean = |i: usize| turned.iter().map(|z| f64::from(white(z[i]))).sum::<f64>();
                (0..features)
                    .map(|i| mean(i) / slides.len() as f64)
                    .collect()
            })
            .collect();
        let k = textures as f64;
        let centre = |i: usize| means.iter().map(|m| m[i]).sum::<f64>() / k;
        let centre: List<f64> = (0..features).map(centre).collect();
        let covariance = |i: usize, j: usize| {
            let products = means
                .iter()
                .map(|m| (m[i] - centre[i]) * (m[j] - centre[j]));
            products.sum::<f64>() / k
        };
        let largest = covariance(0, 0);
        for i in 0..features {
            // but for the rounding of weights
            assert!(i == 0 || covariance(i, i) <= covariance(i - 1, i - 1) + 1e-3 * largest);
            for j in 0..i {
                let off = covariance(i, j).abs();
                let most = 2e-3 * largest;
                assert!(off <= most, "{seed}: {i} {j}: {off} of {largest}");
            }
        }
    }
}

/// W = ((1, -1), (-1, 2)) and g = (1, -1/2), written down by hand.
pub(crate) fn by_hand() -> [u8; 14] {
    [
        0x00, 0x04, 0x00, 0xfe, // g: 1024, -512
        4, 3, // places
        16, 0, 0xf0, 0xff, // 1 and -1 of 4 places
        0xf8, 0xff, 16, 0, // -1 and 2 of 3 places
    ]
}

#[test]
fn a_whitening_is_applied_as_it_is_documented() {
    assert_eq!((Whitening::bytes(2), Whitening::bytes(13)), (14, 377));
    let whitening = Whitening::read(&by_hand(), 2).unwrap();
    assert_eq!(whitening.features(), 2);
    assert_eq!(whitening.as_bytes(), by_hand());
    assert_eq!(whitening.apply(&[1024, -512]), [0, 0]);
    // x - g = (1, 2): z = (-1, 3)
    assert_eq!(whitening.apply(&[2048, 1536]), [-256, 768]);
    // to the nearest step, halves upwards: 4 steps of a feature are 1
    assert_eq!(whitening.apply(&[1025, -512]), [0, 0]);
    assert_eq!(whitening.apply(&[1026, -512]), [1, 0]);
    assert_eq!(whitening.apply(&[1022, -512]), [0, 1]);
    assert_eq!(whitening.apply(&[1021, -512]), [-1, 1]);
    // what is missing is the mean
    assert_eq!(whitening.apply(&[2048]), [256, -256]);
    assert_eq!(whitening.apply(&[]), [0, 0]);
    assert_eq!(whitening.apply(&[2048, 1536, 5]), [-256, 768]);
    assert_eq!(whitening.apply(&[i16::MAX, i16::MIN]), [16_000, -24_064]);

    assert_eq!(Whitening::read(&by_hand()[..13], 2), None);
    assert_eq!(Whitening::read(&by_hand(), 3), None);
    assert_eq!(Whitening::read(&[0; 3 * 29 + 2 * 29 * 29], 29), None);
    let mut places = by_hand();
    places[5] = 30;
    assert!(Whitening::read(&places, 2).is_some());
    places[5] = 31;
    assert_eq!(Whitening::read(&places, 2), None);
}

#[test]
fn the_farthest_values_do_not_overflow() {
    for weight in [i16::MAX, i16::MIN] {
        for mean in [i16::MAX, i16::MIN] {
            let d = MAX_FEATURES;
            let mut bytes = List::new();
            (0..d).for_each(|_| bytes.extend(mean.to_le_bytes()));
            bytes.extend(vec![0; d]);
            (0..d * d).for_each(|_| bytes.extend(weight.to_le_bytes()));
            let whitening = Whitening::read(&bytes, d).unwrap();
            for x in [i16::MAX, i16::MIN] {
                let apart = i64::from(x) - i64::from(mean);
                let expected = match apart * i64::from(weight) {
                    0 => 0,
                    above if above > 0 => i16::MAX,
                    _ => i16::MIN,
                };
                assert_eq!(
                    whitening.apply(&[x; MAX_FEATURES]),
                    [expected; MAX_FEATURES]
                );
            }
        }
    }
}

#[test]
fn without_two_slides_of_a_texture_there_is_no_whitening() {
    let slide = |x: i16| Vector::from_slice(&[x, 2 * x]).unwrap();
    let mut scatter = Scatter::new(2);
    assert_eq!(whiten(&[]), Err(WhitenError::Movements));
    assert_eq!(whiten(&[scatter.clone()]), Err(WhitenError::Trials(0)));
    for x in 0..5 {
        scatter.push(&[slide(x)]).unwrap();
    }
    assert_eq!(whiten(&[scatter.clone()]), Err(WhitenError::Trials(0)));
    let before = std::format!("{scatter:?}");
    let longer = Vector::from_slice(&[1, 2, 3]).unwrap();
    assert_eq!(
        scatter.push(&[slide(1), longer]),
        Err(WhitenError::Features)
    );
    assert_eq!(std::format!("{scatter:?}"), before, "nothing was taken");
    let mut two = scatter.clone();
    two.push(&[slide(5), slide(90)]).unwrap();
    assert!(whiten(&[two.clone()]).is_ok());
    assert_eq!(whiten(&[two.clone(), scatter]), Err(WhitenError::Trials(1)));
    let said = std::format!("{}", WhitenError::Trials(1));
    assert!(
        said.contains("movement 2: no texture has two slides"),
        "{said}"
    );
    let other = Scatter::new(3);
    assert_eq!(whiten(&[two.clone(), other]), Err(WhitenError::Features));
    for features in [0, MAX_FEATURES + 1] {
        let none = whiten(&[Scatter::new(features)]);
        assert_eq!(none, Err(WhitenError::Features));
    }
    assert_eq!(whiten(&vec![two.clone(); 36]).unwrap().len(), 36);
    assert_eq!(whiten(&vec![two; 37]), Err(WhitenError::Movements));
}

/// Every step by the formula of the running mean; all of them together no farther off than their roundings can add up
/// to.
#[test]
fn learning_is_the_running_mean() {
    let noise = &mut Noise(11);
    for features in [1, 13, 14] {
        let (mut learned, mut adapted) = (Whitened::default(), Whitened::default());
        let (mut all, mut recent) = (vec![0.0; features], vec![0.0; features]);
        for n in 0..300u32 {
            let centre = if n < 100 { 0.0 } else { 1500.0 };
            let slide: Vector = (0..features)
                .map(|_| (centre + 256.0 * noise.normal()) as i16)
                .collect();
            let before = (learned, adapted);
            learned.teach(&slide);
            adapted.adapt(&slide);
            let own = f64::from(n.min(255));
            let short = f64::from(n.min(3));
            for i in 0..features {
                let z = f64::from(slide[i]);
                let step = |before: i16, n: f64| {
                    let before = f64::from(before);
                    before + (z - before) / (n + 1.0)
                };
                let error = f64::from(learned.mean[i]) - step(before.0.mean[i], own);
                assert!(error.abs() <= 0.501, "{n}: {error}");
                let error = f64::from(adapted.mean[i]) - step(before.1.mean[i], short);
                assert!(error.abs() <= 0.501, "{n}: {error}");
                all[i] += (z - all[i]) / (own + 1.0);
                recent[i] += (z - recent[i]) / (short + 1.0);
                let error = (f64::from(learned.mean[i]) - all[i]).abs();
                assert!(error <= 0.5 + 0.25 * own, "{n}: {error}");
                assert!(n >= 40 || error <= 4.0, "{n}: {error}");
                let error = (f64::from(adapted.mean[i]) - recent[i]).abs();
                assert!(error <= 4.5, "{n}: {error}");
            }
            assert_eq!(u32::from(learned.slides), (n + 1).min(255));
            assert_eq!(u32::from(adapted.slides), (n + 1).min(3));
            let beyond = &learned.mean[features..];
            assert!(beyond.iter().all(|&mean| mean == 0));
        }
    }
}

#[test]
fn more_slides_than_the_memory_stay_as_many() {
    for slides in [3, 9, 40, 255] {
        let mean = [900; MAX_FEATURES];
        let mut known = Whitened { slides, mean };
        known.adapt(&[0, 1800]);
        // a quarter of the way, however many there were
        assert_eq!(
            (known.slides, known.mean[0], known.mean[1]),
            (slides, 675, 1125)
        );
        assert_eq!(known.mean[2..], mean[2..]);
    }
    let mut far = Whitened::default();
    far.teach(&[i16::MAX]);
    for _ in 0..300 {
        far.teach(&[i16::MIN]);
        far.adapt(&[i16::MAX]);
        assert!(i32::from(far.mean[0]).abs() <= 32_768);
    }
}
