//! The limits of a fused table, from the slides that it is learned from: the distance of each of them, left out and
//! drifted, from all textures.
//!
//! A slide that was learned from lies nearer to its texture's mean than one of another day. Its distance without itself
//! follows from its distance alone, so nothing is learned twice; a draw of the expected drift comes on top.

use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::explorer::{Config, Explorer, ExplorerError, Method};
use tactus_core::features::{PropertySet, Vector, WHITE_STEPS};
use tactus_core::table::{Against, Drifts, EPISODES, Limits, MAX_TEXTURES, Table, Tail, Whitened};

const DRAWS: usize = 8;
/// Largest correction of a slide's distance, squared.
const FARTHEST: f64 = 5.0;
/// Share of the scores in the tail.
const TAIL: f64 = 0.1;
/// Weight, in slides, of a tail that was seen in other tables, where that begins and how far it reaches.
const PRIOR: (f64, f64, f64) = (10.0, -1.0 - 2.5 * std::f64::consts::LN_10, 2.5);
/// Weight of the average over all movements, in slides, as in the whitening.
const SHARED: f64 = 15.0;

/// Slides of a texture at a movement as their whitened distance from its mean, corrected for the part that they have in
/// the mean and in the whitening.
struct Residuals {
    texture: usize,
    /// Per movement with two slides or more: its index, and the slides.
    movements: Vec<(usize, Vec<Vec<f64>>)>,
}

/// Limits of `table`, whose sections have any limits so far. `white` has its slides, whitened, per texture and
/// movement; `drifts` the variances of the drift at every movement, if there is any.
/// Errors: the table cannot be explored.
pub(crate) fn limits(
    false_alarm: f32,
    table: Table<'_>,
    known: &[Vec<Whitened>],
    white: &[Vec<Vec<Vector>>],
    drifts: Option<&[Drifts]>,
) -> Result<Limits, ExplorerError> {
    let config = Config {
        method: Method::Fused,
        ..Config::default()
    };
    let explorer = Box::new(Explorer::<MAX_TEXTURES>::new(
        table,
        PropertySet::ALL,
        config,
    )?);
    let residuals = residuals(known, white);
    let slides: usize = white.iter().flatten().map(Vec::len).sum();
    let weight = slides.saturating_sub(white.len()) as f64;
    let weight = weight / (weight + PRIOR.0);
    let tails = |against, drifts: Option<&[Drifts]>| -> [Tail; EPISODES] {
        std::array::from_fn(|more| {
            // the same draws for every set of textures
            let mut random = ChaCha8Rng::seed_from_u64(more as u64);
            let mut scores = Vec::new();
            for own in &residuals {
                let count: usize = own.movements.iter().map(|(_, slides)| slides.len()).sum();
                for draw in 0..DRAWS * count {
                    let known = &known[own.texture];
                    let visits = episode(own, known, drifts, draw / DRAWS, more + 1, &mut random);
                    scores.extend(explorer.score_of(&visits, against).map(f64::from));
                }
            }
            tail(&mut scores, weight)
        })
    };
    let same = tails(Against::Same, None);
    Ok(Limits {
        false_alarm,
        drifted: match drifts {
            Some(drifts) => tails(Against::Drifted, Some(drifts)),
            None => same,
        },
        same,
    })
}

fn residuals(known: &[Vec<Whitened>], white: &[Vec<Vec<Vector>>]) -> Vec<Residuals> {
    let movements = white.first().map_or(0, Vec::len);
    let freedom = |movement: usize| -> f64 {
        let own = white
            .iter()
            .map(|row| row[movement].len().saturating_sub(1));
        let own = own.sum::<usize>() as f64;
        own + own * SHARED / (SHARED + own) * (movements as f64 - 1.0)
    };
    let freedoms: Vec<f64> = (0..movements).map(freedom).collect();
    let of = |(texture, row): (usize, &Vec<Vec<Vector>>)| {
        let cells = row
            .iter()
            .enumerate()
            .filter(|(_, slides)| slides.len() > 1);
        let movements = cells.map(|(movement, slides)| {
            let (n, freedom) = (slides.len() as f64, freedoms[movement]);
            let out = |slide: &Vector| -> Vec<f64> {
                let mean = &known[texture][movement].mean;
                let apart = slide.iter().zip(mean);
                let r: Vec<f64> = apart
                    .map(|(z, m)| f64::from(i32::from(*z) - i32::from(*m)))
                    .collect();
                let squares = r.iter().map(|r| r * r).sum::<f64>();
                let rho = squares / f64::from(WHITE_STEPS * WHITE_STEPS) * n / (n - 1.0);
                let farther = if rho < freedom {
                    ((freedom - 1.0) / (freedom - rho)).min(FARTHEST)
                } else {
                    FARTHEST
                };
                let by = (farther.max(0.0) / (1.0 - 1.0 / n)).sqrt();
                r.iter().map(|r| r * by).collect()
            };
            (movement, slides.iter().map(out).collect())
        });
        Residuals {
            texture,
            movements: movements.collect(),
        }
    };
    white.iter().enumerate().map(of).collect()
}

/// An episode of so many slides: with one movement of this slide, with more of any slides. Every movement that was
/// made, its slides, and their mean.
fn episode(
    own: &Residuals,
    known: &[Whitened],
    drifts: Option<&[Drifts]>,
    slide: usize,
    slides: usize,
    random: &mut ChaCha8Rng,
) -> Vec<(u8, u8, Vector)> {
    let several = own.movements.len() > 1;
    let mut made = vec![0_u8; own.movements.len()];
    for _ in 0..slides {
        let at = if several {
            random.random_range(0..made.len())
        } else {
            0
        };
        made[at] += 1;
    }
    let visits = made.iter().zip(&own.movements).filter(|(k, _)| **k > 0);
    visits
        .map(|(&k, (movement, slides))| {
            let at = if several {
                random.random_range(0..slides.len())
            } else {
                slide
            };
            let known = &known[*movement];
            let by = (1.0 / f64::from(k) + 1.0 / slides.len() as f64).sqrt();
            let mean = slides[at].iter().zip(known.mean).zip(0_usize..);
            let mean = mean.map(|((r, m), axis)| {
                let sd = drifts.map_or(0.0, |drifts| f64::from(drifts[*movement][axis / 2]).sqrt());
                let drift = if sd > 0.0 {
                    sd * f64::from(WHITE_STEPS) * normal(random)
                } else {
                    0.0
                };
                // `as` saturates, as features do
                (f64::from(m) + r * by + drift).round() as i16
            });
            (*movement as u8, k, mean.collect())
        })
        .collect()
}

/// The upper tail of scores; drawn towards that of other tables by as much as so few slides deserve.
fn tail(scores: &mut [f64], weight: f64) -> Tail {
    let (_, begin, excess) = PRIOR;
    scores.sort_by(f64::total_cmp);
    let at = (1.0 - TAIL) * scores.len().saturating_sub(1) as f64;
    let (Some(low), Some(high)) = (scores.get(at as usize), scores.get((at.ceil()) as usize))
    else {
        return Tail {
            begin: begin as f32,
            excess: excess as f32,
        };
    };
    let from = low + (high - low) * at.fract();
    let above: Vec<f64> = scores
        .iter()
        .map(|s| s - from)
        .filter(|s| *s > 0.0)
        .collect();
    let mean = above.iter().sum::<f64>() / above.len().max(1) as f64;
    Tail {
        begin: (weight * from + (1.0 - weight) * begin) as f32,
        excess: (weight * mean + (1.0 - weight) * excess).max(1e-3) as f32,
    }
}

/// A standard normal number (Box and Muller); the same on every machine.
fn normal(random: &mut ChaCha8Rng) -> f64 {
    let mut uniform = || ((random.next_u64() >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
    let radius = libm::sqrt(-2.0 * libm::log(uniform()));
    radius * libm::cos(std::f64::consts::TAU * uniform())
}
