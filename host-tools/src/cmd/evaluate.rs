//! `tactus evaluate`: virtual explorations, and how often their answers are right.

use std::io::{self, Write};

use anyhow::ensure;
use clap::ValueEnum as _;
use serde::Serialize;
use tactus::eval::courses::courses;
use tactus::eval::evaluate::{Method, Outcome, Summary, evaluate};
use tactus::eval::experiment::{Experiment, Protocol};
use tactus::eval::pictures::evaluation::figures;
use tactus::eval::reliability::{AtThreshold, Statements, by_threshold, statements};
use tactus::eval::seconds::mean_seconds;
use tactus::eval::show::count;
use tactus::eval::verdicts::Verdicts;
use tactus_core::explorer::{self, Config};

use super::output::{Format, percent, print_json, verdict_rows};
use super::progress::with_progress;
pub(crate) use experiment::Args;

mod early;
mod experiment;
mod novelty;
mod verify;

/// What `evaluate` prints.
#[derive(Serialize)]
struct Evaluation {
    method: Method,
    protocol: &'static str,
    train_slides: usize,
    runs: u64,
    textures: usize,
    threshold: f32,
    max_slides: u8,
    seed: u64,
    /// What users would have been told: see [`as_told`].
    verdicts: Verdicts,
    /// Mean number of slides until then.
    mean_slides_told: f64,
    /// Mean time until then, s, where that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    mean_seconds_told: Option<f64>,
    /// How often it was right when it said so, by what it said.
    reliability: Vec<Statements>,
    /// What another threshold would change.
    by_threshold: Vec<AtThreshold>,
    /// Figures of explorations that know that the texture is one of the table's, with slides drawn with replacement: the
    /// paper's protocol.
    #[serde(flatten)]
    summary: Summary,
}

/// Plays the explorations that the arguments ask for.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    if args.lifelong && args.protocol != Protocol::Drift {
        // the first slides are learned from, all others come after them
        let drift = Args {
            protocol: Protocol::Drift,
            ..args.clone()
        };
        return run(&drift, out);
    }
    let is_fused = args.method.method() == explorer::Method::Fused;
    ensure!(
        is_fused || !args.lifelong && !args.verify && args.novelty.is_none(),
        "--novelty, --verify and --lifelong need --method fused: the other methods do not recognise new textures"
    );
    if args.early {
        let config = args
            .choosing
            .config(args.stop.config(args.method), args.slide_time())?;
        return early::run(args, config, out);
    }
    let canvas = args.plot.open()?;
    let (experiment, protocol) = experiment::open(args)?;
    ensure!(
        args.choosing.objective.is_none() || args.properties.is_none(),
        "--objective needs movements of which the speed is known, and --properties has none"
    );
    let config = args.stop.config(args.method);
    let config = args.choosing.config(config, args.slide_time())?;
    if args.lifelong {
        return novelty::lifelong(args, &experiment, config, canvas, out);
    }
    if args.verify {
        return verify::run(args, &experiment, protocol, config, canvas, out);
    }
    if args.novelty.is_some() {
        return novelty::leave_one_out(args, &experiment, protocol, config, canvas, out);
    }
    // a program gets what the pictures show
    let with_courses = canvas.is_some() || args.format == Format::Json;
    let stages = if with_courses { 3 } else { 2 };
    let stage = |number: u32| format!("exploring, {number} of {stages}");
    let outcomes = with_progress(args.runs(), stage(1), |done| {
        evaluate(&experiment, config, args.runs(), done)
    })?;
    let max_slides = args.stop.max_slides;
    let summary = Summary::new(&outcomes, experiment.names(), max_slides);
    let (experiment, config) = as_told(experiment, config);
    let told = with_progress(args.runs(), stage(2), |done| {
        evaluate(&experiment, config, args.runs(), done)
    })?;
    let courses = if with_courses {
        with_progress(args.runs(), stage(3), |done| {
            courses(&experiment, config, args.runs(), done)
        })?
    } else {
        Vec::new()
    };
    let time = args.choosing.time(args.slide_time());
    let evaluation = Evaluation {
        reliability: statements(&courses, args.stop.threshold),
        by_threshold: by_threshold(&courses, args.stop.threshold),
        method: args.method,
        protocol,
        train_slides: experiment.train_slides(),
        runs: args.runs(),
        textures: experiment.names().len(),
        threshold: args.stop.threshold,
        max_slides,
        seed: args.seed,
        verdicts: Verdicts::of(told.iter().map(Outcome::told)),
        mean_slides_told: Summary::new(&told, experiment.names(), max_slides).mean_slides,
        mean_seconds_told: time.map(|time| mean_seconds(&told, experiment.movements(), time)),
        summary,
    };
    match args.format {
        Format::Json => print_json(&evaluation, out)?,
        Format::Text => print_evaluation(&evaluation, out)?,
    }
    if let Some(canvas) = canvas {
        let figures = figures(&courses, experiment.names(), args.stop.threshold)?;
        canvas.write("tactus evaluate", &figures, out)?;
    }
    Ok(())
}

/// The experiment as `identify` meets it: the texture may be none of those known, and no slide counts twice.
fn as_told(experiment: Experiment, config: Config) -> (Experiment, Config) {
    let config = Config {
        open: true,
        ..config
    };
    (experiment.each_slide_once(), config)
}

fn print_evaluation(e: &Evaluation, out: &mut impl Write) -> io::Result<()> {
    let name = e.method.to_possible_value();
    writeln!(
        out,
        "{}, {}, {}: {} over {}, threshold {}, at most {}, seed {}",
        name.as_ref().map_or("", |name| name.get_name()),
        e.protocol,
        count(e.train_slides as u64, "training slide"),
        count(e.runs, "run"),
        count(e.textures as u64, "texture"),
        percent(e.threshold.into()),
        count(e.max_slides, "slide"),
        e.seed
    )?;
    let row = |name: &str, value| format!("  {name:<26} {value}");
    let share = |share: f64| format!("{:5.1} %", share * 100.0);
    writeln!(
        out,
        "what the user is told, after {:.2} slides{} (mean)",
        e.mean_slides_told,
        e.mean_seconds_told
            .map_or(String::new(), |s| format!(", {s:.1} s"))
    )?;
    for (name, value, remark) in verdict_rows(&e.verdicts) {
        writeln!(out, "{}", row(name, share(value) + &remark))?;
    }
    writeln!(out, "where the texture is known to be one of these")?;
    let s = &e.summary;
    let slides = format!("median {}, mean {:.2}", s.median_slides, s.mean_slides);
    let mut rows = vec![
        ("most probable one right", share(s.accuracy)),
        ("sure", share(s.converged)),
        ("wrong among the sure", share(s.wrong_when_sure)),
        ("slides", slides),
    ];
    if e.method.method() == explorer::Method::Fused {
        rows.push(("most like a new texture", share(s.like_unknown)));
    }
    for (name, value) in rows {
        writeln!(out, "{}", row(name, value))?;
    }
    if !s.confused.is_empty() {
        writeln!(out, "  most confused")?;
    }
    for pair in &s.confused {
        let (share, right, wrong) = (pair.share * 100.0, &pair.texture, &pair.identified);
        writeln!(out, "    {share:4.1} %  {right} taken for {wrong}")?;
    }
    Ok(())
}
