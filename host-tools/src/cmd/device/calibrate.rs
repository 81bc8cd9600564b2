//! `tactus device calibrate`, `home` and `stop`: the rig itself.

use std::io::{self, Write};

use anyhow::ensure;
use tactus::link::Question;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::wire::Ask;

use super::bench::{Bench, BenchError, moved};
use super::line::Where;

/// Measure what differs from rig to rig, or show and set it
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device calibrate                   measures the motor's current without load; the date is today's
  tactus device calibrate --show            what is in use
  tactus device calibrate --drifted         for a finger that says in the air that it is not: forgets the old date first
  tactus device calibrate --newton-per-ampere 16.2 --force-mn-per-count 11.4
                                            also takes what was measured on an incline and on a scale")]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    /// Print what is in use, and change nothing
    #[arg(long, conflicts_with_all = ["drifted", "date", "newton_per_ampere", "force_mn_per_count"])]
    show: bool,
    /// The finger has drifted further than the probe believes: forget what P_DC was in the air, and measure it anew
    #[arg(long)]
    drifted: bool,
    /// The day of the calibration, as 20261121; today unless given
    #[arg(long, value_name = "YYYYMMDD", value_parser = clap::value_parser!(u32).range(20_000_101..=29_991_231))]
    date: Option<u32>,
    /// Shear per motor current, N/A, from pulls on an inclined stage
    #[arg(long, value_name = "X")]
    newton_per_ampere: Option<f32>,
    /// Contact force per count of P_DC, mN, from presses on a scale
    #[arg(long, value_name = "X")]
    force_mn_per_count: Option<f32>,
}

/// End a fault and find the limit switches
#[derive(clap::Args)]
pub(crate) struct Home {
    #[command(flatten)]
    at: Where,
}

/// Stop what is being done and lift the finger
#[derive(clap::Args)]
pub(crate) struct Stop {
    #[command(flatten)]
    at: Where,
}

/// Measures, shows or sets the rig's constants.
pub(crate) fn run(how: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&how.at)?;
    let mut calibration: RigCalibration = bench.run(Question::read_calibration(), |_| Ok(()))?;
    if how.show {
        return Ok(show_calibration(&calibration, out)?);
    }
    if how.drifted {
        calibration.date = 0;
        bench.run(Question::write_calibration(&calibration)?, |_| Ok(()))?;
        bench.run(Question::command(Ask::Home), |report| moved(report, out))?;
    }
    writeln!(out, "Measuring the motor's current without load ...")?;
    out.flush()?;
    calibration = bench.run(Question::calibrate(), |report| moved(report, out))?;
    calibration.date = how.date.unwrap_or_else(today);
    if let Some(newton_per_ampere) = how.newton_per_ampere {
        calibration.newton_per_ampere = newton_per_ampere;
    }
    if let Some(force_mn_per_count) = how.force_mn_per_count {
        calibration.pressure.force_mn_per_count = force_mn_per_count;
    }
    bench.run(Question::write_calibration(&calibration)?, |_| Ok(()))?;
    let kept = bench.run(Question::read_calibration(), |_| Ok(()))?;
    ensure!(
        kept == calibration,
        "the probe keeps other constants than it was given: calibrate again"
    );
    show_calibration(&kept, out)?;
    Ok(())
}

/// Ends a fault.
pub(crate) fn home(args: &Home, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at)?;
    bench.run(Question::command(Ask::Home), |report| moved(report, out))?;
    writeln!(
        out,
        "Ready: lever and stage have found their limit switches."
    )?;
    Ok(())
}

/// Stops the rig.
pub(crate) fn stop(args: &Stop, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(&args.at)?;
    match bench.lift() {
        BenchError::Stopped => {
            writeln!(out, "Stopped: the finger is lifted and the stage stands.")?;
            Ok(())
        }
        why => Err(why.into()),
    }
}

fn today() -> u32 {
    let today = time::OffsetDateTime::now_utc().date();
    let year = u32::try_from(today.year()).unwrap_or(0);
    year * 10_000 + u32::from(u8::from(today.month())) * 100 + u32::from(today.day())
}

pub(crate) fn show_calibration(c: &RigCalibration, out: &mut impl Write) -> io::Result<()> {
    let p = &c.pressure;
    let date = match c.date {
        0 => "never: constants that nobody measured".to_owned(),
        date => format!(
            "{}-{:02}-{:02}",
            date / 10_000,
            date / 100 % 100,
            date % 100
        ),
    };
    let serial = String::from_utf8_lossy(&c.serial);
    let serial = serial.trim_matches('\0');
    writeln!(out, "calibrated      {date}")?;
    writeln!(
        out,
        "sensor          {}",
        if serial.is_empty() {
            "not known"
        } else {
            serial
        }
    )?;
    writeln!(
        out,
        "P_DC            {:.1} counts in the air",
        p.pdc_no_contact
    )?;
    writeln!(
        out,
        "force           {:.2} mN per count",
        p.force_mn_per_count
    )?;
    writeln!(
        out,
        "motor current   {:.1} mA + {:.3} mA per mm/s without load",
        c.unloaded_a.0 * 1e3,
        c.unloaded_a.1 * 1e3
    )?;
    writeln!(
        out,
        "shear           {:.2} N/A above that",
        c.newton_per_ampere
    )
}
