//! Quality of a table: the separation of its textures, the verdicts on recorded slides, and advice.

use std::cmp::Ordering;

use rayon::prelude::*;
use serde::Serialize;
use tactus_core::explorer::{self, Config, ENOUGH_TRIALS};
use tactus_core::features::{Observation, WHITE_STEPS};
use tactus_core::table::{Contents, Table};

use crate::data::replay::MeasuredSlide;
use crate::eval::alike::{Alike, alike, nearest};
use crate::eval::evaluate::{Method, explorer, play};
use crate::eval::experiment::Experiment;
use crate::eval::learn::TableError;
use crate::eval::learned::LeftOut;
use crate::eval::samples;
use crate::eval::show::{about_percent, count};
use crate::eval::table_summary::TableSummary;
use crate::eval::verdicts::Verdicts;

/// Explorations for each texture of recordings.
pub const RUNS: u64 = 25;
/// Share of confused slides below which a pair is not listed.
const WORTH_SAYING: f64 = 0.01;
const PAIRS: usize = 20;
/// Distance of the recorded slides' mean, in standard deviations of the mean, from which a texture counts as changed.
const MOVED: f64 = 3.0;
/// Scatter of a texture's slides relative to others' from which a slide is less informative than the table assumes.
const WIDE: f64 = 1.5;

/// A table, and its quality.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Report {
    /// All of it in a sentence.
    pub verdict: String,
    /// Its contents.
    pub table: TableSummary,
    /// The textures, in the order of the table.
    pub textures: Vec<TextureReport>,
    /// Pairs of textures by their confusion, the most frequent first.
    pub pairs: Vec<Pair>,
    /// The verdicts on recordings, if there are any.
    pub recorded: Option<Recorded>,
    /// Advice in words.
    pub advice: Vec<String>,
}

/// A texture of the table.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TextureReport {
    /// Its name.
    pub name: String,
    /// Slides it was learned from at each movement, in the order of the movements.
    pub trials: Vec<u8>,
    /// True if its sample was moved or turned between them; `None` if unknown.
    pub sample_moved: Option<bool>,
    /// The texture that it is most like.
    pub nearest: Option<Alike>,
    /// The verdicts on recordings of it.
    pub recorded: Option<RecordedTexture>,
}

/// Two textures that are taken for each other.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Pair {
    /// The touched texture ...
    pub texture: String,
    /// ... and the one it is taken for.
    #[serde(rename = "nearest")]
    pub other: Alike,
}

/// The verdicts on recorded slides with a table.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Recorded {
    /// Slides that were left out, as the table was learned from them.
    #[serde(flatten)]
    pub left_out: Option<LeftOut>,
    /// That in a sentence.
    pub remark: Option<String>,
    /// Explorations of textures that the table has.
    pub explorations: usize,
    /// Verdicts on them.
    pub known: Verdicts,
    /// Verdicts on textures that the table does not have; `None`: the recordings have no others.
    pub unknown: Option<Verdicts>,
    /// Mean number of slides until then, of the known ones.
    pub mean_slides: f64,
    /// Textures of the recordings that the table does not have.
    pub(crate) not_in_table: Vec<String>,
}

/// The verdicts on recorded slides of one texture.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct RecordedTexture {
    /// Verdicts.
    pub verdicts: Verdicts,
    /// Mean number of slides until then.
    pub mean_slides: f64,
    /// Scatter of its slides, 1 where it is as in all textures together; of a table of whitened features.
    pub spread: Option<f64>,
    /// Distance of their mean from the table's, in standard deviations of that difference, root mean square over
    /// features and movements: about 1 where nothing changed.
    pub moved: Option<f64>,
}

/// Slides of a texture that is in the recordings.
#[derive(Clone, Debug)]
pub struct Slides {
    /// Its name.
    pub name: String,
    /// Its slides, without those that the table was learned from.
    pub slides: Vec<MeasuredSlide>,
}

impl Report {
    /// Of a table, and of recorded slides if there are any.
    pub fn new(
        table: Table<'_>,
        slides: Option<&[Slides]>,
        seed: u64,
        done: impl Fn() + Sync,
    ) -> Result<Self, TableError> {
        let textures = (0..table.textures()).map(|texture| TextureReport {
            name: table.name(texture).unwrap_or_default().to_owned(),
            trials: (0..)
                .zip(table.movements())
                .map(|(m, _)| table.trials(texture, m))
                .collect(),
            sample_moved: table.moved(texture),
            nearest: nearest(table, texture),
            recorded: None,
        });
        let mut report = Self {
            verdict: String::new(),
            table: TableSummary::new(table),
            textures: textures.collect(),
            pairs: pairs(table),
            recorded: None,
            advice: Vec::new(),
        };
        if let Some(slides) = slides {
            report.play(table, slides, seed, done)?;
        }
        report.advice = advice(&report);
        report.verdict = report.sentence();
        Ok(report)
    }

    fn sentence(&self) -> String {
        let nearest = || self.textures.iter().filter_map(|t| t.nearest.as_ref());
        let all = count(self.textures.len() as u64, "texture");
        let same = nearest().filter(|near| near.slides.is_none()).count();
        let most = nearest().filter_map(|near| near.slides).max();
        let most = most.map(|n| count(n, "slide"));
        let apart = match (same, most) {
            (0, None) => format!("{all}, and nothing to tell it from"),
            (0, Some(most)) => format!("All {all} are told apart by {most} at most"),
            (same, None) => format!("Ten slides do not tell {same} of {all} from the nearest one"),
            (same, Some(most)) => format!(
                "Ten slides do not tell {same} of {all} from the nearest one; the others take {most} at most"
            ),
        };
        let told = self.recorded.as_ref().map(|recorded| {
            let [right, wrong] = [recorded.known.right, recorded.known.wrong].map(about_percent);
            format!("; recorded slides get the right name in {right}, a wrong one in {wrong}")
        });
        format!("{apart}{}.", told.unwrap_or_default())
    }

    /// The textures that are hardest to tell from their nearest, the hardest first.
    pub fn hardest(&self) -> Vec<&TextureReport> {
        let mut all: Vec<&TextureReport> = self.textures.iter().collect();
        let ease = |t: &&TextureReport| {
            let near = t.nearest.as_ref()?;
            Some((near.slides.map_or(u8::MAX, Into::into), near.taken_for))
        };
        all.sort_by(|a, b| ease(b).partial_cmp(&ease(a)).unwrap_or(Ordering::Equal));
        all
    }

    /// Notes the slides that were left out of the recordings.
    pub fn leave_out(&mut self, left_out: LeftOut) {
        if let Some(recorded) = &mut self.recorded {
            recorded.left_out = Some(left_out);
            recorded.remark = left_out.in_words();
        }
    }

    /// Explores recorded slides, each once, as `tactus identify --table` does.
    fn play(
        &mut self,
        table: Table<'_>,
        slides: &[Slides],
        seed: u64,
        done: impl Fn() + Sync,
    ) -> Result<(), TableError> {
        let at = |texture: &Slides| -> Vec<Vec<Observation>> {
            let of = |movement| {
                let same = texture
                    .slides
                    .iter()
                    .filter(move |s| s.movement == movement);
                same.map(MeasuredSlide::observation).collect()
            };
            table.movements().map(of).collect()
        };
        let is_whole = |texture: &&Slides| at(texture).iter().all(|slides| !slides.is_empty());
        let whole: Vec<&Slides> = slides.iter().filter(is_whole).collect();
        if whole.is_empty() {
            return Err(TableError::said(
                "none of the recorded textures has slides at all movements of the table; record with this table on \
                 the probe",
            ));
        }
        let observed: Vec<_> = whole.iter().map(|texture| at(texture)).collect();
        let names: Vec<String> = whole.iter().map(|texture| texture.name.clone()).collect();
        let movements = table.movements().collect();
        let experiment = Experiment::shown(names, movements, observed.clone(), seed);
        let experiment = experiment.each_slide_once();
        let method = Method::of(explorer::Method::of(table.contents()));
        let config = Config {
            method: method.method(),
            strategy: method.strategy(),
            open: true,
            ..Config::default()
        };
        let measured = whole.iter().flat_map(|texture| &texture.slides);
        let measured = measured.fold(experiment.measured, |set, s| {
            set.and(s.measurement.properties.measured())
        });
        let explorer = explorer(table.as_bytes(), measured, config, None)?;
        let outcomes: Vec<_> = (0..RUNS * whole.len() as u64)
            .into_par_iter()
            .map_init(
                || explorer.clone(),
                |explorer, run| {
                    let run = experiment.run(run);
                    let outcome = play(explorer, config.strategy, run);
                    done();
                    outcome
                },
            )
            .collect();
        let known = |at: usize| table.find(&whole[at].name);
        let told = |of: &dyn Fn(usize) -> bool| {
            let of: Vec<_> = outcomes.iter().filter(|o| of(o.unknown)).collect();
            let told = of.iter().map(|o| {
                let is_right = known(o.unknown).map(usize::from) == Some(o.identified);
                (o.told, is_right)
            });
            let slides: f64 = of.iter().map(|o| f64::from(o.slides)).sum();
            (
                Verdicts::of(told),
                slides / of.len().max(1) as f64,
                of.len(),
            )
        };
        for (at, texture) in whole.iter().enumerate() {
            let Some(texture) = table.find(&texture.name) else {
                continue;
            };
            let (verdicts, mean_slides, _) = told(&|unknown| unknown == at);
            let (spread, moved) = scatter(table, texture, &observed[at]).unzip();
            if let Some(report) = self.textures.get_mut(usize::from(texture)) {
                report.recorded = Some(RecordedTexture {
                    verdicts,
                    mean_slides,
                    spread,
                    moved,
                });
            }
        }
        let (verdicts, mean_slides, explorations) = told(&|at| known(at).is_some());
        let (unknown, _, others) = told(&|at| known(at).is_none());
        let missing = |at: &usize| known(*at).is_none();
        self.recorded = Some(Recorded {
            left_out: None,
            remark: None,
            explorations,
            known: verdicts,
            unknown: (others > 0).then_some(unknown),
            mean_slides,
            not_in_table: (0..whole.len())
                .filter(missing)
                .map(|at| whole[at].name.clone())
                .collect(),
        });
        Ok(())
    }
}

fn pairs(table: Table<'_>) -> Vec<Pair> {
    let all = (0..table.textures()).flat_map(|a| {
        (0..table.textures())
            .filter(move |b| *b != a)
            .map(move |b| (a, b))
    });
    let mut pairs: Vec<Pair> = all
        .filter_map(|(a, b)| {
            let other = alike(table, a, b).filter(|other| other.taken_for >= WORTH_SAYING)?;
            let texture = table.name(a)?.to_owned();
            Some(Pair { texture, other })
        })
        .collect();
    pairs.sort_by(|a, b| b.other.taken_for.total_cmp(&a.other.taken_for));
    pairs.truncate(PAIRS);
    pairs
}

/// Scatter of slides about their own mean, and distance of that from the table's. A single slide of a movement shows no
/// scatter.
fn scatter(table: Table<'_>, texture: u16, slides: &[Vec<Observation>]) -> Option<(f64, f64)> {
    let Contents::Fused(set, length) = table.contents() else {
        return None;
    };
    let (mut within, mut freedoms, mut away, mut features) = (0.0, 0.0, 0.0, 0.0);
    for (movement, slides) in (0..).zip(slides) {
        let n = f64::from(table.trials(texture, movement));
        let white: Vec<Vec<f64>> = slides
            .iter()
            .filter_map(|slide| {
                let white = table.whiten(movement, &slide.vector(set, length.into())?)?;
                Some(
                    white
                        .iter()
                        .map(|&z| f64::from(z) / f64::from(WHITE_STEPS))
                        .collect(),
                )
            })
            .collect();
        let k = white.len() as f64;
        if k < 2.0 || n == 0.0 {
            continue;
        }
        for (i, learned) in table.white_mean(texture, movement).enumerate() {
            let learned = f64::from(learned) / f64::from(WHITE_STEPS);
            let of = || white.iter().filter_map(|z| z.get(i));
            let mean = of().sum::<f64>() / k;
            within += of().map(|z| (z - mean).powi(2)).sum::<f64>();
            freedoms += k - 1.0;
            away += (mean - learned).powi(2) / (1.0 / k + 1.0 / n);
            features += 1.0;
        }
    }
    (features > 0.0).then(|| ((within / freedoms).sqrt(), (away / features).sqrt()))
}

/// Advice for textures that are taken for each other.
fn of_pairs(report: &Report) -> Vec<String> {
    let mut advice = Vec::new();
    let mut pairs: Vec<&Pair> = Vec::new();
    for pair in &report.pairs {
        let is_other =
            |o: &&Pair| (&o.texture, &o.other.texture) == (&pair.other.texture, &pair.texture);
        if !pairs.iter().any(is_other) {
            pairs.push(pair);
        }
    }
    let listed = |is_one: fn(&Alike) -> bool, says: &dyn Fn(&Alike) -> String| {
        let these = pairs.iter().filter(|pair| is_one(&pair.other));
        let these = these.map(|Pair { texture, other }| {
            format!("{texture} and {} ({})", other.texture, says(other))
        });
        these.collect::<Vec<_>>().join(", ")
    };
    let same = listed(|other| other.slides.is_none(), &|other| {
        format!("{:.0} % taken for it", 100.0 * other.taken_for)
    });
    if !same.is_empty() {
        advice.push(format!(
            "Pairs that cannot be told apart with these movements, not by ten slides: {same}. Give each pair one \
             name, or learn it at another movement."
        ));
    }
    let slow = listed(|other| other.slides >= Some(4), &|other| {
        count(other.slides.unwrap_or_default(), "slide")
    });
    if !slow.is_empty() {
        advice.push(format!(
            "Pairs that take long to tell apart: {slow}. More trials of both would help."
        ));
    }
    advice
}

/// Advice for the table's user.
fn advice(report: &Report) -> Vec<String> {
    let mut advice = of_pairs(report);
    for few in 0..ENOUGH_TRIALS {
        let fewest = |t: &&TextureReport| t.trials.iter().min() == Some(&few);
        let names = report
            .textures
            .iter()
            .filter(fewest)
            .map(|t| t.name.as_str());
        let names: Vec<&str> = names.collect();
        if !names.is_empty() {
            advice.push(format!(
                "Learned from {} of a movement: {}. Five make a texture much surer: record more, or teach it again.",
                if few == 0 { "no slide".to_owned() } else { count(few, "slide") },
                names.join(", ")
            ));
        }
    }
    let at_one_spot = |t: &&TextureReport| t.sample_moved == Some(false);
    let stayed = report.textures.iter().filter(at_one_spot);
    let stayed: Vec<&str> = stayed.map(|t| t.name.as_str()).collect();
    advice.extend(samples::advice(&stayed));
    let beyond = |of: fn(&RecordedTexture) -> Option<f64>, most: f64| {
        let these = report.textures.iter().filter_map(|texture| {
            let value = of(texture.recorded.as_ref()?).filter(|value| *value > most)?;
            Some(format!("{} ({value:.1} times)", texture.name))
        });
        these.collect::<Vec<_>>().join(", ")
    };
    let moved = beyond(|recorded| recorded.moved, MOVED);
    if !moved.is_empty() {
        advice.push(format!(
            "Not as learned, their means off by so many times what chance explains: {moved}. If finger or sample \
             changed, learn these again."
        ));
    }
    let wide = beyond(|recorded| recorded.spread, WIDE);
    if !wide.is_empty() {
        advice.push(format!(
            "Slides scatter more than the table expects: {wide}. They may differ from place to place: learn from more \
             places of the sample."
        ));
    }
    if report.table.movements.len() == 1 && report.table.textures.len() > 1 {
        advice.push(
            "The table has one movement, so there is nothing to choose: a second one, at another force and speed, \
             tells more."
                .to_owned(),
        );
    }
    advice
}

#[cfg(test)]
mod tests;
