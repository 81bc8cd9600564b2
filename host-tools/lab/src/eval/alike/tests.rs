use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::{FeatureSet, Observation, Properties, PropertySet};
use tactus_core::table::{Experience, Whitened, Whitening, encode, encode_fused};

use super::*;

const FEATURES: usize = 12;
const MOVEMENTS: [Movement; 3] = [
    Movement::FOR_TRACTION,
    Movement::FOR_FINENESS,
    Movement::FOR_ROUGHNESS,
];

/// A random number of the standard normal distribution (Box and Muller).
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let (u, v): (f64, f64) = (random.random(), random.random());
    (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

/// A pair of textures: at each movement a mean in standard deviations, `apart[movement]` from each other.
struct Pair {
    means: [[Vec<f64>; MOVEMENTS.len()]; 2],
}

impl Pair {
    fn new(features: usize, apart: [f64; MOVEMENTS.len()], random: &mut ChaCha8Rng) -> Self {
        let a: [Vec<f64>; MOVEMENTS.len()] =
            std::array::from_fn(|_| (0..features).map(|_| normal(random)).collect());
        let b = std::array::from_fn(|movement| {
            let towards: Vec<f64> = (0..features).map(|_| normal(random)).collect();
            let length = towards.iter().map(|x| x * x).sum::<f64>().sqrt();
            let step = apart[movement] / length;
            let from = a[movement].iter().zip(towards);
            from.map(|(a, x)| a + step * x).collect()
        });
        Self { means: [a, b] }
    }

    /// A slide of one of them.
    fn slide(&self, texture: usize, movement: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
        let mean = self.means[texture][movement].iter();
        mean.map(|m| m + normal(random)).collect()
    }
}

/// A whitening that leaves features as they are: from 1/1024 to 1/256.
fn identity() -> Whitening {
    let mut bytes = vec![0; 2 * FEATURES];
    // the places of 2^10
    bytes.extend([10; FEATURES]);
    for row in 0..FEATURES {
        let weights = (0..FEATURES).map(|column| if row == column { 1i16 << 10 } else { 0 });
        bytes.extend(weights.flat_map(i16::to_le_bytes));
    }
    Whitening::read(&bytes, FEATURES).unwrap()
}

fn fused(pair: &Pair, trials: [u8; 2], random: &mut ChaCha8Rng) -> (Vec<u8>, usize) {
    let learned: Vec<Vec<Whitened>> = (0..2)
        .map(|texture| {
            let learn = |movement| {
                let mut whitened = Whitened::default();
                for _ in 0..trials[texture] {
                    let slide = pair.slide(texture, movement, random);
                    let steps: Vec<i16> =
                        slide.iter().map(|x| (x * 256.0).round() as i16).collect();
                    whitened.teach(&steps);
                }
                whitened
            };
            (0..MOVEMENTS.len()).map(learn).collect()
        })
        .collect();
    let mut bytes = vec![0; 1 << 14];
    let movements = MOVEMENTS.map(|movement| (movement, identity()));
    let textures = ["a", "b"]
        .into_iter()
        .zip(learned.iter().map(Vec::as_slice));
    let table = encode_fused(&mut bytes, FeatureSet::Bands, &movements, textures).unwrap();
    let length = table.as_bytes().len();
    (bytes, length)
}

fn gaussians(pair: &Pair, trials: [u8; 2], random: &mut ChaCha8Rng) -> (Vec<u8>, usize) {
    let learned: Vec<Vec<Experience>> = (0..2)
        .map(|texture| {
            let learn = |movement| {
                let mut experience = Experience::default();
                for _ in 0..trials[texture] {
                    let slide = properties(&pair.slide(texture, movement, random));
                    experience.learn(PropertySet::ALL, &slide).unwrap();
                }
                experience
            };
            (0..MOVEMENTS.len()).map(learn).collect()
        })
        .collect();
    let mut bytes = vec![0; 1 << 14];
    let textures = ["a", "b"].into_iter().zip(&learned);
    let textures = textures.map(|(name, known)| (name, &known[..]));
    let table = encode(&mut bytes, PropertySet::ALL, &MOVEMENTS, textures).unwrap();
    let length = table.as_bytes().len();
    (bytes, length)
}

/// Of a slide whose features are in standard deviations of a fifth.
fn properties(slide: &[f64]) -> Properties {
    let value = |n: usize| slide.get(n).map(|x| (x * 0.2) as f32);
    Properties::new([value(0), value(1), value(2)])
}

/// Returns true if the explorer takes a slide of the first for the second.
fn is_taken(table: Table<'_>, movement: u8, slide: &Observation) -> bool {
    let config = Config {
        method: Method::of(table.contents()),
        ..Config::default()
    };
    let mut explorer: Explorer<'_, 2> = Explorer::new(table, PropertySet::ALL, config).unwrap();
    let action = Action {
        movement,
        property: None,
    };
    explorer.observe(action, slide).unwrap();
    explorer.best().texture == 1
}

type Learn = fn(&Pair, [u8; 2], &mut ChaCha8Rng) -> (Vec<u8>, usize);

/// Mean of the computed share, and the share of slides that the explorer takes for the other's, over many tables of
/// pairs so far apart, at the movement that is computed to be the best.
fn said_and_seen(learn: Learn, features: usize, apart: [f64; 3], trials: [u8; 2]) -> (f64, f64) {
    const TABLES: u64 = 200;
    const SLIDES: u32 = 20;
    let (mut said, mut taken) = (0.0, 0);
    for seed in 0..TABLES {
        let random = &mut ChaCha8Rng::seed_from_u64(seed);
        let pair = Pair::new(features, apart, random);
        let (bytes, length) = learn(&pair, trials, random);
        let table = Table::read(&bytes[..length]).unwrap();
        let (movement, deviation) = compare(table, [0, 1]).unwrap();
        let share = normal_below(deviation);
        said += share;
        for _ in 0..SLIDES {
            let slide = pair.slide(0, movement.into(), random);
            let observed = Observation {
                properties: properties(&slide),
                bands: slide.iter().map(|x| (x * 1024.0).round() as i16).collect(),
                pressure: None,
                pace: None,
            };
            taken += u32::from(is_taken(table, movement, &observed));
        }
    }
    let all = TABLES as f64;
    (said / all, f64::from(taken) / (all * f64::from(SLIDES)))
}

#[test]
fn as_many_slides_are_taken_for_the_others_as_is_said() {
    for (learn, features) in [(fused as Learn, FEATURES), (gaussians as Learn, 3)] {
        for trials in [[5, 5], [5, 15], [15, 5], [20, 20]] {
            for apart in [
                [0.0; 3],
                [0.5, 1.0, 2.0],
                [1.5; 3],
                [4.0, 1.0, 0.0],
                [6.0; 3],
            ] {
                let (said, seen) = said_and_seen(learn, features, apart, trials);
                let which = format!(
                    "{features} features, {trials:?} trials, {apart:?} apart: said {said:.3}, seen {seen:.3}"
                );
                if apart == [0.0; 3] {
                    // one texture: only chance separates them, and ten slides do not
                    assert!(said > 0.25 && seen > 0.25, "{which}");
                } else {
                    assert!((said - seen).abs() < 0.1, "{which}");
                }
            }
        }
    }
}

#[test]
fn the_nearest_is_named_and_the_same_texture_twice_is_told() {
    let random = &mut ChaCha8Rng::seed_from_u64(1);
    for (learn, features) in [(fused as Learn, FEATURES), (gaussians as Learn, 3)] {
        let mut told = [0.0, 6.0].map(|apart| {
            let told = |_| {
                let pair = Pair::new(features, [apart; 3], random);
                let (bytes, length) = learn(&pair, [10, 10], random);
                let alike = nearest(Table::read(&bytes[..length]).unwrap(), 0).unwrap();
                assert_eq!(alike.texture, "b");
                alike.feels_the_same
            };
            (0..50).map(told).filter(|same| *same).count()
        });
        // by chance, ten slides of one texture may look like those of two
        told[0] = told[0].min(46);
        assert_eq!(told, [46, 0], "{features} features");
    }
}
