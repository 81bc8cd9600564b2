//! `tactus evaluate`: virtual explorations, and how often their answers are right.

use std::io::{self, Write};

use anyhow::bail;
use clap::ValueEnum as _;
use serde::Serialize;
use tactus::evaluate::{Method, Summary, evaluate};
use tactus::experiment::Protocol;
use tactus_core::explorer;

use super::args::Features;
use super::output::{Format, print_json};
use super::progress::progress;
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
    if (args.lifelong || args.novelty.is_some()) && args.method.method() != explorer::Method::Fused
    {
        bail!(
            "--novelty and --lifelong need --method fused: the others cannot tell what they do not know"
        );
    }
    let (experiment, protocol) = experiment::open(args)?;
    let experiment = experiment.with_features(args.features.map(Features::set));
    let config = args.stop.config(args.method);
    if args.lifelong {
        return novelty::lifelong(args, &experiment, config, out);
    }
    if args.novelty.is_some() {
        return novelty::leave_one_out(args, &experiment, protocol, config, out);
    }
    let bar = progress(args.runs, "exploring");
    let outcomes = evaluate(&experiment, config, args.runs, || bar.inc(1))?;
    bar.finish_and_clear();
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
        Format::Json => print_json(&evaluation, out)?,
        Format::Text => print_evaluation(&evaluation, out)?,
    }
    Ok(())
}

fn print_evaluation(e: &Evaluation, out: &mut impl Write) -> io::Result<()> {
    let method = e
        .method
        .to_possible_value()
        .map_or_else(String::new, |v| v.get_name().to_owned());
    writeln!(
        out,
        "{method}, {}, {} training slides: {} runs over {} textures, threshold {} %, at most {} slides, seed {}",
        e.protocol,
        e.train_slides,
        e.runs,
        e.textures,
        e.threshold * 100.0,
        e.max_slides,
        e.seed
    )?;
    let s = &e.summary;
    writeln!(
        out,
        "  right answers              {:5.1} %",
        s.accuracy * 100.0
    )?;
    writeln!(
        out,
        "  sure                       {:5.1} %",
        s.converged * 100.0
    )?;
    writeln!(
        out,
        "  wrong among the sure       {:5.1} %",
        s.wrong_when_sure * 100.0
    )?;
    writeln!(
        out,
        "  slides                     median {}, mean {:.2}",
        s.median_slides, s.mean_slides
    )?;
    if e.method.method() == explorer::Method::Fused {
        writeln!(
            out,
            "  most like a new texture    {:5.1} %",
            s.like_unknown * 100.0
        )?;
    }
    if !s.confused.is_empty() {
        writeln!(out, "  most confused")?;
    }
    for pair in &s.confused {
        writeln!(
            out,
            "    {:4.1} %  {} taken for {}",
            pair.share * 100.0,
            pair.texture,
            pair.identified
        )?;
    }
    Ok(())
}
