//! What a report is made of: sections of words, tables and figures.

/// A table of the report.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Table {
    /// Name of its file, without the ending.
    pub(super) id: &'static str,
    /// What it shows.
    pub(super) title: String,
    /// Names of the columns, with units.
    pub(super) header: Vec<String>,
    /// The rows.
    pub(super) rows: Vec<Vec<Cell>>,
}

/// A cell of a table.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Cell {
    /// Words.
    Text(String),
    /// A number, and how many decimals of it people see; files have all.
    Number(f64, usize),
    /// Nothing.
    Empty,
}

impl Cell {
    pub(super) fn text(text: impl ToString) -> Self {
        Self::Text(text.to_string())
    }

    /// A number of single precision, with the digits that it has.
    pub(super) fn single(value: f32, decimals: usize) -> Self {
        Self::Number(value.to_string().parse().unwrap_or(f64::NAN), decimals)
    }

    /// In a file.
    pub(super) fn exact(&self) -> String {
        match self {
            Self::Text(text) => text.clone(),
            Self::Number(value, _) => value.to_string(),
            Self::Empty => String::new(),
        }
    }
}

/// A figure, or a panel of one.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Figure {
    /// Name of its file, without the ending.
    pub(super) id: String,
    /// What it shows, for those who cannot see it.
    pub(super) title: String,
    /// The drawing.
    pub(super) svg: String,
}

/// A part of a section.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Block {
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
pub(super) struct Section {
    /// Its place in the page.
    pub(super) id: &'static str,
    /// Its heading.
    pub(super) title: String,
    /// What is in it.
    pub(super) blocks: Vec<Block>,
}
