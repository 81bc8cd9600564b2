//! A 3D printer that moves a probe's finger.

use std::path::PathBuf;
use std::sync::{Mutex, MutexGuard, PoisonError};

use pyo3::prelude::*;
use tactus_link::printer::OpenPrinter;

use crate::error::ProbeError;
use crate::probe::{Events, Probe};

/// A 3D printer that moves the finger of a probe with the firmware `tactus-arm`, as `tactus device printer setup` has
/// measured it. port: its serial port, or tcp:HOST:PORT; that of the set-up, unless given. setup: its file, and not
/// ~/.local/share/tactus/printer.json.
///
/// Raises ProbeError where there is no set-up, or no such port.
#[pyclass(frozen, module = "tactus")]
pub(crate) struct Printer(Mutex<Option<OpenPrinter>>);

impl Printer {
    fn open(&self) -> MutexGuard<'_, Option<OpenPrinter>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl Printer {
    #[new]
    #[pyo3(signature = (port=None, *, setup=None))]
    fn new(py: Python<'_>, port: Option<String>, setup: Option<PathBuf>) -> PyResult<Self> {
        let file = setup.map_or_else(|| setup_file(py), Ok)?;
        let port = port.unwrap_or_default();
        let open = py.detach(|| OpenPrinter::of_file(&port, &file));
        let open = open.map_err(|why| ProbeError::new_err(why.to_string()))?;
        Ok(Self(Mutex::new(Some(open))))
    }

    /// Has it do what a probe asks for while that is at something: gives `events` back, the iterator of
    /// `Probe.identify` or `Probe.train`.
    fn drive(&self, probe: &Bound<'_, Probe>, events: Py<Events>) -> PyResult<Py<Events>> {
        let open = self.open();
        let open = open.as_ref();
        let open = open.ok_or_else(|| ProbeError::new_err("the printer was closed"))?;
        probe.get().linked.move_by(open.printer.clone());
        Ok(events)
    }

    /// Why its last movement failed, in a sentence; None the second time, and where none did.
    fn failure(&self) -> Option<String> {
        let why = self.open().as_ref()?.printer.take_failure()?;
        Some(why.to_string())
    }

    /// Gives its port back, and keeps where it is parked.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        let open = self.open().take();
        let closed = py.detach(|| open.map(|mut open| open.close()));
        closed
            .unwrap_or(Ok(()))
            .map_err(|why| ProbeError::new_err(why.to_string()))
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_error))]
    fn __exit__(&self, py: Python<'_>, _error: &Bound<'_, pyo3::types::PyTuple>) -> PyResult<()> {
        self.close(py)
    }
}

fn setup_file(py: Python<'_>) -> PyResult<PathBuf> {
    let home = || {
        py.import("pathlib")?
            .getattr("Path")?
            .call_method0("home")?
            .str()?
            .extract()
    };
    let data = std::env::var_os("XDG_DATA_HOME").filter(|data| !data.is_empty());
    let data = match data {
        Some(data) => PathBuf::from(data),
        None => home().map(|home: String| PathBuf::from(home).join(".local/share"))?,
    };
    Ok(data.join("tactus/printer.json"))
}

pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Printer>()
}
