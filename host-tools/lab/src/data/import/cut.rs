//! Where in a long recording the finger slides, and where it is still, by energy.

use std::ops::Range;

/// Samples that are looked at together: 50 ms at 2200 Hz.
const FRAME: usize = 110;
/// Power of sliding over that of stillness from which these are two states, not one that varies.
const APART: f64 = 16.0;
/// Longest pause within one slide, in frames.
const PAUSE: usize = 4;
/// Taken off both ends of a stretch, in frames: the begin and the end of a movement are no steady sliding.
const EDGE: usize = 2;
/// Fewest frames of a still part: the filter must fill, and its power settle.
const STILL: usize = 6;

/// The parts of one recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Parts {
    /// Each slide.
    pub slides: Vec<Range<usize>>,
    /// The longest stretch in which nothing moves, if there is one.
    pub still: Option<Range<usize>>,
}

/// The slides of a signal, in samples. Stretches longer than two slides of `length` are divided into such; none is
/// shorter than `least`.
pub(super) fn parts(signal: &[f64], length: usize, least: usize) -> Parts {
    let powers: Vec<f64> = signal.chunks_exact(FRAME).map(power).collect();
    let mut sorted = powers.clone();
    sorted.sort_by(f64::total_cmp);
    let quantile = |part: f64| {
        let at = (part * sorted.len() as f64) as usize;
        sorted
            .get(at.min(sorted.len().saturating_sub(1)))
            .copied()
            .unwrap_or(0.0)
    };
    let (low, high) = (quantile(0.05), quantile(0.9));
    let whole = || stretch(0..signal.len(), length, least);
    if high <= low * APART {
        return Parts {
            slides: whole(),
            still: None,
        };
    }
    // between the two, in logarithms; silence has a power, too
    let limit = (low.max(high * 1e-6) * high).sqrt();
    let is_moving: Vec<bool> = powers.iter().map(|power| *power > limit).collect();
    let mut runs: Vec<Range<usize>> = Vec::new();
    for at in (0..is_moving.len()).filter(|at| is_moving[*at]) {
        match runs.last_mut() {
            Some(run) if at - run.end <= PAUSE => run.end = at + 1,
            _ => runs.push(at..at + 1),
        }
    }
    let mut still: Option<Range<usize>> = None;
    let mut from = 0;
    for run in runs.iter().cloned().chain(Some(powers.len()..powers.len())) {
        // what is next to a movement is not still
        let (begin, end) = (from + EDGE.min(from), run.start.saturating_sub(EDGE));
        if end >= begin + STILL
            && still
                .as_ref()
                .is_none_or(|s| s.len() < (end - begin) * FRAME)
        {
            still = Some(begin * FRAME..end * FRAME);
        }
        from = run.end;
    }
    let inside = |run: Range<usize>| {
        let (from, to) = (run.start + EDGE, run.end.saturating_sub(EDGE));
        stretch(from * FRAME..to * FRAME, length, least)
    };
    Parts {
        slides: runs.into_iter().flat_map(inside).collect(),
        still,
    }
}

/// A stretch of sliding as slides.
fn stretch(run: Range<usize>, length: usize, least: usize) -> Vec<Range<usize>> {
    let samples = run.end.saturating_sub(run.start);
    if samples < least {
        return Vec::new();
    }
    let pieces = if samples < 2 * length {
        1
    } else {
        samples / length
    };
    let each = if pieces == 1 { samples } else { length };
    (0..pieces)
        .map(|n| run.start + n * each..run.start + (n + 1) * each)
        .collect()
}

/// Power of the differences between neighbours: slow drifts do not count.
fn power(frame: &[f64]) -> f64 {
    let steps = frame.windows(2).map(|pair| (pair[1] - pair[0]).powi(2));
    steps.sum::<f64>() / frame.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn slides_are_found_where_they_are() {
        for seed in 0..50 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            // still, slide, still, slide, ...
            let (mut signal, mut truth): (Vec<f64>, Vec<Range<usize>>) = Default::default();
            for _ in 0..random.random_range(1..5) {
                let noise = |random: &mut ChaCha8Rng, sd: f64| sd * random.random_range(-1.0..1.0);
                let still = random.random_range(1500..4000);
                signal.extend((0..still).map(|_| noise(&mut random, 1.0)));
                let from = signal.len();
                let slide = random.random_range(3000..9000);
                signal.extend((0..slide).map(|_| noise(&mut random, 20.0)));
                truth.push(from..signal.len());
            }
            signal.extend((0..1500).map(|_| random.random_range(-1.0..1.0)));
            let parts = parts(&signal, 6600, 1100);
            assert_eq!(
                parts.slides.len(),
                truth.len(),
                "seed {seed}: {parts:?}, {truth:?}"
            );
            for (found, truth) in parts.slides.iter().zip(&truth) {
                assert!(
                    found.start >= truth.start && found.end <= truth.end,
                    "seed {seed}"
                );
                assert!(found.len() + 6 * FRAME > truth.len(), "seed {seed}");
            }
            let still = parts.still.unwrap();
            assert!(
                truth
                    .iter()
                    .all(|t| still.end <= t.start || t.end <= still.start)
            );
        }
    }

    #[test]
    fn a_recording_without_a_still_part_is_divided() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let signal: Vec<f64> = (0..30_000)
            .map(|_| random.random_range(-9.0..9.0))
            .collect();
        let parts = parts(&signal, 6600, 1100);
        assert_eq!(parts.slides.len(), 4);
        assert!(parts.still.is_none());
        assert!(parts.slides.windows(2).all(|p| p[0].end <= p[1].start));
    }
}
