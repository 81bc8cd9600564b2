//! Decisions of the core, with its fixed-point table and f32 arithmetic, beside an oracle that computes the paper's
//! equations in f64 from the training slides themselves.

use rand::Rng as _;
use rayon::prelude::*;
use tactus::evaluate::{Outcome, evaluate};
use tactus::experiment::{Experiment, Protocol, Run};
use tactus::properties::PropertyTable;
use tactus::recordings::RecordingSet;
use tactus::replay::feel;
use tactus_core::explorer::Config;
use tactus_core::features::Property;
use tactus_core::fused::Observation;
use tactus_tests::data;

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
            run.training
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
            let slide = run.slide(action / 3);
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
                    slides,
                    unknown_like: false,
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

/// Share of the runs with the same answer, and with the same answer after the same slides.
fn agreement(experiment: &Experiment, runs: u64) -> (f64, f64) {
    let config = Config::default();
    let ours = evaluate(experiment, config, runs, || ()).unwrap();
    let oracle: Vec<Outcome> = (0..runs)
        .into_par_iter()
        .map_init(
            || None,
            |at_first, index| {
                let run = experiment.run(index);
                if !experiment.is_fixed() {
                    *at_first = None;
                }
                Oracle::new(&run).explore(run, config, at_first)
            },
        )
        .collect();
    let share = |same: &dyn Fn(&Outcome, &Outcome) -> bool| {
        ours.iter().zip(&oracle).filter(|(a, b)| same(a, b)).count() as f64 / runs as f64
    };
    (
        share(&|a, b| a.identified == b.identified && a.sure == b.sure),
        share(&|a, b| a.identified == b.identified && a.sure == b.sure && a.slides == b.slides),
    )
}

#[test]
fn recorded_slides_are_decided_as_in_f64() {
    let Some(folder) = data("biotac") else { return };
    let set = RecordingSet::open(&folder).unwrap();
    let names: Vec<String> = set.textures().iter().map(|t| t.name.clone()).collect();
    let felt = feel(&set, |_| ()).unwrap();
    for protocol in [Protocol::Interleaved, Protocol::Blocked, Protocol::Drift] {
        let experiment = Experiment::recorded(names.clone(), &felt, None, protocol, 5, 1).unwrap();
        let (answer, all) = agreement(&experiment, 8000);
        println!(
            "{protocol:?}: same answer in {:.2} % of 8000 runs, same slides too in {:.2} %",
            answer * 100.0,
            all * 100.0
        );
        assert!(answer >= 0.995, "{protocol:?}: {answer}");
    }
}

#[test]
fn property_worlds_are_decided_as_in_f64() {
    let Some(folder) = data("worlds") else { return };
    for world in 1..=3 {
        let set = PropertyTable::read(&folder.join(format!("world_{world}.csv"))).unwrap();
        let (answer, all) = agreement(&Experiment::given(&set, None, 1).unwrap(), 1600);
        println!(
            "world {world}: same answer in {:.2} % of 1600 runs, same slides too in {:.2} %",
            answer * 100.0,
            all * 100.0
        );
        assert!(answer >= 0.995, "world {world}: {answer}");
    }
}
