//! The Python package `tactus`: recordings, features, tables, explorations, simulated and real probes, all by the code
//! that runs on the chip and in the command `tactus`. What each name means, with shapes and units, stands in
//! `tactus/__init__.pyi`.

mod arguments;
mod arrays;
mod error;
mod evaluate;
mod explorer;
mod features;
mod printer;
mod probe;
mod recordings;
mod rows;
mod samples;
mod simulate;
mod table;
mod values;
mod work;

use pyo3::prelude::*;

/// What `tactus/__init__.py` imports.
#[pymodule]
fn _tactus(module: &Bound<'_, PyModule>) -> PyResult<()> {
    error::add(module)?;
    features::add(module)?;
    recordings::add(module)?;
    table::add(module)?;
    rows::add(module)?;
    evaluate::add(module)?;
    explorer::add(module)?;
    simulate::add(module)?;
    printer::add(module)?;
    probe::add(module)?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))
}
