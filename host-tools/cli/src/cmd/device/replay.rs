//! `tactus device log`: the log of a session shown again, and replayed: every decision of the session computed again from
//! its events, by the same core.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, ensure};
use clap::Subcommand;
use serde::Serialize;
use tactus_core::dsp::Plan;
use tactus_core::features::PropertySet;
use tactus_core::table::Table;
use tactus_core::wire::{self, Event, Forget, Identify, Report, Verdict};
use tactus_lab::eval::show::{Show, count};
use tactus_lab::eval::transcript::{Answer, Transcript};
use tactus_link::follow::{ALLOWED, Agreement, Follower};
use tactus_study::chart::{DrawError, Figure};
use tactus_study::pictures::exploration::Exploration;

use super::listen;
use super::log::{Line, LogError, TableParts, read};
use crate::cmd::output::{Format, percent, print_json};
use crate::cmd::plot::Plot;

/// Listen to a probe (--mcap), show the log of a session (--log), or compute its decisions again
#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "\
Examples:
  tactus device log --mcap session.mcap                    what the probe reports until Ctrl-C, for Foxglove and PlotJuggler
  tactus device log --mcap - --seconds 60 > minute.mcap
  tactus device log show session.jsonl
  tactus device log show session.jsonl --plot pictures     as `tactus identify` draws them
  tactus device log replay session.jsonl    computes every decision again; exit code 1 if one differs"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    listen: listen::Listen,
}

#[derive(Subcommand)]
enum Command {
    /// Compute every decision of the session again, and compare
    Replay {
        /// The log; "-" reads standard input
        file: PathBuf,
        #[command(flatten)]
        plot: Plot,
        /// How to print what came of it
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
    /// Show the session's explorations as they were shown live
    Show {
        /// The log; "-" reads standard input
        file: PathBuf,
        #[command(flatten)]
        plot: Plot,
        /// How to print them
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
}

/// Writes, shows or replays a log.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    match &args.command {
        Some(command) => of_a_file(command, out),
        None => listen::run(&args.listen, out),
    }
}

fn of_a_file(command: &Command, out: &mut impl Write) -> anyhow::Result<()> {
    let (file, plot) = match command {
        Command::Replay { file, plot, .. } | Command::Show { file, plot, .. } => (file, plot),
    };
    let canvas = plot.open()?;
    let done = match command {
        Command::Replay { format, .. } => replay(file, *format, out).map_err(Into::into),
        Command::Show { format, .. } if *format == Format::Json => show_json(file, out),
        _ => show(file, out).map_err(Into::into),
    };
    done.with_context(|| file.display().to_string())?;
    if let Some(canvas) = canvas {
        canvas.write("tactus device log", &pictures(&explorations(file)?)?, out)?;
    }
    Ok(())
}

/// The pictures of the explorations whose table the log has. Where there are several, their names begin with their number.
fn pictures(explorations: &[Logged]) -> Result<Vec<Figure>, DrawError> {
    let mut all = Vec::new();
    for (logged, number) in explorations.iter().zip(1..) {
        let Some(table) = logged.table() else {
            continue;
        };
        let mut exploration = Exploration::new(table);
        for event in &logged.events {
            exploration.event(event);
        }
        let mut figures = exploration.figures(logged.asked.threshold)?;
        for figure in &mut figures {
            if explorations.len() > 1 {
                figure.id = format!("{number}-{}", figure.id);
            }
        }
        all.extend(figures);
    }
    Ok(all)
}

/// Why a log cannot be replayed.
#[derive(Debug, thiserror::Error)]
enum ReplayError {
    /// See [`LogError`].
    #[error(transparent)]
    Log(#[from] LogError),
    /// Nothing to replay.
    #[error("no exploration in this log; `tactus device identify --log FILE` writes one")]
    Nothing,
    /// The decisions are others here.
    #[error("not every decision is the same here")]
    Differs,
    /// What is shown cannot be written.
    #[error(transparent)]
    Io(#[from] io::Error),
}

/// An exploration as the log has it.
struct Logged {
    asked: Identify,
    /// The table in use, or why it is not known.
    table: Result<Vec<u8>, &'static str>,
    events: Vec<Event>,
    /// When each of them was reported, since the probe booted.
    at_ms: Vec<u32>,
}

impl Logged {
    fn table(&self) -> Option<Table<'_>> {
        Table::read(self.table.as_ref().ok()?).ok()
    }
}

const NOT_READ: &str = "the log does not have the table that the probe used";
const CHANGED: &str = "the probe's table was changed after the log read it";

/// The explorations of a log.
fn explorations(path: &Path) -> Result<Vec<Logged>, ReplayError> {
    let mut explorations: Vec<Logged> = Vec::new();
    let mut running = false;
    let mut parts = TableParts::default();
    let mut table = Err(NOT_READ);
    read(path, |line| match line {
        Line::Session { .. } => {}
        Line::Command(command) => match command.into_owned() {
            wire::Command::Identify(asked) => {
                running = true;
                explorations.push(Logged {
                    asked,
                    table: table.clone(),
                    events: Vec::new(),
                    at_ms: Vec::new(),
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
            let Report { at_ms, event, .. } = report.into_owned();
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
                last.at_ms.push(at_ms);
                running = !over;
            }
        }
    })?;
    if explorations.is_empty() {
        return Err(ReplayError::Nothing);
    }
    Ok(explorations)
}

/// An exploration in `device log show --format json`.
#[derive(Serialize)]
struct Shown {
    /// Textures that it might be.
    among: usize,
    threshold: f32,
    max_slides: u8,
    seed: u32,
    slides: Transcript,
    verdict: Option<Answer>,
}

/// The explorations of a log as objects; those whose table the log does not have are an error.
fn show_json(path: &Path, out: &mut impl Write) -> anyhow::Result<()> {
    let mut all = Vec::new();
    for logged in &explorations(path)? {
        let table = logged.table().context(NOT_READ)?;
        let mut show = Show::new(table, io::sink());
        let mut slides = Transcript::default();
        for event in &logged.events {
            slides.event(event, table);
            show.event(event)?;
        }
        let asked = &logged.asked;
        all.push(Shown {
            among: match asked.among.len() {
                0 => table.textures().into(),
                some => some,
            },
            threshold: asked.threshold,
            max_slides: asked.max_slides,
            seed: asked.seed,
            slides,
            verdict: show
                .answered()
                .map(|(verdict, slides)| Answer::new(verdict, slides, table)),
        });
    }
    print_json(&all, out)
}

/// Shows the explorations of a log as they were shown live.
fn show(path: &Path, out: &mut impl Write) -> Result<(), ReplayError> {
    for (logged, number) in explorations(path)?.iter().zip(1..) {
        headline(number, logged, out)?;
        let Some(table) = logged.table() else {
            writeln!(out, "  {NOT_READ}")?;
            continue;
        };
        let mut show = Show::new(table, &mut *out);
        for event in &logged.events {
            show.event(event)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Computes every decision of a log again and says what came of it.
fn replay(path: &Path, format: Format, stdout: &mut impl Write) -> Result<(), ReplayError> {
    let mut nowhere = io::sink();
    let mut out: &mut dyn Write = match format {
        Format::Text => &mut *stdout,
        Format::Json => &mut nowhere,
    };
    let mut all = Replayed {
        same: true,
        ..Replayed::default()
    };
    for (logged, number) in explorations(path)?.iter().zip(1..) {
        all.explorations += 1;
        headline(number, logged, &mut out)?;
        let agreement = match follow(logged, &mut out) {
            Ok(agreement) => agreement,
            Err(why) => {
                writeln!(out, "  cannot be replayed: {why}")?;
                all.same = false;
                continue;
            }
        };
        all.slides += agreement.slides;
        all.choices += agreement.choices;
        all.posteriors += agreement.posteriors;
        all.answers += agreement.verdicts;
        let here = agreement.properties.max(agreement.signal);
        all.largest_difference = all
            .largest_difference
            .max(here)
            .max(agreement.posterior)
            .max(agreement.expected);
        // one that was stopped before its first slide was over has decided nothing else
        let observed = logged
            .events
            .iter()
            .any(|t| matches!(t, Event::SlideReport { .. }));
        all.same &= agreement.agrees()
            || !observed && agreement.other_choices.is_empty() && agreement.expected <= ALLOWED;
    }
    if format == Format::Json {
        let json = serde_json::to_string_pretty(&all).map_err(io::Error::from)?;
        writeln!(stdout, "{json}")?;
    } else if all.same {
        writeln!(
            stdout,
            "\nEvery decision is the same here: {}, {} measured again from their samples, {}, {}; largest difference {:e}.",
            count(all.choices, "choice"),
            count(all.slides, "slide"),
            count(all.posteriors, "posterior"),
            count(all.answers, "answer"),
            all.largest_difference
        )?;
    }
    if all.same {
        Ok(())
    } else {
        Err(ReplayError::Differs)
    }
}

/// What `device log replay --format json` prints: what was compared.
#[derive(Default, Serialize)]
struct Replayed {
    explorations: u32,
    choices: u32,
    /// Measured again from their samples.
    slides: u32,
    posteriors: u32,
    answers: u32,
    /// Of features, posteriors and expected outcomes.
    largest_difference: f32,
    /// Whether every decision is the same here.
    same: bool,
}

fn headline(number: usize, logged: &Logged, out: &mut (impl Write + ?Sized)) -> io::Result<()> {
    let textures = logged.table().map(|t| format!(" among {}", t.textures()));
    writeln!(
        out,
        "Exploration {number}{}, threshold {}, at most {}",
        textures.unwrap_or_default(),
        percent(logged.asked.threshold.into()),
        count(logged.asked.max_slides, "slide")
    )
}

/// Follows one exploration step by step.
fn follow(logged: &Logged, out: &mut (impl Write + ?Sized)) -> anyhow::Result<Agreement> {
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
