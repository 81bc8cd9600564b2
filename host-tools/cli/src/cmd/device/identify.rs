//! `tactus device identify`: an exploration of the probe, shown step by step.

use std::io::Write;

use anyhow::Context as _;
use serde::Serialize;
use tactus_core::table::Table;
use tactus_core::wire::{Identify, Status};
use tactus_lab::eval::evaluate::Method;
use tactus_lab::eval::transcript::{Answer, Transcript};
use tactus_lab::remote::operations;
use tactus_study::pictures::exploration::Exploration;

use super::bench::Bench;
use super::line::Where;
use super::train::seed_of_now;
use crate::cmd::args::Stop;
use crate::cmd::names::{find, nearest};
use crate::cmd::output::{Done, Format, print_json};
use crate::cmd::plot::Plot;

/// Have the probe identify what lies under its finger, and show every step
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device identify --log session.jsonl          every report is kept, and can be computed again
  tactus device identify --among burlap,silk --closed   it is one of these two
  tactus device identify --plot pictures              as `tactus identify` draws them")]
pub(crate) struct Run {
    #[command(flatten)]
    args: Args,
    /// How to print the exploration
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    plot: Plot,
}

/// What to identify, where, and how.
#[derive(clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) at: Where,
    #[command(flatten)]
    stop: Stop,
    /// How to decide and to choose the next movement; the best for the probe's table unless given
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// The textures that it may be; all unless given
    #[arg(long, value_name = "T,T,...", value_delimiter = ',')]
    among: Vec<String>,
    /// It is one of the textures known: never answer that it is none, and tell names as sure
    #[arg(long)]
    closed: bool,
    /// Let the probe learn from an answer that it is certain of
    #[arg(long)]
    learn: bool,
    /// Where on the sample slides begin, and random choices; drawn anew unless given
    #[arg(long)]
    seed: Option<u32>,
}

impl Args {
    /// The request, for a probe that knows these textures and is so.
    pub(crate) fn wanted(&self, names: &[String], status: &Status) -> anyhow::Result<Identify> {
        let index = |wanted: &String| {
            let wanted = wanted.trim();
            let known: Vec<&str> = names.iter().map(String::as_str).collect();
            let index = find(wanted, &known).ok();
            let index = index.and_then(|name| known.iter().position(|known| *known == name));
            let index = index.and_then(|index| u16::try_from(index).ok());
            index.with_context(|| {
                let known = match nearest(wanted, &known) {
                    Some(name) => format!("Did you mean {name}?"),
                    None => format!("It knows: {}", known.join(", ")),
                };
                format!("--among {wanted}: the probe does not know it. {known}")
            })
        };
        Ok(Identify {
            among: self.among.iter().map(index).collect::<Result<_, _>>()?,
            threshold: self.stop.threshold,
            max_slides: self.stop.max_slides,
            method: self.method.map(Method::method),
            strategy: self.method.map(Method::strategy).unwrap_or_default(),
            open: !self.closed,
            learn: self.learn,
            seed: self.seed.unwrap_or_else(seed_of_now),
            // told, so that a log says what was decided by
            false_alarm: self.stop.false_alarm.or(status.false_alarm),
        })
    }
}

#[derive(Serialize)]
struct Identification {
    /// Textures that it may be.
    among: usize,
    threshold: f32,
    max_slides: u8,
    seed: u32,
    slides: Transcript,
    verdict: Option<Answer>,
    /// Slides that the probe has learned from by itself.
    learned_slides: u8,
    frames_damaged: u64,
    reports_lost: u64,
}

pub(crate) fn run(run: &Run, out: &mut impl Write) -> anyhow::Result<Done> {
    let Run { args, format, plot } = run;
    let canvas = plot.open()?;
    let (mut bench, status) = Bench::open(&args.at, *format)?;
    // it is in the log then, too
    let bytes = bench.table()?;
    let table = Table::read(&bytes)?;
    let names: Vec<String> = table.names().map(str::to_owned).collect();
    let wanted = args.wanted(&names, &status)?;
    let (among, seed) = (wanted.among.len(), wanted.seed);
    let among = if among == 0 { names.len() } else { among };
    let mut slides = Transcript::default();
    let mut exploration = Exploration::new(table);
    let probe = bench.probe.clone();
    let identified = operations::identify(&probe, wanted, |report| {
        slides.event(&report.event, table);
        if canvas.is_some() {
            exploration.event(&report.event);
        }
    });
    let (identified, answered) = bench.done(identified, out)?;
    let verdict = answered.map(|(verdict, slides)| Answer::new(verdict, slides, table));
    let told = verdict.as_ref().map(|verdict| verdict.told);
    if *format == Format::Json {
        let (frames_damaged, reports_lost) = probe.losses();
        let identification = Identification {
            among,
            threshold: args.stop.threshold,
            max_slides: args.stop.max_slides,
            seed,
            slides,
            verdict,
            learned_slides: identified.learned,
            frames_damaged,
            reports_lost,
        };
        print_json(&identification, out)?;
    }
    if let Some(canvas) = canvas {
        let figures = exploration.figures(args.stop.threshold)?;
        canvas.write(&figures, out)?;
    }
    Ok(told.map_or(Done::Unsure, Done::of))
}
