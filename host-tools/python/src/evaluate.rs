//! Thousands of virtual explorations.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tactus_lab::eval::evaluation::{EvaluationRequest, evaluation};
use tactus_lab::eval::experiment::Experiment;
use tactus_lab::eval::learn::Expected;

use crate::arguments;
use crate::error::Raise as _;
use crate::recordings::Recordings;
use crate::rows;
use crate::values::object;
use crate::work::work_on_all_cores;

/// Arguments of [`evaluate`].
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Arguments {
    method: String,
    protocol: String,
    train_slides: usize,
    runs: u64,
    seed: u64,
    threshold: f32,
    max_slides: u8,
    features: Option<String>,
    drift: (f32, f32),
    false_alarm: Option<f32>,
}

/// As `tactus evaluate --format json`.
#[pyfunction]
fn evaluate<'py>(
    py: Python<'py>,
    recordings: &Bound<'py, PyAny>,
    labels: Option<&Bound<'py, PyAny>>,
    sessions: Option<&Bound<'py, PyAny>>,
    arguments: Arguments,
) -> PyResult<Bound<'py, PyAny>> {
    let Arguments {
        runs,
        seed,
        threshold,
        max_slides,
        ..
    } = arguments;
    let method = arguments::method(&arguments.method)?;
    let protocol = arguments::protocol(&arguments.protocol)?;
    if !(1..=10_000_000).contains(&runs) {
        return Err(PyValueError::new_err("runs: 1 to 10 000 000"));
    }
    let config = arguments::config(method, threshold, max_slides, arguments.false_alarm, false)?;
    let expected = Expected {
        drift: Some(arguments::drift(arguments.drift)?),
        ..Expected::default()
    };
    let features = arguments::features(arguments.features.as_deref())?;
    let (names, slides) = match recordings.cast::<Recordings>() {
        Ok(recordings) => {
            let recordings = recordings.get();
            (recordings.set.names(), recordings.measured(py)?)
        }
        Err(_) => rows::slides(recordings, labels, sessions)?,
    };
    let train = arguments.train_slides;
    let request = EvaluationRequest {
        method,
        protocol: protocol.name(),
        runs,
        seed,
        config,
        closed: false,
        with_courses: true,
    };
    let figures = work_on_all_cores(py, move |between| {
        let experiment = Experiment::recorded(names, &slides, None, protocol, train, seed);
        let experiment = experiment.map_err(|why| why.raise())?;
        let experiment = experiment.expecting(expected).with_features(features);
        let played = evaluation(experiment, &request, |_, stage| stage(between));
        played
            .map(|(figures, _)| figures)
            .map_err(|why| why.raise())
    })?;
    object(py, &figures)
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(evaluate, module)?)
}
