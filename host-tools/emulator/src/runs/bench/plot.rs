//! Curves of the growth as SVG. What draws takes long to build, and nothing else here needs it.

use std::path::Path;

use super::error::BenchError;

/// A name, and its points.
pub(super) type Curve = (&'static str, Vec<(f64, f64)>);

/// Draws how table and decision grow.
#[cfg(feature = "plot")]
pub(super) fn draw(path: &Path, curves: &[Curve]) -> Result<(), BenchError> {
    let title = "A fused decision after a slide, three movements";
    let svg = tactus_study::chart::curves(title, "textures of the table", "", curves)?;
    std::fs::write(path, svg).map_err(|source| {
        let path = path.into();
        BenchError::Write(crate::host::args::WriteError { path, source })
    })
}

/// Says what is missing.
#[cfg(not(feature = "plot"))]
pub(super) fn draw(_: &Path, _: &[Curve]) -> Result<(), BenchError> {
    Err(BenchError::NoPlot)
}
