//! `tactus evaluate --novelty` and `--lifelong`: textures that are not in the table, and sessions that go on learning.

use std::io::Write;

use anyhow::bail;
use serde::Serialize;
use tactus::evaluate::Method;
use tactus::experiment::Experiment;
use tactus::lifelong::{self, Learning, Lifelong};
use tactus::novelty::{self, After};
use tactus_core::explorer::Config;

use super::experiment::Args;
use crate::cmd::output::{Format, print_json};
use crate::cmd::progress::progress;

/// What `evaluate --novelty` prints.
#[derive(Serialize)]
struct NoveltyFigures {
    method: Method,
    protocol: &'static str,
    train_slides: usize,
    runs: u64,
    seed: u64,
    novelty: Vec<After>,
}

/// What `evaluate --lifelong` prints.
#[derive(Serialize)]
struct LifelongFigures {
    method: Method,
    train_slides: usize,
    sessions: u64,
    seed: u64,
    lifelong: Vec<Lifelong>,
}

/// Most sessions of `--lifelong`; they differ in the order of the textures only.
const SESSIONS: u64 = 50;

pub(crate) fn leave_one_out(
    args: &Args,
    experiment: &Experiment,
    protocol: &'static str,
    config: Config,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    if experiment.names().len() < 4 {
        bail!("leaving one out takes four textures or more");
    }
    let bar = progress(args.runs, "presenting new textures");
    let novelty = novelty::leave_one_out(experiment, config, args.runs, || bar.inc(1))?;
    bar.finish_and_clear();
    let figures = NoveltyFigures {
        method: args.method,
        protocol,
        train_slides: experiment.train_slides(),
        runs: args.runs,
        seed: args.seed,
        novelty,
    };
    if args.format == Format::Json {
        return print_json(&figures, out);
    }
    writeln!(
        out,
        "Every texture left out in turn, {protocol}, {} training slides, {} runs, seed {}",
        figures.train_slides, figures.runs, figures.seed
    )?;
    for after in &figures.novelty {
        writeln!(
            out,
            "  after {} slide{}  noticed {:5.1} %, known ones taken for new {:4.1} %",
            after.slides,
            if after.slides == 1 { " " } else { "s" },
            after.detections * 100.0,
            after.false_alarms * 100.0
        )?;
    }
    Ok(())
}

pub(crate) fn lifelong(
    args: &Args,
    experiment: &Experiment,
    config: Config,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let sessions = args.runs.min(SESSIONS);
    let bar = progress(3 * sessions, "living through sessions");
    let figures = LifelongFigures {
        method: args.method,
        train_slides: experiment.train_slides(),
        sessions,
        seed: args.seed,
        lifelong: lifelong::lifelong(experiment, config, sessions, args.seed, || bar.inc(1))?,
    };
    bar.finish_and_clear();
    if args.format == Format::Json {
        return print_json(&figures, out);
    }
    writeln!(
        out,
        "A session in time order: {} slides to learn from, then visits of one slide; {sessions} orders of the textures, seed {}",
        figures.train_slides, figures.seed
    )?;
    for life in &figures.lifelong {
        let (who, uncertain) = match life.learning {
            Learning::None => ("learning nothing      ", "uncertain"),
            Learning::Itself => ("learning by itself    ", "uncertain"),
            Learning::Asking => ("asking where uncertain", "asked"),
        };
        writeln!(
            out,
            "  {who}  right at first {:5.1} %, worst {:5.1} % ({}), {uncertain} {:4.1} %, wrong lessons {:.2} %",
            life.accuracy * 100.0,
            life.worst.0 * 100.0,
            life.worst.1,
            life.uncertain * 100.0,
            life.wrong_lessons * 100.0
        )?;
    }
    Ok(())
}
