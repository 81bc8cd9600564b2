//! Virtual explorations without a threshold: the belief after each slide, from which the verdict at any threshold
//! follows.

use tactus_core::explorer::{Config, VerdictKind};

use crate::eval::evaluate::{EvaluateError, evaluate_by, play_with};
use crate::eval::experiment::Experiment;

/// The belief of an explorer after a slide.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Belief {
    /// The most probable texture.
    pub texture: usize,
    /// Its posterior probability.
    pub probability: f32,
    /// True if it is rather none of the known textures: then no threshold makes the texture sure.
    rather_new: bool,
    is_new: bool,
    /// True if it differs from the texture as it was learned.
    is_changed: bool,
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
        let is_sure = |b: &Belief| b.probability > threshold && !b.rather_new && !b.is_changed;
        // that takes two slides: see `Explorer::verdict`
        let is_changed = |at, b: &Belief| at > 0 && b.probability > threshold && b.is_changed;
        let mut beliefs = self.beliefs.iter().enumerate();
        let over = beliefs.position(|(at, b)| is_sure(b) || is_changed(at, b));
        let at = over.unwrap_or(self.beliefs.len().saturating_sub(1));
        let last = self.beliefs.get(at);
        let told = match last {
            Some(b) if over.is_some() && is_sure(b) => VerdictKind::Sure,
            Some(b) if b.is_new => VerdictKind::New,
            Some(b) if b.is_changed => VerdictKind::Changed,
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
) -> Result<Vec<Course>, EvaluateError> {
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
                rather_new: config.open && best.log_odds.is_some_and(|odds| odds > 0.0),
                is_new: best.unknown,
                is_changed: best.changed,
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
