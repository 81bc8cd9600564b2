//! The report of a study: one HTML page that needs nothing else, every figure as .svg, every table as .csv, and study.json.

mod draw;
mod page;
mod sections;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

pub use draw::{DrawError, curves};

use super::Study;

/// A table of the report.
#[derive(Clone, PartialEq, Debug)]
pub struct Table {
    /// Name of its file, without the ending.
    pub id: &'static str,
    /// What it shows.
    pub title: String,
    /// Names of the columns, with units.
    pub header: Vec<String>,
    /// The rows.
    pub rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Clone, PartialEq, Debug)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A number, and how many decimals of it people see; files have all.
    Number(f64, usize),
    /// Nothing.
    Empty,
}

impl Cell {
    fn text(text: impl ToString) -> Self {
        Self::Text(text.to_string())
    }

    /// A number of single precision, with the digits that it has.
    fn single(value: f32, decimals: usize) -> Self {
        Self::Number(value.to_string().parse().unwrap_or(f64::NAN), decimals)
    }

    /// In a file.
    fn exact(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(value, _) => value.to_string(),
            Self::Empty => String::new(),
        }
    }
}

/// A figure, or a panel of one.
#[derive(Clone, PartialEq, Debug)]
pub struct Figure {
    /// Name of its file, without the ending.
    pub id: String,
    /// What it shows, for those who cannot see it.
    pub title: String,
    /// The drawing.
    pub svg: String,
}

/// A part of a section.
#[derive(Clone, PartialEq, Debug)]
pub enum Block {
    /// A paragraph.
    Text(String),
    /// A table.
    Table(Table),
    /// The panels of a figure, and what they show.
    Figure(Vec<Figure>, String),
    /// A table that is too large to read: only its file is named.
    File(Table),
}

/// A section of the report.
#[derive(Clone, PartialEq, Debug)]
pub struct Section {
    /// Its place in the page.
    pub id: &'static str,
    /// Its heading.
    pub title: String,
    /// What is in it.
    pub blocks: Vec<Block>,
}

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
