//! Texture tables learned from slides, for every way of deciding.

use serde::{Deserialize, Serialize};
use tactus_core::explorer::ExplorerError;
use tactus_core::explorer::Method;
use tactus_core::features::{FeatureSet, Movement, Observation, PropertySet, Vector};
use tactus_core::sensor::FingerCode;
use tactus_core::table::{
    self, Contents, Drift, Drifts, EncodeError, Experience, FALSE_ALARM, FINGER_LENGTH, Limits,
    Population, Scatter, Sections, Shorter, Table, Tail, WhitenError, Whitened, Whitening,
    whiten_drifting, with_finger, with_lengths, with_sections,
};
use tactus_link::for_probe;

use crate::data::recordings::RecordingError;

use super::basis::{best_features, length};
use super::calibrate::limits;
use super::learned;
use super::pace;

/// Three sections, whose lengths are numbers of 16 bits.
const MOST_SECTIONS: usize = 3 * (4 + u16::MAX as usize);

/// Reasons why slides make no table, or one cannot be explored.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// The table cannot be written.
    #[error("the table cannot be written")]
    Encode(#[from] EncodeError),
    /// The slides do not show the differences of slides of one texture.
    #[error(
        "the features cannot be whitened; learn from more slides, or with --features of a smaller set"
    )]
    Whiten(#[from] WhitenError),
    /// The table cannot be explored.
    #[error("the table cannot be explored")]
    Explorer(#[from] ExplorerError),
    /// The table cannot be read back.
    #[error("the table that was learned does not read back; please report this")]
    Table(#[from] table::TableError),
    /// The slides cannot be compared.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A sentence.
    #[error("{0}")]
    Said(String),
}

impl TableError {
    pub(crate) fn said(why: &str) -> Self {
        Self::Said(why.to_owned())
    }
}

/// Slides to learn from: per texture and movement.
pub type Slides = [Vec<Vec<Observation>>];

/// The properties that every slide has.
pub fn measured(slides: &Slides) -> PropertySet {
    slides
        .iter()
        .flatten()
        .flatten()
        .fold(PropertySet::ALL, |set, slide| {
            set.and(slide.properties.measured())
        })
}

/// Learns a table for a method; the fused one from `features`, or the best there are, for the usual drift.
pub fn learn(
    method: Method,
    features: Option<FeatureSet>,
    names: &[String],
    movements: &[Movement],
    slides: &Slides,
) -> Result<Vec<u8>, TableError> {
    let usual = Expected::default();
    learn_for(&usual, method, features, names, movements, slides)
}

/// Expectations of a fused table.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Expected {
    /// Change of fingers and samples; `None` for a table without drift and limits, which decides by its means alone.
    pub drift: Option<Drift>,
    /// Share of known textures that may be taken for new ones.
    pub false_alarm: f32,
}

impl Default for Expected {
    fn default() -> Self {
        Self {
            drift: Some(Drift::default()),
            false_alarm: FALSE_ALARM,
        }
    }
}

/// A table with the finger that its slides were made with, the day of that finger's calibration, and the name of a
/// sensor of somebody else.
/// Errors: these bytes are no table.
pub fn name_finger(
    bytes: &[u8],
    finger: FingerCode,
    calibrated: u32,
    sensor: &str,
) -> Result<Vec<u8>, EncodeError> {
    let table = Table::read(bytes).map_err(EncodeError::Invalid)?;
    let there = (table.finger(), table.calibrated(), table.sensor());
    if there == (finger, calibrated, sensor) {
        return Ok(bytes.to_vec());
    }
    let mut named = vec![0; bytes.len() + FINGER_LENGTH + sensor.len()];
    let length = with_finger(&mut named, &table, finger, calibrated, sensor)?
        .as_bytes()
        .len();
    named.truncate(length);
    Ok(named)
}

/// A table with the statistics of shorter slides, the shortest first: their length in ms, a table learned from the
/// first parts of the same slides, and a bit for each movement whose slides are longer. Without any, the table without
/// those statistics.
/// Errors: A table is invalid, or not of the same textures and movements.
pub fn know_lengths(bytes: &[u8], shorter: &[(u16, Vec<u8>, u64)]) -> Result<Vec<u8>, EncodeError> {
    let noted = Table::read(bytes).map_err(EncodeError::Invalid)?;
    let slides = noted.learned_slides();
    let bare = for_probe(&noted);
    let table = Table::read(&bare).map_err(EncodeError::Invalid)?;
    let shorter = shorter.iter().map(|(ms, table, movements)| {
        let table = Table::read(table).map_err(EncodeError::Invalid)?;
        Ok(Shorter {
            ms: *ms,
            table,
            movements: *movements,
        })
    });
    let shorter = shorter.collect::<Result<Vec<_>, EncodeError>>()?;
    // a section is shorter than its table
    let sections = shorter.iter().map(|shorter| shorter.table.as_bytes().len());
    let mut out = vec![0; bytes.len() + sections.sum::<usize>()];
    let length = with_lengths(&mut out, &table, &shorter)?.as_bytes().len();
    out.truncate(length);
    match bare.len() < bytes.len() {
        true => learned::write(&out, slides),
        false => Ok(out),
    }
}

/// Features of a slide of a trial, and those of its first part alone.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct ObservedTrial {
    /// The whole slide.
    pub whole: Observation,
    /// Its first part, for each requested length; `None` if it does not last longer.
    pub first: Vec<Option<Observation>>,
}

/// As [`learn_for`], with features after each of these lengths, in ms at constant speed, the shortest first: those that
/// each trial was observed at.
pub(crate) fn learn_lengths(
    expected: &Expected,
    (method, features): (Method, Option<FeatureSet>),
    names: &[String],
    movements: &[Movement],
    lengths_ms: &[u16],
    trials: &[Vec<Vec<ObservedTrial>>],
) -> Result<Vec<u8>, TableError> {
    // the first parts have few frames
    let all = lengths_ms.is_empty();
    let bands = |observation: Observation| match all {
        true => observation,
        false => observation.with_coarse_bands(),
    };
    let learn = |slide: &dyn Fn(&ObservedTrial) -> Observation| {
        let of = |cell: &Vec<ObservedTrial>| cell.iter().map(slide).map(bands).collect();
        let slides: Vec<Vec<Vec<Observation>>> = trials
            .iter()
            .map(|row| row.iter().map(of).collect())
            .collect();
        learn_for(expected, method, features, names, movements, &slides)
    };
    let whole = learn(&|trial| trial.whole.clone())?;
    if lengths_ms.is_empty() {
        return Ok(whole);
    }
    let shorter = lengths_ms.iter().enumerate().map(|(n, &ms)| {
        let first = |trial: &ObservedTrial| trial.first.get(n).cloned().flatten();
        let is_longer = |movement: usize| {
            let mut cells = trials.iter().filter_map(|row| row.get(movement)).flatten();
            cells.all(|trial| first(trial).is_some())
        };
        let longer = (0..movements.len()).filter(|movement| is_longer(*movement));
        // where it does not last longer the whole one takes its place, without any statistics
        let table = learn(&|trial| first(trial).unwrap_or_else(|| trial.whole.clone()))?;
        Ok((ms, table, longer.map(|movement| 1 << movement).sum()))
    });
    let shorter = shorter.collect::<Result<Vec<_>, TableError>>()?;
    Ok(know_lengths(&whole, &shorter)?)
}

/// As [`learn`], with these expectations.
pub fn learn_for(
    expected: &Expected,
    method: Method,
    features: Option<FeatureSet>,
    names: &[String],
    movements: &[Movement],
    slides: &Slides,
) -> Result<Vec<u8>, TableError> {
    if method == Method::Fused {
        let set = features.unwrap_or_else(|| best_features(slides));
        learn_fused(expected, set, names, movements, slides)
    } else {
        let measured = measured(slides);
        let experience: Vec<Vec<Experience>> = slides
            .iter()
            .map(|row| {
                row.iter()
                    .map(|slides| experience(measured, slides))
                    .collect()
            })
            .collect();
        Ok(encode(measured, movements, names, &experience)?)
    }
}

/// The experience from these slides, which all have the properties of `measured`.
pub fn experience(measured: PropertySet, slides: &[Observation]) -> Experience {
    let mut experience = Experience::default();
    for slide in slides {
        // a slide that lacks a property was not counted into `measured`
        let _ = experience.learn(measured, &slide.properties);
    }
    experience
}

/// Writes a table of Gaussians of any size.
pub fn encode(
    measured: PropertySet,
    movements: &[Movement],
    names: &[String],
    experience: &[Vec<Experience>],
) -> Result<Vec<u8>, EncodeError> {
    let textures = names
        .iter()
        .zip(experience)
        .map(|(name, known)| (name.as_str(), &known[..]));
    let mut bytes = buffer(Contents::Gaussians(measured), names, movements.len());
    table::encode(&mut bytes, measured, movements, textures)?;
    Ok(bytes)
}

fn buffer(contents: Contents, names: &[String], movements: usize) -> Vec<u8> {
    let of_names = names.iter().map(|n| n.len() + 1).sum();
    vec![0; table::encoded_len(contents, names.len(), movements, of_names)]
}

fn learn_fused(
    expected: &Expected,
    set: FeatureSet,
    names: &[String],
    movements: &[Movement],
    slides: &Slides,
) -> Result<Vec<u8>, TableError> {
    let mut all = slides.iter().flatten().flatten();
    all.next()
        .ok_or_else(|| TableError::said("there are no slides to learn from"))?;
    let features = length(set, slides);
    // per texture and movement, the features of the slides
    let vectors = slides
        .iter()
        .zip(names)
        .map(|(row, texture)| {
            let of = |slides: &Vec<Observation>| {
                let vectors = slides.iter().map(|slide| slide.vector(set, features));
                vectors.collect::<Option<Vec<Vector>>>()
            };
            row.iter()
                .map(of)
                .collect::<Option<Vec<Vec<Vector>>>>()
                .ok_or_else(|| {
                    let features = set.name();
                    TableError::Said(format!(
                        "a slide of {texture} does not have {features}; learn from other features"
                    ))
                })
        })
        .collect::<Result<Vec<_>, _>>()?;
    // a table without sections has no field for slopes
    let lines = expected
        .drift
        .and_then(|_| pace::lines(slides, &vectors, features));
    let vectors = match &lines {
        Some(lines) => lines.at_movement_speed(&vectors),
        None => vectors,
    };
    let mut scatters = vec![Scatter::new(features); movements.len()];
    for row in &vectors {
        for (scatter, slides) in scatters.iter_mut().zip(row) {
            scatter.push(slides)?;
        }
    }
    let drift = expected.drift.unwrap_or(Drift::NONE);
    let learned = whiten_drifting(&scatters, set, drift)?;
    let (whitenings, drifts): (Vec<Whitening>, Vec<Drifts>) = learned.into_iter().unzip();
    let of_texture = |row: &Vec<Vec<Vector>>| -> Vec<Vec<Vector>> {
        let cells = row.iter().zip(&whitenings);
        cells
            .map(|(slides, whitening)| slides.iter().map(|x| whitening.apply(x)).collect())
            .collect()
    };
    let white: Vec<Vec<Vec<Vector>>> = vectors.iter().map(of_texture).collect();
    let known: Vec<Vec<Whitened>> = white
        .iter()
        .map(|row| row.iter().map(|slides| mean(slides, features)).collect())
        .collect();
    let whitened = lines.map(|lines| lines.whitened(&whitenings));
    let movements: Vec<_> = movements.iter().copied().zip(whitenings).collect();
    let contents = Contents::Fused(set, features as u8);
    let mut plain = buffer(contents, names, movements.len());
    let textures = names.iter().map(String::as_str);
    let textures = textures.zip(known.iter().map(Vec::as_slice));
    let plain = table::encode_fused(&mut plain, set, &movements, textures)?;

    if expected.drift.is_none() {
        return Ok(plain.as_bytes().to_vec());
    }
    let population = |movement: usize| {
        let means = known.iter().map(|row| &row[movement]);
        Population::new(features, means.map(|cell| (cell.slides, &cell.mean[..])))
    };
    let populations: Option<Vec<Population>> = (0..movements.len()).map(population).collect();
    let write = |novelty: Option<(Limits, &[Population])>| {
        let sections = Sections {
            drift: (drift, &drifts),
            novelty,
            slopes: whitened.as_ref().map(pace::Whitened::slopes),
        };
        let mut bytes = vec![0; plain.as_bytes().len() + MOST_SECTIONS];
        let length = with_sections(&mut bytes, &plain, &sections)?
            .as_bytes()
            .len();
        bytes.truncate(length);
        Ok::<_, EncodeError>(bytes)
    };
    let Some(populations) = populations else {
        return Ok(write(None)?);
    };
    // scores take a table; they do not depend on its limits
    let any = [Tail {
        begin: 0.0,
        excess: 1.0,
    }; 3];
    let any = Limits {
        false_alarm: expected.false_alarm,
        drifted: any,
        same: any,
    };
    let scored = write(Some((any, &populations)))?;
    let scored = Table::read(&scored).map_err(EncodeError::Invalid)?;
    let limits = limits(
        expected.false_alarm,
        scored,
        &known,
        &white,
        (!drift.is_none()).then_some(&drifts[..]),
    )?;
    Ok(write(Some((limits, &populations)))?)
}

/// The mean of whitened slides, rounded once.
fn mean(slides: &[Vector], features: usize) -> Whitened {
    let mut whitened = Whitened {
        slides: u8::try_from(slides.len()).unwrap_or(u8::MAX),
        ..Whitened::default()
    };
    for (feature, mean) in whitened.mean.iter_mut().take(features).enumerate() {
        let sum: f64 = slides.iter().map(|slide| f64::from(slide[feature])).sum();
        *mean = (sum / slides.len().max(1) as f64).round() as i16;
    }
    whitened
}
