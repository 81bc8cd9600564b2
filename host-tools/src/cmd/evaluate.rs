//! `tactus evaluate`: virtual explorations, and how often their answers are right.

use std::io::{self, Write};

use anyhow::ensure;
use clap::ValueEnum as _;
use serde::Serialize;
use tactus::eval::evaluate::{Method, Summary, evaluate};
use tactus::eval::experiment::Protocol;
use tactus_core::explorer;

use super::output::{Format, print_json};
use super::progress::with_progress;
pub(crate) use experiment::Args;

mod experiment;
mod novelty;

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
        is_fused || !args.lifelong && args.novelty.is_none(),
        "--novelty and --lifelong need --method fused: the other methods do not recognise new textures"
    );
    let (experiment, protocol) = experiment::open(args)?;
    let config = args.stop.config(args.method);
    if args.lifelong {
        return novelty::lifelong(args, &experiment, config, out);
    }
    if args.novelty.is_some() {
        return novelty::leave_one_out(args, &experiment, protocol, config, out);
    }
    let outcomes = with_progress(args.runs, "exploring", |done| {
        evaluate(&experiment, config, args.runs, done)
    })?;
    let evaluation = Evaluation {
        method: args.method,
        protocol,
        train_slides: experiment.train_slides(),
        runs: args.runs,
        textures: experiment.names().len(),
        threshold: args.stop.threshold,
        max_slides: args.stop.max_slides,
        seed: args.seed,
        summary: Summary::new(&outcomes, experiment.names(), args.stop.max_slides),
    };
    match args.format {
        Format::Json => print_json(&evaluation, out),
        Format::Text => Ok(print_evaluation(&evaluation, out)?),
    }
}

fn print_evaluation(e: &Evaluation, out: &mut impl Write) -> io::Result<()> {
    let name = e.method.to_possible_value();
    writeln!(
        out,
        "{}, {}, {} training slides: {} runs over {} textures, threshold {} %, at most {} slides, seed {}",
        name.as_ref().map_or("", |name| name.get_name()),
        e.protocol,
        e.train_slides,
        e.runs,
        e.textures,
        e.threshold * 100.0,
        e.max_slides,
        e.seed
    )?;
    let s = &e.summary;
    let percent = |share: f64| format!("{:5.1} %", share * 100.0);
    let slides = format!("median {}, mean {:.2}", s.median_slides, s.mean_slides);
    let mut rows = vec![
        ("right answers", percent(s.accuracy)),
        ("sure", percent(s.converged)),
        ("wrong among the sure", percent(s.wrong_when_sure)),
        ("slides", slides),
    ];
    if e.method.method() == explorer::Method::Fused {
        rows.push(("most like a new texture", percent(s.like_unknown)));
    }
    for (name, value) in rows {
        writeln!(out, "  {name:<26} {value}")?;
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
