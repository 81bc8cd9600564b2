//! `tactus evaluate`: virtual explorations, and how often their answers are right.

use std::io::{self, Write};

use anyhow::ensure;
use clap::ValueEnum as _;
use tactus_core::explorer::{self, Config};
use tactus_lab::eval::evaluation::{Evaluation, EvaluationRequest, evaluation};
use tactus_lab::eval::open_set;
use tactus_lab::eval::show::count;
use tactus_study::pictures::evaluation::confusion;

use super::output::{Format, percent, print_json, verdict_rows};
use super::progress::with_progress;
pub(crate) use experiment::Args;

mod experiment;
mod novelty;
mod verify;

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let is_fused = args.method.method() == explorer::Method::Fused;
    ensure!(
        is_fused || !args.verify && !args.learn && args.novelty.is_none(),
        "--novelty, --learn and --verify need --method fused: the other methods do not recognise new textures"
    );
    let canvas = args.plot.open()?;
    let (experiment, protocol) = experiment::open(args)?;
    let config = Config {
        learn: args.learn,
        ..args.stop.config(args.method)
    };
    if args.verify {
        return verify::run(args, &experiment, protocol, config, canvas, out);
    }
    if args.novelty.is_some() {
        return novelty::leave_one_out(args, &experiment, protocol, config, out);
    }
    // a program gets what the pictures show
    let with_courses = canvas.is_some() || args.format == Format::Json;
    let asked = EvaluationRequest {
        method: args.method,
        protocol,
        runs: args.runs(),
        seed: args.seed,
        config,
        closed: args.closed,
        with_courses,
    };
    let names = experiment.names.clone();
    let (evaluation, courses) = evaluation(experiment, &asked, |[stage, stages], work| {
        let what = format!("exploring, {stage} of {stages}");
        with_progress(args.runs(), what, work)
    })?;
    match args.format {
        Format::Json => print_json(&evaluation, out)?,
        Format::Text => print_evaluation(&evaluation, out)?,
    }
    if let Some(canvas) = canvas {
        let figure = confusion(&courses, &names, args.stop.threshold)?;
        canvas.write(&[figure], out)?;
    }
    Ok(())
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
    for note in &e.notes {
        writeln!(out, "{note}")?;
    }
    if let Some(figures) = &e.open_set {
        writeln!(out, "Its own figures: {}", open_set::in_words(figures))?;
    }
    let row = |name: &str, value| format!("  {name:<26} {value}");
    let share = |share: f64| format!("{:5.1} %", share * 100.0);
    writeln!(
        out,
        "what the user is told, after {:.2} slides (mean)",
        e.mean_slides_told
    )?;
    for (name, value) in verdict_rows(&e.verdicts) {
        writeln!(out, "{}", row(name, share(value)))?;
    }
    if let Some(updates) = e.updates {
        writeln!(out, "{}", row("learned by itself", share(updates.made)))?;
        writeln!(out, "{}", row("  wrongly", share(updates.wrong)))?;
    }
    writeln!(out, "where the texture is known to be one of these")?;
    let s = &e.summary;
    let slides = format!("median {}, mean {:.2}", s.median_slides, s.mean_slides);
    let mut rows = vec![
        ("right after one slide", share(e.one_slide_accuracy)),
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
