//! The confusion of textures (eq. 7) by their whitened means.

use heapless::{Vec, VecView};

use super::config::NEGLIGIBLE;
use crate::dsp::fixed::{LN_2, LOG2_E, exp2_neg_q30};
use crate::features::MAX_FEATURES;
use crate::table::{Contents, Numbers, Table};

/// Whitened numbers, 0 beyond the features.
type White = [i16; MAX_FEATURES];

/// A texture that is still likely, while a movement is weighed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Candidate {
    mean: White,
    /// 1 where the sum of the squares of the mean is odd, else 0.
    odd: u64,
    probability: f32,
    /// Sum over all others of confusion times probability: the numerator of eq. 8.
    pub(super) confused: f32,
    slides: u8,
}

impl Candidate {
    /// One that is not compared yet. Of `known` the first `features` are its mean; each of these is shrunk by one of
    /// `scales`, in 1/2^15, if there are any.
    pub(super) fn new(
        known: &[u8],
        features: usize,
        scales: Option<&White>,
        probability: f32,
        slides: u8,
    ) -> Self {
        let mut mean = White::default();
        for (to, from) in mean.iter_mut().zip(known.as_chunks().0).take(features) {
            *to = i16::from_le_bytes(*from);
        }
        for (mean, scale) in mean.iter_mut().zip(scales.into_iter().flatten()) {
            *mean = ((i32::from(*mean) * i32::from(*scale)) >> 15) as i16;
        }
        let square = mean.iter().map(|m| i64::from(i32::from(*m).pow(2)));
        Self {
            mean,
            odd: (square.sum::<i64>() as u64).min(u32::MAX.into()) & 1,
            probability,
            confused: 0.0,
            slides,
        }
    }

    fn left(&self) -> f32 {
        self.probability * self.confused / (self.probability + self.confused)
    }
}

/// The worth of squared distances of whitened means, Q16 (eq. 7).
#[derive(Clone, Copy, Debug)]
struct Likeness {
    /// Of two textures, the one with fewer slides was learned from so many.
    fewer: u8,
    /// The degree of confusion is 2 to the power of less the distance times this, of which the upper half is in Q18.
    octaves: u32,
    /// Means that far apart, an even number, are not confused: 25 octaves, as with Gaussians.
    far: u64,
}

impl Likeness {
    fn new(fewer: u8) -> Self {
        // the exponent is the squared distance times n / (8 (n + 1))
        let n = u32::from(fewer.max(1));
        let far = ((25 * 8 * LN_2 as u64) >> 16) as u32;
        Self {
            fewer,
            octaves: 2 * LOG2_E / (n + 1) * n,
            far: u64::from((far * (n + 1) / n) & !1),
        }
    }

    /// Degree of confusion of two textures: 1 for equal ones, and for one that was never learned with all others.
    #[inline]
    fn confusion(&self, a: &Candidate, b: &Candidate) -> f32 {
        if self.fewer == 0 {
            return 1.0;
        }
        let square = |a: i16, b: i16| {
            let apart = i64::from(i32::from(a) - i32::from(b));
            (apart * apart) as u64
        };
        let mut distance = a.odd;
        for ([a, b], [c, d]) in a.mean.as_chunks().0.iter().zip(b.mean.as_chunks().0) {
            distance += square(*a, *c) + square(*b, *d);
            // mostly soon: the axes along which textures scatter most come first
            if distance >= self.far {
                return 0.0;
            }
        }
        let octaves = (distance * u64::from(self.octaves)) >> 32;
        exp2_neg_q30(octaves as u32) as f32 * (1.0 / (1u32 << 30) as f32)
    }
}

/// By what the axes of a movement are shrunk, to compare textures learned from `n` slides in spite of this drift:
/// there the mean of a slide has the variance 1 + 1/n + delta instead of 1 + 1/n.
fn scales(drifts: Numbers<'_>, n: u8) -> White {
    let v = 1.0 + 1.0 / f32::from(n.max(1));
    let mut scales = White::default();
    for (pair, drift) in scales.as_chunks_mut::<2>().0.iter_mut().zip(drifts) {
        *pair = [(libm::sqrtf(v / (v + drift)) * 32767.0) as i16; 2];
    }
    scales
}

/// Sum over the textures that are still likely of the numerator of eq. 11, after a movement.
pub(super) fn uncertainty<const N: usize>(
    table: &Table<'_>,
    movement: u8,
    posterior: &[f32],
) -> f32 {
    let mut live: Vec<Candidate, N> = Vec::new();
    gather(table, movement, posterior, &mut live);
    confuse_all(&mut live);
    live.iter().map(Candidate::left).sum()
}

#[inline(never)]
fn confuse_all(live: &mut [Candidate]) {
    let mut rest = live;
    while let Some((a, others)) = rest.split_first_mut() {
        confuse(a, others);
        rest = others;
    }
}

/// Adds the confusion of `a` with each of `others` (eq. 7) to what they are confused with.
pub(super) fn confuse(a: &mut Candidate, others: &mut [Candidate]) {
    let mut likeness = Likeness::new(a.slides);
    for b in others {
        let fewer = a.slides.min(b.slides);
        if fewer != likeness.fewer {
            likeness = Likeness::new(fewer);
        }
        let confusion = likeness.confusion(a, b);
        a.confused += confusion * b.probability;
        b.confused += confusion * a.probability;
    }
}

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
    // exact where all were learned from as many slides as the first one
    let scales = table
        .drifts(movement)
        .map(|drifts| scales(drifts, column.slides(0)));
    for (&probability, texture) in posterior.iter().zip(0..) {
        if probability >= NEGLIGIBLE {
            let (mean, slides) = (column.mean(texture), column.slides(texture));
            let candidate =
                Candidate::new(mean, features.into(), scales.as_ref(), probability, slides);
            // `live` has space: it is as long as the posterior
            let _ = live.push(candidate);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The last texture of a table has fewer bytes behind its mean than others.
    #[test]
    fn what_lies_behind_a_mean_does_not_count() {
        let mean = [3i16, -400, 5000, -32768];
        let mut bytes = [0xa5; 68];
        for (to, from) in bytes.as_chunks_mut().0.iter_mut().zip(mean) {
            *to = from.to_le_bytes();
        }
        for bytes in [&bytes[..8], &bytes] {
            let candidate = Candidate::new(bytes, mean.len(), None, 0.5, 7);
            assert_eq!(candidate.mean[..4], mean);
            assert_eq!(candidate.mean[4..], [0; MAX_FEATURES - 4]);
            assert_eq!(candidate.odd, 1);
        }
    }
}
