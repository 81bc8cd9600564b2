//! `cargo xtask bench` asks what the kernels cost: the bench image is given its work on the emulated chip, the
//! instructions that it counted are read, and the plain kernels do the same on this PC.

mod counter;
pub(crate) mod error;
mod gates;
mod inputs;
mod on_the_rig;
mod row;
pub mod slowed;
#[path = "../../../../firmware/src/bench/workload.rs"]
pub mod workload;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args as Arguments;
use serde_json::Value;
use tactus_core::explorer::Method;
use tactus_core::sensor::FingerName;
use tactus_core::wire::Identify;
use tactus_lab::eval::learn::{TableError, know_lengths};
use tactus_lab::sim::collection::Collection;

use self::counter::Bench;
use self::error::BenchError;
use self::gates::{GATES, gate};
use self::inputs::{SLIDE, Wanted, extremes, observed, of_gates, slide};
use self::on_the_rig::on_the_rig;
use self::row::{Row, print};
use self::workload::Workload;
use super::error::RunError;
use crate::host::args::{Firmware, Format};

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
    /// For people, or JSON for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// An exploration of one slide, the same each time.
fn one_slide() -> Identify {
    Identify {
        threshold: 1.0,
        max_slides: 1,
        open: false,
        seed: 1,
        ..Identify::default()
    }
}

/// Exit code when gates are missed and every result is right. `cargo xtask test` knows it.
const MISSED: u8 = 2;

/// Counts, and says by its exit code whether every gate is met.
pub(crate) fn run(args: &Args) -> Result<ExitCode, RunError> {
    let met = count(args)?;
    Ok(if met {
        ExitCode::SUCCESS
    } else {
        ExitCode::from(MISSED)
    })
}

fn count(args: &Args) -> Result<bool, BenchError> {
    let text = args.format == Format::Text;
    if let Some(rig) = args
        .rig
        .as_ref()
        .filter(|_| args.finger != FingerName::Biotac)
    {
        let rows = on_the_rig(rig, args.finger)?;
        if text {
            print(&rows, "one of the simulated rig");
        } else {
            println!("{}", Value::from_iter(rows.iter().map(Row::json)));
        }
        return Ok(rows.iter().all(Row::ok));
    }
    let mut bench = Bench::start(&args.firmware.elf)?;
    extremes(&mut bench)?;
    let (samples, source) = slide()?;
    let mut rows = kernels(&mut bench, &samples)?;
    let mut slow = None;
    if let Some(rig) = &args.rig {
        rows.extend(on_the_rig(rig, args.finger)?);
        slow = Some(slowed::slowed(rig, slowed::WORST_RATIO * slowed::RESERVE));
        let is_counted = |name: &str| rows.iter().any(|row| row.kernel == name);
        if let Some((name, ..)) = GATES.iter().find(|(name, ..)| !is_counted(name)) {
            let (kernel, what) = ((*name).to_owned(), "it has a gate and was not counted");
            return Err(BenchError::Unsuitable { kernel, what });
        }
    }
    if text {
        print(&rows, source);
        if let Some(slowed) = &slow {
            slowed::print(slowed);
        }
    } else {
        println!("{}", Value::from_iter(rows.iter().map(Row::json)));
    }
    let different = rows.iter().filter(|row| !row.equal);
    let different: Vec<String> = different.map(|row| row.kernel.clone()).collect();
    if !different.is_empty() {
        return Err(BenchError::Different(different));
    }
    let in_time = slow.is_none_or(|slowed| slowed::missed(&slowed).is_empty());
    Ok(in_time && rows.iter().all(Row::ok))
}

/// A kernel that is to be counted: its work, and what it is held against.
struct Kernel<'a> {
    name: String,
    unit: &'static str,
    /// How many of them the work has.
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

    /// What CMSIS-DSP takes in an expert's hands.
    fn cmsis(self, cmsis: f64) -> Self {
        Self {
            cmsis: Some(cmsis),
            ..self
        }
    }

    fn count(self, bench: &mut Bench) -> Result<Row, BenchError> {
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
fn kernels(bench: &mut Bench, samples: &[i16]) -> Result<Vec<Row>, BenchError> {
    let name = "band-pass FIR with mean power";
    let band_power = Kernel {
        units: SLIDE,
        floor: Some(45.0),
        ..Kernel::new(name, "sample", Workload::BandPower, &[], samples)
    };
    let name = "window, FFT, power accumulated";
    let frame = Kernel::new(name, "512 points", Workload::Frame, &[], samples);
    let name = "all features of a slide";
    let all = Kernel::new(name, "slide of 3 s", Workload::Slide, &[], samples);
    let mut rows = vec![
        band_power.cmsis(96.5 + 1.8).count(bench)?,
        frame.cmsis(2.0 * 14_162.0).count(bench)?,
        all.cmsis(1_650_000.0).count(bench)?,
    ];
    for method in [Method::Paper, Method::Fused] {
        let table = of_gates(method)?;
        rows.extend(decisions(bench, samples, &table, method)?);
    }
    rows.push(look(bench)?);
    Ok(rows)
}

/// What decisions take with a table.
fn decisions(
    bench: &mut Bench,
    samples: &[i16],
    table: &[u8],
    method: Method,
) -> Result<Vec<Row>, BenchError> {
    let is_paper = method == Method::Paper;
    let name = if is_paper { "paper" } else { "fused" };
    let [many, few] = [50, 20].map(|live| observed(table, method, live));
    let (many, few) = (many?, few?);
    let words = &many.words[..];
    let last = [words, &samples[..SLIDE]].concat();
    let kernel = |what: &str, unit, workload, words| {
        Kernel::new(format!("{what}, {name}"), unit, workload, table, words)
    };
    let choice = |observed: &Wanted| format!("choice among {} live textures", observed.live);
    let mut posterior = kernel("posterior", "117 textures", Workload::Observe, words);
    let first = kernel("first choice", "choice", Workload::FirstChoice, words);
    let mut of_many = kernel(&choice(&many), "choice", Workload::Choice, words);
    let of_few = kernel(&choice(&few), "choice", Workload::Choice, &few.words);
    let decision = "last sample to decision";
    let decision = kernel(decision, "decision", Workload::Decision, &last);
    let begin = kernel("an explorer begins", "exploration", Workload::Begin, words);
    if is_paper {
        posterior = posterior.cmsis(23_412.0);
        of_many = Kernel {
            floor: Some(154_000.0),
            ..of_many.cmsis(251_000.0)
        };
    }
    let kernels = [posterior, first, of_many, of_few, decision, begin].into_iter();
    let is_counted = |kernel: &Kernel<'_>| !(is_paper && kernel.words == few.words);
    kernels
        .filter(is_counted)
        .map(|kernel| kernel.count(bench))
        .collect()
}

/// What a look at a slide takes that may end early: by a table whose three lengths say the same as the whole slide.
fn look(bench: &mut Bench) -> Result<Row, BenchError> {
    let whole = of_gates(Method::Fused)?;
    let words = observed(&whole, Method::Fused, 50)?.words;
    let lengths = Collection::LENGTHS_MS.map(|ms| (ms, whole.clone(), u64::MAX));
    let table = know_lengths(&whole, &lengths).map_err(TableError::from)?;
    let name = "a look at a slide, fused";
    Kernel::new(name, "117 textures", Workload::Look, &table, &words).count(bench)
}
