//! Decisions of the core, with its fixed-point tables and arithmetic, beside oracles that compute the paper's equations
//! and the fused recipe in f64 from the training slides themselves.

use rand::Rng as _;
use rayon::prelude::*;
use tactus_core::explorer::{Config, Method, VerdictKind};
use tactus_core::features::Property;
use tactus_core::features::{FeatureSet, Observation};
use tactus_lab::data::properties::PropertyTable;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::measure_all;
use tactus_lab::eval::evaluate::{Outcome, evaluate};
use tactus_lab::eval::experiment::{Experiment, Protocol, Run};
use tactus_lab::eval::learn::Expected;
use tactus_tests::{count, data};

use crate::oracle;

use oracle::{Episode, Trained};

/// Mean and standard deviation per texture and action, actions in the core's order.
struct Oracle {
    mean: Vec<Vec<f64>>,
    sd: Vec<Vec<f64>>,
}

impl Oracle {
    fn new(run: &Run<'_>) -> Self {
        let of = |statistic: &dyn Fn(&[f64]) -> f64| -> Vec<Vec<f64>> {
            let values = |slides: &[Observation], p| -> Vec<f64> {
                slides
                    .iter()
                    .map(|s| f64::from(s.properties.get(p).unwrap()))
                    .collect()
            };
            run.training()
                .iter()
                .map(|movements| {
                    movements
                        .iter()
                        .flat_map(|slides| Property::ALL.map(|p| statistic(&values(slides, p))))
                        .collect()
                })
                .collect()
        };
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
        let sd = |x: &[f64]| {
            (x.iter().map(|v| (v - mean(x)).powi(2)).sum::<f64>() / (x.len() - 1) as f64).sqrt()
        };
        Self {
            mean: of(&mean),
            sd: of(&sd),
        }
    }

    /// Eq. 11 with eq. 7, over the textures that can still be told from nothing.
    fn uncertainty(&self, p: &[f64], a: usize) -> f64 {
        let live: Vec<usize> = (0..p.len()).filter(|&i| p[i] > 1e-12).collect();
        let certain: f64 = live
            .iter()
            .map(|&i| {
                let confused: f64 = live
                    .iter()
                    .map(|&j| {
                        let v = self.sd[i][a].powi(2) + self.sd[j][a].powi(2);
                        let c = (2.0 * self.sd[i][a] * self.sd[j][a] / v).sqrt();
                        c * (-(self.mean[i][a] - self.mean[j][a]).powi(2) / (4.0 * v)).exp() * p[j]
                    })
                    .sum();
                p[i] * p[i] / confused
            })
            .sum();
        1.0 - certain
    }

    fn explore(
        &self,
        mut run: Run<'_>,
        config: Config,
        at_first: &mut Option<Vec<f64>>,
    ) -> Outcome {
        let actions = self.mean[0].len();
        let mut log = vec![0.0f64; self.mean.len()];
        let mut made = vec![0; actions];
        for slides in 1..=config.max_slides {
            let p = normalised(&log);
            let uncertain = |a| self.uncertainty(&p, a);
            let all = || (0..actions).map(uncertain).collect::<Vec<f64>>();
            let uncertainty = if slides == 1 {
                at_first.get_or_insert_with(all).clone()
            } else {
                all()
            };
            let benefit = |a: usize| {
                1.0 - uncertainty[a]
                    .max(0.0)
                    .powf(1.0 / (f64::from(made[a]) + 1.0))
            };
            let action = (1..actions).fold(
                0,
                |best, a| if benefit(a) > benefit(best) { a } else { best },
            );
            made[action] += 1;
            // the core draws for the random strategy at every step
            let _ = run.random.next_u32();
            let slide = run.slide(action / 3).unwrap();
            let x = f64::from(slide.properties.get(Property::ALL[action % 3]).unwrap());
            for (texture, log) in log.iter_mut().enumerate() {
                let (mean, sd) = (self.mean[texture][action], self.sd[texture][action]);
                *log -= sd.ln() + (x - mean).powi(2) / (2.0 * sd * sd);
            }
            let p = normalised(&log);
            let best = (1..p.len()).fold(0, |best, i| if p[i] > p[best] { i } else { best });
            let sure = p[best] > f64::from(config.threshold);
            if sure || slides == config.max_slides {
                return Outcome {
                    unknown: run.unknown,
                    identified: best,
                    sure,
                    told: told(sure),
                    slides,
                    unknown_like: false,
                    learns: false,
                };
            }
        }
        unreachable!("the last slide decides")
    }
}

fn normalised(log: &[f64]) -> Vec<f64> {
    let top = log.iter().copied().fold(f64::MIN, f64::max);
    let p: Vec<f64> = log.iter().map(|l| (l - top).exp()).collect();
    let sum: f64 = p.iter().sum();
    p.iter().map(|p| p / sum).collect()
}

/// The fused recipe, with so many features of a slide.
fn explore_fused(
    trained: &Trained,
    mut run: Run<'_>,
    config: Config,
    x: impl Fn(&Observation) -> Vec<f64>,
) -> Outcome {
    let mut episode = Episode::new(trained.movements.len());
    loop {
        let benefits = episode.benefits(trained);
        let first = |best: usize, m: usize| {
            if benefits[m] > benefits[best] {
                m
            } else {
                best
            }
        };
        let movement = (1..benefits.len()).fold(0, first);
        // the core draws for the random strategy at every step
        let _ = run.random.next_u32();
        let slide = run.slide(movement).unwrap();
        episode.slide(trained, movement, &x(slide));
        let (best, p) = episode.best(trained);
        let sure = p > f64::from(config.threshold);
        if sure || episode.slides() == u32::from(config.max_slides) {
            return Outcome {
                unknown: run.unknown,
                identified: best,
                sure,
                told: told(sure),
                slides: episode.slides() as u8,
                unknown_like: episode.novel(trained),
                learns: false,
            };
        }
    }
}

/// These explorations are closed.
fn told(sure: bool) -> VerdictKind {
    if sure {
        VerdictKind::Sure
    } else {
        VerdictKind::Undecided
    }
}

/// Features of a slide as real numbers.
fn features(set: FeatureSet, slide: &Observation) -> Vec<f64> {
    let of = |p| f64::from(slide.properties.get(p).unwrap());
    let bands = slide.bands.iter().map(|b| f64::from(*b) / 1024.0);
    match set {
        FeatureSet::Force => std::iter::once(of(Property::Traction))
            .chain(bands)
            .collect(),
        FeatureSet::Bands => bands.collect(),
        FeatureSet::Properties => Property::ALL.map(of).into(),
        FeatureSet::Pressure => unreachable!("no recording has P_DC"),
    }
}

/// The oracles' verdicts on the same runs.
fn oracle(experiment: &Experiment, set: FeatureSet, config: Config, runs: u64) -> Vec<Outcome> {
    // the table of a fixed experiment is the same in all runs, and so is the first choice
    let trained = |run: &Run<'_>| {
        let of = |slides: &Vec<Observation>| slides.iter().map(|s| features(set, s)).collect();
        let of = |texture: &Vec<Vec<Observation>>| texture.iter().map(of).collect();
        Trained::train(&run.training().iter().map(of).collect())
    };
    let one = |kept: &mut (Option<Vec<f64>>, Option<Trained>), index| {
        let run = experiment.run(index);
        if !experiment.is_fixed() {
            *kept = (None, None);
        }
        if config.method == Method::Paper {
            return Oracle::new(&run).explore(run, config, &mut kept.0);
        }
        let trained = kept.1.get_or_insert_with(|| trained(&run));
        explore_fused(trained, run, config, |slide| features(set, slide))
    };
    (0..runs)
        .into_par_iter()
        .map_init(|| (None, None), one)
        .collect()
}

/// The paper's method, or the fused one with these features: the answer is the same in 99.5 % of the runs.
fn decided_alike(name: &str, experiment: Experiment, method: Option<FeatureSet>, runs: u64) {
    let config = Config {
        method: method.map_or(Method::Paper, |_| Method::Fused),
        ..Config::default()
    };
    // drift and limits are held against an oracle of their own: fused_recipe.rs
    let plain = Expected {
        drift: None,
        ..Expected::default()
    };
    let experiment = experiment.with_features(method).expecting(plain);
    let ours = evaluate(&experiment, config, runs, || ()).unwrap();
    let oracle = oracle(
        &experiment,
        method.unwrap_or(FeatureSet::Properties),
        config,
        runs,
    );
    let share = |same: &dyn Fn(&Outcome, &Outcome) -> bool| {
        ours.iter().zip(&oracle).filter(|(a, b)| same(a, b)).count() as f64 / runs as f64
    };
    let answer = share(&|a, b| a.identified == b.identified && a.sure == b.sure);
    let novel = share(&|a, b| a.unknown_like == b.unknown_like);
    println!(
        "{name}, {:?}: same answer in {answer} of {runs} runs, as new or not in {novel}",
        config.method
    );
    assert!(answer >= 0.995, "{name}, {:?}: {answer}", config.method);
    assert!(novel >= 0.99 || method.is_none(), "{name}: {novel}");
}

#[test]
fn recorded_slides_are_decided_as_in_f64() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let names: Vec<String> = set.textures().iter().map(|t| t.name.clone()).collect();
    let observed = measure_all(&set, |_| ()).unwrap();
    for protocol in [Protocol::Interleaved, Protocol::Blocked, Protocol::Drift] {
        let experiment =
            Experiment::recorded(names.clone(), &observed, None, protocol, 5, 1).unwrap();
        let name = format!("{protocol:?}");
        decided_alike(&name, experiment.clone(), None, count(8000, 2000));
        decided_alike(
            &name,
            experiment,
            Some(FeatureSet::Force),
            count(8000, 1000),
        );
    }
}

#[test]
fn property_worlds_are_decided_as_in_f64() {
    let Some(folder) = data("worlds") else { return };
    for world in 1..=3 {
        let set = PropertyTable::read(&folder.join(format!("world_{world}.csv"))).unwrap();
        let experiment = Experiment::given(&set, None, 1).unwrap();
        let name = format!("world {world}");
        decided_alike(&name, experiment.clone(), None, count(1600, 400));
        decided_alike(
            &name,
            experiment,
            Some(FeatureSet::Properties),
            count(800, 400),
        );
    }
}
