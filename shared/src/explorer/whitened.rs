//! The fused way of deciding: how well the whitened slides of an episode fit each texture, in fixed point.
//!
//! At each movement the running mean of the episode's slides is compared with the texture's mean, as Student's t with
//! 8 degrees of freedom. A further slide replaces what the movement said before: adding to it would count the error of
//! the texture's own mean again with every slide.

use super::episode::Episode;
use super::novelty::{NoveltyModel, Source, student_norm};
use super::spread::{DEGREES_OF_FREEDOM, Spread, distance};
use crate::dsp::fixed::ln_q16;
use crate::table::{Contents, Table};

/// Adds the logarithms of the likelihoods (Q16, up to a constant) of all textures after the slides of an episode to
/// `logs`; that of a texture that the table does not have, and whether the table has textures enough to tell it. The
/// drift that the table expects counts, or not.
///
/// With a calibrated table, the movements of an episode have one tail together: for that `odds` has space for as many
/// numbers.
#[inline(never)]
pub(super) fn add_likelihoods(
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
    // all of them are, or none
    let calibrated = novelty_models
        .first()
        .is_some_and(NoveltyModel::is_calibrated);
    if table.is_paced() || calibrated && episode.len() > 1 {
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
        let mut spread: Option<Spread> = None;
        for (log, texture) in logs.iter_mut().zip(0..) {
            let slides = column.slides(texture);
            if slides == 0 {
                *log += untaught;
                continue;
            }
            // mostly that of the texture before, which has as many slides
            let spread = match spread {
                Some(ref last) if last.slides == slides => last,
                _ => spread.insert(Spread::new(sums.slides, slides, features, drifts)),
            };
            let distance = distance(&mean, column.mean(texture), &spread.narrowness);
            *log += spread.likelihood(distance);
        }
    }
    Some((elsewhere, can_tell))
}

/// [`add_likelihoods`] of an episode of several movements, or with slopes ([`Pace`](super::paced::Pace)): the squared
/// distances of all movements have one Student's t. A movement at which a texture was never measured is for it as for a
/// texture that the table does not have.
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
    let calibrated = novelty_models
        .first()
        .is_some_and(NoveltyModel::is_calibrated);
    let of_all = if calibrated {
        student_norm(features * episode.len())
    } else {
        0.0
    };
    let (mut elsewhere, mut can_tell) = (-of_all, true);
    for sums in episode {
        let mean = sums.mean(features);
        let pace = if table.is_paced() {
            Some(sums.pace(table.slopes_at(sums.movement)?))
        } else {
            None
        };
        let background = novelty_models
            .iter()
            .find(|b| b.movement == sums.movement)?;
        // what is not in the table goes with the speed as all textures do
        let usual = pace.as_ref().map_or(0, |pace| pace.mean);
        let slowed = table.at_movement_speed(None, sums.movement, &mean, usual);
        let unknown = if calibrated {
            background.population_likelihood(table, &slowed, sums.slides)
        } else {
            background.likelihood(table, &slowed, sums.slides)
        };
        elsewhere += unknown;
        can_tell &= background.source != Source::Nowhere;
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
            let (known, weights) = (column.mean(texture), &spread.narrowness);
            let (off, widening) = match &pace {
                Some(pace) => pace.distance(texture, &mean, known, weights),
                None => ((distance(&mean, known, weights) >> 16) as f32, 0),
            };
            *odds += off;
            *log += spread.norm - widening;
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
        if calibrated && taught < features * episode.len() {
            *log += q16(student_norm(taught) - of_all);
        }
    }
    Some((elsewhere, can_tell))
}

/// A logarithm in Q16; none of an episode's is below -256, so that sums stay within 32 bits.
pub(super) fn q16(ln: f32) -> i32 {
    (ln.max(-256.0) * 65536.0) as i32
}
