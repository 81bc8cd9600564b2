//! What a file of signals does not say: options of the command, or `import.toml` beside the data.

use std::path::Path;

use serde::{Deserialize, Serialize};

use tactus_core::sensor::FingerCode;
use tactus_core::table::valid_name;

use super::signals::Signals;
use crate::data::recordings::files::confined;
use crate::data::recordings::{RecordingError, Result, Sensor, read_bounded};

/// Name of the file of settings in the folder of the data.
pub const SETTINGS: &str = "import.toml";
const MAX_SETTINGS: u64 = 64 << 10;
/// Longest slide that is asked for, s: longer than any slow sensor needs.
const MAX_LENGTH_S: f64 = 3600.0;

/// Settings of an import; what is `None` is found by looking at the data.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "arguments", derive(clap::Args))]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// Samples per second, where the files have no time
    #[cfg_attr(feature = "arguments", arg(long, value_name = "HZ"))]
    pub rate: Option<f64>,
    /// Column of the time: s, ms, us, ns as its name or its steps say, or instants such as 2026-11-28T10:00:00.125
    #[cfg_attr(feature = "arguments", arg(long, value_name = "COLUMN"))]
    pub time: Option<String>,
    /// Column or channel of the vibration, by name or number; the liveliest one by default
    #[cfg_attr(feature = "arguments", arg(long, value_name = "COLUMN"))]
    pub channel: Option<String>,
    /// Unit of the vibration: counts, g, m/s2, V, Pa, N
    #[cfg_attr(feature = "arguments", arg(long))]
    pub unit: Option<String>,
    /// Counts per unit; by default what fills 12 bits without clipping
    #[cfg_attr(feature = "arguments", arg(long, value_name = "COUNTS"))]
    pub gain: Option<f64>,
    /// Column of the contact's pressure (P_DC), a slow signal; none by default
    #[cfg_attr(feature = "arguments", arg(long, value_name = "COLUMN"))]
    pub pressure: Option<String>,
    /// Column of the tangential force against the motion in N; none by default
    #[cfg_attr(feature = "arguments", arg(long, value_name = "COLUMN"))]
    pub shear: Option<String>,
    /// Name of the texture: a column, or a pattern of paths with {texture}, {session}, {run}, {speed} in mm/s, {force}
    /// in N or {force_mn}, and * for anything: "{session}/{texture}_*.wav"
    #[cfg_attr(feature = "arguments", arg(long, value_name = "COLUMN|PATTERN"))]
    pub texture: Option<String>,
    /// Session of all files, or the column that names it
    #[cfg_attr(feature = "arguments", arg(long))]
    pub session: Option<String>,
    /// Name of the sensor
    #[cfg_attr(feature = "arguments", arg(long, value_name = "NAME"))]
    pub finger: Option<String>,
    /// Contact force in N, if known
    #[cfg_attr(feature = "arguments", arg(long, value_name = "N"))]
    pub force: Option<f32>,
    /// Sliding speed in mm/s, if known
    #[cfg_attr(feature = "arguments", arg(long, value_name = "MM_S"))]
    pub speed: Option<f32>,
    /// Sliding from and to, in s from the start of each file: "0.5,3"
    #[cfg_attr(feature = "arguments", arg(long, value_name = "FROM,TO"))]
    pub window: Option<String>,
    /// Length of the slides into which longer sliding is divided, in s
    #[cfg_attr(feature = "arguments", arg(long, value_name = "S"))]
    pub length: Option<f64>,
}

const HELP: [(&str, &str, &str); 14] = [
    (
        "rate",
        "1000.0",
        "samples per second, where the files have no time",
    ),
    (
        "time",
        "\"time_s\"",
        "column of the time: s, ms, us, ns as its name or its steps say, or instants",
    ),
    (
        "channel",
        "\"z\"",
        "column or channel of the vibration, by name or number",
    ),
    ("unit", "\"m/s2\"", "counts, g, m/s2, V, Pa, N"),
    ("gain", "100.0", "counts per unit"),
    (
        "pressure",
        "\"force_n\"",
        "column of the contact's pressure (P_DC)",
    ),
    (
        "shear",
        "\"fx_n\"",
        "column of the tangential force against the motion, N",
    ),
    (
        "texture",
        "\"{session}/{texture}_*.csv\"",
        "a column, or a pattern of paths: {texture} {session} {run} {speed} {force} {force_mn} *",
    ),
    (
        "session",
        "\"monday\"",
        "session of all files, or its column",
    ),
    ("finger", "\"my-sensor\"", "name of the sensor"),
    ("force", "0.5", "contact force, N"),
    ("speed", "25.0", "sliding speed, mm/s"),
    (
        "window",
        "\"0.5,3\"",
        "sliding from and to, s from the start of each file",
    ),
    (
        "length",
        "3.0",
        "length of the slides into which longer sliding is divided, s",
    ),
];

impl Settings {
    /// These, and for what they leave open those of the file in a folder, if there is one.
    /// Errors: The file is none of settings.
    pub fn with_file(self, folder: &Path) -> Result<Self> {
        let path = folder.join(SETTINGS);
        if path.symlink_metadata().is_err() {
            return Ok(self);
        }
        confined(folder, &path)?;
        let bytes = read_bounded(&path, MAX_SETTINGS)?;
        let text = String::from_utf8(bytes).map_err(|why| RecordingError::at(&path, why))?;
        let file: Self = toml::from_str(&text).map_err(|why| {
            let place = why
                .span()
                .map(|span| text[..span.start].matches('\n').count() + 1);
            let place = place
                .map(|line| format!("line {line}: "))
                .unwrap_or_default();
            RecordingError::at(&path, format!("{place}{}", why.message()))
        })?;
        let mut all = toml::Table::try_from(file).unwrap_or_default();
        all.extend(toml::Table::try_from(self).unwrap_or_default());
        all.try_into()
            .map_err(|why: toml::de::Error| RecordingError::at(&path, why))
    }

    /// These, and what the first file says by its kind: MCAP of ours has its columns.
    pub(super) fn completed(mut self, first: &Signals) -> Self {
        if first.kind == "MCAP" {
            let has = |name: &str| Some(first.channel(name)?.0.clone());
            self.unit.get_or_insert_with(|| "counts".to_owned());
            self.pressure = self.pressure.or_else(|| has("pdc"));
            self.shear = self.shear.or_else(|| has("shear"));
        }
        self
    }

    /// The pattern of paths, if the texture is given by one.
    pub(super) fn pattern(&self) -> Option<&str> {
        self.texture
            .as_deref()
            .filter(|texture| texture.contains(['{', '*']))
    }

    /// The file of these settings: each with a line that says what it is, those that are open as comments.
    pub fn template(&self) -> String {
        let given = toml::Table::try_from(self).unwrap_or_default();
        let lines = HELP
            .iter()
            .map(|(key, example, what)| match given.get(*key) {
                Some(value) => format!("# {what}\n{key} = {value}\n"),
                None => format!("# {what}\n# {key} = {example}\n"),
            });
        let head = "# What the files of this folder do not say, for `tactus import`.\n\n";
        head.to_owned() + &lines.collect::<String>()
    }

    /// The finger, and the sensor's name.
    /// Errors: as [`Sensor::named`].
    pub(super) fn sensor(&self) -> std::result::Result<(FingerCode, String), String> {
        let name = self.finger.as_deref().map(str::trim);
        let name = name.filter(|name| !name.is_empty()).unwrap_or("my-sensor");
        Sensor::named(name).map_err(|why| format!("finger {why}"))
    }

    /// Refuses what no file can be read with.
    pub(super) fn check(&self) -> std::result::Result<(), String> {
        self.sensor()?;
        if let Some(unit) = &self.unit {
            valid_name(unit).map_err(|why| format!("unit {unit:?} {why}"))?;
        }
        if self.texture.as_ref().is_some_and(|t| t.len() > MAX_PATTERN) {
            return Err(format!(
                "--texture has more than {MAX_PATTERN} bytes; give a column, or a shorter pattern"
            ));
        }
        if let Some(pattern) = self.pattern() {
            check_pattern(pattern)?;
        }
        match self.length {
            Some(length) if !(length > 0.0 && length <= MAX_LENGTH_S) => Err(format!(
                "slides of {length} s; --length is more than 0, and {MAX_LENGTH_S} at most"
            )),
            _ => Ok(()),
        }
    }

    /// Sliding from and to, s.
    pub(super) fn window(&self) -> std::result::Result<Option<(f64, f64)>, String> {
        let Some(window) = &self.window else {
            return Ok(None);
        };
        let wrong = || format!("window {window:?} is not FROM,TO in seconds, as 0.5,3");
        let (from, to) = window.split_once(',').ok_or_else(wrong)?;
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|s| s.is_finite());
        match number(from).zip(number(to)) {
            Some((from, to)) if 0.0 <= from && from < to => Ok(Some((from, to))),
            _ => Err(wrong()),
        }
    }
}

/// What a path says of its recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Named {
    pub texture: String,
    pub session: String,
    /// Its run; empty: the file.
    pub run: String,
    /// Contact force in N, and sliding speed in mm/s.
    pub force: Option<f32>,
    pub speed: Option<f32>,
}

/// Fields of a pattern, and whether these are numbers.
const FIELDS: [(&str, bool); 6] = [
    ("texture", false),
    ("session", false),
    ("run", false),
    ("speed", true),
    ("force", true),
    ("force_mn", true),
];

fn is_number(field: &str) -> bool {
    FIELDS.contains(&(field, true))
}

impl Named {
    /// Takes the value of a field.
    fn take(&mut self, field: &str, value: &str) -> Option<()> {
        let number = || value.parse::<f32>().ok();
        match field {
            "texture" => self.texture = value.to_owned(),
            "session" => self.session = value.to_owned(),
            "run" => self.run = value.to_owned(),
            "speed" => self.speed = Some(number()?),
            "force" => self.force = Some(number()?),
            _ => self.force = Some(number()? / 1e3),
        }
        Some(())
    }
}

/// Refuses fields that no pattern has.
fn check_pattern(pattern: &str) -> std::result::Result<(), String> {
    let fields = pattern.split('{').skip(1);
    let mut fields = fields.filter_map(|rest| Some(rest.split_once('}')?.0));
    let unknown = |field: &&str| !field.is_empty() && FIELDS.iter().all(|(name, _)| name != field);
    match fields.find(unknown) {
        Some(field) => Err(format!(
            "{{{field}}} is no field of a pattern; there are {{{}}}, and * for anything",
            FIELDS.map(|(name, _)| name).join("}, {")
        )),
        None if pattern.contains("{texture}") => Ok(()),
        None => Err(format!("{pattern:?} has no {{texture}}")),
    }
}

/// Longest pattern of paths, bytes.
pub(super) const MAX_PATTERN: usize = 256;

/// A pattern of paths such as `{session}/{texture}_*.wav`, of at most [`MAX_PATTERN`] bytes. A star is anything but a
/// slash; fields and stars are as short as can be.
pub(super) struct Pattern(Vec<Part>);

enum Part {
    Letter(char),
    Star,
    Field(String),
}

impl Part {
    /// True if what it stands for may have this letter.
    fn takes(&self, letter: char) -> bool {
        match self {
            Self::Letter(own) => *own == letter,
            Self::Field(name) if is_number(name) => letter.is_ascii_digit() || letter == '.',
            Self::Star | Self::Field(_) => letter != '/',
        }
    }
}

impl Pattern {
    pub(super) fn new(pattern: &str) -> Self {
        let (mut parts, mut rest) = (Vec::new(), pattern);
        while let Some(letter) = rest.chars().next() {
            let after = &rest[letter.len_utf8()..];
            let field = if letter == '{' {
                after.split_once('}')
            } else {
                None
            };
            rest = field.map_or(after, |(_, after)| after);
            parts.push(match field {
                Some((name, _)) if !name.is_empty() => Part::Field(name.to_owned()),
                None if letter != '*' => Part::Letter(letter),
                _ => Part::Star,
            });
        }
        Self(parts)
    }

    /// The parts of a path; nothing if it is not like this.
    pub(super) fn named(&self, path: &str) -> Option<Named> {
        let letters: Vec<char> = path.chars().collect();
        let mut failed = vec![false; (self.0.len() + 1) * (letters.len() + 1)];
        let ends = self.ends(&letters, 0, 0, &mut failed)?;
        let (mut named, mut start) = (Named::default(), 0);
        // the end of the last part was found first
        for (part, end) in self.0.iter().zip(ends.into_iter().rev()) {
            if let Part::Field(name) = part {
                let value: String = letters.get(start..end)?.iter().collect();
                named.take(name, &value)?;
            }
            start = end;
        }
        Some(named).filter(|named| !named.texture.is_empty())
    }

    /// The ends of the parts from one on, the last one first, where the rest of a path is like these. What has failed
    /// once is not tried again, so that many stars take no longer than a few.
    fn ends(
        &self,
        letters: &[char],
        at: usize,
        start: usize,
        failed: &mut [bool],
    ) -> Option<Vec<usize>> {
        let Some(part) = self.0.get(at) else {
            return (start == letters.len()).then(Vec::new);
        };
        let seen = at * (letters.len() + 1) + start;
        if failed[seen] {
            return None;
        }
        let takes = letters[start..].iter().take_while(|c| part.takes(**c));
        let (least, most) = match part {
            Part::Letter(_) => (1, takes.take(1).count()),
            Part::Star => (0, takes.count()),
            Part::Field(_) => (1, takes.count()),
        };
        for length in least..=most {
            if let Some(mut ends) = self.ends(letters, at + 1, start + length, failed) {
                ends.push(start + length);
                return Some(ends);
            }
        }
        failed[seen] = true;
        None
    }
}

/// What a path says without a pattern: the folder is the texture, and one of a session above or below it; without
/// folders, the file's name without the number at its end.
pub(super) fn guessed(path: &str) -> Named {
    let mut folders: Vec<&str> = path.split('/').collect();
    let file = folders.pop().unwrap_or_default();
    let is_session = |name: &&str| {
        let letters = name.trim_end_matches(|c: char| c.is_ascii_digit() || "-_ .".contains(c));
        let words = ["", "day", "session", "sess", "s", "run", "r", "d"];
        name.ends_with(|c: char| c.is_ascii_digit())
            && words.contains(&letters.to_lowercase().as_str())
    };
    let session = folders
        .iter()
        .copied()
        .find(|f| is_session(f))
        .unwrap_or_default();
    let texture = folders.iter().rev().copied().find(|f| !is_session(f));
    let stem = || {
        let stem = file.strip_suffix(".gz").unwrap_or(file);
        let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
        let bare = stem.trim_end_matches(|c: char| c.is_ascii_digit());
        let bare = bare.trim_end_matches(['_', '-', ' ', '.', '#']);
        if bare.is_empty() { stem } else { bare }
    };
    Named {
        texture: texture.unwrap_or_else(stem).to_owned(),
        session: session.to_owned(),
        ..Named::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matched(pattern: &str, path: &str) -> Option<Named> {
        Pattern::new(pattern).named(path)
    }

    #[test]
    fn paths_say_texture_and_session() {
        for (path, texture, session) in [
            ("cotton/1.wav", "cotton", ""),
            ("day1/cotton/1.wav", "cotton", "day1"),
            ("cotton/2026-11-28/a.csv", "cotton", "2026-11-28"),
            ("denim_12.csv.gz", "denim", ""),
            ("007.csv", "007", ""),
        ] {
            let named = guessed(path);
            assert_eq!(
                (named.texture.as_str(), named.session.as_str()),
                (texture, session)
            );
        }
        let named = matched("{session}/*_{texture}-*.wav", "monday/x_silk-03.wav").unwrap();
        assert_eq!(
            (named.texture.as_str(), named.session.as_str()),
            ("silk", "monday")
        );
        assert_eq!(matched("{texture}/*.wav", "a/b/c.wav"), None);
        assert_eq!(matched("{texture}*.csv", "é1.csv").unwrap().texture, "é");
        let named = matched("{texture}_{session}", "a_b_c").unwrap();
        assert_eq!(
            (named.texture.as_str(), named.session.as_str()),
            ("a", "b_c")
        );
        let named = matched("{texture}_*_{speed}_{force_mn}_*.*", "0_135_40.5_500_1.csv").unwrap();
        assert_eq!(
            (named.texture.as_str(), named.speed, named.force),
            ("0", Some(40.5), Some(0.5))
        );
        let named = matched("{texture}_{speed}.csv", "raw_silk_40.csv").unwrap();
        assert_eq!(
            (named.texture.as_str(), named.speed),
            ("raw_silk", Some(40.0))
        );
        assert_eq!(matched("{texture}_{speed}.csv", "silk_fast.csv"), None);
        assert_eq!(matched("{texture}_{speed}.csv", "silk_4.5.6.csv"), None);
        assert!(
            check_pattern("{textur}_*.csv")
                .unwrap_err()
                .contains("{texture}, {session}")
        );
        assert!(
            check_pattern("{session}/*")
                .unwrap_err()
                .contains("no {texture}")
        );
        let ends = matched("x{texture}", "xsilk").unwrap();
        assert_eq!(ends.texture, "silk");
    }

    #[test]
    fn a_pattern_of_many_stars_ends() {
        let began = std::time::Instant::now();
        let stars = "{texture}".to_owned() + &"*a".repeat(120) + "b";
        assert_eq!(matched(&stars, &"a".repeat(255)), None);
        let path = "a".repeat(200) + "b";
        assert_eq!(matched(&stars, &path).unwrap().texture, "a");
        assert!(began.elapsed().as_secs() < 2);
    }

    #[test]
    fn a_template_is_read_as_it_was_written() {
        let given = Settings {
            rate: Some(999.5),
            texture: Some("{texture}/*".to_owned()),
            ..Settings::default()
        };
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(SETTINGS), given.template()).unwrap();
        assert_eq!(Settings::default().with_file(folder.path()).unwrap(), given);
        // every line that is a comment is a setting, too
        let all = Settings::default().template().replace("# r", "r");
        assert!(all.contains("\nrate = 1000.0"));
        std::fs::write(folder.path().join(SETTINGS), "rate = 1\nrat = 2").unwrap();
        let why = Settings::default()
            .with_file(folder.path())
            .unwrap_err()
            .to_string();
        assert!(why.contains("line 2") && why.contains("rat"), "{why}");
    }
}
