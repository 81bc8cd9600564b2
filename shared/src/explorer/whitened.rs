//! The fused way of deciding: how well the whitened slides of an episode fit each texture, in fixed point.
//!
//! At each movement the running mean of the episode's slides is compared with the texture's mean, as Student's t with 8
//! degrees of freedom. A further slide replaces what the movement said before: adding to it would count the error of the
//! texture's own mean again with every slide.

use heapless::{Vec, VecView};

use super::config::NEGLIGIBLE;
use super::episode::Episode;
use super::kernels::{Candidate, Kernels, Spread, distance, mask};
use super::novelty::NoveltyModel;
use crate::dsp::fixed::exp_neg_q30;
use crate::table::{Contents, Table};

/// [`Kernels::add_likelihoods`].
type AddLikelihoods = fn(&[i16], &[u8], usize, &Spread, &mut [i32]) -> usize;

/// Adds the logarithms of the likelihoods (Q16, up to a constant) of all textures after the slides of an episode to `logs`;
/// that of a texture that the table does not have, and whether the table has textures enough to tell it.
// not generic: so it is compiled with this crate, for speed
#[inline(never)]
pub(super) fn add_likelihoods(
    table: &Table<'_>,
    episode: &Episode,
    novelty_models: &[NoveltyModel],
    logs: &mut [i32],
    add: AddLikelihoods,
) -> Option<(f32, bool)> {
    let Contents::Fused(_, features) = table.contents() else {
        return None;
    };
    let features = usize::from(features);
    let (mut elsewhere, mut can_tell) = (0.0, true);
    for sums in episode {
        let mean = sums.mean(features);
        let background = novelty_models
            .iter()
            .find(|b| b.movement == sums.movement)?;
        let unknown = background.likelihood(&mean, sums.slides);
        elsewhere += unknown;
        can_tell &= background.known;
        // as little is known of a texture that was never measured here as of one that the table does not have
        let untaught = (unknown * 65536.0) as i32;
        let column = table.column(sums.movement);
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
                let spread = Spread::new(sums.slides, slides, features);
                let mut done = 0;
                loop {
                    let to_do = these.get_mut(done..).unwrap_or_default();
                    let means = column.mean(texture + done);
                    done += add(&mean, means, column.stride, &spread, to_do);
                    // one that is too far away
                    let Some(log) = these.get_mut(done) else {
                        break;
                    };
                    *log += spread.likelihood(distance(&mean, column.mean(texture + done)));
                    done += 1;
                }
            }
            rest = others;
            texture += same;
        }
    }
    Some((elsewhere, can_tell))
}

/// e^(-x) is 0 from here on, Q16: [`exp_neg_q30`].
const FAR: u32 = 22 << 16;

/// Degree of confusion of two textures (eq. 7, of the means of whitened slides) whose means are so far apart, Q16: 1 where
/// one was never learned. `fewer` is the smaller number of slides of the two.
fn confusion(apart: u32, fewer: u8) -> f32 {
    if fewer == 0 {
        return 1.0;
    }
    // |m_i - m_j|^2 / (8 (1 + 1/n))
    let n = u32::from(fewer);
    let exponent = match apart.checked_mul(n) {
        Some(product) => product / (8 * (n + 1)),
        None => (u64::from(apart) * u64::from(n) / u64::from(8 * (n + 1))) as u32,
    };
    exp_neg_q30(exponent) as f32 * (1.0 / (1u32 << 30) as f32)
}

/// Sum over the textures that are still likely of the numerator of eq. 11, after a movement.
pub(super) fn uncertainty<K: Kernels, const N: usize>(
    table: &Table<'_>,
    movement: u8,
    posterior: &[f32],
) -> f32 {
    let mut live: Vec<Candidate, N> = Vec::new();
    gather(table, movement, posterior, &mut live);
    let mut rest = live.as_mut_slice();
    while let Some((a, others)) = rest.split_first_mut() {
        K::candidate_distances(a, others);
        confuse_with(a, others);
        rest = others;
    }
    let left = |c: &Candidate| c.probability * c.confused / (c.probability + c.confused);
    live.iter().map(left).sum()
}

/// The textures that are still likely.
#[inline(never)]
pub(super) fn gather(
    table: &Table<'_>,
    movement: u8,
    posterior: &[f32],
    live: &mut VecView<Candidate>,
) {
    let Contents::Fused(_, features) = table.contents() else {
        return;
    };
    let column = table.column(movement);
    let mask = mask(features.into());
    for (&probability, texture) in posterior.iter().zip(0..) {
        if probability >= NEGLIGIBLE {
            let (mean, slides) = (column.mean(texture), column.slides(texture));
            // `live` has space: it is as long as the posterior
            let _ = live.push(Candidate::new(mean, &mask, probability, slides));
        }
    }
}

/// Confusion of one texture with all others, whose distances from it are known.
#[inline(never)]
pub(super) fn confuse_with(a: &mut Candidate, others: &mut [Candidate]) {
    let mut confused = a.confused;
    for b in others {
        // the last factor of the exponent is 2 at most
        let far = b.distance >= u64::from(16 * FAR);
        if far && a.slides > 0 && b.slides > 0 {
            continue;
        }
        // no distance counts where one was never learned
        let apart = if far { 0 } else { b.distance as u32 };
        let confusion = confusion(apart, a.slides.min(b.slides));
        confused += confusion * b.probability;
        b.confused += confusion * a.probability;
    }
    a.confused = confused;
}
