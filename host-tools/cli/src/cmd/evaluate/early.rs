//! `tactus evaluate --early`: what it brings to end slides early, and what it costs.

use std::io::Write;

use anyhow::ensure;
use serde::Serialize;
use tactus_core::explorer::{Config, most_doubt};
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::measure_cut;
use tactus_lab::eval::early::{Change, Ended, Lengths, change, look, whole};
use tactus_lab::eval::evaluate::Method;
use tactus_lab::eval::experiment::Experiment;
use tactus_lab::eval::show::count;

use super::experiment::{Args, expected};
use crate::cmd::args::Features;
use crate::cmd::output::{Format, UsageError, print_json};
use crate::cmd::progress::with_progress;

/// What `evaluate --early` prints.
#[derive(Serialize)]
struct Figures {
    method: Method,
    protocol: &'static str,
    train_slides: usize,
    runs: u64,
    textures: usize,
    threshold: f32,
    seed: u64,
    lengths_s: Vec<f64>,
    /// With slides to their end.
    whole: Ended,
    /// With slides that may end early.
    early: Vec<Change>,
}

/// Plays explorations whose slides may end early.
pub(super) fn run(args: &Args, config: Config, out: &mut impl Write) -> anyhow::Result<()> {
    let usual = most_doubt(config.method).map(f64::from);
    let doubts = match (&args.ending.doubt[..], usual) {
        ([], Some(usual)) => vec![usual],
        ([], None) => {
            let say = "--early is for the method fused; --method paper needs --doubt, and is wrong more often with any";
            return Err(UsageError(say.to_owned()).into());
        }
        (given, _) => given.to_vec(),
    };
    let folder = args.from.folder()?;
    let set = RecordingSet::open(&folder)?;
    set.finger()?;
    let lengths_ms = args.ending.lengths_ms()?;
    let textures = set.textures().len() as u64;
    let slides = with_progress(textures, "measuring slides", |done| {
        measure_cut(&set, &lengths_ms, |_| done())
    })?;
    let features = args.features.map(Features::set);
    let lengths = Lengths::new(&lengths_ms, &slides, |measured| {
        let (names, slides) = (set.names(), args.train_slides.unwrap_or(5));
        let experiment =
            Experiment::recorded(names, measured, None, args.protocol, slides, args.seed)?;
        let experiment = experiment.expecting(expected(args)).with_features(features);
        Ok::<_, anyhow::Error>(experiment.each_slide_once())
    })?;
    ensure!(
        slides
            .iter()
            .flatten()
            .any(|slide| slide.first.iter().any(Option::is_some)),
        "--lengths: no slide of {} is longer than that",
        folder.display()
    );
    let config = Config {
        open: true,
        ..config
    };
    let looked = with_progress(args.runs(), "exploring", |done| {
        look(&lengths, config, args.runs(), done)
    })?;
    let round = lengths.whole().round() as usize;
    let figures = Figures {
        method: args.method,
        protocol: args.protocol.name(),
        train_slides: lengths.whole().train_slides(),
        runs: args.runs(),
        textures: set.textures().len(),
        threshold: args.stop.threshold,
        seed: args.seed,
        lengths_s: lengths_ms.iter().map(|&ms| f64::from(ms) / 1e3).collect(),
        whole: whole(&looked),
        early: doubts
            .iter()
            .map(|&doubt| change(&looked, round, doubt))
            .collect(),
    };
    match args.format {
        Format::Json => print_json(&figures, out),
        Format::Text => print(&figures, out),
    }
}

fn print(figures: &Figures, out: &mut impl Write) -> anyhow::Result<()> {
    let lengths: Vec<String> = figures.lengths_s.iter().map(f64::to_string).collect();
    writeln!(
        out,
        "Slides that end early, {}: {} over {}, {}, seed {}; looked at after {} s",
        figures.protocol,
        count(figures.runs, "run"),
        count(figures.textures as u64, "texture"),
        count(figures.train_slides as u64, "training slide"),
        figures.seed,
        lengths.join(", ")
    )?;
    let row = |name: String, ended: &Ended| {
        format!(
            "  {name:<24} {:5.2} s of sliding a verdict, right {:5.2} %, wrong when sure {:5.2} %",
            ended.seconds,
            100.0 * ended.right,
            100.0 * ended.wrong_when_sure
        )
    };
    writeln!(
        out,
        "{}",
        row("slides to their end".to_owned(), &figures.whole)
    )?;
    for change in &figures.early {
        let name = format!("doubt {:.1e} or less", change.doubt);
        writeln!(out, "{}", row(name, &change.ended))?;
        let (by, error) = (change.difference, change.error);
        writeln!(
            out,
            "    {:.1} % end early; {:+.2} s (+-{:.2}), right {:+.2} points (+-{:.2}), wrong when sure {:+.2} points (+-{:.2})",
            100.0 * change.early,
            by.seconds,
            error.seconds,
            100.0 * by.right,
            100.0 * error.right,
            100.0 * by.wrong_when_sure,
            100.0 * error.wrong_when_sure
        )?;
    }
    Ok(())
}
