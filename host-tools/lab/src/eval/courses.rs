//! Virtual explorations without a threshold: the belief after each slide, from which the verdict at any threshold
//! follows.

use tactus_core::explorer::{Config, VerdictKind};

use crate::eval::evaluate::{evaluate_by, play_with};
use crate::eval::experiment::Experiment;
use crate::eval::learn::TableError;

/// The belief of an explorer after a slide.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Belief {
    /// The most probable texture.
    pub texture: usize,
    /// Its posterior probability.
    pub probability: f32,
    /// True if the slides fit the texture: otherwise no threshold makes it sure.
    fits: bool,
    is_new: bool,
    /// True if it differs from the texture as it was learned.
    is_changed: bool,
    /// True if no name is told as sure.
    is_guarded: bool,
}

/// A run without a threshold: the belief after each of its slides.
#[derive(Clone, PartialEq, Debug)]
pub struct Course {
    /// The texture that was to be identified.
    pub presented: usize,
    pub(crate) beliefs: Vec<Belief>,
}

impl Course {
    /// The verdict at this threshold, the slides until then, and the most probable texture. The choice of movements
    /// does not depend on the threshold, so the run at one is the beginning of the run at a higher one.
    pub fn told(&self, threshold: f32) -> (VerdictKind, usize, usize) {
        let mut beliefs = self.beliefs.iter();
        let over = beliefs.position(|b| b.probability > threshold && b.fits);
        let at = over.unwrap_or(self.beliefs.len().saturating_sub(1));
        let last = self.beliefs.get(at);
        let told = match last {
            Some(b) if over.is_some() && b.is_guarded => VerdictKind::MostLike,
            Some(b) if over.is_some() && b.is_changed => VerdictKind::Changed,
            Some(_) if over.is_some() => VerdictKind::Sure,
            Some(b) if b.is_new => VerdictKind::New,
            _ => VerdictKind::Undecided,
        };
        (
            told,
            last.map_or(0, |_| at + 1),
            last.map_or(0, |b| b.texture),
        )
    }
}

/// Plays runs as [`evaluate`](super::evaluate::evaluate) does, but without a threshold: see [`Course::told`].
pub fn courses(
    experiment: &Experiment,
    config: Config,
    runs: u64,
    done: impl Fn() + Sync,
) -> Result<Vec<Course>, TableError> {
    let config = Config {
        // never exceeded
        threshold: 1.0,
        ..config
    };
    evaluate_by(experiment, config, runs, done, |explorer, run| {
        let mut beliefs = Vec::new();
        let outcome = play_with(explorer, config.strategy, run, |_, explorer| {
            let best = explorer.best();
            beliefs.push(Belief {
                texture: best.texture.into(),
                probability: best.probability,
                fits: !config.open || explorer.fits(),
                is_new: best.unknown,
                is_guarded: explorer.is_guarded(),
                is_changed: config.open && explorer.changed_by().is_some_and(|by| by > 0.0),
            });
        });
        Course {
            presented: outcome.unknown,
            beliefs,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recordings::RecordingSet;
    use crate::data::replay::measure_all;
    use crate::eval::evaluate::{Method, evaluate};
    use crate::eval::experiment::Protocol;

    #[test]
    fn a_run_at_a_threshold_is_the_beginning_of_its_course() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");
        let set = RecordingSet::open(folder.as_ref()).unwrap();
        let names = set.textures().iter().map(|t| t.name.clone()).collect();
        let measured = measure_all(&set, |_| ()).unwrap();
        let interleaved = Protocol::Interleaved;
        let experiment = Experiment::recorded(names, &measured, None, interleaved, 2, 1).unwrap();
        let experiment = experiment.each_slide_once();
        let mut sure = 0;
        for (method, threshold) in [
            (Method::Fused, 0.99),
            (Method::Fused, 0.5),
            (Method::Paper, 0.7),
            (Method::Cycle, 0.9),
            (Method::Random, 0.95),
        ] {
            let config = Config {
                method: method.method(),
                strategy: method.strategy(),
                threshold,
                open: true,
                ..Config::default()
            };
            let outcomes = evaluate(&experiment, config, 200, || ()).unwrap();
            let courses = courses(&experiment, config, 200, || ()).unwrap();
            for (outcome, course) in outcomes.iter().zip(&courses) {
                assert_eq!(outcome.unknown, course.presented);
                let told = (
                    outcome.told,
                    usize::from(outcome.slides),
                    outcome.identified,
                );
                assert_eq!(told, course.told(threshold), "{method:?}, {threshold}");
            }
            assert_eq!(outcomes.len(), courses.len());
            sure += outcomes.iter().filter(|o| o.sure).count();
        }
        assert!((200..1000).contains(&sure), "{sure} of 1000");
    }
}
