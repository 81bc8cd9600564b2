//! The fused way of deciding: how well the whitened slides of an episode fit each texture, in fixed point.
//!
//! At each movement the running mean of the episode's slides is compared with the texture's mean, as Student's t with 8
//! degrees of freedom. A further slide replaces what the movement said before: adding to it would count the error of the
//! texture's own mean again with every slide.

use heapless::{Vec, VecView};

use super::config::NEGLIGIBLE;
use super::episode::Episode;
use super::kernels::{
    Candidate, DEGREES_OF_FREEDOM, Kernels, MOST_SQUARE, Spread, distance, mask, scales,
};
use super::novelty::{NoveltyModel, Source, student_norm};
use crate::dsp::Plain;
use crate::dsp::fixed::ln_q16;
use crate::table::{Contents, Table};

/// [`Kernels::add_likelihoods`].
type AddLikelihoods = fn(&[i16], &[u8], usize, &Spread, &mut [i32]) -> usize;

/// Adds the logarithms of the likelihoods (Q16, up to a constant) of all textures after the slides of an episode to `logs`;
/// that of a texture that the table does not have, and whether the table has textures enough to tell it. The drift that the
/// table expects counts, or not.
///
/// With a calibrated table, the movements of an episode have one tail together: for that `odds` has space for as many
/// numbers.
// not generic: so it is compiled with this crate, for speed
#[inline(never)]
pub(super) fn add_likelihoods(
    table: &Table<'_>,
    episode: &Episode,
    novelty_models: &[NoveltyModel],
    drifting: bool,
    logs: &mut [i32],
    odds: &mut [f32],
    add: AddLikelihoods,
) -> Option<(f32, bool)> {
    let Contents::Fused(_, features) = table.contents() else {
        return None;
    };
    let features = usize::from(features);
    // all of them are, or none
    let calibrated = novelty_models
        .first()
        .is_some_and(NoveltyModel::is_calibrated);
    if calibrated && episode.len() > 1 {
        return add_jointly(table, episode, novelty_models, drifting, logs, odds);
    }
    let (mut elsewhere, mut can_tell) = (0.0, true);
    for sums in episode {
        let mean = sums.mean(features);
        let background = novelty_models
            .iter()
            .find(|b| b.movement == sums.movement)?;
        let unknown = background.likelihood(table, &mean, sums.slides);
        elsewhere += unknown;
        can_tell &= background.source != Source::Nowhere;
        // as little is known of a texture that was never measured here as of one that the table does not have
        let untaught = q16(unknown);
        let column = table.column(sums.movement);
        let drifts = table.drifts(sums.movement).filter(|_| drifting);
        let mut rest = &mut *logs;
        let mut texture = 0;
        while !rest.is_empty() {
            let slides = column.slides(texture);
            let same = if background.slides.is_some() {
                rest.len()
            } else {
                let others = (texture..).zip(&*rest);
                others
                    .take_while(|(other, _)| column.slides(*other) == slides)
                    .count()
            };
            let Some((these, others)) = rest.split_at_mut_checked(same) else {
                break;
            };
            if slides == 0 {
                these.iter_mut().for_each(|log| *log += untaught);
            } else {
                let spread = Spread::new(sums.slides, slides, features, drifts);
                let mut done = 0;
                loop {
                    let to_do = these.get_mut(done..).unwrap_or_default();
                    let means = column.mean(texture + done);
                    done += add(&mean, means, column.stride, &spread, to_do);
                    // one that is too far away
                    let Some(log) = these.get_mut(done) else {
                        break;
                    };
                    let far = column.mean(texture + done);
                    *log += spread.likelihood(distance(&mean, far, &spread.narrowness));
                    done += 1;
                }
            }
            rest = others;
            texture += same;
        }
    }
    Some((elsewhere, can_tell))
}

/// [`add_likelihoods`] of an episode of several movements: the squared distances of all of them have one Student's t. A
/// movement at which a texture was never measured is for it as for a texture that the table does not have.
#[inline(never)]
fn add_jointly(
    table: &Table<'_>,
    episode: &Episode,
    novelty_models: &[NoveltyModel],
    drifting: bool,
    logs: &mut [i32],
    odds: &mut [f32],
) -> Option<(f32, bool)> {
    let Contents::Fused(_, features) = table.contents() else {
        return None;
    };
    let features = usize::from(features);
    let odds = odds.get_mut(..logs.len())?;
    odds.fill(0.0);
    let of_all = student_norm(features * episode.len());
    let mut elsewhere = -of_all;
    for sums in episode {
        let mean = sums.mean(features);
        let background = novelty_models
            .iter()
            .find(|b| b.movement == sums.movement)?;
        let unknown = background.population_likelihood(table, &mean, sums.slides);
        elsewhere += unknown;
        let column = table.column(sums.movement);
        let drifts = table.drifts(sums.movement).filter(|_| drifting);
        let mut spread: Option<Spread> = None;
        for ((log, odds), texture) in logs.iter_mut().zip(&mut *odds).zip(0..) {
            let slides = column.slides(texture);
            if slides == 0 {
                *log += q16(unknown);
                continue;
            }
            // mostly that of the texture before, which has as many slides
            let spread = match spread {
                Some(ref last) if last.slides == slides => last,
                _ => spread.insert(Spread::new(sums.slides, slides, features, drifts)),
            };
            *odds += (distance(&mean, column.mean(texture), &spread.narrowness) >> 16) as f32;
            *log += spread.norm;
        }
    }
    for ((log, odds), texture) in logs.iter_mut().zip(odds).zip(0..) {
        let taught = episode.iter();
        let taught = taught.filter(|sums| table.trials(texture, sums.movement) > 0);
        let taught = taught.count() * features;
        let weight = i64::from(DEGREES_OF_FREEDOM) + taught as i64;
        let tail = weight * i64::from(ln_q16((1 << 16) + *odds as u64));
        // 512/2 times 31 in Q16: 29 bits
        *log -= (tail >> 1) as i32;
        if taught < features * episode.len() {
            *log += q16(student_norm(taught) - of_all);
        }
    }
    Some((elsewhere, true))
}

/// A logarithm in Q16; none of an episode's is below -256, so that sums stay within 32 bits.
pub(super) fn q16(ln: f32) -> i32 {
    (ln.max(-256.0) * 65536.0) as i32
}

/// Sum over the textures that are still likely of the numerator of eq. 11, after a movement.
pub(super) fn uncertainty<K: Kernels, const N: usize>(
    table: &Table<'_>,
    movement: u8,
    posterior: &[f32],
) -> f32 {
    let mut live: Vec<Candidate, N> = Vec::new();
    let confuse = gather::<K>(table, movement, posterior, &mut live);
    let mut rest = live.as_mut_slice();
    while let Some((a, others)) = rest.split_first_mut() {
        confuse.with(a, others);
        rest = others;
    }
    let left = |c: &Candidate| c.probability * c.confused / (c.probability + c.confused);
    live.iter().map(left).sum()
}

/// How textures are confused with each other.
#[derive(Clone, Copy)]
pub(super) struct Confuse {
    /// [`Kernels::confuse_whitened`].
    with: fn(&mut Candidate, &mut [Candidate], u8),
    /// How many slides all of them were learned from; `None` where these are different numbers, or none.
    slides: Option<u8>,
}

impl Confuse {
    /// Confusion of one texture with all others.
    pub(super) fn with(self, a: &mut Candidate, others: &mut [Candidate]) {
        if let Some(slides) = self.slides {
            return (self.with)(a, others, slides);
        }
        let mut rest = others;
        while let Some(first) = rest.first().map(|b| b.slides) {
            let many = rest.iter().take_while(|b| b.slides == first).count();
            let (alike, later) = rest.split_at_mut_checked(many).unwrap_or_default();
            rest = later;
            let slides = first.min(a.slides);
            if slides > 0 {
                (self.with)(a, alike, slides);
                continue;
            }
            // one that was never learned is confused with all
            for b in alike {
                a.confused += b.probability;
                b.confused += a.probability;
            }
        }
    }
}

/// The textures that are still likely, and how they are confused.
pub(super) fn gather<K: Kernels>(
    table: &Table<'_>,
    movement: u8,
    posterior: &[f32],
    live: &mut VecView<Candidate>,
) -> Confuse {
    let (slides, bounded) = gather_live(table, movement, posterior, live, K::sqrt);
    let with = if bounded {
        K::confuse_whitened
    } else {
        Plain::confuse_whitened
    };
    Confuse { with, slides }
}

/// The textures that are still likely; how many slides all of them were learned from, if these are as many, and whether
/// their sums of squares are bounded as kernels want it.
#[inline(never)]
fn gather_live(
    table: &Table<'_>,
    movement: u8,
    posterior: &[f32],
    live: &mut VecView<Candidate>,
    sqrt: fn(f32) -> f32,
) -> (Option<u8>, bool) {
    let Contents::Fused(_, features) = table.contents() else {
        return (None, false);
    };
    let column = table.column(movement);
    let mask = mask(features.into());
    let drifts = table.drifts(movement);
    // exact where all were learned from as many slides as the first one
    let scales = drifts.map(|drifts| scales(drifts, column.slides(0), sqrt));
    let (mut first, mut alike, mut most) = (0, true, 0);
    for (&probability, texture) in posterior.iter().zip(0..) {
        if probability >= NEGLIGIBLE {
            let (mean, slides) = (column.mean(texture), column.slides(texture));
            let candidate = Candidate::new(mean, &mask, scales.as_ref(), probability, slides);
            if live.is_empty() {
                first = slides;
            }
            alike &= slides == first;
            most = most.max(candidate.square);
            // `live` has space: it is as long as the posterior
            let _ = live.push(candidate);
        }
    }
    let slides = Some(first).filter(|first| alike && *first > 0);
    (slides, most < MOST_SQUARE)
}
