//! Tables of text: the encoding, the mark between columns, decimal commas, lines before the table, a row of units, and
//! a header that comes again are found by looking at them.

use std::borrow::Cow;
use std::collections::{HashMap, HashSet};

use super::{MOST_RUNS, MOST_WORDS, Piece, Signals, bare, fits, is_measured, several};

/// Most bytes of a line.
const MAX_LINE: usize = 1 << 20;
/// Most rows before a table, and of those most that begin like it; usual rows that are looked at.
const LOOK: usize = 400;
const PREAMBLE: usize = 64;
const USUAL: usize = 8;
/// Marks between the columns of a table, in the order in which they are tried.
const MARKS: [u8; 5] = [b'\t', b';', b',', b'|', b' '];
/// Words for a number that is missing.
const MISSING: [&str; 10] = [
    "", "-", "?", "--", "na", "n/a", "nan", "-nan", "null", "none",
];
/// Units of columns, in small letters.
const UNITS: [&str; 33] = [
    "", "-", "s", "sec", "ms", "us", "µs", "ns", "g", "mg", "m/s2", "m/s^2", "m/s²", "m/s/s", "v",
    "mv", "n", "mn", "pa", "kpa", "hz", "counts", "raw", "lsb", "mm", "mm/s", "m", "rad/s",
    "deg/s", "dps", "a", "ma", "°c",
];

/// The way of writing of a table.
#[derive(Clone, Copy)]
struct Style {
    mark: u8,
    decimal_comma: bool,
}

impl Style {
    /// The style of a row with numbers.
    fn of(row: &str) -> Self {
        let measures = |style: &Self| {
            let fields = style.fields(row);
            let filled = fields.iter().filter(|field| !field.is_empty());
            filled.count() > 1 && fields.iter().any(|field| style.is_measured(field))
        };
        let marks = MARKS
            .into_iter()
            .filter(|mark| row.as_bytes().contains(mark));
        let styles = marks.map(|mark| {
            let style = Self {
                mark,
                decimal_comma: true,
            };
            let fields = style.fields(row);
            let comma = |field: &Cow<'_, str>| field.contains(',') && style.number(field).is_some();
            let point = |field: &Cow<'_, str>| field.contains('.') && field.parse::<f64>().is_ok();
            Self {
                mark,
                decimal_comma: fields.iter().any(comma) && !fields.iter().any(point),
            }
        });
        let commas = Self {
            mark: b',',
            decimal_comma: false,
        };
        styles.into_iter().find(measures).unwrap_or(commas)
    }

    fn number(self, field: &str) -> Option<f64> {
        let number = match self.decimal_comma && field.contains(',') {
            // points are between thousands
            true => field.replace('.', "").replace(',', ".").parse(),
            false => field.parse(),
        };
        number.ok().filter(|x: &f64| !x.is_nan())
    }

    /// True for a number or an instant.
    fn is_measured(self, field: &str) -> bool {
        self.number(field).is_some() || instant(field).is_some()
    }

    /// The fields of a line, without blanks and quotes around them.
    fn fields(self, line: &str) -> Vec<Cow<'_, str>> {
        let is_field = |field: &str| self.mark != b' ' || !field.is_empty();
        if !line.contains('"') {
            let fields = line.split(char::from(self.mark)).map(str::trim);
            return fields.filter(|f| is_field(f)).map(Cow::Borrowed).collect();
        }
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(self.mark)
            .has_headers(false)
            .trim(csv::Trim::All)
            .buffer_capacity(line.len())
            .from_reader(line.as_bytes());
        let mut record = csv::StringRecord::new();
        // a line of text in memory is one record at least
        let _ = reader.read_record(&mut record);
        let fields = record.iter().filter(|f| is_field(f));
        fields.map(|f| Cow::Owned(f.to_owned())).collect()
    }
}

fn is_missing(field: &str) -> bool {
    MISSING.iter().any(|word| word.eq_ignore_ascii_case(field))
}

/// A text as lines.
struct Lines<'t> {
    text: &'t str,
    end: char,
}

impl<'t> Lines<'t> {
    /// All lines with their numbers.
    fn all(&self) -> impl Iterator<Item = (usize, &'t str)> + use<'t> {
        (1..).zip(self.text.split(self.end).map(str::trim))
    }

    /// The lines that are neither empty nor a comment, with their numbers.
    fn rows(&self) -> impl Iterator<Item = (usize, &'t str)> + use<'t> {
        self.all().filter(|(_, line)| is_row(line))
    }

    /// The first rows, but for what is no row of a table.
    fn begin(&self) -> impl Iterator<Item = &'t str> + use<'t> {
        let rows = self.rows().map(|(_, row)| row).take(LOOK);
        rows.take_while(|row| row.len() <= MAX_LINE)
    }

    /// Usual rows: some with numbers from the middle, where no header is, else the last one of the begin.
    fn usual(&self) -> Vec<&'t str> {
        let half = self.text.len() / 2;
        let end = self
            .text
            .bytes()
            .skip(half)
            .position(|b| b == self.end as u8);
        let later = end.and_then(|end| self.text.get(half + end + 1..));
        let later = later.unwrap_or_default().split(self.end).map(str::trim);
        let later = later.filter(|row| is_row(row) && row.len() <= MAX_LINE);
        let measures = |row: &&str| {
            let style = Style::of(row);
            let fields = style.fields(row);
            fields.iter().any(|field| style.is_measured(field))
        };
        let usual: Vec<&str> = later.take(USUAL).filter(measures).collect();
        if !usual.is_empty() {
            return usual;
        }
        let last = self.begin().filter(measures).last();
        let first =
            || Some(self.rows().next()?.1).map(|row| if row.len() <= MAX_LINE { row } else { "" });
        last.or_else(first).into_iter().collect()
    }
}

/// True for a line that is neither empty nor a comment.
fn is_row(line: &str) -> bool {
    !line.is_empty() && !line.starts_with(['#', '%']) && !line.starts_with("//")
}

pub(super) fn read(bytes: &[u8], most: usize) -> Result<Signals, String> {
    let text = decoded(bytes)
        .ok_or("none of WAV, .npy, .npz, or a table in text (CSV, TSV); save it as one of them")?;
    let end = if text.contains('\n') { '\n' } else { '\r' };
    let lines = Lines { text: &text, end };
    let usual = lines.usual();
    let mut style = Style::of(usual.first().ok_or("an empty file")?);
    // a row of whole numbers has none
    style.decimal_comma = usual.iter().any(|row| Style::of(row).decimal_comma);
    let begin = begin(&lines, style, &usual);
    let before: Vec<&str> = lines.begin().take(begin).collect();
    let first = lines.begin().nth(begin).unwrap_or_default();
    let (names, headers) = names(style, &before, first);
    let mut columns: Vec<Column> = names.into_iter().map(Column::new).collect();
    fits(1, columns.len(), most)?;
    let mut cuts = Vec::new();
    for (at, (line, text)) in lines.rows().enumerate() {
        if text.len() > MAX_LINE {
            return Err(format!(
                "line {line} has {} bytes: no row of a table",
                text.len()
            ));
        }
        if at < begin {
            continue;
        }
        let rows = columns[0].numbers.len();
        if headers.contains(&text) {
            if cuts.last() != Some(&rows) {
                cuts.push(rows);
            }
            several(cuts.len())?;
            continue;
        }
        let fields = style.fields(text);
        // one mark too many at the end is let pass
        let mut rest = fields.get(columns.len()..).unwrap_or_default().iter();
        if fields.len() < columns.len() || rest.any(|f| !f.is_empty()) {
            return Err(format!(
                "line {line}: {} fields where there are {} columns: cut off or damaged",
                fields.len(),
                columns.len()
            ));
        }
        fits(rows + 1, columns.len(), most)?;
        for (column, field) in columns.iter_mut().zip(&fields) {
            column.push(field, style);
        }
    }
    let rows = columns[0].numbers.len();
    let mut signals = columns_of(columns)?;
    signals.rate_hz = lines.all().take(LOOK).find_map(|(_, line)| said_rate(line));
    cuts.push(rows);
    cuts.dedup();
    if cuts.len() > 1 {
        let begins = [0].into_iter().chain(cuts.iter().copied());
        let piece = |(start, end): (usize, usize)| Piece {
            rows: start..end,
            ..Piece::default()
        };
        signals.pieces = begins.zip(cuts.iter().copied()).map(piece).collect();
    }
    Ok(signals)
}

/// The text of a file: UTF-8, UTF-16 with its mark or without, or Latin letters of one byte.
fn decoded(bytes: &[u8]) -> Option<Cow<'_, str>> {
    let wide = |bytes: &[u8], of: fn([u8; 2]) -> u16| {
        let pairs = bytes.as_chunks::<2>().0.iter().map(|pair| of(*pair));
        let text: Result<String, _> = char::decode_utf16(pairs).collect();
        text.ok().map(Cow::Owned)
    };
    let text = match bytes {
        [0xef, 0xbb, 0xbf, rest @ ..] => std::str::from_utf8(rest).ok().map(Cow::Borrowed),
        [0xff, 0xfe, rest @ ..] => wide(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => wide(rest, u16::from_be_bytes),
        [a, 0, b, 0, ..] if *a != 0 && *b != 0 => wide(bytes, u16::from_le_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => Some(Cow::Borrowed(text)),
            // control characters are of no text
            Err(_)
                if bytes
                    .iter()
                    .any(|b| *b < 0x20 && !b"\t\n\r\x0c".contains(b)) =>
            {
                None
            }
            Err(_) => Some(bytes.iter().map(|byte| char::from(*byte)).collect()),
        },
    };
    text.filter(|text| !text.contains('\0'))
}

/// The first row of numbers, counted among the rows; the first of all where there is none. The columns of numbers of
/// usual rows are such there, too. A few rows in which only half of them are may be what is said before the table, many
/// are of it: labels that become numbers.
fn begin(lines: &Lines<'_>, style: Style, usual: &[&str]) -> usize {
    let usual: Vec<_> = usual.iter().map(|row| style.fields(row)).collect();
    let is_measured = |field: &str| style.is_measured(field);
    let measured = (0..usual.first().map_or(0, Vec::len)).filter(|n| {
        let mut fields = usual
            .iter()
            .map(|row| row.get(*n).map_or("", |field| field));
        fields.clone().any(is_measured) && fields.all(|f| is_measured(f) || is_missing(f))
    });
    let measured: Vec<usize> = measured.collect();
    // of so many of the columns at least
    let first = |least: usize| {
        lines.begin().position(|row| {
            let fields = style.fields(row);
            let count = |is: &dyn Fn(&str) -> bool| {
                let there = measured.iter().filter_map(|n| fields.get(*n));
                there.filter(|field| is(field)).count()
            };
            let values = count(&is_measured);
            values > 0 && values + count(&is_missing) >= least
        })
    };
    let half = first(measured.len().div_ceil(2));
    let all = first(measured.len());
    let near = all.zip(half).filter(|(all, half)| all - half < PREAMBLE);
    near.map(|(all, _)| all).or(half).unwrap_or(0)
}

/// The fields without those that a mark too many makes.
fn trimmed(mut fields: Vec<Cow<'_, str>>) -> Vec<Cow<'_, str>> {
    while fields.len() > 1 && fields.last().is_some_and(|field| field.is_empty()) {
        fields.pop();
    }
    fields
}

/// The names of the columns by the rows before the first one of numbers, and the rows that are these: the last ones
/// that are as wide; a second one has the units.
fn names<'t>(style: Style, before: &[&'t str], first: &str) -> (Vec<String>, Vec<&'t str>) {
    let width = trimmed(style.fields(first)).len();
    let mut rows = before
        .iter()
        .rev()
        .map(|row| (*row, trimmed(style.fields(row))));
    let mut header = || {
        let (text, fields) = rows.next()?;
        let is_name = |field: &Cow<'_, str>| style.number(field).is_none();
        (fields.len() >= width && fields.iter().all(is_name)).then_some((text, fields))
    };
    let is_unit = |field: &Cow<'_, str>| {
        let bare = field.trim_matches(['(', ')', '[', ']', ' ']).to_lowercase();
        UNITS.contains(&bare.as_str())
    };
    let (mut names, mut units) = (header(), None);
    if names
        .as_ref()
        .is_some_and(|(_, fields)| fields.iter().all(is_unit))
        && let Some(above) = header()
    {
        units = names.replace(above);
    }
    let none = ("", Vec::new());
    let texts = [&names, &units]
        .into_iter()
        .flatten()
        .map(|(text, _)| *text);
    let texts = texts.collect();
    let (_, names) = names.unwrap_or_else(|| none.clone());
    let (_, units) = units.unwrap_or(none);
    let name = |n: usize| match names.get(n).filter(|name| !name.is_empty()) {
        Some(name) => {
            let unit = units
                .get(n)
                .map(|unit| unit.trim_matches(['(', ')', '[', ']', ' ']));
            match unit.filter(|unit| !unit.is_empty() && !name.contains(['(', '['])) {
                Some(unit) => format!("{name} ({unit})"),
                None => name.to_string(),
            }
        }
        None => (n + 1).to_string(),
    };
    (
        (0..width.max(names.len()).max(1)).map(name).collect(),
        texts,
    )
}

/// The rate in a line before the table: `# Sample rate: 1600 Hz`, `fs = 10 kHz`.
fn said_rate(line: &str) -> Option<f64> {
    const NAMES: [&str; 6] = [
        "sample rate",
        "sampling rate",
        "sample_rate",
        "sampling frequency",
        "samplerate",
        "fs",
    ];
    let lower = line.get(..line.len().min(200))?.to_lowercase();
    let bare = lower.trim_start_matches(['#', '%', '/', '"', ' ', '\t']);
    let rest = NAMES.iter().find_map(|name| bare.strip_prefix(name))?;
    let rest = rest.trim_start_matches([
        ':', '=', ' ', ',', ';', '\t', '"', '(', '[', ')', ']', 'h', 'z',
    ]);
    let end = rest.find(|c: char| !c.is_ascii_digit() && c != '.');
    let (number, unit) = rest.split_at(end.unwrap_or(rest.len()));
    let number: f64 = number.parse().ok()?;
    let kilo = unit.trim_start().starts_with("khz");
    Some(if kilo { 1e3 * number } else { number }).filter(|rate| *rate >= 1.0)
}

/// An instant such as `2026-11-28T10:00:00.125Z`, `28.11.2026 10:00:00,125` or `10:00:00.125`, in s.
fn instant(field: &str) -> Option<f64> {
    if field.len() > 40 || !field.contains(':') {
        return None;
    }
    let (date, clock) = match field.split_once(['T', ' ']) {
        Some((date, clock)) => (Some(date), clock.trim()),
        None => (None, field),
    };
    // a zone is the same for all
    let clock = clock
        .split(['Z', '+', '-'])
        .next()
        .unwrap_or_default()
        .trim();
    let mut parts = clock.split(':');
    let mut whole = || parts.next()?.parse::<u8>().ok().map(f64::from);
    let (hours, minutes) = (whole()?, whole()?);
    let seconds: f64 = parts.next()?.replace(',', ".").parse().ok()?;
    if parts.next().is_some() || !(0.0..61.0).contains(&seconds) {
        return None;
    }
    let days = date.map_or(Some(0.0), days)?;
    Some(86_400.0 * days + 3600.0 * hours + 60.0 * minutes + seconds)
}

/// Days since 1 January 1970.
fn days(date: &str) -> Option<f64> {
    let parts = date.split(['-', '/', '.']).map(|part| part.parse().ok());
    let (year, month, day): (i64, i64, i64) = match parts.collect::<Option<Vec<i64>>>()?[..] {
        [year, month, day] if year > 31 => (year, month, day),
        [day, month, year] if year > 31 => (year, month, day),
        _ => return None,
    };
    if year > 9999 || !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    // years begin in March
    let (year, month) = (year - i64::from(month < 3), (month + 9) % 12);
    let day_of_year = (153 * month + 2) / 5 + day - 1;
    let leaps = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    Some((365 * year + leaps + day_of_year - 719_468) as f64)
}

/// A column while it is read.
struct Column {
    name: String,
    /// The number of each row; not a number where there is a word.
    numbers: Vec<f64>,
    /// Rows with a number, those of them that are instants, and rows with nothing.
    with_number: usize,
    instants: usize,
    missing: Vec<usize>,
    /// The first row with none, or with one that no sensor measures.
    wrong: Option<(usize, String)>,
    /// Its words, each with its place among them.
    words: HashMap<String, u32>,
    /// Rows with the same word one after the other: its place, and the row behind the last. Empty for too many.
    runs: Vec<(u32, usize)>,
    names_nothing: bool,
}

impl Column {
    fn new(name: String) -> Self {
        Self {
            name,
            numbers: Vec::new(),
            with_number: 0,
            instants: 0,
            missing: Vec::new(),
            wrong: None,
            words: HashMap::new(),
            runs: Vec::new(),
            names_nothing: false,
        }
    }

    fn push(&mut self, field: &str, style: Style) {
        let row = self.numbers.len();
        if row == self.numbers.capacity() {
            // doubled, it would be twice as much as is read
            self.numbers.reserve_exact(row / 4 + 16);
        }
        let number = style.number(field);
        let instant = if number.is_none() {
            instant(field)
        } else {
            None
        };
        self.instants += usize::from(instant.is_some());
        let value = number.or(instant);
        self.numbers.push(value.unwrap_or(f64::NAN));
        self.with_number += usize::from(value.is_some());
        if value.is_none() && is_missing(field) {
            self.missing.push(row);
        } else if !value.is_some_and(is_measured) && self.wrong.is_none() {
            self.wrong = Some((row, field.chars().take(40).collect()));
        }
        if value.is_none() && !self.names_nothing {
            self.word(field, row);
        }
    }

    fn word(&mut self, word: &str, row: usize) {
        let place = match self.words.get(word) {
            Some(place) => *place,
            None => {
                let place = self.words.len() as u32;
                self.words.insert(word.to_owned(), place);
                place
            }
        };
        match self.runs.last_mut() {
            Some((last, end)) if *last == place && *end == row => *end += 1,
            _ => self.runs.push((place, row + 1)),
        }
        if self.words.len() > MOST_WORDS || self.runs.len() > MOST_RUNS {
            (self.words, self.runs) = Default::default();
            self.names_nothing = true;
        }
    }

    /// Its stretches of the same word; numbers among words are words, too. None if it is no column of names.
    fn stretches(self) -> Vec<(String, usize)> {
        let mut names = vec![""; self.words.len()];
        for (word, place) in &self.words {
            names[*place as usize] = word;
        }
        let mut stretches: Vec<(String, usize)> = Vec::new();
        let mut put = |word: Cow<'_, str>, end: usize| match stretches.last_mut() {
            Some((last, before)) if *last == word => *before = end,
            _ => stretches.push((word.into_owned(), end)),
        };
        let mut words = self.runs.iter().peekable();
        let mut row = 0;
        while row < self.numbers.len() && !self.names_nothing {
            match words.next_if(|_| self.numbers[row].is_nan()) {
                Some((place, end)) => {
                    put(Cow::Borrowed(names[*place as usize]), *end);
                    row = *end;
                }
                None => {
                    put(Cow::Owned(self.numbers[row].to_string()), row + 1);
                    row += 1;
                }
            }
        }
        if stretches.len() > MOST_RUNS {
            stretches.clear();
        }
        stretches
    }
}

/// Sorts columns into numbers and words.
fn columns_of(columns: Vec<Column>) -> Result<Signals, String> {
    let mut signals = Signals {
        kind: "table",
        ..Signals::default()
    };
    let mut twice = HashSet::new();
    for mut column in columns {
        let mut name = std::mem::take(&mut column.name);
        if !twice.insert(name.clone()) {
            return Err(format!(
                "two columns are called {name:?}; give each a name of its own"
            ));
        }
        let words = column.numbers.len() - column.with_number - column.missing.len();
        // a column with some words among its numbers is damaged, not a column of words
        if column.with_number <= words {
            if words > 0 {
                signals.words.push((name, column.stretches()));
            }
            continue;
        }
        if let Some((row, word)) = column.wrong {
            return Err(format!(
                "row {} of column {name:?}: {word:?} is not a number that was measured; mend it or cut it out",
                row + 1,
            ));
        }
        if column.instants > 0 {
            if column.instants < column.with_number {
                return Err(format!(
                    "column {name:?} has numbers and times of day; mend it or cut it out"
                ));
            }
            name = format!("{} (s)", bare(&name));
        }
        fill(&mut column.numbers, &column.missing);
        if !column.missing.is_empty() {
            signals.missing.insert(name.clone(), column.missing);
        }
        signals.channels.push((name, column.numbers));
    }
    Ok(signals)
}

/// Puts straight lines where numbers are missing: of each run of them between its neighbours, at an end its neighbour.
fn fill(numbers: &mut [f64], missing: &[usize]) {
    for run in missing.chunk_by(|a, b| a + 1 == *b) {
        let (first, behind) = (run[0], run[run.len() - 1] + 1);
        let before = first.checked_sub(1).and_then(|at| numbers.get(at)).copied();
        let after = numbers.get(behind).copied();
        let (from, to) = (
            before.or(after).unwrap_or(0.0),
            after.or(before).unwrap_or(0.0),
        );
        for (at, number) in (1..).zip(&mut numbers[first..behind]) {
            let part = f64::from(at) / (run.len() + 1) as f64;
            *number = from + part * (to - from);
        }
    }
}
