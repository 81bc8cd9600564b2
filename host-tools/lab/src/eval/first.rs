//! A table from the first slides of a folder of recordings: the work of `tactus learn`.

use tactus_core::features::{FeatureSet, Movement, Observation};
use tactus_core::table::EncodeError;

use crate::data::recordings::{RecordingError, RecordingSet};
use crate::data::replay::MeasuredSlide;
use crate::eval::evaluate::Method;
use crate::eval::learn::{Expected, TableError, learn_for, name_finger};
use crate::eval::samples::{note, of_all};
use crate::eval::show::count;

/// Reasons why a folder makes no table.
#[derive(Debug, thiserror::Error)]
pub enum FirstError {
    /// A texture has too few slides.
    #[error("{0}")]
    Few(String),
    /// The slides make no table.
    #[error(transparent)]
    Table(#[from] TableError),
    /// The recordings' notes of samples and finger do not fit into a table.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The slides cannot be compared.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}

impl FirstError {
    /// So few slides of one texture and movement.
    pub fn few(texture: &str, movement: Movement, there: usize) -> Self {
        let there = count(there as u64, "slide");
        Self::Few(format!(
            "{texture}, {movement}: {there}; the spread of a texture's slides takes at least two"
        ))
    }
}

/// Checks that there are enough slides to learn from.
pub fn at_least_two(slides: usize) -> Result<(), FirstError> {
    if slides < 2 {
        return Err(FirstError::Few(format!(
            "--train-slides {slides}: the spread of a texture's slides takes at least two slides"
        )));
    }
    Ok(())
}

/// The table learned from the first slides of every texture and movement: so many, or all where there are fewer.
pub fn learn_first(
    set: &RecordingSet,
    measured: &[Vec<MeasuredSlide>],
    slides: usize,
    method: Method,
    features: Option<FeatureSet>,
    expected: &Expected,
) -> Result<Vec<u8>, FirstError> {
    at_least_two(slides)?;
    let movements = set.movements();
    let first = |name: &str, measured: &[MeasuredSlide], movement: Movement| {
        let same = measured.iter().filter(|s| s.movement == movement);
        let trials: Vec<_> = same
            .map(|s| Observation::from(&s.measurement))
            .take(slides)
            .collect();
        let there = trials.len();
        if there < 2 {
            return Err(FirstError::few(name, movement, there));
        }
        Ok(trials)
    };
    let textures = set.textures().iter().zip(measured);
    let first = textures.map(|(texture, measured)| {
        let trials = movements
            .iter()
            .map(|&movement| first(&texture.name, measured, movement));
        trials.collect()
    });
    let first: Vec<Vec<Vec<Observation>>> = first.collect::<Result<_, FirstError>>()?;
    let names = set.names();
    let bytes = learn_for(
        expected,
        method.method(),
        features,
        &names,
        &movements,
        &first,
    )?;
    // the recordings' notes of the slides that were learned from
    let moved = |texture: usize| {
        let keys = set.slides(texture);
        let of = |movement: &Movement| {
            let same = measured[texture].iter().filter(|s| s.movement == *movement);
            let numbers: Vec<u32> = same.map(|s| s.number).take(slides).collect();
            let used = keys.iter().filter(move |key| numbers.contains(&key.number));
            used.map(|key| key.labels.moved)
        };
        of_all(movements.iter().flat_map(of))
    };
    let noted = note(&bytes, |texture| moved(texture.into()))?;
    let sensor = set.sensor()?;
    let named = name_finger(&noted, sensor.finger, sensor.calibrated, &sensor.name);
    Ok(named?)
}
