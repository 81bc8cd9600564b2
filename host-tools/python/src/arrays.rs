//! Recordings from arrays in memory: the import of `tactus import` without files.

use std::ffi::CString;

use pyo3::exceptions::{PyTypeError, PyUserWarning, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyString;
use serde::{Deserialize, Serialize};
use tactus_core::table::is_printable;
use tactus_lab::data::import::foreign::{InMemory, Survey};
use tactus_lab::data::import::settings::Settings;
use tactus_lab::data::recordings::RecordingSet;

use crate::samples::numbers;
use crate::work::work_on_all_cores;

/// What the import found.
#[derive(Clone, Serialize, Deserialize)]
pub(crate) struct Found {
    /// Samples per second.
    pub(crate) rate_hz: f64,
    /// Unit of the samples.
    pub(crate) unit: Option<String>,
    /// Counts per unit.
    pub(crate) gain: f64,
    /// The channel, where arrays have several, as numpy counts.
    pub(crate) channel: Option<usize>,
    /// Slides that were left out, and why.
    pub(crate) left_out: Vec<String>,
    /// All of it as settings of an import.
    pub(crate) settings: Settings,
}

/// What belongs to each array, in their order.
pub(crate) struct Columns<'a, 'py> {
    pub(crate) labels: &'a Bound<'py, PyAny>,
    pub(crate) sessions: Option<&'a Bound<'py, PyAny>>,
    pub(crate) runs: Option<&'a Bound<'py, PyAny>>,
}

/// The words for each of so many arrays.
pub(crate) fn words(
    name: &str,
    given: Option<&Bound<'_, PyAny>>,
    arrays: usize,
) -> PyResult<Vec<String>> {
    let Some(given) = given else {
        return Ok(vec![String::new(); arrays]);
    };
    if given.is_instance_of::<PyString>() {
        let say = format!("{name}: one for each array, not one for all");
        return Err(PyTypeError::new_err(say));
    }
    let word = |one: PyResult<Bound<'_, PyAny>>| match one? {
        none if none.is_none() => Ok(String::new()),
        some => Ok(some.str()?.to_string()),
    };
    let all = given.try_iter().map_err(|_| {
        let kind = given.get_type();
        PyTypeError::new_err(format!(
            "{name}: {kind} is given, and wanted is one for each array"
        ))
    })?;
    let words: Vec<String> = all.map(word).collect::<PyResult<_>>()?;
    let hides = |word: &String| !word.chars().all(is_printable);
    if let Some(at) = words.iter().position(hides) {
        let say = format!(
            "{name}: {:?} of array {at} has characters that do not print; give plain text",
            words[at]
        );
        return Err(PyValueError::new_err(say));
    }
    if words.len() != arrays {
        let say = format!("{name}: {} of them for {arrays} slides", words.len());
        return Err(PyValueError::new_err(say));
    }
    Ok(words)
}

/// The number of a channel as the import counts, from 1.
pub(crate) fn channel(number: Option<usize>) -> Option<String> {
    number.map(|number| (number + 1).to_string())
}

/// The slides of arrays.
pub(crate) fn read(
    arrays: &Bound<'_, PyAny>,
    columns: &Columns<'_, '_>,
    settings: Settings,
) -> PyResult<(RecordingSet, Found)> {
    let py = arrays.py();
    let mut all = Vec::new();
    for (at, array) in arrays.try_iter()?.enumerate() {
        let (name, array) = (format!("array {at}"), array?);
        let (shape, values) = numbers(&name, &array)?;
        let one = InMemory::new(&shape, values);
        all.push(one.map_err(|why| PyValueError::new_err(format!("{name}: {why}")))?);
    }
    let of = |name, given| words(name, given, all.len());
    let labels = of("labels", Some(columns.labels))?;
    if let Some(at) = labels.iter().position(|label| label.trim().is_empty()) {
        let say = format!("labels: array {at} has none; give each the name of its texture");
        return Err(PyValueError::new_err(say));
    }
    let (sessions, runs) = (of("sessions", columns.sessions)?, of("runs", columns.runs)?);
    let several = all.iter().any(|one| one.channels() > 1);
    let words = labels.into_iter().zip(sessions.into_iter().zip(runs));
    for (one, (texture, (session, run))) in all.iter_mut().zip(words) {
        (one.texture, one.session, one.run) = (texture, session, run);
    }
    let (set, found) = work_on_all_cores(py, move |_| {
        let survey = Survey::of_memory(all, settings)?;
        let (set, left_out) = survey.recordings()?;
        let channel = survey.channel.parse::<usize>().ok();
        let found = Found {
            rate_hz: survey.rate_hz,
            unit: survey.settings().unit,
            gain: survey.gain,
            channel: channel.and_then(|n| n.checked_sub(1)).filter(|_| several),
            left_out,
            settings: survey.settings(),
        };
        Ok::<_, tactus_lab::data::recordings::RecordingError>((set, found))
    })?;
    if !found.left_out.is_empty() {
        let say = format!("left out: {}", found.left_out.join("; "));
        let say = CString::new(say).map_err(|why| PyValueError::new_err(why.to_string()))?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &say, 2)?;
    }
    Ok((set, found))
}
