//! `tactus device calibrate`, `home` and `stop`: the rig itself.

use std::io::Write;

use anyhow::ensure;
use clap::ArgGroup;
use tactus_link::operations::{self, Calibrating};

use super::bench::Bench;
use super::line::Where;
use crate::cmd::output::Format;

/// Measure what differs from rig to rig, or set it
#[derive(clap::Args)]
#[command(group(ArgGroup::new("scale").args(["force_mn_per_count", "turn_over", "weights"])), after_help = "\
Examples:
  tactus device calibrate                   measures the motor's current without load, and P_DC in the air
  tactus device calibrate --drifted         if a finger in the air seems to touch something: takes its P_DC anew
  tactus device calibrate --weights 30g,60g,90g,120g,150g   asks for these on the finger
  tactus device calibrate --turn-over       only asks for a finger with an accelerometer to be turned over
  tactus device calibrate --newton-per-ampere 16.2 --force-mn-per-count 11.4   as measured on incline and scale

`tactus device status` shows what is in use. What a count of P_DC is worth in mN has a day only once it was
measured: with --weights, or with --force-mn-per-count. Until then it is the paper's, of another finger.")]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    /// Measure what a count of acceleration is worth, and nothing else: the finger points straight down and keeps
    /// still, then straight up. For a finger with an accelerometer
    #[arg(long, conflicts_with_all = ["drifted", "newton_per_ampere"])]
    turn_over: bool,
    /// The finger has drifted further than the probe allows: discard the P_DC that it had in the air, and measure it
    /// anew
    #[arg(long)]
    drifted: bool,
    /// Shear per motor current, N/A, from pulls on an inclined stage
    #[arg(long, value_name = "X")]
    newton_per_ampere: Option<f32>,
    /// Contact force per count of P_DC, mN, measured by presses on a scale
    #[arg(long, value_name = "X")]
    force_mn_per_count: Option<f32>,
    /// Three known weights or more, N, or g as in 30g, which the probe asks for one after the other: each is laid on
    /// the finger, or a kitchen scale is pressed against it until it shows that
    #[arg(long, value_name = "N,N,...", value_delimiter = ',', value_parser = newton)]
    weights: Vec<u16>,
}

pub(crate) fn run(how: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    ensure!(
        how.weights.is_empty() || how.weights.len() >= 3,
        "a line takes three weights or more, as in --weights 30g,60g,90g,120g,150g"
    );
    let (mut bench, _) = Bench::open(&how.at, Format::Text)?;
    let probe = bench.probe.clone();
    let calibrating = Calibrating {
        drifted: how.drifted,
        newton_per_ampere: how.newton_per_ampere,
        force_mn_per_count: how.force_mn_per_count,
        weights: how.weights.clone(),
        day: today(),
    };
    let calibrated = async {
        match how.turn_over {
            true => operations::turn_over(&probe, today()).await,
            false => operations::calibrate(&probe, &calibrating).await,
        }
    };
    bench.done(calibrated, out)?;
    Ok(())
}

/// A weight in N, or in g with a g behind it, as mN: what a fingertip's line holds for.
fn newton(text: &str) -> Result<u16, String> {
    let text = text.trim();
    let grams = text.strip_suffix('g').map(str::trim_end);
    let number: Result<f32, _> = grams.unwrap_or(text).parse();
    let number = number.map_err(|_| "a weight is a number of N, or of g as in 50g".to_owned())?;
    let newton = grams.map_or(number, |_| number * 9.806_65e-3);
    match newton {
        0.2..=2.0 => Ok((newton * 1e3).round() as u16),
        _ => Err("a weight has 0.2 to 2 N (100 g are 0.98 N)".to_owned()),
    }
}

fn today() -> u32 {
    let (year, month, day) = time::OffsetDateTime::now_utc().to_calendar_date();
    u32::try_from(year).unwrap_or(0) * 10_000 + u32::from(u8::from(month)) * 100 + u32::from(day)
}

pub(crate) fn home(at: &Where, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(at, Format::Text)?;
    let probe = bench.probe.clone();
    Ok(bench.done(operations::home(&probe), out)?)
}

pub(crate) fn stop(at: &Where, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(at, Format::Text)?;
    let probe = bench.probe.clone();
    Ok(bench.done(operations::stop(&probe), out)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_newtons_or_grams() {
        assert_eq!(newton("0.49"), Ok(490));
        let kitchen = ["30g", "60 g", " 90g", "120g", "150g"].map(newton);
        assert_eq!(kitchen, [294, 588, 883, 1177, 1471].map(Ok));
        for wrong in ["", "g", "50", "10g", "250g", "NaN", "1kg", "30gg"] {
            assert!(newton(wrong).is_err(), "{wrong}");
        }
    }
}
