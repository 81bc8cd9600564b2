//! Features of a user's own: a row for each slide.

use std::collections::HashMap;
use std::sync::Arc;

use numpy::PyArray2;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use tactus_core::explorer::{Config, Method};
use tactus_core::features::{
    COARSE_BANDS, FEATURE_STEPS, FUSED_BANDS, Movement, Observation, PropertySet, fixed,
};
use tactus_core::table::{Action, Table as Read};
use tactus_lab::data::replay::MeasuredSlide;
use tactus_lab::eval::evaluate::explorer;

use crate::arrays::words;
use crate::error::Raise as _;
use crate::recordings::Measured;
use crate::samples::numbers;
use crate::table::Table;
use crate::values::rows;
use crate::work::work;

/// Largest feature.
const MOST: f64 = i16::MAX as f64 / FEATURE_STEPS as f64;

/// Rows of features.
///
/// # Errors
/// `TypeError` for what are no real numbers; `ValueError` for another shape, and features that a table does not hold.
pub(crate) fn observations(given: &Bound<'_, PyAny>) -> PyResult<Vec<Observation>> {
    let (shape, values) = numbers("the features", given)?;
    let features = match shape[..] {
        [features] => features,
        [_, features] => features,
        _ => {
            let say = "features have the shape (slides, features)";
            return Err(PyValueError::new_err(say));
        }
    };
    if !(1..=COARSE_BANDS).contains(&features) && features != FUSED_BANDS {
        return Err(PyValueError::new_err(format!(
            "{features} features, and a table has 1 to {COARSE_BANDS} of them, or the {FUSED_BANDS} of ln_fused_bands: \
             choose the best, or reduce them first, as by sklearn.decomposition.PCA({COARSE_BANDS})"
        )));
    }
    if let Some(value) = values
        .iter()
        .find(|value| value.is_nan() || value.abs() > MOST)
    {
        return Err(PyValueError::new_err(format!(
            "a feature of {value}, and a table holds -{MOST:.1} to {MOST:.1}: take logarithms, or scale them, as \
             TactusClassifier does"
        )));
    }
    let row = |row: &[f64]| Observation {
        bands: row.iter().filter_map(|x| fixed(*x as f32)).collect(),
        ..Observation::default()
    };
    Ok(values.chunks_exact(features).map(row).collect())
}

/// One row of features.
///
/// # Errors
/// As [`observations`]; `ValueError` for several rows.
pub(crate) fn one(given: &Bound<'_, PyAny>) -> PyResult<Observation> {
    match <[Observation; 1]>::try_from(observations(given)?) {
        Ok([one]) => Ok(one),
        Err(rows) => {
            let say = format!("{} slides at once; give one row of features", rows.len());
            Err(PyValueError::new_err(say))
        }
    }
}

/// Rows by their labels: the names in the order in which they come first, and of each the places of its rows.
///
/// # Errors
/// As [`observations`]; `TypeError` without labels, `ValueError` where there is not a label for each row.
#[expect(
    clippy::type_complexity,
    reason = "names, places and rows belong together"
)]
fn labelled(
    given: &Bound<'_, PyAny>,
    labels: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Vec<String>, Vec<Vec<usize>>, Vec<Observation>)> {
    if labels.is_none() {
        let say = "give Recordings, or features of shape (slides, features) and labels";
        return Err(PyTypeError::new_err(say));
    }
    let observed = observations(given)?;
    let (mut known, mut all) = (Vec::new(), Vec::<Vec<usize>>::new());
    let mut places = HashMap::new();
    let names = words("labels", labels, observed.len())?;
    for (at, name) in names.into_iter().enumerate() {
        let place = *places.entry(name.clone()).or_insert_with(|| {
            known.push(name);
            all.push(Vec::new());
            all.len() - 1
        });
        all[place].push(at);
    }
    Ok((known, all, observed))
}

/// Per texture and movement the slides to learn from.
pub(crate) type ToLearn = Vec<Vec<Vec<Observation>>>;

/// Rows to learn from: the names, and of each the first so many rows.
///
/// # Errors
/// As [`labelled`].
pub(crate) fn to_learn(
    given: &Bound<'_, PyAny>,
    labels: Option<&Bound<'_, PyAny>>,
    most: usize,
) -> PyResult<(Vec<String>, ToLearn)> {
    let (names, places, observed) = labelled(given, labels)?;
    let first = |places: Vec<usize>| {
        let rows = places.into_iter().take(most);
        vec![rows.map(|at| observed[at].clone()).collect()]
    };
    Ok((names, places.into_iter().map(first).collect()))
}

/// Rows as slides of recordings, in the order of time: the names, and the slides of each.
///
/// # Errors
/// As [`labelled`]; `ValueError` where there is not a session for each row.
pub(crate) fn slides(
    given: &Bound<'_, PyAny>,
    labels: Option<&Bound<'_, PyAny>>,
    sessions: Option<&Bound<'_, PyAny>>,
) -> PyResult<(Vec<String>, Arc<Measured>)> {
    let (names, places, observed) = labelled(given, labels)?;
    let sessions = words("sessions", sessions, observed.len())?;
    let slide = |at: usize| {
        let features = observed[at].clone();
        MeasuredSlide::given(at as u32 + 1, features, sessions[at].clone())
    };
    let of = |places: Vec<usize>| places.into_iter().map(slide).collect();
    Ok((names, Arc::new(places.into_iter().map(of).collect())))
}

/// The movement of slides of which nothing else is known.
pub(crate) const MOVEMENT: Movement = Movement::UNKNOWN;

/// The probability of each texture of a table after one slide, if it is one of them: float32 of shape (slides,
/// textures).
#[pyfunction]
fn _posteriors<'py>(
    py: Python<'py>,
    table: &Table,
    slides: &Bound<'py, PyAny>,
) -> PyResult<Bound<'py, PyArray2<f32>>> {
    let (bytes, observed) = (table.bytes.clone(), observations(slides)?);
    let textures = usize::from(Read::read(&bytes).map_err(|why| why.raise())?.textures());
    let all = work(py, move |between| {
        let config = Config {
            method: Method::Fused,
            open: false,
            ..Config::default()
        };
        let mut explorer =
            explorer(&bytes, PropertySet::ALL, config, None).map_err(|why| why.raise())?;
        let action = Action {
            movement: 0,
            property: None,
        };
        let mut all = Vec::with_capacity(observed.len() * textures);
        for slide in &observed {
            between();
            explorer.restart();
            let taken = explorer.observe(action, slide);
            taken.map_err(|why| why.raise())?;
            all.extend_from_slice(explorer.posterior());
        }
        Ok::<_, PyErr>(all)
    })?;
    rows(py, all, textures)
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("MAX_FEATURES", COARSE_BANDS)?;
    module.add("_MOST", MOST)?;
    module.add_function(wrap_pyfunction!(_posteriors, module)?)
}
