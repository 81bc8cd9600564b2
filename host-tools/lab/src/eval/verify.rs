//! "The same as this one?": the share of slides of a texture that are taken for another one's, and the other way round,
//! for every limit.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use serde::Serialize;
use tactus_core::explorer::{Answer, Config, Explorer, Strategy};
use tactus_core::features::{Vector, WHITE_STEPS};
use tactus_core::table::{Change, Contents, Table, Tally, TextureStats, Whitened, amend};

use crate::data::replay::MeasuredSlide;
use crate::eval::evaluate::explorer;
use crate::eval::experiment::{Experiment, Run};
use crate::eval::learn::TableError;
use crate::eval::learned::note_learned;

/// Slides after which it is counted.
pub const SLIDES: usize = 3;
const OTHERS: usize = 3;
const POINTS: usize = 60;

/// The result of verifications.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Verified {
    /// After one slide, two, three.
    pub verify: Vec<After>,
    /// Answers for the reference's own slides, which end with an answer or with the last slide.
    pub same: AnswerShares,
    /// Answers for another texture's slides.
    pub other: AnswerShares,
}

/// Shares after so many slides.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct After {
    /// Slides of the episode.
    pub slides: usize,
    /// Error rate at the limit where the shares of false rejects and of false accepts are equal.
    pub equal_error: f64,
    /// Share of the reference's own that is called different.
    pub false_reject: f64,
    /// Share of others' that is called the same.
    pub false_accept: f64,
    /// Shares of false rejects and false accepts, limit by limit.
    pub curve: Vec<[f64; 2]>,
}

/// Shares of answers, which add up to 1.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct AnswerShares {
    /// "The same."
    pub same: f64,
    /// "Different."
    pub different: f64,
    /// "Not sure yet", at the end.
    pub unsure: f64,
    /// Mean number of slides.
    pub mean_slides: f64,
}

struct Episode {
    is_same: bool,
    scores: [f64; SLIDES],
    answers: [Answer; SLIDES],
    end: (Answer, usize),
}

/// Compares slides of each texture in turn with its own reference and with those of others.
pub fn verify(
    experiment: &Experiment,
    config: Config,
    runs: u64,
    done: impl Fn() + Sync,
) -> Result<Verified, TableError> {
    let experiment = experiment.clone().each_slide_once();
    let config = Config {
        // there is nothing to choose: every movement takes its turn
        strategy: Strategy::Cycling,
        open: true,
        ..config
    };
    let textures = experiment.names.len();
    let episodes: Vec<Vec<Episode>> = (0..runs)
        .into_par_iter()
        .panic_fuse()
        .map(|index| {
            let mut run = experiment.run_alone(index);
            let bytes = run.learn(config.method)?;
            let presented = run.unknown;
            let other = |random: usize| (presented + 1 + random) % textures;
            let mut references = vec![presented];
            for _ in 0..OTHERS {
                references.push(other(run.random.random_range(0..textures - 1)));
            }
            let episodes = references.into_iter().map(|reference| {
                // the same slides for all references
                episode(&experiment, &bytes, config, run.clone(), reference)
            });
            let episodes = episodes.collect();
            done();
            episodes
        })
        .collect::<Result<_, TableError>>()?;
    let episodes: Vec<Episode> = episodes.into_iter().flatten().collect();
    let told = |same: bool| {
        let of: Vec<_> = episodes.iter().filter(|e| e.is_same == same).collect();
        let all = of.len().max(1) as f64;
        let share = |answer| of.iter().filter(|v| v.end.0 == answer).count() as f64 / all;
        AnswerShares {
            same: share(Answer::Same),
            different: share(Answer::Different),
            unsure: share(Answer::Unsure),
            mean_slides: of.iter().map(|v| v.end.1 as f64).sum::<f64>() / all,
        }
    };
    Ok(Verified {
        verify: (0..SLIDES)
            .map(|after| After::of(&episodes, after))
            .collect(),
        same: told(true),
        other: told(false),
    })
}

fn episode(
    experiment: &Experiment,
    bytes: &[u8],
    config: Config,
    mut run: Run<'_>,
    reference: usize,
) -> Result<Episode, TableError> {
    let candidates = [reference as u16];
    let mut explorer = explorer(bytes, experiment.measured, config, Some(&candidates))?;
    let mut episode = Episode {
        is_same: run.unknown == reference,
        scores: [0.0; SLIDES],
        answers: [Answer::Unsure; SLIDES],
        end: (Answer::Unsure, 0),
    };
    let mut made = 0;
    let mut missing = 0;
    while made < SLIDES || episode.end.0 == Answer::Unsure && made < config.max_slides.into() {
        let action = explorer.choose(&[], 0);
        let Some(slide) = run.slide(action.movement.into()) else {
            missing += 1;
            if !explorer.reject(action) || missing == 2 * experiment.movements.len() {
                break;
            }
            continue;
        };
        explorer
            .observe(action, slide)
            .expect("every slide has the features that the table was learned from");
        let verification = explorer.verification().ok_or_else(|| {
            TableError::said(
                "tables of these slides have no limits: verification needs three textures at least, whitened \
                 features, and --method fused",
            )
        })?;
        let after = episode
            .scores
            .iter_mut()
            .zip(&mut episode.answers)
            .nth(made);
        if let Some((score, answer)) = after {
            (*score, *answer) = (verification.score.into(), verification.answer);
        }
        made += 1;
        if episode.end.0 == Answer::Unsure {
            episode.end = (verification.answer, made);
        }
    }
    // where slides ran out, the last state counts
    for after in made.max(1)..SLIDES {
        episode.scores[after] = episode.scores[after - 1];
        episode.answers[after] = episode.answers[after - 1];
    }
    Ok(episode)
}

impl After {
    fn of(episodes: &[Episode], after: usize) -> Self {
        let scores = |same: bool| {
            let of = episodes.iter().filter(|e| e.is_same == same);
            let mut scores: Vec<f64> = of.map(|v| v.scores[after]).collect();
            scores.sort_by(f64::total_cmp);
            scores
        };
        let [own, others] = [scores(true), scores(false)];
        let answered = |same: bool, answer| {
            let of = episodes.iter().filter(|e| e.is_same == same);
            let wrong = of.clone().filter(|v| v.answers[after] == answer).count();
            wrong as f64 / of.count().max(1) as f64
        };
        let (equal_error, curve) = trade_off(&own, &others);
        Self {
            slides: after + 1,
            equal_error,
            false_reject: answered(true, Answer::Different),
            false_accept: answered(false, Answer::Same),
            curve,
        }
    }
}

/// The rate at which false rejects and false accepts are equal, and the curve of both, of sorted scores.
fn trade_off(own: &[f64], others: &[f64]) -> (f64, Vec<[f64; 2]>) {
    let at = |limit: f64| {
        let rejected = own.len() - own.partition_point(|s| *s <= limit);
        let accepted = others.partition_point(|s| *s <= limit);
        [
            rejected as f64 / own.len().max(1) as f64,
            accepted as f64 / others.len().max(1) as f64,
        ]
    };
    let mut limits: Vec<f64> = own.iter().chain(others).copied().collect();
    limits.sort_by(f64::total_cmp);
    let equal = limits.iter().map(|limit| at(*limit));
    let equal = equal.min_by(|a, b| (a[0] - a[1]).abs().total_cmp(&(b[0] - b[1]).abs()));
    let equal = equal.map_or(0.0, |[a, b]| f64::midpoint(a, b));
    // as many points among the own ones as among the others, the far ends of both among them
    let places = (0..POINTS).map(|n| n as f64 / (POINTS - 1) as f64);
    let of = |scores: &[f64], share: f64| {
        let place = (share * (scores.len() as f64 - 1.0)).round() as usize;
        scores.get(place).copied()
    };
    let own_tail = places.clone().filter_map(|p| of(own, 1.0 - 0.25 * p * p));
    let others_tail = places.filter_map(|p| of(others, 0.25 * p * p));
    let mut at_limits: Vec<f64> = own_tail.chain(others_tail).collect();
    at_limits.sort_by(f64::total_cmp);
    at_limits.dedup();
    (equal, at_limits.into_iter().map(at).collect())
}

const NOTHING_IN_COMMON: &str = "the reference has no slide at a movement of the table with the features that it \
     compares: record it with this table";

/// A table with one more texture, or another one of this name, that was learned from these slides.
pub fn put(table: Table<'_>, name: &str, slides: &[MeasuredSlide]) -> Result<Vec<u8>, TableError> {
    let Contents::Fused(set, length) = table.contents() else {
        return Err(TableError::said(
            "the table is of the paper's properties: give one that was learned with --method fused",
        ));
    };
    let at = |(index, movement): (u8, _)| {
        let mut known = Whitened::default();
        for slide in slides.iter().filter(|slide| slide.movement == movement) {
            let features = slide.observation().vector(set, length.into());
            let white = features.and_then(|features| table.whiten(index, &features));
            known.teach(&white.ok_or_else(|| TableError::said(NOTHING_IN_COMMON))?);
        }
        Ok(known)
    };
    let known = (0..).zip(table.movements()).map(at);
    let known: Vec<Whitened> = known.collect::<Result<_, TableError>>()?;
    if known.iter().all(|known| known.slides == 0) {
        return Err(TableError::said(NOTHING_IN_COMMON));
    }
    let mut bytes = vec![0; table.as_bytes().len() + MOST_OF_ONE];
    let change = Change::Put {
        name,
        known: TextureStats::Fused(&known),
        tally: Tally::default(),
    };
    let length = amend(&mut bytes, &table, change)?.as_bytes().len();
    bytes.truncate(length);
    let all = table.learned_slides().all;
    let slides: Vec<_> = slides.iter().map(|slide| &slide.marks).collect();
    Ok(note_learned(&bytes, all, &slides)?)
}

const MOST_OF_ONE: usize = 4096;
const DRAWN: usize = 40;

/// Share of episodes of the table's other textures, drawn about their means and as long as that of `explorer`, that
/// would be called the same as `reference`. `None` if the table has no other texture, or nothing was observed.
pub fn false_accept<const N: usize>(explorer: &Explorer<'_, N>, reference: u16) -> Option<f64> {
    let table = explorer.table();
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let mut normal = || {
        let twelve = (0..12).map(|_| random.random::<f32>()).sum::<f32>();
        twelve - 6.0
    };
    let observed: Vec<(u8, u8)> = explorer.observed().map(|(m, k, _)| (m, k)).collect();
    let (mut all, mut accepted) = (0, 0);
    for texture in (0..table.textures()).filter(|&texture| texture != reference) {
        let taught = |(movement, _): &(u8, u8)| table.trials(texture, *movement) > 0;
        if observed.is_empty() || !observed.iter().all(taught) {
            continue;
        }
        for _ in 0..DRAWN {
            let drawn = observed.iter().map(|&(movement, slides)| {
                // the mean of the slides, and the uncertainty of the texture's own
                let n = f32::from(table.trials(texture, movement));
                let sd = (1.0 / f32::from(slides) + 1.0 / n).sqrt() * WHITE_STEPS;
                let mean = table.white_mean(texture, movement);
                let mean = mean.map(|m| (f32::from(m) + sd * normal()).round() as i16);
                (movement, slides, mean.collect::<Vector>())
            });
            let drawn: Vec<(u8, u8, Vector)> = drawn.collect();
            all += 1;
            let answer = explorer.verify(&drawn)?.answer;
            accepted += usize::from(answer == Answer::Same);
        }
    }
    (all > 0).then(|| accepted as f64 / all as f64)
}

#[cfg(test)]
mod tests {
    use tactus_core::explorer::Method;
    use tactus_core::features::Movement;
    use tactus_core::table::Action;

    use super::*;
    use crate::data::recordings::RecordingSet;
    use crate::data::replay::measure_all;
    use crate::eval::experiment::Protocol;

    /// The repository's recordings.
    fn recorded() -> Experiment {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");
        let set = RecordingSet::open(folder.as_ref()).unwrap();
        let names = set.textures().iter().map(|t| t.name.clone()).collect();
        let measured = measure_all(&set, |_| ()).unwrap();
        Experiment::recorded(names, &measured, None, Protocol::Interleaved, 2, 1).unwrap()
    }

    #[test]
    fn its_own_slides_are_told_from_those_of_others() {
        let config = Config {
            method: Method::Fused,
            ..Config::default()
        };
        let verified = verify(&recorded(), config, 120, || ()).unwrap();
        for after in &verified.verify {
            assert!(after.equal_error < 0.05, "{after:?}");
            assert!(after.false_accept < 0.05, "{after:?}");
        }
        assert!(verified.same.same > 0.8, "{:?}", verified.same);
        assert!(verified.other.different > 0.8, "{:?}", verified.other);
        for told in [verified.same, verified.other] {
            assert!((told.same + told.different + told.unsure - 1.0).abs() < 1e-9);
            assert!((1.0..=3.0).contains(&told.mean_slides));
        }
        // a larger share of false alarms: no more is accepted, and no less rejected
        let strict = Config {
            false_alarm: Some(0.2),
            ..config
        };
        let strict = verify(&recorded(), strict, 120, || ()).unwrap();
        for (strict, after) in strict.verify.iter().zip(&verified.verify) {
            assert!(strict.false_reject >= after.false_reject);
            assert!(strict.false_accept <= after.false_accept);
            assert_eq!(strict.equal_error, after.equal_error);
        }
    }

    #[test]
    fn a_reference_that_is_put_into_a_table_is_verified_as_if_it_had_been_learned() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");
        let set = RecordingSet::open(folder.as_ref()).unwrap();
        let measured = measure_all(&set, |_| ()).unwrap();
        let experiment = recorded();
        let bytes = experiment
            .run(0)
            .learn_without(Method::Fused, &[5])
            .unwrap();
        let table = Table::read(&bytes).unwrap();
        // two of each movement, and a third one of each to compare with it
        let third = |texture: usize| -> Vec<MeasuredSlide> {
            let thirds = measured[texture].chunks(3).map(|trials| trials[2].clone());
            thirds.collect()
        };
        let learned: Vec<MeasuredSlide> = measured[5]
            .chunks(3)
            .flat_map(|trials| trials[..2].to_vec())
            .collect();
        let with = put(table, "Reference", &learned).unwrap();
        let with = Table::read(&with).unwrap();
        let reference = with.find("Reference").unwrap();
        assert_eq!(with.textures(), table.textures() + 1);
        assert_eq!(with.limits(), table.limits());
        let answer = |slides: &[MeasuredSlide]| {
            let config = Config {
                method: Method::Fused,
                strategy: Strategy::Cycling,
                open: true,
                ..Config::default()
            };
            let bytes = with.as_bytes();
            let mut explorer =
                explorer(bytes, experiment.measured, config, Some(&[reference])).unwrap();
            assert_eq!(explorer.verification(), None);
            for slide in slides {
                let at = with.movements().position(|m| m == slide.movement).unwrap();
                let action = Action {
                    movement: at as u8,
                    property: None,
                };
                explorer.observe(action, &slide.observation()).unwrap();
            }
            let accepted = false_accept(&explorer, reference).unwrap();
            assert!((0.0..0.2).contains(&accepted), "{accepted}");
            explorer.verification().unwrap().answer
        };
        assert_eq!(answer(&third(5)), Answer::Same);
        assert_eq!(answer(&third(4)), Answer::Different);
        // a slide of another movement than the table's does not count
        let mut elsewhere = measured[5][0].clone();
        elsewhere.movement = Movement::grid()
            .find(|m| with.movements().all(|n| n != *m))
            .unwrap();
        let nothing = put(table, "Reference", &[elsewhere]);
        assert_eq!(nothing.unwrap_err().to_string(), NOTHING_IN_COMMON);
    }

    #[test]
    fn errors_are_equal_where_two_known_distributions_cross() {
        // own scores 0 to 1, others' 0.9 to 1.9, evenly: a tenth of each is beyond the other's end
        let own: Vec<f64> = (0..1000).map(|n| f64::from(n) / 1000.0).collect();
        let others: Vec<f64> = own.iter().map(|s| s + 0.9).collect();
        let (equal, curve) = trade_off(&own, &others);
        assert!((equal - 0.05).abs() < 0.002, "{equal}");
        assert!(
            curve
                .windows(2)
                .all(|w| w[0][0] >= w[1][0] && w[0][1] <= w[1][1])
        );
        // apart, nothing is wrong; the same, half
        assert_eq!(
            trade_off(&own, &own.iter().map(|s| s + 2.0).collect::<Vec<_>>()).0,
            0.0
        );
        assert!((trade_off(&own, &own).0 - 0.5).abs() < 0.01);
    }
}
