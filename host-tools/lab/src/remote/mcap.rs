//! An MCAP file that `tactus convert` or `tactus device log` wrote: a session, or recordings.

use std::collections::HashMap;

use mcap::records::{Record, op};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{McapError, parse_record};
use serde::Deserialize;
use serde_json::{Value, json};
use tactus_core::features::{FEATURE_STEPS, Movement};
use tactus_core::table::Action;
use tactus_core::wire::{Event, SlideReport};

use super::recorded::{Opened, Recorded, RecordedSlide, Stream};
use super::replay::Replay;
use crate::data::recording::PAC_RATE_HZ;
use tactus_link::log::Line;

/// What an attachment with the table in use is called.
pub const TABLE: &str = "table.tact";
/// How bad a sentence of `/log` is that tells why something came to nothing.
const WARNING: u64 = 3;

/// Why an MCAP file cannot be shown, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// It does not begin as one.
    #[error(
        "this is no MCAP file: `tactus convert session.jsonl --mcap FILE` or `tactus convert recordings --mcap FILE` writes one"
    )]
    Other,
    /// Its end is missing.
    #[error("the MCAP file is cut off: copy it again, or convert again what it was made from")]
    Short,
    /// Something in it is wrong.
    #[error(
        "the MCAP file is damaged ({0}): copy it again, or convert again what it was made from"
    )]
    Damaged(String),
    /// Of another program.
    #[error(
        "its channels are not those of Tactus ({0}): only what `tactus convert --mcap` and `tactus device log --mcap` write can be shown"
    )]
    Foreign(String),
    /// Compressed, which ours never is.
    #[error(
        "it is compressed ({0}): only what `tactus convert --mcap` and `tactus device log --mcap` write can be shown, which is not compressed"
    )]
    Compressed(String),
    /// A session whose table is not in it.
    #[error(
        "no table of the probe is in this MCAP file: convert the session's log again with this version of tactus, or drop the log itself"
    )]
    NoTable,
    /// Nothing was decided.
    #[error(
        "nothing was explored, verified or recorded in this MCAP file: `tactus device identify --log FILE` writes a log to convert"
    )]
    Nothing,
}

impl From<McapError> for FileError {
    fn from(why: McapError) -> Self {
        match why {
            McapError::UnexpectedEof | McapError::UnexpectedEoc => Self::Short,
            McapError::UnsupportedCompression(name) => Self::Compressed(name),
            why => Self::Damaged(why.to_string()),
        }
    }
}

/// What is in it.
///
/// # Errors
/// See [`FileError`].
pub(super) fn read(bytes: &[u8]) -> Result<Opened, FileError> {
    if !bytes.starts_with(mcap::MAGIC) {
        return Err(FileError::Other);
    }
    let options = LinearReaderOptions::default()
        .with_record_length_limit(bytes.len())
        .with_validate_chunk_crcs(true);
    let (mut reader, mut rest) = (LinearReader::new_with_options(options), bytes);
    let mut content = Content::default();
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(wanted) => {
                let (now, later) = rest.split_at(wanted.min(rest.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                rest = later;
            }
            LinearReadEvent::Record {
                opcode: opcode @ (op::CHANNEL | op::MESSAGE | op::ATTACHMENT),
                data,
            } => content.take(parse_record(opcode, data)?)?,
            LinearReadEvent::Record { .. } => {}
        }
    }
    content.end()
}

/// A message of `/pac`, `/pdc` or `/shear`.
#[derive(Deserialize)]
struct Sample {
    #[serde(alias = "mn")]
    counts: i16,
    #[serde(default)]
    still: bool,
}

/// What has been read so far.
#[derive(Default)]
struct Content {
    channels: HashMap<u16, String>,
    session: Replay,
    /// whether there was something that only a session has
    decided: bool,
    /// of the slide under way
    action: Option<Action>,
    features: Option<SlideReport>,
    still: Vec<i16>,
    recorded: Recorded,
    /// when the last samples were: P_DC, shear
    before: [Option<u64>; 2],
}

impl Content {
    fn take(&mut self, record: Record<'_>) -> Result<(), FileError> {
        match record {
            Record::Channel(channel) => {
                self.channels.insert(channel.id, channel.topic);
            }
            Record::Attachment { header, data, .. } if header.name == TABLE => {
                self.session.table(data.into_owned());
            }
            Record::Message { header, data } => {
                let topic = self.channels.get(&header.channel_id).cloned();
                let topic = topic.unwrap_or_default();
                self.message(&topic, header.log_time, &data)
                    .map_err(|why| FileError::Damaged(format!("{topic}: {why}")))?;
            }
            _ => {}
        }
        Ok(())
    }

    fn message(&mut self, topic: &str, at_ns: u64, data: &[u8]) -> serde_json::Result<()> {
        match topic {
            "/pac" | "/pdc" | "/shear" => self.sample(topic, at_ns, &serde_json::from_slice(data)?),
            "/movement" => self.movement(&serde_json::from_slice(data)?),
            "/features" => {
                let measured = measured(&serde_json::from_slice(data)?);
                if let Some(slide) = self.recorded.slides.last_mut() {
                    slide.measured = Ok(measured.clone());
                }
                self.features = Some(measured);
            }
            "/log" => self.sentence(at_ns, &serde_json::from_slice(data)?),
            // what a log has is read as a log is
            "/request" => {
                if let Line::Command(command) = serde_json::from_slice(data)? {
                    self.session.asked(command.into_owned());
                }
            }
            "/choice" => {
                let choice: Value = serde_json::from_slice(data)?;
                self.decided = true;
                let movement = self.movement_of(&choice["action"]);
                if let Some(movement) = movement {
                    let chosen = json!({"Chosen": {
                        "slide": choice["slide"], "movement": movement, "action": choice["action"], "expected": choice["expected"],
                    }});
                    self.event(at_ns, &chosen)?;
                }
            }
            "/posterior" => self.posterior(at_ns, &serde_json::from_slice(data)?),
            "/verification" => {
                let told: Value = serde_json::from_slice(data)?;
                self.decided = true;
                let verified = json!({"Verified": {"slides": told["slides"], "now": told}});
                self.event(at_ns, &verified)?;
            }
            "/verdict" => {
                let told: Value = serde_json::from_slice(data)?;
                self.decided = true;
                self.event(at_ns, &json!({ "Verdict": told }))?;
            }
            _ => {}
        }
        Ok(())
    }

    /// An event as a log has it.
    fn event(&mut self, at_ns: u64, event: &Value) -> serde_json::Result<()> {
        let at_ms = (at_ns / 1_000_000) as u32;
        let line = json!({"report": {"number": 0, "at_ms": at_ms, "event": event}}).to_string();
        if let Line::Report(report) = serde_json::from_slice(line.as_bytes())? {
            let event = report.into_owned().event;
            if let Event::Chosen { action, .. } = &event {
                self.action = Some(*action);
            }
            self.session.said(at_ms, event);
        }
        Ok(())
    }

    fn movement_of(&self, action: &Value) -> Option<Value> {
        let at = action["movement"].as_u64()?;
        let movement = self.session.in_use()?.movement(at as u8)?;
        serde_json::to_value(movement).ok()
    }

    fn posterior(&mut self, at_ns: u64, told: &Value) {
        let (Some(action), Some(observed)) = (self.action, self.features.take()) else {
            return;
        };
        let Some(table) = self.session.in_use() else {
            return;
        };
        let of = |name: &str| told["all"][name].as_f64().unwrap_or_default() as f32;
        let report = Event::SlideReport {
            slide: told["slide"].as_u64().unwrap_or_default() as u8,
            action,
            observed,
            posterior: table.names().map(of).collect(),
        };
        self.session.said((at_ns / 1_000_000) as u32, report);
    }

    fn sentence(&mut self, at_ns: u64, told: &Value) {
        if told["level"].as_u64() < Some(WARNING) {
            return;
        }
        let said = told["message"].as_str().unwrap_or_default();
        match self.recorded.slides.last_mut() {
            Some(slide) => slide.measured = Err(said.to_owned()),
            None => self.session.refused((at_ns / 1_000_000) as u32, said),
        }
    }

    fn sample(&mut self, topic: &str, at_ns: u64, sample: &Sample) {
        if sample.still {
            self.still.push(sample.counts);
            return;
        }
        let Some(slide) = self.recorded.slides.last_mut() else {
            // a session's, in which no slide begins with a movement
            self.still.clear();
            return;
        };
        let (stream, before) = match topic {
            "/pac" => {
                slide.pac.push(sample.counts);
                return;
            }
            "/pdc" => (&mut slide.pdc, &mut self.before[0]),
            _ => (&mut slide.shear_mn, &mut self.before[1]),
        };
        if let Some(before) = before.replace(at_ns).filter(|_| stream.samples.len() == 1) {
            let step = at_ns.saturating_sub(before).max(1);
            stream.rate_hz = (1e9 / step as f64).round() as u32;
        }
        stream.samples.push(sample.counts);
    }

    /// A slide of recordings begins.
    fn movement(&mut self, told: &Value) {
        let name = told["texture"].as_str().unwrap_or_default();
        let number = |field: &str| told[field].as_f64().unwrap_or_default() as f32;
        let Ok(movement) = Movement::from_si(number("force_n"), number("speed_mm_s")) else {
            return;
        };
        let names = &mut self.recorded.names;
        let texture = names.iter().position(|known| known == name);
        let texture = texture.unwrap_or_else(|| {
            names.push(name.to_owned());
            names.len() - 1
        });
        let stream = || Stream {
            rate_hz: PAC_RATE_HZ,
            samples: Vec::new(),
        };
        let pac = std::mem::take(&mut self.still);
        self.recorded.slides.push(RecordedSlide {
            texture,
            number: number("slide") as u32,
            movement,
            still: pac.len(),
            pac,
            pdc: stream(),
            shear_mn: stream(),
            measured: Err("its features are not in the file".to_owned()),
        });
    }

    fn end(self) -> Result<Opened, FileError> {
        if !self.recorded.slides.is_empty() {
            return Ok(Opened::Recordings(self.recorded));
        }
        let ours = |topic: &String| matches!(topic.as_str(), "/choice" | "/movement");
        if !self.channels.values().any(ours) {
            let mut topics: Vec<String> = self.channels.into_values().collect();
            topics.sort();
            topics.truncate(8);
            return Err(FileError::Foreign(match topics.is_empty() {
                true => "it has none".to_owned(),
                false => topics.join(", "),
            }));
        }
        match (self.decided, self.session.in_use().is_some()) {
            (false, _) => Err(FileError::Nothing),
            (true, false) => Err(FileError::NoTable),
            (true, true) => Ok(Opened::Session(self.session.end())),
        }
    }
}

/// The features of a slide.
fn measured(told: &Value) -> SlideReport {
    let number = |value: &Value| value.as_f64().map(|number| number as f32);
    let list = |field: &str| told[field].as_array().map_or(&[][..], Vec::as_slice);
    let steps = |value: &Value| (number(value).unwrap_or_default() * FEATURE_STEPS).round() as i16;
    let mut report = SlideReport {
        properties: ["traction_n", "roughness", "fineness"].map(|field| number(&told[field])),
        roughness_is_bound: false,
        background: 0.0,
        bands: Default::default(),
        pressure: None,
        pace: None,
    };
    for band in list("ln_bands") {
        // of more than there are, nothing is known
        let _ = report.bands.push(steps(band));
    }
    if let [mean, deviation] = list("ln_pressure") {
        report.pressure = Some([steps(mean), steps(deviation)]);
    }
    report
}
