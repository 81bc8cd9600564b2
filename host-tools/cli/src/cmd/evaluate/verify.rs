//! `tactus evaluate --verify`: how often slides are taken for those of a reference.

use std::io::Write;

use anyhow::ensure;
use tactus_core::explorer::Config;
use tactus_lab::eval::experiment::Experiment;
use tactus_lab::eval::show::count;
use tactus_lab::eval::verify::{AnswerShares, Verified, verify};
use tactus_study::pictures::trade_off;

use super::experiment::{Args, Figures};
use crate::cmd::output::{Format, print_json};
use crate::cmd::plot::Canvas;
use crate::cmd::progress::with_progress;

pub(super) fn run(
    args: &Args,
    experiment: &Experiment,
    protocol: &'static str,
    config: Config,
    canvas: Option<Canvas>,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    ensure!(
        experiment.names.len() >= 4,
        "--verify needs four textures or more: record more of them"
    );
    let verified = with_progress(args.runs(), "holding slides against references", |done| {
        verify(experiment, config, args.runs(), done)
    })?;
    let figures = Figures::new(args, experiment, protocol, &verified);
    match args.format {
        Format::Json => print_json(&figures, out)?,
        Format::Text => print(&figures, out)?,
    }
    if let Some(canvas) = canvas {
        let figure = trade_off::figure(&verified.verify)?;
        canvas.write(&[figure], out)?;
    }
    Ok(())
}

fn print(figures: &Figures<'_, Verified>, out: &mut impl Write) -> anyhow::Result<()> {
    let runs = count(figures.runs, "run");
    let (protocol, slides, seed) = (figures.protocol, figures.train_slides, figures.seed);
    writeln!(
        out,
        "The same as this one? {protocol}, {slides} training slides, {runs}, seed {seed}"
    )?;
    for note in figures.notes {
        writeln!(out, "{note}")?;
    }
    let percent = |share: f64| format!("{:5.2} %", 100.0 * share);
    for after in &figures.of.verify {
        writeln!(
            out,
            "  after {:<9} equal error {}, at the limits its own rejected {}, others accepted {}",
            count(after.slides as u64, "slide"),
            percent(after.equal_error),
            percent(after.false_reject),
            percent(after.false_accept)
        )?;
    }
    for (whose, told) in [
        ("its own slides", figures.of.same),
        ("those of others", figures.of.other),
    ] {
        let AnswerShares {
            same,
            different,
            unsure,
            mean_slides,
        } = told;
        writeln!(
            out,
            "  {whose:<15} told the same {}, different {}, not sure {}, after {mean_slides:.2} slides (mean)",
            percent(same),
            percent(different),
            percent(unsure)
        )?;
    }
    Ok(())
}
