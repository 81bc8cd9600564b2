//! The report of a study: one HTML page that needs nothing else, study.json with all numbers, and the learned tables.
//!
//! The words of the page are in its template, `report/page.html`. The files beside it make the tables and figures, and
//! the numbers that stand between the words.

mod error;
mod folder;
mod identification;
mod model;
mod pilot;
mod signals;
mod summary;
mod training;

use serde_json::json;

use super::results::Study;
pub use crate::chart::DrawError;
use crate::page::render;
pub use error::ReportError;
pub use folder::Folder;
use model::Report;

/// Writes everything of a study into its folder, which has its name then.
///
/// # Errors
/// See [`ReportError`].
pub fn write(study: &Study, folder: Folder) -> Result<(), ReportError> {
    folder.clear()?;
    let put = |name: &str, bytes: &[u8]| folder.put(name, bytes);
    let report = report(study)?;
    for table in study.training.iter().flat_map(|t| &t.tables) {
        put(&table.file, &table.data)?;
    }
    put("study.json", json(study)?.as_bytes())?;
    put(
        "report.html",
        render(include_str!("report/page.html"), &report)
            .map_err(ReportError::Page)?
            .as_bytes(),
    )?;
    folder.finish()
}

/// study.json.
///
/// # Errors
/// [`ReportError::Json`].
pub fn json(study: &Study) -> Result<String, ReportError> {
    Ok(serde_json::to_string(study).map_err(ReportError::Json)? + "\n")
}

/// Tables, figures and numbers of the whole study.
fn report(study: &Study) -> Result<Report, DrawError> {
    let mut report = Report::default();
    let about = json!({
        "version": study.version,
        "command": study.command,
        "seed": study.seed,
        "variation": study.variation.to_string(),
    });
    report.words.insert("about", about);
    if let Some(pilot) = &study.pilot {
        pilot::add(pilot, &mut report)?;
    }
    if let Some(training) = &study.training {
        training::add(training, &mut report)?;
    }
    if let Some(pairs) = &study.pairs {
        identification::add_pairs(pairs, study.simulations, &mut report);
    }
    if let Some(identification) = &study.identification {
        identification::add(identification, &mut report)?;
    }
    if let Some(signals) = &study.signals {
        signals::add(signals, &mut report)?;
    }
    if !study.worlds.is_empty() {
        identification::add_worlds(&study.worlds, &mut report)?;
    }
    summary::add(study, &mut report);
    Ok(report)
}
