//! The report of a study: one HTML page that needs nothing else, every figure as .svg, every table as .csv, and study.json.

mod draw;
mod model;
mod page;
mod sections;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

pub use draw::{DrawError, curves};
use model::{Block, Cell, Table};

use super::results::Study;

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder has something in it.
    #[error("{}: is not empty; give --out a new folder, so that no study is mixed with another", .0.display())]
    Taken(PathBuf),
    /// The system could not write.
    #[error("{}: {source}; give --out a folder that can be written", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A figure failed.
    #[error(transparent)]
    Draw(#[from] DrawError),
}

/// Makes the folder of a report; it must be empty or new. Before the work, not after it: a study takes minutes.
///
/// # Errors
/// See [`ReportError`].
pub fn prepare(folder: &Path) -> Result<(), ReportError> {
    let io = |source| ReportError::Io {
        path: folder.to_owned(),
        source,
    };
    fs::create_dir_all(folder).map_err(io)?;
    if fs::read_dir(folder).map_err(io)?.next().is_some() {
        return Err(ReportError::Taken(folder.to_owned()));
    }
    // whether it can be written shows only when it is
    let tables = folder.join("tables");
    fs::create_dir(&tables).map_err(|source| ReportError::Io {
        path: tables,
        source,
    })
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
    let sections = sections::of(study)?;
    for block in sections.iter().flat_map(|section| &section.blocks) {
        match block {
            Block::Text(_) => {}
            Block::Table(table) | Block::File(table) => {
                put(&format!("tables/{}.csv", table.id), &csv(table))?;
            }
            Block::Figure(panels, _) => {
                for figure in panels {
                    put(&format!("figures/{}.svg", figure.id), figure.svg.as_bytes())?;
                }
            }
        }
    }
    for table in study.training.iter().flat_map(|t| &t.tables) {
        put(&table.file, &table.data)?;
    }
    put("study.json", json(study).as_bytes())?;
    put("report.html", page::html(study, &sections).as_bytes())
}

/// study.json.
pub fn json(study: &Study) -> String {
    let text =
        serde_json::to_string(study).expect("a study has no maps, whose keys could be no text");
    text + "\n"
}

fn csv(table: &Table) -> Vec<u8> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let exact = |row: &Vec<Cell>| row.iter().map(Cell::exact).collect::<Vec<_>>();
    let rows = table.rows.iter().map(exact);
    for row in std::iter::once(table.header.clone()).chain(rows) {
        writer
            .write_record(row)
            .expect("memory can be written, and all rows are as long");
    }
    writer.into_inner().expect("memory can be written")
}
