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

/// What a folder has in it while it is not whole.
const INCOMPLETE: &str = "INCOMPLETE";

/// A folder that a report is written into: under another name, `DIR.part`, until it is whole. What an interrupted study
/// left there is replaced by the next one.
#[derive(Debug)]
pub struct Folder {
    whole: PathBuf,
    part: PathBuf,
}

impl Folder {
    /// Makes the folder of a report, which is to be `whole`; that must be empty or new. Before the work, not after it: a
    /// study takes minutes.
    ///
    /// # Errors
    /// See [`ReportError`].
    pub fn prepare(whole: &Path) -> Result<Self, ReportError> {
        let io = |path: &Path, source| ReportError::Io {
            path: path.to_owned(),
            source,
        };
        match fs::read_dir(whole).map(|mut there| there.next().is_some()) {
            Ok(true) => return Err(ReportError::Taken(whole.to_owned())),
            Err(why) if why.kind() != io::ErrorKind::NotFound => return Err(io(whole, why)),
            Ok(false) | Err(_) => {}
        }
        // `.` and the like have a name, too
        let whole = fs::canonicalize(whole).unwrap_or_else(|_| whole.components().collect());
        let mut part = whole.clone().into_os_string();
        part.push(".part");
        let part = PathBuf::from(part);
        if part.join(INCOMPLETE).is_file() {
            fs::remove_dir_all(&part).map_err(|source| io(&part, source))?;
        } else if part.exists() {
            return Err(ReportError::Taken(part));
        }
        // whether it can be written shows only when it is
        fs::create_dir_all(&part).map_err(|source| io(&part, source))?;
        let folder = Self { whole, part };
        folder.put(INCOMPLETE, b"A study is being made, or was interrupted: the next one with this --out replaces this.\n")?;
        Ok(folder)
    }

    fn put(&self, name: &str, bytes: &[u8]) -> Result<(), ReportError> {
        let path = self.part.join(name);
        path.parent()
            .map_or(Ok(()), fs::create_dir_all)
            .and_then(|()| fs::write(&path, bytes))
            .map_err(|source| ReportError::Io { path, source })
    }

    /// Gives the folder its name. An empty folder of that name may be there.
    fn finish(&self) -> Result<(), ReportError> {
        fs::remove_file(self.part.join(INCOMPLETE))
            .and_then(|()| match fs::remove_dir(&self.whole) {
                Err(why) if why.kind() != io::ErrorKind::NotFound => Err(why),
                _ => fs::rename(&self.part, &self.whole),
            })
            .map_err(|source| ReportError::Io {
                path: self.whole.clone(),
                source,
            })
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // a study that failed; one that is whole has its name
        let _ = fs::remove_dir_all(&self.part);
    }
}

/// Writes everything of a study into its folder, which has its name then.
///
/// # Errors
/// See [`ReportError`].
pub fn write(study: &Study, folder: &Folder) -> Result<(), ReportError> {
    let put = |name: &str, bytes: &[u8]| folder.put(name, bytes);
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_its_name_only_when_it_is_whole() {
        let here = tempfile::tempdir().unwrap();
        let (whole, part) = (here.path().join("study"), here.path().join("study.part"));
        let folder = Folder::prepare(&whole).unwrap();
        folder.put("tables/a.csv", b"a").unwrap();
        // it is killed here
        std::mem::forget(folder);
        assert!(!whole.exists() && part.is_dir());
        // the next one replaces what was left, and one that fails leaves nothing
        drop(Folder::prepare(&whole).unwrap());
        assert!(!whole.exists() && !part.exists());
        // an empty folder of its name may be there
        fs::create_dir(&whole).unwrap();
        let folder = Folder::prepare(&whole).unwrap();
        assert!(!part.join("tables").exists());
        folder.put("tables/b.csv", b"b").unwrap();
        folder.finish().unwrap();
        drop(folder);
        assert_eq!(fs::read(whole.join("tables/b.csv")).unwrap(), b"b");
        assert!(!whole.join(INCOMPLETE).exists() && !part.exists());
        // what is there is never touched
        assert!(matches!(Folder::prepare(&whole), Err(ReportError::Taken(path)) if path == whole));
        let other = here.path().join("other");
        fs::create_dir_all(here.path().join("other.part/mine")).unwrap();
        assert!(matches!(
            Folder::prepare(&other),
            Err(ReportError::Taken(_))
        ));
    }
}
