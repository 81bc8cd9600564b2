//! Many explorations and power cuts on emulated boards, in a table, against the bars.

mod explorations;
mod report;

use std::time::Instant;

use clap::Args as Arguments;
use tactus_lab::eval::evaluate::Method;

pub use self::explorations::{Group, Results, recorded, run as explore, simulated};
use self::report::Report;
use super::cuts::{self, Cuts};
use super::error::RunError;
use crate::host::args::{Firmware, Output};
use crate::host::{progress, under_finger};

/// Has the firmware identify many textures on emulated boards, several at once, and holds the results against the bars.
///
/// One half feels the textures of a simulated world, the other recordings of a real BioTac; each knows 20 textures. Every
/// exploration is followed by the PC from the raw samples.
///
/// Then the power is cut: at every word that the firmware programs when a texture is trained and when the probe learns by
/// itself, and at seeded moments of an update that turns a page of its settings. It boots on what is left of the flash, in
/// which the last word or erase is torn, and must hold the old or the new; where it repairs the flash first, the power is
/// cut in that too. The exit code is 1 if a bar is missed.
#[derive(Arguments)]
pub(crate) struct Args {
    #[command(flatten)]
    firmware: Firmware,
    /// Explorations in the simulated world
    #[arg(long, value_name = "N", default_value_t = 20)]
    simulated: usize,
    /// Explorations on recordings
    #[arg(long, value_name = "N", default_value_t = 20)]
    recordings: usize,
    /// Power cuts of the sector change; 0 leaves all power cuts out
    #[arg(long, value_name = "N", default_value_t = 100)]
    cuts: usize,
    /// How the firmware decides, and what its table is learned for
    #[arg(long, value_enum, default_value_t = Method::Fused)]
    method: Method,
    /// Another seed is another world, other slides to learn from, and other trials
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    output: Output,
}

/// Whether all bars are met.
pub(crate) fn run(args: &Args) -> Result<bool, RunError> {
    let elf = &args.firmware.elf;
    let sha256 = args.firmware.show(false)?;
    let began = Instant::now();
    let mut groups = Vec::new();
    let bar = progress::spinner("");
    // recordings first, since it may be that there are none
    if args.recordings > 0 {
        bar.set_message("learning the recorded materials");
        let recorded_texture = under_finger::recordings(args.method.method(), args.seed)?;
        let group = recorded(&recorded_texture, args.recordings, args.method, args.seed)?;
        groups.push(group);
    }
    if args.simulated > 0 {
        bar.set_message("learning the simulated textures");
        let group = simulated(args.simulated, args.method, args.seed, || ())?;
        groups.insert(0, group);
    }
    bar.finish_and_clear();
    let count = groups
        .iter()
        .map(|group| group.unknown.len())
        .sum::<usize>();
    let bar = progress::bar("exploring", count as u64, ", {elapsed}");
    let results = explore(elf, &groups, || bar.inc(1));
    bar.finish_and_clear();
    let cuts = (args.cuts > 0).then(|| make_cuts(args)).transpose()?;
    let report = Report {
        sha256,
        seed: args.seed,
        method: args.method,
        results,
        cuts,
        wall_s: began.elapsed().as_secs_f64(),
    };
    args.output.write(|| report.text(), || report.json())?;
    Ok(report.met())
}

fn make_cuts(args: &Args) -> Result<Cuts, RunError> {
    let elf = &args.firmware.elf;
    let bar = progress::spinner("");
    let prepared = cuts::prepare(elf, args.seed, |what| bar.set_message(what))?;
    bar.finish_and_clear();
    let count = cuts::count(&prepared, args.cuts);
    let bar = progress::bar("cutting", count as u64, ", {eta} left");
    let cuts = cuts::run(elf, &prepared, args.cuts, args.seed, || bar.inc(1))?;
    bar.finish_and_clear();
    Ok(cuts)
}
