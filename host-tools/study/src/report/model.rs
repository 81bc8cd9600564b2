//! The parts of a report: tables, figures, and the numbers that its page puts between its words.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;
use tactus_core::features::Property;

use crate::chart::Figure;

/// The contents of a report: the page's template gives the place of each piece and the text about it.
#[derive(Debug, Default, Serialize)]
pub(super) struct Report {
    /// Tables that the page shows, by their names.
    pub(super) tables: BTreeMap<&'static str, Table>,
    /// The panels of the page's figures, by figure.
    pub(super) figures: BTreeMap<&'static str, Vec<Figure>>,
    /// Values in the text, by section.
    #[serde(flatten)]
    pub(super) words: BTreeMap<&'static str, Value>,
}

impl Report {
    /// Adds a table that the page shows.
    pub(super) fn table(&mut self, id: &'static str, header: &[&str], rows: Rows) {
        self.tables.insert(
            id,
            Table {
                header: header.iter().map(|&name| name.to_owned()).collect(),
                rows,
            },
        );
    }
}

/// A movement by its force in N and its speed in mm/s.
pub(super) fn movement_name((force_n, speed_mm_s): (f32, f32)) -> String {
    format!("{force_n:.2} N, {speed_mm_s:.1} mm/s")
}

/// A property with its unit, for an axis.
pub(super) fn axis(property: Property) -> &'static str {
    match property {
        Property::Traction => "traction (N)",
        Property::Roughness => "roughness (ln of counts\u{b2})",
        Property::Fineness => "fineness (ln of Hz)",
    }
}

/// The rows of a table, each as long as its header.
pub(super) type Rows = Vec<Vec<Cell>>;

/// A table of the report.
#[derive(Debug, Serialize)]
pub(super) struct Table {
    /// Names of the columns, with units.
    pub(super) header: Vec<String>,
    pub(super) rows: Rows,
}

/// A cell of a table.
#[derive(Debug, Default, Serialize)]
pub(super) struct Cell {
    /// The text for people.
    shown: String,
    number: bool,
}

/// The cells of a row: words, and numbers with the number of decimals for people.
macro_rules! cells {
    ($($cell:expr),* $(,)?) => { vec![$($crate::report::model::Cell::from($cell)),*] };
}
pub(super) use cells;

impl From<String> for Cell {
    fn from(words: String) -> Self {
        Self {
            shown: words,
            number: false,
        }
    }
}

impl From<&str> for Cell {
    fn from(words: &str) -> Self {
        words.to_owned().into()
    }
}

impl From<bool> for Cell {
    fn from(is: bool) -> Self {
        (if is { "yes" } else { "no" }).into()
    }
}

impl From<(f64, usize)> for Cell {
    fn from((value, decimals): (f64, usize)) -> Self {
        Self {
            shown: format!("{value:.decimals$}"),
            number: true,
        }
    }
}

/// A number of single precision has the digits that it has.
impl From<(f32, usize)> for Cell {
    fn from((value, decimals): (f32, usize)) -> Self {
        let digits: f64 = value.to_string().parse().unwrap_or(f64::NAN);
        (digits, decimals).into()
    }
}

impl From<u8> for Cell {
    fn from(number: u8) -> Self {
        (f64::from(number), 0).into()
    }
}
