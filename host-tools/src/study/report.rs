//! The report of a study: one HTML page that needs nothing else, every figure as .svg, every table as .csv, and study.json.
//!
//! The words of the page are in its template, `report/page.html`. The files beside it make the tables and figures, and the
//! numbers that stand between the words.

mod identification;
mod model;
mod pilot;
mod signals;
mod training;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use minijinja::Environment;
use minijinja::syntax::SyntaxConfig;
use minijinja::value::Serde;
use serde_json::json;

use super::results::Study;
pub use crate::eval::chart::{DrawError, curves};
use model::Report;

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder has something in it.
    #[error("{}: is not empty; give --out a new folder, so that no study is mixed with another", .0.display())]
    Taken(PathBuf),
    /// The system could not write.
    #[error("{} cannot be written; give --out a folder that can be written", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A figure failed.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// A table does not become a file.
    #[error("the table {table} of the report cannot be written; please report this")]
    Table {
        /// Name of its file, without the ending.
        table: String,
        /// The first row that does not fit.
        source: csv::Error,
    },
    /// The study does not become JSON.
    #[error("the study cannot be written as JSON; please report this")]
    Json(#[source] serde_json::Error),
    /// The page's template fails.
    #[error("the template of the report's page fails; please report this")]
    Page(#[source] minijinja::Error),
}

/// Makes the folder of a report; it must be empty or new. Before the work, not after it: a study takes minutes.
///
/// # Errors
/// See [`ReportError`].
pub fn prepare(folder: &Path) -> Result<(), ReportError> {
    let io = |path: &Path, source| ReportError::Io {
        path: path.to_owned(),
        source,
    };
    fs::create_dir_all(folder).map_err(|source| io(folder, source))?;
    let mut there = fs::read_dir(folder).map_err(|source| io(folder, source))?;
    if there.next().is_some() {
        return Err(ReportError::Taken(folder.to_owned()));
    }
    // whether it can be written shows only when it is
    let tables = folder.join("tables");
    fs::create_dir(&tables).map_err(|source| io(&tables, source))
}

/// Writes everything of a study into a folder that was [prepared](prepare).
///
/// # Errors
/// See [`ReportError`].
pub fn write(study: &Study, folder: &Path) -> Result<(), ReportError> {
    let put = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        path.parent()
            .map_or(Ok(()), fs::create_dir_all)
            .and_then(|()| fs::write(&path, bytes))
            .map_err(|source| ReportError::Io { path, source })
    };
    let report = report(study)?;
    let shown = report.tables.iter().map(|(id, table)| (*id, table));
    let files = report.files.iter().map(|(id, table)| (id.as_str(), table));
    for (id, table) in shown.chain(files) {
        let csv = table.csv().map_err(|source| ReportError::Table {
            table: id.to_owned(),
            source,
        })?;
        put(&format!("tables/{id}.csv"), &csv)?;
    }
    for figure in report.figures.values().flatten() {
        put(&format!("figures/{}.svg", figure.id), figure.svg.as_bytes())?;
    }
    for table in study.training.iter().flat_map(|t| &t.tables) {
        put(&table.file, &table.data)?;
    }
    put("study.json", json(study)?.as_bytes())?;
    put(
        "report.html",
        page(&report).map_err(ReportError::Page)?.as_bytes(),
    )
}

/// study.json.
///
/// # Errors
/// [`ReportError::Json`].
pub fn json(study: &Study) -> Result<String, ReportError> {
    Ok(serde_json::to_string(study).map_err(ReportError::Json)? + "\n")
}

/// Tables, figures and numbers of all that was studied.
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
    Ok(report)
}

/// The page: HTML that needs no other file and no script. It is well-formed XML as well, so that a small parser can check it.
fn page(report: &Report) -> Result<String, minijinja::Error> {
    let lines = SyntaxConfig::builder()
        .trim_blocks(true)
        .lstrip_blocks(true)
        .build()?;
    let mut templates = Environment::new();
    templates.set_syntax(lines);
    templates.add_template("page.html", include_str!("report/page.html"))?;
    templates.get_template("page.html")?.render(Serde(report))
}
