//! Arrays that a user gives: samples as 16-bit counts, copied where nothing is lost, and real numbers of any type.

use numpy::{PyArray1, PyArrayMethods as _};
use pyo3::basic::CompareOp;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::IntoPyDict as _;

/// A copy of an array or a sequence, whatever its size, byte order, alignment and order in memory. All that is looked
/// at is the copy: another thread may write to the array meanwhile.
///
/// # Errors
/// `TypeError` for what makes no array; `ValueError` for masked values.
fn copied<'py>(name: &str, given: &Bound<'py, PyAny>, wanted: &str) -> PyResult<Bound<'py, PyAny>> {
    let py = given.py();
    if py
        .import("numpy.ma")?
        .call_method1("is_masked", (given,))?
        .is_truthy()?
    {
        let say =
            "has masked samples, and a slide has no gaps: fill them, or cut the slide before them";
        return Err(PyValueError::new_err(format!("{name} {say}")));
    }
    let plain = [("copy", true), ("subok", false)].into_py_dict(py)?;
    let copy = py
        .import("numpy")?
        .call_method("array", (given,), Some(&plain));
    copy.map_err(|why| {
        if why.is_instance_of::<PyTypeError>(py) || why.is_instance_of::<PyValueError>(py) {
            PyTypeError::new_err(format!("{name} makes no array: {why}; wanted is {wanted}"))
        } else {
            why
        }
    })
}

/// Copies real numbers of any type: their shape, and their values row by row.
///
/// # Errors
/// As [`copied`]; `TypeError` for what are no real numbers.
pub(crate) fn numbers(name: &str, given: &Bound<'_, PyAny>) -> PyResult<(Vec<usize>, Vec<f64>)> {
    let copy = copied(name, given, "one of real numbers")?;
    let (shape, kind) = (copy.getattr("shape")?, copy.getattr("dtype")?);
    if !matches!(kind.getattr("kind")?.extract()?, 'b' | 'i' | 'u' | 'f') {
        return Err(PyTypeError::new_err(format!(
            "{name} is {kind} of shape {shape}, and wanted are real numbers: give numpy.real({name}) or \
             numpy.asarray({name}, float)"
        )));
    }
    let flat = copy
        .call_method1("astype", ("float64",))?
        .call_method0("ravel")?;
    let values = flat.cast_into::<PyArray1<f64>>()?.readonly().to_vec()?;
    Ok((shape.extract()?, values))
}

/// Copies samples from an array or a sequence of whole numbers, as [`copied`].
///
/// # Errors
/// `TypeError` for what has no whole numbers in it; `ValueError` for another shape, masked samples, and numbers that 16
/// bits do not hold.
pub(crate) fn samples(name: &str, given: &Bound<'_, PyAny>) -> PyResult<Vec<i16>> {
    let copy = copied(name, given, "a row of whole numbers")?;
    let (shape, kind) = (copy.getattr("shape")?, copy.getattr("dtype")?);
    let is_row = copy.getattr("ndim")?.extract::<usize>()? == 1;
    if is_row && copy.len()? == 0 {
        return Ok(Vec::new());
    }
    if !matches!(kind.getattr("kind")?.extract()?, 'i' | 'u') {
        return Err(PyTypeError::new_err(format!(
            "{name} is {kind} of shape {shape}, and samples are whole counts of 16 bits: if yours are counts, give \
             numpy.rint({name}).astype(numpy.int16)"
        )));
    }
    if !is_row {
        return Err(PyValueError::new_err(format!(
            "{name} has the shape {shape}, and samples have the shape (samples,): give one column, or {name}.ravel()"
        )));
    }
    let counts = copy.call_method1("astype", ("int16",))?;
    let same = counts.rich_compare(&copy, CompareOp::Eq)?;
    if !same.call_method0("all")?.is_truthy()? {
        let (low, high) = (copy.call_method0("min")?, copy.call_method0("max")?);
        return Err(PyValueError::new_err(format!(
            "{name} has samples from {low} to {high}, and 16 bits hold -32768 to 32767: are they counts?"
        )));
    }
    Ok(counts.cast_into::<PyArray1<i16>>()?.readonly().to_vec()?)
}
