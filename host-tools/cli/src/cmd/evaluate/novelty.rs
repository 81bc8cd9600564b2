//! `tactus evaluate --novelty`: textures that are not in the table.

use std::io::Write;

use anyhow::ensure;
use tactus_core::explorer::Config;
use tactus_lab::eval::experiment::Experiment;
use tactus_lab::eval::novelty;
use tactus_lab::eval::open_set;
use tactus_lab::eval::show::count;
use tactus_lab::eval::verdicts::Verdicts;

use super::experiment::{Args, Figures};
use crate::cmd::output::{Format, print_json, verdict_rows};
use crate::cmd::progress::with_progress;

/// Leaves every texture out of the table in turn.
pub(crate) fn leave_one_out(
    args: &Args,
    experiment: &Experiment,
    protocol: &'static str,
    config: Config,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    // a texture that is known is presented while another is left out, and limits take three
    ensure!(
        experiment.names.len() >= 4,
        "--novelty needs 4 textures or more: record more of them"
    );
    let novelty = with_progress(args.runs(), "presenting new textures", |done| {
        novelty::leave_one_out(experiment, config, args.runs(), done)
    })?;
    let (train_slides, runs, seed) = (experiment.train_slides, args.runs(), args.seed);
    if args.format == Format::Json {
        return print_json(&Figures::new(args, experiment, protocol, &novelty), out);
    }
    writeln!(
        out,
        "Every texture left out in turn, {protocol}, {}, {}, seed {seed}",
        count(train_slides as u64, "training slide"),
        count(runs, "run")
    )?;
    for note in &experiment.notes {
        writeln!(out, "{note}")?;
    }
    for after in &novelty.novelty {
        let slides = format!(
            "{} slide{}",
            after.slides,
            if after.slides == 1 { " " } else { "s" }
        );
        let new = in_words(&after.unknown);
        writeln!(out, "  after {slides}  of a new texture  {new}")?;
        writeln!(
            out,
            "  {:14}  of a known one    {}",
            "",
            in_words(&after.known)
        )?;
    }
    if let Some(figures) = &novelty.open_set {
        writeln!(out, "Its own figures: {}", open_set::in_lines(figures))?;
    }
    let (new, known) = (&novelty.verdicts_new, &novelty.verdicts_known);
    writeln!(
        out,
        "What the user is told, after as many slides as it takes"
    )?;
    writeln!(out, "  of a new texture    {}", in_words(new))?;
    writeln!(out, "  of a known one      {}", in_words(known))?;
    if let Some(updates) = novelty.updates_new {
        let share = updates.made * 100.0;
        writeln!(
            out,
            "  of a new one it learns by itself, wrongly, in {share:.1} %"
        )?;
    }
    Ok(())
}

fn in_words(verdicts: &Verdicts) -> String {
    let words = verdict_rows(verdicts);
    let words = words.into_iter();
    let words = words.map(|(name, share)| format!("{} {:.1} %", name.trim(), share * 100.0));
    words.collect::<Vec<_>>().join(", ")
}
