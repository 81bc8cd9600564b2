//! Values for Python: arrays that nobody writes to, and what serialises, as dictionaries.

use numpy::{Element, PyArray1, PyArray2, PyArrayMethods as _, PyReadwriteArray, ndarray};
use pyo3::exceptions::{PyRuntimeError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A vector as an array, without a copy. It is read-only.
pub(crate) fn array<T: Element>(py: Python<'_>, values: Vec<T>) -> Bound<'_, PyArray1<T>> {
    locked(PyArray1::from_vec(py, values))
}

/// Rows of one length as an array, without a copy. It is read-only.
///
/// # Errors
/// They are not.
pub(crate) fn rows<T: Element>(
    py: Python<'_>,
    values: Vec<T>,
    columns: usize,
) -> PyResult<Bound<'_, PyArray2<T>>> {
    let rows = values.len() / columns.max(1);
    Ok(locked(
        PyArray1::from_vec(py, values).reshape([rows, columns])?,
    ))
}

fn locked<T: Element, D: ndarray::Dimension>(
    array: Bound<'_, numpy::PyArray<T, D>>,
) -> Bound<'_, numpy::PyArray<T, D>> {
    let writes: PyReadwriteArray<'_, T, D> = array.readwrite();
    drop(writes.make_nonwriteable());
    array
}

/// What `--format json` would print, as dictionaries, lists and numbers: a number has the digits that it has there.
///
/// # Errors
/// It cannot be written, which no value of this package is.
pub(crate) fn object<'py>(py: Python<'py>, value: &impl Serialize) -> PyResult<Bound<'py, PyAny>> {
    let text = tactus_lab::data::json::text(value);
    let text = text.map_err(|why| PyRuntimeError::new_err(why.to_string()))?;
    py.import("json")?.call_method1("loads", (text,))
}

/// What `__reduce__` gives to pickle: a function of this package, and what it is called with.
pub(crate) type Pickled<'py> = (Bound<'py, PyAny>, (String,));

/// A value as text, and the function that reads it again.
///
/// # Errors
/// It cannot be written, which no value of this package is.
pub(crate) fn pickled<'py>(
    py: Python<'py>,
    read_by: &str,
    value: &impl Serialize,
) -> PyResult<Pickled<'py>> {
    let text = serde_json::to_string(value);
    let text = text.map_err(|why| PyRuntimeError::new_err(why.to_string()))?;
    Ok((py.import("tactus._tactus")?.getattr(read_by)?, (text,)))
}

/// The value of a text that [`pickled`] gave.
///
/// # Errors
/// `ValueError`: it is another text.
pub(crate) fn unpickled<T: DeserializeOwned>(what: &str, text: &str) -> PyResult<T> {
    let value = serde_json::from_str(text);
    value.map_err(|why| PyValueError::new_err(format!("these are no pickled {what}: {why}")))
}

/// Why something cannot be pickled, and what can be in its place.
pub(crate) fn no_pickle<T>(what: &str, instead: &str) -> PyResult<T> {
    let say = format!("a {what} cannot be pickled or copied: {instead}");
    Err(PyTypeError::new_err(say))
}
