//! A row for each slide as Apache Parquet: its features, and what they make of the textures of a table.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;

use anyhow::Context as _;
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type,
};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;
use serde_json::json;
use tactus_core::explorer::{self, Config};
use tactus_core::features::{FEATURE_STEPS, Movement, PDC_UNIT, PropertySet};
use tactus_core::table::{Action, Table};
use tactus_core::wire::{Command, Event, SlideReport};
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::MeasuredSlide;
use tactus_lab::eval::evaluate::{MAX_TEXTURES, Method, explorer};

use crate::cmd::device::log::{self, Line, TableParts};
use crate::cmd::textures::of_one_finger;

/// The columns, in the order in which [`fill`] fills them.
const SCHEMA: &str = "
message slide {
  optional int32 exploration;
  optional double time_s;
  optional binary texture (STRING);
  required int32 slide;
  optional binary finger (STRING);
  optional binary lot (STRING);
  optional float force_n;
  optional float speed_mm_s;
  optional float traction_n;
  optional float roughness;
  required boolean roughness_is_bound;
  optional float fineness;
  required float background;
  optional float pdc_mean;
  optional float pdc_sd;
  required group ln_bands (LIST) { repeated group list { required float element; } }
  optional binary most_likely (STRING);
  optional float probability;
  required group posterior (MAP) { repeated group key_value { required binary key (STRING); required float value; } }
}";

/// What the numbers of a column are in.
const UNITS: [(&str, &str); 12] = [
    ("time_s", "s since the probe booted, by its own clock"),
    ("force_n", "N"),
    ("speed_mm_s", "mm/s"),
    ("traction_n", "N"),
    ("roughness", "ln of a power over the still finger's"),
    ("fineness", "ln of a frequency in Hz"),
    ("background", "counts^2"),
    ("pdc_mean", "counts"),
    ("pdc_sd", "counts"),
    (
        "ln_bands",
        "ln of counts^2 per bin, bands from 17 to 1000 Hz in equal ratios",
    ),
    ("probability", "0 to 1"),
    ("posterior", "0 to 1, without those below a millionth"),
];
/// Below it a probability is not told, as on the link.
const LEAST: f32 = 1e-6;

/// A slide.
struct Row {
    exploration: Option<i32>,
    time_s: Option<f64>,
    texture: Option<String>,
    slide: u32,
    finger: Option<String>,
    lot: Option<String>,
    movement: Option<Movement>,
    measured: SlideReport,
    posterior: Vec<(String, f32)>,
}

/// What holds for all rows.
#[derive(Default)]
struct About {
    finger: Option<String>,
    table: Option<String>,
}

impl About {
    fn table(&mut self, table: Table<'_>) {
        let about = json!({
            "textures": table.textures(),
            "finger": table.finger().to_string(),
            "calibrated": table.calibrated(),
            "checksum": format!("{:08x}", table.crc()),
        });
        self.table = Some(about.to_string());
    }
}

/// The slides of a folder; with a table, what each of them alone makes of its textures.
pub(super) fn recordings(
    to: impl Write + Send,
    set: &RecordingSet,
    measured: &[Vec<MeasuredSlide>],
    table: Option<Table<'_>>,
) -> anyhow::Result<()> {
    let (finger, _) = set.finger()?;
    let mut about = About {
        finger: Some(finger.to_string()),
        table: None,
    };
    let mut judge = None;
    if let Some(table) = table {
        of_one_finger(set, table)?;
        about.table(table);
        judge = Some(Judge::new(table, measured)?);
    }
    let mut rows = Vec::new();
    for (index, (texture, measured)) in set.textures().iter().zip(measured).enumerate() {
        for (key, slide) in set.slides(index).iter().zip(measured) {
            let measured = SlideReport::from(&slide.measurement);
            let posterior = judge.as_mut().map(|judge| judge.posterior(slide));
            rows.push(Row {
                exploration: None,
                time_s: None,
                texture: Some(texture.name.clone()),
                slide: slide.number,
                finger: Some(key.labels.finger.to_string()),
                lot: Some(key.labels.lot.clone()),
                movement: Some(slide.movement),
                measured,
                posterior: posterior.transpose()?.unwrap_or_default(),
            });
        }
    }
    write(to, set.folder(), &rows, &about)
}

/// What one slide says of the textures of a table.
struct Judge<'b> {
    table: Table<'b>,
    explorer: Box<explorer::Explorer<'b, MAX_TEXTURES>>,
}

impl<'b> Judge<'b> {
    fn new(table: Table<'b>, measured: &[Vec<MeasuredSlide>]) -> anyhow::Result<Self> {
        let measures = measured.iter().flatten().fold(PropertySet::ALL, |set, s| {
            set.and(s.measurement.properties.measured())
        });
        let method = Method::of(explorer::Method::of(table.contents()));
        let config = Config {
            method: method.method(),
            strategy: method.strategy(),
            ..Config::default()
        };
        let explorer = explorer(table.as_bytes(), measures, config, None)?;
        Ok(Self { table, explorer })
    }

    /// Nothing, where the table does not have the movement.
    fn posterior(&mut self, slide: &MeasuredSlide) -> anyhow::Result<Vec<(String, f32)>> {
        let mut known = (0..).zip(self.table.movements());
        let at = known.find_map(|(at, other)| (other == slide.movement).then_some(at));
        let Some(movement) = at else {
            return Ok(Vec::new());
        };
        let property = None;
        self.explorer.restart();
        let action = Action { movement, property };
        self.explorer
            .observe(action, &(&slide.measurement).into())
            .with_context(|| format!("slide {}", slide.number))?;
        let names = self.table.names().map(str::to_owned);
        Ok(likely(names, self.explorer.posterior()))
    }
}

/// The textures that are not out of the question.
fn likely(names: impl Iterator<Item = String>, posterior: &[f32]) -> Vec<(String, f32)> {
    let all = names.zip(posterior.iter().copied());
    all.filter(|(_, p)| *p >= LEAST).collect()
}

/// The slides of a session.
pub(super) fn log(to: impl Write + Send, from: &Path) -> anyhow::Result<()> {
    let mut session = Session::default();
    log::read(from, |line| session.line(&line)).with_context(|| from.display().to_string())?;
    write(to, from, &session.rows, &session.about)
}

#[derive(Default)]
struct Session {
    rows: Vec<Row>,
    about: About,
    parts: TableParts,
    names: Vec<String>,
    explorations: i32,
    /// of the last slide of this exploration
    last: u8,
    movement: Option<Movement>,
    training: Option<String>,
}

impl Session {
    fn line(&mut self, line: &Line<'_>) {
        match line {
            Line::Session { .. } => {}
            Line::Command(command) => match command.as_ref().as_ref() {
                Command::Train(train) => self.training = Some(train.name.to_string()),
                Command::Identify(_) | Command::Verify(_) => self.last = u8::MAX,
                _ => {}
            },
            Line::Report(report) => self.event(report.at_ms, &report.event),
        }
    }

    fn event(&mut self, at_ms: u32, event: &Event) {
        match event {
            Event::Booted { finger, .. } => self.about.finger = Some(finger.to_string()),
            Event::Status(status) => self.about.finger = Some(status.finger.to_string()),
            Event::TablePart {
                offset,
                length,
                bytes,
            } => {
                let whole = self.parts.take(*offset, *length, bytes);
                if let Some(table) = whole.as_deref().and_then(|b| Table::read(b).ok()) {
                    self.names = table.names().map(str::to_owned).collect();
                    self.about.table(table);
                }
            }
            Event::Chosen { movement, .. } => self.movement = Some(*movement),
            Event::SlideReport {
                slide,
                observed,
                posterior,
                ..
            } => {
                // a handheld's user begins without a command
                if *slide <= self.last {
                    self.explorations += 1;
                }
                self.last = *slide;
                let named = |at: usize| match self.names.get(at) {
                    Some(name) => name.clone(),
                    None => format!("texture {}", at + 1),
                };
                let posterior = likely((0..posterior.len()).map(named), posterior);
                let exploration = Some(self.explorations);
                let movement = self.movement;
                self.add(at_ms, exploration, None, *slide, movement, observed);
                if let Some(row) = self.rows.last_mut() {
                    row.posterior = posterior;
                }
            }
            Event::TrainingSlide {
                movement,
                trial,
                observed,
                ..
            } => {
                let texture = self.training.clone();
                self.add(at_ms, None, texture, *trial, Some(*movement), observed);
            }
            _ => {}
        }
    }

    fn add(
        &mut self,
        at_ms: u32,
        exploration: Option<i32>,
        texture: Option<String>,
        slide: u8,
        movement: Option<Movement>,
        measured: &SlideReport,
    ) {
        self.rows.push(Row {
            exploration,
            time_s: Some(f64::from(at_ms) * 1e-3),
            texture,
            slide: slide.into(),
            finger: self.about.finger.clone(),
            lot: None,
            movement,
            measured: measured.clone(),
            posterior: Vec::new(),
        });
    }
}

/// Writes one group of rows, and what is said of all.
fn write(
    mut to: impl Write + Send,
    from: &Path,
    rows: &[Row],
    about: &About,
) -> anyhow::Result<()> {
    let units = serde_json::Map::from_iter(UNITS.map(|(of, unit)| (of.to_owned(), json!(unit))));
    let said = [
        ("tactus", Some(env!("CARGO_PKG_VERSION").to_owned())),
        ("from", Some(from.display().to_string())),
        ("finger", about.finger.clone()),
        ("table", about.table.clone()),
        ("units", Some(json!(units).to_string())),
    ];
    let said = said.into_iter().filter(|(_, value)| value.is_some());
    let said = said.map(|(key, value)| KeyValue::new(key.to_owned(), value));
    let properties = WriterProperties::builder().set_key_value_metadata(Some(said.collect()));
    let schema = Arc::new(parse_message_type(SCHEMA)?);
    let mut file = SerializedFileWriter::new(&mut to, schema, Arc::new(properties.build()))?;
    fill(Group(file.next_row_group()?, rows))?;
    file.close()?;
    Ok(to.flush()?)
}

/// The columns of [`SCHEMA`], in its order.
fn fill<W: Write + Send>(mut group: Group<'_, '_, W>) -> anyhow::Result<()> {
    let text = |text: &Option<String>| text.as_deref().map(ByteArray::from);
    let property = |at: usize| move |row: &Row| row.measured.properties[at];
    let pressure = |at: usize| {
        move |row: &Row| {
            let steps = f32::from(row.measured.pressure?[at]);
            Some(steps / FEATURE_STEPS * PDC_UNIT)
        }
    };
    let best = |row: &Row| {
        let best = row.posterior.iter().max_by(|(_, a), (_, b)| a.total_cmp(b));
        best.cloned()
    };
    group.optional::<Int32Type>(|row| row.exploration)?;
    group.optional::<DoubleType>(|row| row.time_s)?;
    group.optional::<ByteArrayType>(|row| text(&row.texture))?;
    group.required::<Int32Type>(|row| row.slide.cast_signed())?;
    group.optional::<ByteArrayType>(|row| text(&row.finger))?;
    group.optional::<ByteArrayType>(|row| text(&row.lot))?;
    group.optional::<FloatType>(|row| Some(row.movement?.force_n()))?;
    group.optional::<FloatType>(|row| Some(row.movement?.speed_mm_s()))?;
    group.optional::<FloatType>(property(0))?;
    group.optional::<FloatType>(property(1))?;
    group.required::<BoolType>(|row| row.measured.roughness_is_bound)?;
    group.optional::<FloatType>(property(2))?;
    group.required::<FloatType>(|row| row.measured.background)?;
    group.optional::<FloatType>(pressure(0))?;
    group.optional::<FloatType>(pressure(1))?;
    group.list::<FloatType>(|row| {
        let bands = row.measured.bands.iter();
        bands.map(|band| f32::from(*band) / FEATURE_STEPS).collect()
    })?;
    group.optional::<ByteArrayType>(|row| text(&best(row).map(|(name, _)| name)))?;
    group.optional::<FloatType>(|row| best(row).map(|(_, p)| p))?;
    group.list::<ByteArrayType>(|row| {
        let names = row.posterior.iter();
        names.map(|(name, _)| ByteArray::from(&name[..])).collect()
    })?;
    group.list::<FloatType>(|row| row.posterior.iter().map(|(_, p)| *p).collect())?;
    group.0.close()?;
    Ok(())
}

/// Columns, one after the other.
struct Group<'a, 'r, W: Write>(SerializedRowGroupWriter<'a, W>, &'r [Row]);

impl<W: Write + Send> Group<'_, '_, W> {
    fn column<T: DataType>(
        &mut self,
        values: &[T::T],
        defined: Option<&[i16]>,
        repeated: Option<&[i16]>,
    ) -> anyhow::Result<()> {
        let column = self.0.next_column()?;
        let mut column = column.context("a column more than the schema has")?;
        column.typed::<T>().write_batch(values, defined, repeated)?;
        Ok(column.close()?)
    }

    fn required<T: DataType>(&mut self, of: impl Fn(&Row) -> T::T) -> anyhow::Result<()> {
        let values: Vec<T::T> = self.1.iter().map(of).collect();
        self.column::<T>(&values, None, None)
    }

    fn optional<T: DataType>(&mut self, of: impl Fn(&Row) -> Option<T::T>) -> anyhow::Result<()> {
        let values: Vec<Option<T::T>> = self.1.iter().map(of).collect();
        let defined: Vec<i16> = values.iter().map(|v| v.is_some().into()).collect();
        let values: Vec<T::T> = values.into_iter().flatten().collect();
        self.column::<T>(&values, Some(&defined), None)
    }

    /// Repeated values: the first of a row has level 0 of repetition, and a row without any is not defined.
    fn list<T: DataType>(&mut self, of: impl Fn(&Row) -> Vec<T::T>) -> anyhow::Result<()> {
        let (mut values, mut defined, mut repeated) = (Vec::new(), Vec::new(), Vec::new());
        for row in self.1 {
            let of_row = of(row);
            defined.extend((0..of_row.len().max(1)).map(|_| i16::from(!of_row.is_empty())));
            repeated.extend((0..of_row.len().max(1)).map(|n| i16::from(n > 0)));
            values.extend(of_row);
        }
        self.column::<T>(&values, Some(&defined), Some(&repeated))
    }
}
