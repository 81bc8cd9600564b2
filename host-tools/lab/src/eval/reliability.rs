//! Reliability of stated probabilities.

use serde::Serialize;

use super::courses::Course;
use super::verdicts::Verdicts;

/// Lower ends of the probabilities that are counted together; the last has no upper one.
const SAID: [f32; 7] = [0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 0.999];
/// Statements of about the same probability: the most probable texture after each slide, until the exploration ended.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Statements {
    /// From this probability on.
    pub from: f32,
    /// Below this one; 1 is the last of the last.
    pub to: f32,
    /// Their number.
    pub count: u64,
    /// Number of right ones.
    pub right: u64,
    /// Mean of the stated probabilities; `None` if there are none.
    pub said: Option<f64>,
}

/// Share of right names by the stated probability of the most probable texture. Slides of one exploration are not
/// independent.
pub(crate) fn statements(courses: &[Course], threshold: f32) -> Vec<Statements> {
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

/// Shares of the verdicts at this threshold.
pub fn verdicts(courses: &[Course], threshold: f32) -> Verdicts {
    Verdicts::of(courses.iter().map(|course| {
        let (told, _, texture) = course.told(threshold);
        (told, texture == course.presented)
    }))
}
