//! `tactus device log`: every decision of a session computed again from its log, by the same core.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, ensure};
use tactus_core::dsp::Plan;
use tactus_core::features::PropertySet;
use tactus_core::table::Table;
use tactus_core::wire::{self, Event, Forget, Identify, Verdict};
use tactus_lab::eval::show::{Show, count};
use tactus_link::follow::{ALLOWED, Agreement, Follower};
use tactus_link::log::{self, Line, TableParts};

use crate::cmd::output::percent;
use crate::cmd::table_file::opened;

/// Compute every decision of a session again from its log (--log), and compare
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device identify --log session.jsonl
  tactus device log session.jsonl    exit code 1 if a decision differs
  tactus convert session.jsonl --mcap session.mcap    for Foxglove and PlotJuggler")]
pub(crate) struct Args {
    /// The log; "-" reads standard input
    file: PathBuf,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    replay(&args.file, out).with_context(|| args.file.display().to_string())
}

struct Logged {
    asked: Identify,
    /// The table in use, or why it is not known.
    table: Result<Vec<u8>, &'static str>,
    events: Vec<Event>,
}

impl Logged {
    fn table(&self) -> Option<Table<'_>> {
        Table::read(self.table.as_ref().ok()?).ok()
    }
}

const NOT_READ: &str = "the log does not have the table that the probe used";
const CHANGED: &str = "the probe's table was changed after the log read it";

fn explorations(path: &Path) -> anyhow::Result<Vec<Logged>> {
    let mut explorations: Vec<Logged> = Vec::new();
    let mut running = false;
    let mut parts = TableParts::default();
    let mut table = Err(NOT_READ);
    log::read(opened(path)?, |line| match line {
        Line::Session { .. } => {}
        Line::Command(command) => match command.into_owned() {
            wire::Command::Identify(asked) => {
                running = true;
                explorations.push(Logged {
                    asked,
                    table: table.clone(),
                    events: Vec::new(),
                });
            }
            wire::Command::Label(_)
            | wire::Command::Train(_)
            | wire::Command::Rename { .. }
            | wire::Command::Forget(Forget::Texture(_) | Forget::SelfLearned)
            | wire::Command::BeginTable(_)
            | wire::Command::CommitTable
            | wire::Command::FactoryTable => table = Err(CHANGED),
            _ => {}
        },
        Line::Report(report) => {
            let event = report.into_owned().event;
            if let Event::TablePart {
                offset,
                length,
                bytes,
            } = &event
            {
                if let Some(whole) = parts.take(*offset, *length, bytes) {
                    table = Ok(whole);
                }
                return;
            }
            if matches!(event, Event::TextureLearned(_)) {
                table = Err(CHANGED);
            }
            let over = matches!(event, Event::Verdict(_) | Event::Refused { .. });
            if running && let Some(last) = explorations.last_mut() {
                last.events.push(event);
                running = !over;
            }
        }
    })?;
    ensure!(
        !explorations.is_empty(),
        "no exploration in this log; `tactus device identify --log FILE` writes one"
    );
    Ok(explorations)
}

fn replay(path: &Path, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut all, mut same, mut largest) = ([0; 4], true, 0.0_f32);
    for (logged, number) in explorations(path)?.iter().zip(1..) {
        headline(number, logged, out)?;
        let agreement = match follow(logged, out) {
            Ok(agreement) => agreement,
            Err(why) => {
                writeln!(out, "  cannot be replayed: {why}")?;
                same = false;
                continue;
            }
        };
        let Agreement {
            choices,
            slides,
            posteriors,
            verdicts,
            ..
        } = agreement;
        for (sum, one) in all.iter_mut().zip([choices, slides, posteriors, verdicts]) {
            *sum += one;
        }
        largest = largest.max(agreement.largest());
        // one that was stopped before its first slide was over has decided nothing else
        let mut events = logged.events.iter();
        let observed = events.any(|t| matches!(t, Event::SlideReport { .. }));
        same &= agreement.agrees()
            || !observed && agreement.other_choices.is_empty() && agreement.expected <= ALLOWED;
    }
    ensure!(same, "not every decision is the same here");
    let [choices, slides, posteriors, answers] = all;
    writeln!(
        out,
        "\nEvery decision is the same here: {}, {} measured again from their samples, {}, {}; largest difference \
         {largest:e}.",
        count(choices, "choice"),
        count(slides, "slide"),
        count(posteriors, "posterior"),
        count(answers, "answer"),
    )?;
    Ok(())
}

fn headline(number: usize, logged: &Logged, out: &mut impl Write) -> io::Result<()> {
    let textures = logged.table().map(|t| format!(" among {}", t.textures()));
    writeln!(
        out,
        "Exploration {number}{}, threshold {}, at most {}",
        textures.unwrap_or_default(),
        percent(logged.asked.threshold.into()),
        count(logged.asked.max_slides, "slide")
    )
}

fn follow(logged: &Logged, out: &mut impl Write) -> anyhow::Result<Agreement> {
    let table = Table::read(logged.table.as_ref().map_err(|why| anyhow!(*why))?)?;
    let plan = Plan::new();
    // a handheld probe feels no traction, from its first slide on
    let measured = logged.events.iter().find_map(|event| match event {
        Event::SlideReport { observed, .. } => Some(observed.properties().measured()),
        _ => None,
    });
    let measured = measured.unwrap_or(PropertySet::ALL);
    let mut follower = Follower::new(table, measured, &logged.asked, &plan)?;
    let words = Show::new(table, io::sink());
    let mut whole = true;
    for event in &logged.events {
        let before = follower.agreement().clone();
        if let Err(why) = follower.hear(event) {
            writeln!(out, "  {why}")?;
            whole = false;
        }
        let now = follower.agreement();
        match event {
            Event::Chosen { slide, action, .. } => {
                let here = match now.other_choices.get(before.other_choices.len()) {
                    None => "chosen here too".to_owned(),
                    Some(other) => format!("HERE {} IS CHOSEN", words.name(other.here)),
                };
                writeln!(out, "  slide {slide}: {}: {here}", words.name(*action))?;
            }
            Event::SlideReport { .. } => {
                let apart = |now: f32, before: f32, what: &str| match now > before {
                    true => format!("{what} up to {now:e} apart"),
                    false => format!("{what} the same"),
                };
                let [features, earlier] = [now, &before].map(|a| a.properties.max(a.signal));
                let observed = match now.slides == before.slides {
                    true => "samples not compared".to_owned(),
                    false => apart(features, earlier, "features"),
                };
                let posterior = apart(now.posterior, before.posterior, "posterior");
                writeln!(out, "           {observed}, {posterior}")?;
            }
            Event::Rejected { slide, why } => writeln!(out, "  slide {slide}: rejected: {why}")?,
            Event::Verdict(Verdict { name, slides, .. }) => {
                let same = now.other_verdicts == before.other_verdicts;
                let here = if same {
                    "the same here"
                } else {
                    "ANOTHER ONE HERE"
                };
                writeln!(out, "  answer after {slides}: {name}: {here}")?;
            }
            Event::Refused { why, .. } => writeln!(out, "  ended: {why}")?,
            _ => {}
        }
    }
    ensure!(whole, "a part of it is missing");
    Ok(follower.agreement().clone())
}
