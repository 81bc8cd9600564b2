//! Thousands of virtual explorations.

use std::path::PathBuf;

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use tactus_core::explorer::{self, Config};
use tactus_lab::data::properties::PropertyTable;
use tactus_lab::eval::evaluation::{EvaluationRequest, evaluation};
use tactus_lab::eval::experiment::{Experiment, Protocol};
use tactus_lab::eval::learn::Expected;
use tactus_lab::eval::{novelty, verify};

use crate::arguments;
use crate::error::Raise as _;
use crate::recordings::Recordings;
use crate::values::object;
use crate::work::work;

/// What is explored, and how.
struct Asks {
    experiment: Experiment,
    asked: EvaluationRequest,
}

/// Arguments that all of these take.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Arguments {
    method: String,
    protocol: String,
    train_slides: Option<usize>,
    runs: u64,
    seed: u64,
    threshold: f32,
    max_slides: u8,
    features: Option<String>,
    drift: (f32, f32),
    false_alarm: Option<f32>,
    test: Option<Py<Recordings>>,
    reliability: bool,
}

/// Measured properties of slides from a CSV table (texture, movement, trial, set, traction, roughness, fineness), for `evaluate`.
///
/// Raises RecordingError where the table makes no sense.
#[pyclass(frozen, module = "tactus")]
struct Properties {
    table: PropertyTable,
}

#[pymethods]
impl Properties {
    #[new]
    fn new(file: PathBuf) -> PyResult<Self> {
        let table = PropertyTable::read(&file).map_err(|why| why.raise())?;
        Ok(Self { table })
    }

    /// Names of the textures.
    #[getter]
    fn textures(&self) -> Vec<String> {
        self.table.textures.clone()
    }
}

/// Where slides come from.
#[derive(FromPyObject)]
enum From {
    Recordings(Py<Recordings>),
    Properties(Py<Properties>),
}

impl Asks {
    fn new(py: Python<'_>, from: &From, arguments: &Arguments) -> PyResult<Self> {
        let method = arguments::method(&arguments.method)?;
        let protocol = arguments::protocol(&arguments.protocol)?;
        let Arguments {
            threshold,
            max_slides,
            false_alarm,
            runs,
            seed,
            ..
        } = *arguments;
        if !(1..=10_000_000).contains(&runs) {
            return Err(PyValueError::new_err("runs: 1 to 10 000 000"));
        }
        let config: Config = arguments::config(method, threshold, max_slides, false_alarm, false)?;
        let expected = Expected {
            drift: Some(arguments::drift(arguments.drift)?),
            ..Expected::default()
        };
        let features = arguments::features(arguments.features.as_deref())?;
        let (experiment, protocol) = match from {
            From::Properties(table) => {
                // as many slides as there are
                let table = &table.get().table;
                let experiment = Experiment::given(table, arguments.train_slides, seed);
                (experiment.map_err(|why| why.raise())?, "properties")
            }
            From::Recordings(recordings) => {
                let recorded = recorded(py, recordings.get(), arguments, protocol)?;
                (recorded, protocol.name())
            }
        };
        Ok(Self {
            experiment: experiment.expecting(expected).with_features(features),
            asked: EvaluationRequest {
                method,
                protocol,
                runs,
                seed,
                config,
                with_courses: arguments.reliability,
            },
        })
    }

    fn fused(py: Python<'_>, from: &From, arguments: &Arguments) -> PyResult<Self> {
        let asks = Self::new(py, from, arguments)?;
        if asks.asked.config.method != explorer::Method::Fused {
            return Err(PyValueError::new_err(
                "novelty and verification need the method fused: the other methods do not recognise new textures",
            ));
        }
        Ok(asks)
    }
}

/// Recorded slides, divided as the protocol says.
fn recorded(
    py: Python<'_>,
    recordings: &Recordings,
    arguments: &Arguments,
    protocol: Protocol,
) -> PyResult<Experiment> {
    let measured = recordings.measured(py)?;
    let test = arguments.test.as_ref().map(|test| test.get());
    let tested = match test {
        None => None,
        Some(test) => {
            let of = |r: &Recordings| r.set.finger().map_err(|why| why.raise());
            let [here, there] = [of(recordings)?.0, of(test)?.0];
            if here != there {
                return Err(PyValueError::new_err(format!(
                    "test has slides of the finger {there}, and the others are of {here}: they cannot be compared"
                )));
            }
            Some((test.set.names(), test.measured(py)?))
        }
    };
    let tested = tested
        .as_ref()
        .map(|(names, slides)| (names.as_slice(), *slides));
    let experiment = Experiment::recorded(
        recordings.set.names(),
        measured,
        tested,
        protocol,
        arguments.train_slides.unwrap_or(5),
        arguments.seed,
    );
    experiment.map_err(|why| why.raise())
}

/// As `tactus evaluate --format json`.
#[pyfunction]
fn evaluate<'py>(
    py: Python<'py>,
    recordings: From,
    arguments: Arguments,
) -> PyResult<Bound<'py, PyAny>> {
    let Asks { experiment, asked } = Asks::new(py, &recordings, &arguments)?;
    let (figures, _) = work(py, |between| {
        evaluation(experiment, &asked, |_, stage| stage(between))
    })?;
    object(py, &figures)
}

/// As `tactus evaluate --novelty leave-one-out --format json`.
#[pyfunction]
fn leave_out<'py>(
    py: Python<'py>,
    recordings: From,
    arguments: Arguments,
) -> PyResult<Bound<'py, PyAny>> {
    let Asks { experiment, asked } = Asks::fused(py, &recordings, &arguments)?;
    if experiment.names().len() < 4 {
        return Err(PyValueError::new_err(
            "--novelty needs 4 textures or more: record more of them",
        ));
    }
    let EvaluationRequest { config, runs, .. } = asked;
    let figures = work(py, |between| {
        novelty::leave_one_out(&experiment, config, runs, between)
    })?;
    object(py, &figures)
}

/// As `tactus evaluate --verify --format json`.
#[pyfunction]
fn verifications<'py>(
    py: Python<'py>,
    recordings: From,
    arguments: Arguments,
) -> PyResult<Bound<'py, PyAny>> {
    let Asks { experiment, asked } = Asks::fused(py, &recordings, &arguments)?;
    if experiment.names().len() < 4 {
        return Err(PyValueError::new_err(
            "--verify needs four textures or more: record more of them",
        ));
    }
    let EvaluationRequest { config, runs, .. } = asked;
    let figures = work(py, |between| {
        verify::verify(&experiment, config, runs, between)
    })?;
    object(py, &figures)
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Properties>()?;
    module.add_function(wrap_pyfunction!(evaluate, module)?)?;
    module.add_function(wrap_pyfunction!(leave_out, module)?)?;
    module.add_function(wrap_pyfunction!(verifications, module)?)
}
