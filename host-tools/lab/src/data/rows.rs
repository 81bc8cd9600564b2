//! Rows of a CSV table with a header, one at a time; every error names the file, the line and the column.
use std::fmt::Display;
use std::fs::File;
use std::io::{self, BufReader, Read as _};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use tactus_core::table::{NameError, is_printable};

use crate::data::recordings::{RecordingError, files};

/// Largest table that is read, in bytes: a damaged file must not fill the memory with one endless line.
pub const MAX_BYTES: u64 = 64 << 20;

/// A table that is being read.
pub struct Rows {
    path: PathBuf,
    reader: csv::Reader<BufReader<io::Take<File>>>,
    record: csv::StringRecord,
    header_fields: usize,
    /// where the wanted columns are
    columns: Vec<(&'static str, usize)>,
}

/// One row of a table.
#[derive(Clone, Copy, Debug)]
pub struct Row<'a> {
    path: &'a Path,
    record: &'a csv::StringRecord,
    columns: &'a [(&'static str, usize)],
}

impl Rows {
    /// Opens the table at `path`, which must have `columns`, in any order; it may have the `optional` ones, and others.
    /// Errors: if the file cannot be read or a column is missing or there twice.
    pub fn open(
        path: &Path,
        columns: &[&'static str],
        optional: &[&'static str],
    ) -> Result<Self, RecordingError> {
        let header_error = |cause: String| fault(path, 1, None, &cause);
        let file = files::open(path).map_err(|why| header_error(why.to_string()))?;
        let mut reader = csv::ReaderBuilder::new()
            // of "\r\n" the first half is trimmed away: csv's own way of ending a line there counts lines one short
            .terminator(csv::Terminator::Any(b'\n'))
            .trim(csv::Trim::All)
            .flexible(true)
            .from_reader(BufReader::new(file.take(MAX_BYTES)));
        let header = reader
            .headers()
            .map_err(|e| header_error(cause_of(e)))?
            .clone();
        let there = |name: &&&'static str| header.iter().any(|h| h == **name);
        let missing = columns.iter().filter(|name| !there(name)).copied();
        let missing: Vec<&str> = missing.collect();
        if !missing.is_empty() {
            let found: Vec<&str> = header.iter().take(50).collect();
            let (missing, found) = (missing.join(", "), found.join(","));
            return Err(header_error(format!(
                "no column {missing} in the header ({found})"
            )));
        }
        let columns = columns
            .iter()
            .chain(optional.iter().filter(there))
            .map(|&name| {
                let mut at = (0..).zip(&header).filter(|(_, h)| *h == name);
                match (at.next(), at.next()) {
                    (Some((i, _)), None) => Ok((name, i)),
                    _ => Err(header_error(format!("two columns {name} in the header"))),
                }
            })
            .collect::<Result<_, _>>()?;
        Ok(Self {
            path: path.to_owned(),
            reader,
            record: csv::StringRecord::new(),
            header_fields: header.len(),
            columns,
        })
    }

    /// The next row; empty lines are skipped.
    /// Errors: if the file cannot be read, or the row has another number of fields than the header. One comma too many
    /// at the end is let pass: the BioTac publisher's rows have it.
    pub(crate) fn next_row(&mut self) -> Result<Option<Row<'_>>, RecordingError> {
        let error = |line, cause: String| fault(&self.path, line, None, &cause);
        loop {
            let line = self.reader.position().line();
            let more = self.reader.read_record(&mut self.record).map_err(|e| {
                let line = e.position().map_or(line, csv::Position::line);
                error(line, cause_of(e))
            })?;
            if self.reader.get_ref().get_ref().limit() == 0 {
                let why = format!("the table is longer than {MAX_BYTES} bytes; split it");
                return Err(error(line, why));
            }
            if !more {
                return Ok(None);
            }
            // a line with nothing but a carriage return
            if self.record.len() > 1 || self.record.iter().any(|f| !f.is_empty()) {
                break;
            }
        }
        let line = self.record.position().map_or(0, csv::Position::line);
        let (fields, wanted) = (self.record.len(), self.header_fields);
        if fields < wanted || self.record.iter().skip(wanted).any(|f| !f.is_empty()) {
            return Err(error(
                line,
                format!(
                    "{fields} fields where the header has {wanted}: cut off or damaged; fetch or write the file again"
                ),
            ));
        }
        Ok(Some(Row {
            path: &self.path,
            record: &self.record,
            columns: &self.columns,
        }))
    }
}

impl<'a> Row<'a> {
    /// Line of this row in the file.
    pub fn line(&self) -> u64 {
        self.record.position().map_or(0, csv::Position::line)
    }

    /// The text in `column`, without spaces around it; empty if [`Rows::open`] was not asked for it.
    pub fn text(&self, column: &'static str) -> &'a str {
        let at = self.columns.iter().find(|(name, _)| *name == column);
        at.and_then(|&(_, i)| self.record.get(i)).unwrap_or("")
    }

    /// The text in `column`, for people to read.
    /// Errors: a character that prints nothing, or changes those around it.
    pub fn shown(&self, column: &'static str) -> Result<&'a str, RecordingError> {
        let text = self.text(column);
        let Some(hidden) = text.chars().find(|c| !is_printable(*c)) else {
            return Ok(text);
        };
        let why = NameError::Unprintable(hidden.into());
        Err(self.error(Some(column), format!("{text:?} {why}")))
    }

    /// The value in `column`; the error names `what` it should be.
    /// Errors: if it is not.
    pub fn parse<T: FromStr>(
        &self,
        column: &'static str,
        what: &'static str,
    ) -> Result<T, RecordingError> {
        let text = self.text(column);
        let wrong = |_| {
            let text: String = text.chars().take(40).collect();
            self.error(Some(column), format!("{text:?} is not {what}"))
        };
        text.parse().map_err(wrong)
    }

    /// The finite number in `column`.
    /// Errors: if it is not a number, or not finite.
    pub fn number<T>(&self, column: &'static str) -> Result<T, RecordingError>
    where
        T: FromStr + Into<f64> + Copy,
    {
        let number: T = self.parse(column, "a number")?;
        if !number.into().is_finite() {
            let text = self.text(column);
            let why =
                format!("{text} is not a finite number; measure it again or leave the row out");
            return Err(self.error(Some(column), why));
        }
        Ok(number)
    }

    /// An error in this row.
    pub fn error(&self, column: Option<&str>, cause: impl Display) -> RecordingError {
        fault(self.path, self.line(), column, &cause.to_string())
    }
}

fn fault(path: &Path, line: u64, column: Option<&str>, cause: &str) -> RecordingError {
    let column = column.map(|name| format!("column {name}: "));
    let (path, column) = (path.display(), column.unwrap_or_default());
    RecordingError::said(format!("{path}:{line}: {column}{cause}"))
}

/// The message of csv without the place, which the caller adds.
fn cause_of(error: csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::Io(_) => std::io::Error::from(error).to_string(),
        csv::ErrorKind::Utf8 { .. } => "not UTF-8 text, so this is not a table in CSV".to_owned(),
        _ => error.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::cells;

    fn errors(text: &[u8]) -> (usize, String) {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        let mut rows = match Rows::open(file.path(), &["a", "b"], &["c"]) {
            Ok(rows) => rows,
            Err(e) => return (0, e.to_string()),
        };
        let mut count = 0;
        loop {
            let number = match rows.next_row() {
                Ok(Some(row)) => row.number::<f64>("b"),
                Ok(None) => return (count, String::new()),
                Err(e) => return (count, e.to_string()),
            };
            match number {
                Ok(_) => count += 1,
                Err(e) => return (count, e.to_string()),
            }
        }
    }

    #[test]
    fn the_line_is_right_whatever_ends_the_lines() {
        for end in ["\n", "\r\n"] {
            const CASES: &str = r#"
a,b~1,2~1,x           | 1 | :3: column b: "x" is not a number
b,c,a~2,1,1~2,1       | 1 | :3: 2 fields where the header has 3
a,b~1,2~1,2,~1,2,3  | 2 | :4: 3 fields where the header has 2
a,b~1,2~1,inf         | 1 | :3: column b: inf is not a finite number
a,b~1, 2 ~ "1","2"~     | 2 |
a,b~1,2~1,~~             | 1 | :3: column b: "" is not a number
a,b~"1~1",2~1,x     | 1 | :4: column b
a,c                       | 0 | :1: no column b in the header (a,c)
a,b,a                     | 0 | :1: two columns a
"#;
            for [lines, count, place] in cells(CASES) {
                let (found, message) = errors(lines.replace('~', end).as_bytes());
                assert!(
                    message.contains(place) && message.is_empty() == place.is_empty(),
                    "{place:?} is not in {message:?}"
                );
                assert_eq!(found.to_string(), count, "{lines:?}");
            }
        }
        let (_, message) = errors(b"a,b\n1,2\n\xff,2");
        assert!(message.contains(":3: not UTF-8"), "{message}");
    }
}
