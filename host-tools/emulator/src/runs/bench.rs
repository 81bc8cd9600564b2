//! `cargo xtask bench` asks what the kernels cost: the bench image is given its work on the emulated chip, the
//! instructions that it counted are read, and the plain kernels do the same on this PC.

mod counter;
mod gates;
mod inputs;
mod on_the_rig;
mod row;
#[path = "../../../../firmware/src/workload.rs"]
pub mod workload;

use std::path::PathBuf;

use anyhow::bail;
use clap::Args as Arguments;
use tactus_core::explorer::Method;
use tactus_core::sensor::FingerName;

use self::counter::Bench;
use self::gates::{GATES, gate};
use self::inputs::{SLIDE, extremes, observed, of_gates, slide};
use self::on_the_rig::on_the_rig;
use self::row::{Row, print};
use self::workload::Workload;
use crate::host::args::Firmware;

/// What is counted.
#[derive(Arguments)]
pub(crate) struct Args {
    /// The bench image.
    #[command(flatten)]
    firmware: Firmware,
    /// The rig's image, whose acquisition, load and latency are measured during a slide
    #[arg(long)]
    rig: Option<PathBuf>,
    /// The finger that the rig's image is for; of another one than a BioTac, the rig alone is measured
    #[arg(long, value_name = "NAME", default_value_t = FingerName::Biotac, requires = "rig")]
    finger: FingerName,
}

const DIFFERENT: &str = "not what the plain kernels give: ";

/// Counts and prints; true if every gate is met.
pub(crate) fn run(args: &Args) -> anyhow::Result<bool> {
    if let Some(rig) = args
        .rig
        .as_ref()
        .filter(|_| args.finger != FingerName::Biotac)
    {
        let rows = on_the_rig(rig, args.finger)?;
        print(&rows, "one of the simulated rig");
        return Ok(rows.iter().all(Row::ok));
    }
    let mut bench = Bench::start(&args.firmware.elf)?;
    extremes(&mut bench)?;
    let (samples, source) = slide()?;
    let mut rows = kernels(&mut bench, &samples)?;
    if let Some(rig) = &args.rig {
        rows.extend(on_the_rig(rig, args.finger)?);
        let is_counted = |name: &str| rows.iter().any(|row| row.kernel == name);
        if let Some((name, ..)) = GATES.iter().find(|(name, ..)| !is_counted(name)) {
            bail!("{name}: it has a gate and was not counted");
        }
    }
    print(&rows, source);
    let different = rows.iter().filter(|row| !row.equal);
    let different: Vec<&str> = different.map(|row| row.kernel.as_str()).collect();
    if !different.is_empty() {
        bail!(DIFFERENT.to_owned() + &different.join("; "));
    }
    Ok(rows.iter().all(Row::ok))
}

/// A kernel that is to be counted: its work, and what it is held against.
struct Kernel<'a> {
    name: String,
    unit: &'static str,
    /// Number of them in the work.
    units: usize,
    cmsis: Option<f64>,
    floor: Option<f64>,
    workload: Workload,
    table: &'a [u8],
    words: &'a [i16],
}

impl<'a> Kernel<'a> {
    fn new(
        name: impl Into<String>,
        unit: &'static str,
        workload: Workload,
        table: &'a [u8],
        words: &'a [i16],
    ) -> Self {
        Self {
            name: name.into(),
            unit,
            units: 1,
            cmsis: None,
            floor: None,
            workload,
            table,
            words,
        }
    }

    /// The count of CMSIS-DSP in an expert's hands.
    fn cmsis(self, cmsis: f64) -> Self {
        Self {
            cmsis: Some(cmsis),
            ..self
        }
    }

    fn count(self, bench: &mut Bench) -> anyhow::Result<Row> {
        let counted = bench.count(self.workload, self.table, self.words)?;
        let units = self.units as f64;
        Ok(Row {
            gate: gate(&self.name),
            kernel: self.name,
            unit: self.unit,
            instructions: counted.instructions as f64 / units,
            cmsis: self.cmsis,
            floor: self.floor,
            equal: counted.equal,
        })
    }
}

/// The core's kernels as a rig with 117 textures uses them, on a slide.
fn kernels(bench: &mut Bench, samples: &[i16]) -> anyhow::Result<Vec<Row>> {
    let name = "band-pass FIR with mean power";
    let band_power = Kernel {
        units: SLIDE,
        floor: Some(45.0),
        ..Kernel::new(name, "sample", Workload::BandPower, &[], samples)
    };
    let name = "window, FFT, power and bands";
    let frame = Kernel::new(name, "512 points", Workload::Frame, &[], samples);
    let name = "all features of a slide";
    let all = Kernel::new(name, "slide of 3 s", Workload::Slide, &[], samples);
    let mut rows = vec![
        band_power.cmsis(96.5 + 1.8).count(bench)?,
        frame.cmsis(2.0 * 14_162.0).count(bench)?,
        all.cmsis(1_650_000.0).count(bench)?,
    ];
    for (name, method) in [("paper", Method::Paper), ("fused", Method::Fused)] {
        let table = of_gates(method)?;
        let words = [&observed(&table, method)?[..], &samples[..SLIDE]].concat();
        let (name, unit) = (format!("last sample to decision, {name}"), "decision");
        rows.push(Kernel::new(name, unit, Workload::Decision, &table, &words).count(bench)?);
    }
    Ok(rows)
}
