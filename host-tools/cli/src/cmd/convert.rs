//! `tactus convert`: a session's log as MCAP: messages in JSON, each channel with its schema.

use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, WriteOptions};
use serde_json::{Map, Value, json};
use tactus_core::features::{Block, FEATURE_STEPS};
use tactus_core::table::Table;
use tactus_core::wire::{Event, Report, SlideReport};
use tactus_lab::data::recording::PAC_RATE_HZ;
use tactus_link::log::{self, Line, TableParts};

use super::table_file::{Force, Output, is_pipe, opened, spare_input};

/// Convert a session's log to MCAP, for Foxglove and PlotJuggler
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus convert session.jsonl --mcap session.mcap    a log of `tactus device ... --log session.jsonl`

The book lists the channels.")]
pub(crate) struct Args {
    /// The log; "-" reads standard input
    from: PathBuf,
    /// The file to write; "-" writes to standard output
    #[arg(long, value_name = "FILE")]
    mcap: PathBuf,
    #[command(flatten)]
    force: Force,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let Args { from, mcap, force } = args;
    spare_input(mcap, from)?;
    let log = convert(Output::create(mcap, *force)?, from)?;
    let written = log.failed.and_then(|()| log.to.finish());
    written.with_context(|| mcap.display().to_string())?;
    if !is_pipe(mcap) {
        let bytes = std::fs::metadata(mcap)?.len();
        writeln!(out, "{}: {bytes} bytes", mcap.display())?;
    }
    Ok(())
}

/// The channels, each with the fields of its messages, `name:kind` in JSON's words.
const CHANNELS: [(&str, &str); 13] = [
    ("/pac", "counts:integer still:boolean"),
    ("/pdc", "counts:integer"),
    ("/shear", "mn:integer"),
    (
        "/rig",
        "force_mn:integer lever_steps:integer stage_mm:number speed_mm_s:number current_ma:integer",
    ),
    ("/phase", "phase:string"),
    (
        "/features",
        "slide:integer traction_n:number roughness:number fineness:number ln_bands:array ln_pressure:array",
    ),
    (
        "/posterior",
        "slide:integer most_likely:string probability:number all:object",
    ),
    (
        "/choice",
        "slide:integer force_n:number speed_mm_s:number action:object expected:array",
    ),
    (
        "/verdict",
        "name:string probability:number sure:boolean unknown:boolean changed:boolean slides:integer",
    ),
    (
        "/verification",
        "slides:integer score:number limit:number answer:string",
    ),
    ("/fault", "fault:string remedy:string"),
    ("/request", "command:object"),
    (LOG, ""),
];
/// Sentences, as Foxglove's panel of logs shows them.
const LOG: &str = "/log";
const INFO: u8 = 2;
const WARNING: u8 = 3;
const ERROR: u8 = 4;

struct Writer {
    mcap: mcap::Writer<NoSeek<Output>>,
    channels: BTreeMap<&'static str, (u16, u32)>,
}

impl Writer {
    fn new(to: Output, of: &Path) -> anyhow::Result<Self> {
        let library = concat!("tactus ", env!("CARGO_PKG_VERSION"));
        // standard output cannot be sought in
        let options = WriteOptions::new().compression(None).library(library);
        let options = options.disable_seeking(true);
        let mut mcap = options.create(NoSeek::new(to))?;
        let mut channels = BTreeMap::new();
        for (topic, fields) in CHANNELS {
            let (name, schema) = if topic == LOG {
                ("foxglove.Log".to_owned(), foxglove_log())
            } else {
                (format!("tactus{}", topic.replace('/', ".")), schema(fields))
            };
            let schema = mcap.add_schema(&name, "jsonschema", schema.to_string().as_bytes())?;
            let channel = mcap.add_channel(schema, topic, "json", &BTreeMap::new())?;
            channels.insert(topic, (channel, 0));
        }
        let metadata = [
            ("from", of.display().to_string()),
            (
                "time",
                "since the probe booted, by its own clock".to_owned(),
            ),
        ];
        let metadata = metadata.map(|(key, value)| (key.to_owned(), value));
        mcap.write_metadata(&Metadata {
            name: "tactus".to_owned(),
            metadata: metadata.into(),
        })?;
        Ok(Self { mcap, channels })
    }

    fn tell(&mut self, topic: &'static str, at_ns: u64, message: &Value) -> anyhow::Result<()> {
        let (channel_id, sequence) = self.channels.get_mut(topic).context(topic)?;
        let header = MessageHeader {
            channel_id: *channel_id,
            sequence: *sequence,
            log_time: at_ns,
            publish_time: at_ns,
        };
        *sequence = sequence.wrapping_add(1);
        let message = serde_json::to_vec(message)?;
        Ok(self.mcap.write_to_known_channel(&header, &message)?)
    }

    /// Samples from an instant on, so many a second; the instant of the next one.
    fn samples(
        &mut self,
        topic: &'static str,
        from_ns: u64,
        rate_hz: u32,
        samples: &[i16],
        message: impl Fn(i16) -> Value,
    ) -> anyhow::Result<u64> {
        let at = |n: usize| from_ns + n as u64 * 1_000_000_000 / u64::from(rate_hz);
        for (n, &sample) in samples.iter().enumerate() {
            self.tell(topic, at(n), &message(sample))?;
        }
        Ok(at(samples.len()))
    }

    fn log(&mut self, at_ns: u64, level: u8, message: &str) -> anyhow::Result<()> {
        let (sec, nsec) = (at_ns / 1_000_000_000, at_ns % 1_000_000_000);
        let timestamp = json!({"sec": sec, "nsec": nsec});
        let message = json!({
            "timestamp": timestamp, "level": level, "message": message, "name": "tactus", "file": "", "line": 0
        });
        self.tell(LOG, at_ns, &message)
    }

    fn features(&mut self, at_ns: u64, slide: u32, observed: &SlideReport) -> anyhow::Result<()> {
        let [traction, roughness, fineness] = observed.properties;
        let of = |steps: &i16| f32::from(*steps) / FEATURE_STEPS;
        let ln_bands: Vec<f32> = observed.bands.iter().map(of).collect();
        let mut message = json!({
            "slide": slide, "traction_n": traction, "roughness": roughness, "fineness": fineness, "ln_bands": ln_bands
        });
        if let Some(pressure) = observed.pressure {
            message["ln_pressure"] = json!(pressure.each_ref().map(of));
        }
        self.tell("/features", at_ns, &message)
    }

    /// The table in use from now on, as a file beside the messages.
    fn table(&mut self, at_ns: u64, table: &[u8]) -> anyhow::Result<()> {
        Ok(self.mcap.attach(&Attachment {
            log_time: at_ns,
            create_time: at_ns,
            name: "table.tact".to_owned(),
            media_type: "application/octet-stream".to_owned(),
            data: table.into(),
        })?)
    }

    fn finish(mut self) -> anyhow::Result<()> {
        self.mcap.finish()?;
        Ok(self.mcap.into_inner().into_inner().finish()?)
    }
}

/// The schema of an object with such fields; what a rig does not measure is null.
fn schema(fields: &str) -> Value {
    let fields = fields.split(' ').filter_map(|field| field.split_once(':'));
    let properties = fields.map(|(name, kind)| {
        let kind = match kind {
            "number" => json!(["number", "null"]),
            kind => json!(kind),
        };
        (name.to_owned(), json!({ "type": kind }))
    });
    let properties: Map<String, Value> = properties.collect();
    json!({"type": "object", "properties": properties})
}

/// foxglove.Log as Foxglove's documentation has it.
fn foxglove_log() -> Value {
    let number = json!({"type": "integer"});
    let text = json!({"type": "string"});
    json!({
        "title": "foxglove.Log",
        "type": "object",
        "properties": {
            "timestamp": {"type": "object", "title": "time", "properties": {"sec": number, "nsec": number}},
            "level": number, "message": text, "name": text, "file": text, "line": number
        }
    })
}

fn convert(to: Output, from: &Path) -> anyhow::Result<Converted> {
    let name = || from.display().to_string();
    let mut log = Converted::new(to, from)?;
    log::read(opened(from).with_context(name)?, |line| {
        if log.failed.is_ok() {
            log.failed = log.line(&line);
        }
    })
    .with_context(name)?;
    Ok(log)
}

struct Converted {
    to: Writer,
    now_ns: u64,
    parts: TableParts,
    /// of the table in use, as far as it was read
    names: Vec<String>,
    table: Vec<u8>,
    /// when the next sample of this kind is, still or not: P_AC, shear
    next: Option<(bool, u64, u64)>,
    /// number of the block that comes next
    number: u16,
    failed: anyhow::Result<()>,
}

impl Converted {
    fn new(to: Output, from: &Path) -> anyhow::Result<Self> {
        Ok(Self {
            to: Writer::new(to, from)?,
            now_ns: 0,
            parts: TableParts::default(),
            names: Vec::new(),
            table: Vec::new(),
            next: None,
            number: 0,
            failed: Ok(()),
        })
    }

    fn line(&mut self, line: &Line<'_>) -> anyhow::Result<()> {
        match line {
            Line::Session { tactus, port, .. } => {
                let by = format!("logged by tactus {tactus} at {port}");
                self.to.log(0, INFO, &by)
            }
            Line::Command(command) => {
                let message = json!({ "command": command.as_ref() });
                self.to.tell("/request", self.now_ns, &message)
            }
            Line::Report(report) => {
                self.now_ns = u64::from(report.at_ms) * 1_000_000;
                self.report(report)
            }
        }
    }

    fn report(&mut self, report: &Report) -> anyhow::Result<()> {
        let now = self.now_ns;
        match &report.event {
            Event::Live(live) => {
                let message = json!({
                    "force_mn": live.force_mn,
                    "lever_steps": live.steps,
                    "stage_mm": f64::from(live.stage_um) * 1e-3,
                    "speed_mm_s": f64::from(live.speed_um_s) * 1e-3,
                    "current_ma": live.current_ma,
                });
                self.to.tell("/rig", now, &message)
            }
            Event::Block(block) => self.block(block),
            Event::Pdc(counts) => {
                let before = counts.len() as u64 * 1_000_000_000 / u64::from(PAC_RATE_HZ);
                let from = now.saturating_sub(before);
                let message = |counts| json!({ "counts": counts });
                let end = self.to.samples("/pdc", from, PAC_RATE_HZ, counts, message);
                end.map(|_| ())
            }
            Event::Phase(phase) => self.to.tell("/phase", now, &json!({ "phase": phase })),
            Event::TablePart {
                offset,
                length,
                bytes,
            } => {
                if let Some(bytes) = self.parts.take(*offset, *length, bytes) {
                    let table = Table::read(&bytes);
                    let names = table.map(|table| table.names().map(str::to_owned).collect());
                    self.names = names.unwrap_or_default();
                    // it is read again before each request that needs it
                    if self.table != bytes {
                        self.to.table(now, &bytes)?;
                        self.table = bytes;
                    }
                }
                Ok(())
            }
            Event::Chosen {
                slide,
                movement,
                action,
                expected,
            } => {
                let (force_mn, um_s) = (movement.force_mn(), movement.speed_um_s());
                let [force_n, speed_mm_s] = [force_mn.into(), um_s.into()].map(|x: f64| x * 1e-3);
                let message = json!({
                    "slide": slide, "force_n": force_n, "speed_mm_s": speed_mm_s, "action": action, "expected": expected
                });
                self.to.tell("/choice", now, &message)
            }
            Event::SlideReport {
                slide,
                observed,
                posterior,
                ..
            } => {
                self.to.features(now, u32::from(*slide), observed)?;
                self.posterior(*slide, posterior)
            }
            Event::TrainingSlide {
                trial, observed, ..
            } => self.to.features(now, u32::from(*trial), observed),
            Event::Verdict(verdict) => self.to.tell("/verdict", now, &json!(verdict)),
            Event::Verified { slides, now: told } => {
                let message = json!({
                    "slides": slides, "score": told.score, "limit": told.limit, "answer": told.answer
                });
                self.to.tell("/verification", now, &message)
            }
            Event::Fault(fault) => {
                let (name, remedy) = (fault.to_string(), fault.recovery());
                self.to.log(now, ERROR, &format!("{name}: {remedy}"))?;
                let message = json!({"fault": name, "remedy": remedy});
                self.to.tell("/fault", now, &message)
            }
            Event::Refused { why, .. } | Event::Rejected { why, .. } | Event::Trouble(why) => {
                self.to.log(now, WARNING, &why.to_string())
            }
            Event::Booted { version, reset, .. } => {
                let message = format!("the probe has booted ({reset:?}), firmware {version}");
                self.to.log(now, INFO, &message)
            }
            Event::TextureLearned(learned) => {
                let message = format!("{} is learned from {} more", learned.name, learned.slides);
                self.to.log(now, INFO, &message)
            }
            _ => Ok(()),
        }
    }

    /// Samples come when the block is full: the first one of a series was so long ago.
    fn block(&mut self, block: &Block) -> anyhow::Result<()> {
        const SHEAR_HZ: u32 = 1000;
        let length = block.pac.len() as u64 * 1_000_000_000 / u64::from(PAC_RATE_HZ);
        // and after what came before it, however late that was
        let over = self.next.map_or(0, |(_, pac, _)| pac);
        let begun = self.now_ns.saturating_sub(length).max(over);
        let follows = block.number > 0 && block.number == self.number;
        if block.lost > 0 || block.number > 0 && !follows {
            let why = "samples before this are missing: the slide does not count";
            self.to.log(self.now_ns, WARNING, why)?;
        }
        self.number = block.number.wrapping_add(1);
        let (pac, shear) = match self.next {
            Some((still, pac, shear)) if still == block.still && follows => (pac, shear),
            _ => {
                let steady = block.steady.map_or(0, |(from, _)| from);
                let steady = u64::from(steady) * 1_000_000_000 / u64::from(PAC_RATE_HZ);
                (begun, begun + steady)
            }
        };
        let still = block.still;
        let message = |counts| json!({"counts": counts, "still": still});
        let pac = self
            .to
            .samples("/pac", pac, PAC_RATE_HZ, &block.pac, message)?;
        let message = |mn| json!({ "mn": mn });
        let shear = self
            .to
            .samples("/shear", shear, SHEAR_HZ, &block.shear_mn, message)?;
        self.next = Some((still, pac, shear));
        Ok(())
    }

    fn posterior(&mut self, slide: u8, posterior: &[f32]) -> anyhow::Result<()> {
        let name = |at: usize| match self.names.get(at) {
            Some(name) => name.clone(),
            None => format!("texture {}", at + 1),
        };
        let best = posterior
            .iter()
            .enumerate()
            .max_by(|(_, a), (_, b)| a.total_cmp(b));
        let Some((best, probability)) = best else {
            return Ok(());
        };
        let likely = posterior.iter().enumerate().filter(|(_, p)| **p > 0.0);
        let all: Map<String, Value> = likely.map(|(at, p)| (name(at), json!(p))).collect();
        let message = json!({
            "slide": slide, "most_likely": name(best), "probability": probability, "all": all
        });
        self.to.tell("/posterior", self.now_ns, &message)
    }
}
