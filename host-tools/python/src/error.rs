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
use tactus_lab::eval::experiment::ExperimentError;
use tactus_lab::eval::learn::TableError as LearnError;
use tactus_lab::sim::collection::TrialError;
use tactus_lab::sim::rig::SimError;
use tactus_link::line::LineError;
use tactus_link::log::LogError;
use tactus_link::{LinkError, OperationError};

macro_rules! exceptions {
    ($($exception:ident: $base:ident, $says:literal;)*) => {
        $(create_exception!(tactus, $exception, $base, $says);)*

        pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
            let py = module.py();
            $(module.add(stringify!($exception), py.get_type::<$exception>())?;)*
            Ok(())
        }
    };
}

exceptions! {
    TactusError: PyException, "Whatever goes wrong in this package: the sentence of the command line, which says what \
     to do.";
    RecordingError: TactusError, "Recordings cannot be read or written.";
    SlideError: TactusError, "A slide has no features: it is too short, silent, or not whole.";
    TableError: TactusError, "A table cannot be learned, read, explored or written.";
    SimulationError: TactusError, "The simulated rig has a fault, or gives no slide.";
    ProbeError: TactusError, "There is no line to a probe, it is gone, or it refuses.";
}

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
    /// The exception of this class with a sentence.
    fn exception(sentence: String) -> PyErr;

    fn raise(&self) -> PyErr
    where
        Self: Sized,
    {
        Self::exception(sentence(self))
    }

    /// The same, of something that has a name.
    fn raise_of(&self, what: String) -> PyErr
    where
        Self: Sized,
    {
        Self::exception(format!("{what}: {}", sentence(self)))
    }
}

macro_rules! raise {
    ($($error:ty => $exception:ident,)*) => {$(
        impl Raise for $error {
            fn exception(sentence: String) -> PyErr {
                $exception::new_err(sentence)
            }
        }
    )*};
}

/// What is an exception stays that one.
impl Raise for PyErr {
    fn exception(sentence: String) -> PyErr {
        TactusError::new_err(sentence)
    }

    fn raise(&self) -> PyErr {
        Python::attach(|py| self.clone_ref(py))
    }
}

raise! {
    OfRecordings => RecordingError,
    MovementError => SlideError,
    OfSlide => SlideError,
    OfTable => TableError,
    TableFileError => TableError,
    ExperimentError => TactusError,
    ExplorerError => TableError,
    ObserveError => TableError,
    LearnError => TableError,
    SimError => SimulationError,
    LineError => ProbeError,
    LinkError => ProbeError,
    OperationError => ProbeError,
    LogError => ProbeError,
    TrialError => SimulationError,
}
