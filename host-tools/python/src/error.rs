//! Errors as exceptions, with the sentences of the command line.

use std::error::Error;

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use tactus_core::explorer::{ExplorerError, ObserveError};
use tactus_core::features::{MovementError, SlideError as OfSlide};
use tactus_core::table::TableError as OfTable;
use tactus_lab::data::recordings::RecordingError as OfRecordings;
use tactus_lab::data::table_file::TableFileError;
use tactus_lab::eval::evaluate::EvaluateError;
use tactus_lab::eval::experiment::ExperimentError;
use tactus_lab::eval::first::FirstError;
use tactus_lab::eval::learn::TableError as LearnError;
use tactus_lab::eval::verify::VerifyError;
use tactus_lab::sim::collection::TrialError;
use tactus_lab::sim::rig::SimError;
use tactus_link::line::LineError;
use tactus_link::log::LogError;
use tactus_link::{LinkError, OperationError};

create_exception!(
    tactus,
    TactusError,
    PyException,
    "Whatever goes wrong in this package: the sentence of the command line, which says what to do."
);
create_exception!(
    tactus,
    RecordingError,
    TactusError,
    "Recordings cannot be read or written."
);
create_exception!(
    tactus,
    SlideError,
    TactusError,
    "A slide has no features: it is too short, silent, or not whole."
);
create_exception!(
    tactus,
    TableError,
    TactusError,
    "A table cannot be learned, read, explored or written."
);

create_exception!(
    tactus,
    SimulationError,
    TactusError,
    "The simulated rig has a fault, or gives no slide."
);

create_exception!(
    tactus,
    ProbeError,
    TactusError,
    "There is no line to a probe, it is gone, or it refuses."
);

/// A cause and all causes of that, as the command says them.
pub(crate) fn sentence(why: &dyn Error) -> String {
    let mut sentence = why.to_string();
    let mut cause = why.source();
    while let Some(deeper) = cause {
        sentence = format!("{sentence}: {deeper}");
        cause = deeper.source();
    }
    sentence
}

/// What is raised for an error.
pub(crate) trait Raise: Error {
    /// The exception.
    fn raise(&self) -> PyErr;

    /// The same, of something that has a name.
    fn raise_of(&self, what: &str) -> PyErr
    where
        Self: Sized,
    {
        self.with(format!("{what}: {}", sentence(self)))
    }

    /// An exception of the same class.
    fn with(&self, sentence: String) -> PyErr;
}

macro_rules! raise {
    ($($error:ty => $exception:ident,)*) => {$(
        impl Raise for $error {
            fn raise(&self) -> PyErr {
                self.with(sentence(self))
            }

            fn with(&self, sentence: String) -> PyErr {
                $exception::new_err(sentence)
            }
        }
    )*};
}

raise! {
    OfRecordings => RecordingError,
    MovementError => SlideError,
    OfSlide => SlideError,
    OfTable => TableError,
    TableFileError => TableError,
    FirstError => TableError,
    EvaluateError => TableError,
    ExperimentError => TactusError,
    ExplorerError => TableError,
    ObserveError => TableError,
    VerifyError => TableError,
    LearnError => TableError,
    SimError => SimulationError,
    LineError => ProbeError,
    LinkError => ProbeError,
    OperationError => ProbeError,
    LogError => ProbeError,
    TrialError => SimulationError,
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("TactusError", py.get_type::<TactusError>())?;
    module.add("RecordingError", py.get_type::<RecordingError>())?;
    module.add("SlideError", py.get_type::<SlideError>())?;
    module.add("SimulationError", py.get_type::<SimulationError>())?;
    module.add("ProbeError", py.get_type::<ProbeError>())?;
    module.add("TableError", py.get_type::<TableError>())
}
