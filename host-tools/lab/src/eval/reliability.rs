//! How often explorations are right when they say so, and what another threshold would change.

use serde::Serialize;

use super::courses::Course;
use super::verdicts::Verdicts;

/// Lower ends of the probabilities that are counted together; the last has no upper one.
const SAID: [f32; 7] = [0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 0.999];
/// Thresholds that are compared, besides the one in use.
const THRESHOLDS: [f32; 8] = [0.5, 0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999];

/// Statements of about the same probability: the most probable texture after each slide, until the exploration ended.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Statements {
    /// From this probability on.
    pub from: f32,
    /// Below this one; 1 is the last of the last.
    pub to: f32,
    /// How many there were.
    pub count: u64,
    /// How many of them were right.
    pub right: u64,
    /// Mean of the probabilities that were said; `None` where none was.
    pub said: Option<f64>,
}

/// What explorations would come to at a threshold.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct AtThreshold {
    /// Sure above this probability.
    pub threshold: f32,
    /// Mean number of slides until the answer.
    pub mean_slides: f64,
    /// What users would be told.
    pub verdicts: Verdicts,
}

/// How often the most probable texture was the right one, by the probability that was said. Slides of one exploration are
/// not independent.
pub fn statements(courses: &[Course], threshold: f32) -> Vec<Statements> {
    let upper = SAID.iter().skip(1).copied().chain([1.0]);
    let mut bins: Vec<(Statements, f64)> = SAID
        .iter()
        .zip(upper)
        .map(|(&from, to)| {
            let none = Statements {
                from,
                to,
                count: 0,
                right: 0,
                said: None,
            };
            (none, 0.0)
        })
        .collect();
    for course in courses {
        let (_, slides, _) = course.told(threshold);
        for belief in course.beliefs.iter().take(slides) {
            let above = SAID.iter().take_while(|&&low| belief.probability >= low);
            let (bin, sum) = &mut bins[above.count().max(1) - 1];
            bin.count += 1;
            bin.right += u64::from(belief.texture == course.presented);
            *sum += f64::from(belief.probability);
        }
    }
    let mean = |(bin, sum): (Statements, f64)| Statements {
        said: (bin.count > 0).then(|| sum / bin.count as f64),
        ..bin
    };
    bins.into_iter().map(mean).collect()
}

/// What explorations would come to at usual thresholds and at the one in use, from the lowest on.
pub fn by_threshold(courses: &[Course], in_use: f32) -> Vec<AtThreshold> {
    let mut thresholds = THRESHOLDS.to_vec();
    if !thresholds.contains(&in_use) {
        thresholds.push(in_use);
        thresholds.sort_by(f32::total_cmp);
    }
    let at = |threshold| {
        let slides = courses.iter().map(|course| course.told(threshold).1 as f64);
        AtThreshold {
            threshold,
            mean_slides: slides.sum::<f64>() / courses.len().max(1) as f64,
            verdicts: verdicts(courses, threshold),
        }
    };
    thresholds.into_iter().map(at).collect()
}

/// What users would be told at this threshold.
pub fn verdicts(courses: &[Course], threshold: f32) -> Verdicts {
    Verdicts::of(courses.iter().map(|course| {
        let (told, _, texture) = course.told(threshold);
        (told, texture == course.presented)
    }))
}
