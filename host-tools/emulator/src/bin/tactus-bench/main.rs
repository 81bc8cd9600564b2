//! `cargo xtask bench` asks this program what the kernels cost: it gives the bench image its work, reads the instructions that
//! it counted, and does the same with the plain kernels on this PC.

mod chip;
mod rig;
mod work;
#[path = "../../../../../firmware/src/workload.rs"]
pub mod workload;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::{Context as _, ensure};
use clap::{Parser, ValueEnum};
use serde_json::{Value, json};
use tactus::study::report;
use tactus_core::explorer::Method;

use chip::Bench;
use rig::on_the_rig;
use work::{corners, felt, slide, synthetic};
use workload::Workload;

/// Counts the instructions of the core's kernels on the emulated chip
#[derive(Parser)]
struct Cli {
    /// The bench image
    elf: PathBuf,
    /// The rig's image, whose acquisition, load and latency are measured during a slide
    #[arg(long)]
    rig: Option<PathBuf>,
    /// For people, or JSON for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Tell on stderr which functions each kernel spends its instructions in
    #[arg(long)]
    profile: bool,
    /// Tell how table and decision grow with the number of textures instead
    #[arg(long)]
    growth: bool,
    /// With --growth, draw that as SVG, too
    #[arg(long, value_name = "FILE", requires = "growth")]
    plot: Option<PathBuf>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

/// Samples of a slide of 3 s.
const SLIDE: usize = 6600;
/// Textures of the paper, and of the table that comes with the firmware.
const TEXTURES: usize = 117;
/// Less probable textures are left out of a choice: the core's own limit.
const NEGLIGIBLE: f32 = 1e-6;
/// Exit code when gates are missed and every result is right. `cargo xtask test` knows it.
const MISSED: u8 = 2;

fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(MISSED),
        Err(why) => {
            eprintln!("error: {why:#}");
            ExitCode::FAILURE
        }
    }
}

/// A kernel and what it is held against, all per unit.
struct Row {
    kernel: String,
    unit: &'static str,
    instructions: f64,
    cycles: Option<f64>,
    gate: Option<f64>,
    /// CMSIS-DSP in an expert's hands, and the floor of the instruction set (facts/performance.md).
    cmsis: Option<f64>,
    floor: Option<f64>,
    /// The chip's result is the plain kernels' to the bit.
    equal: bool,
}

impl Row {
    fn ok(&self) -> bool {
        self.equal && self.gate.is_none_or(|gate| self.instructions <= gate)
    }
}

fn run(cli: &Cli) -> anyhow::Result<bool> {
    let mut bench = Bench::start(cli)?;
    if cli.growth {
        return growth(&mut bench, cli.plot.as_deref());
    }
    let model = std::mem::take(&mut bench.model);
    corners(&mut bench)?;
    bench.model = model;
    let mut rows = rows(&mut bench)?;
    if let Some(rig) = &cli.rig {
        rows.extend(on_the_rig(rig)?);
    }
    match cli.format {
        Format::Text => print(&rows, bench.source),
        Format::Json => println!("{}", Value::from_iter(rows.iter().map(json))),
    }
    let different: Vec<_> = rows.iter().filter(|row| !row.equal).collect();
    for row in &different {
        eprintln!("error: {}: not what the plain kernels give", row.kernel);
    }
    ensure!(different.is_empty(), "the chip's kernels are wrong");
    Ok(rows.iter().all(Row::ok))
}

fn json(row: &Row) -> Value {
    json!({
        "kernel": row.kernel,
        "unit": row.unit,
        "instructions": row.instructions,
        "gate": row.gate,
        "ok": row.ok(),
    })
}

fn print(rows: &[Row], source: &str) {
    let number = |number: Option<f64>| match number {
        None => "-".into(),
        Some(n) if n < 1000.0 => format!("{n:.1}"),
        Some(n) => format!("{n:.0}"),
    };
    println!(
        "{:48} {:16} {:>12} {:>9} {:>9} {:>9} {:>6}  {:>9}",
        "kernel", "unit", "instructions", "cycles", "CMSIS", "floor", "ratio", "gate"
    );
    for row in rows {
        let ratio = row.floor.or(row.cmsis).map(|to| row.instructions / to);
        let verdict = match (row.gate, row.equal) {
            (_, false) => "  DIFFERS from the plain kernels",
            (None, true) => "",
            (Some(_), true) if row.ok() => "  ok",
            (Some(_), true) => "  MISSED",
        };
        println!(
            "{:48} {:16} {:>12} {:>9} {:>9} {:>9} {:>6}  {:>9}{verdict}",
            row.kernel,
            row.unit,
            number(Some(row.instructions)),
            number(row.cycles),
            number(row.cmsis),
            number(row.floor),
            ratio.map_or("-".into(), |ratio| format!("{ratio:.2}")),
            number(row.gate),
        );
    }
    println!(
        "\nInstructions by the core's counter on the emulated board; the slide is {source}; results compared with the plain\n\
         kernels on this PC, to the bit. Ratio: to the floor where one is known, else to CMSIS-DSP. Cycles are a model."
    );
}

fn rows(bench: &mut Bench) -> anyhow::Result<Vec<Row>> {
    let mut rows = Vec::new();
    let mut count = |kernel: &str,
                     unit: &'static str,
                     units: usize,
                     gate: Option<f64>,
                     cmsis: Option<f64>,
                     floor: Option<f64>,
                     workload: Workload,
                     table: &[u8],
                     words: &[i16]|
     -> anyhow::Result<()> {
        let counted = bench
            .count(workload, table, words)
            .with_context(|| kernel.to_owned())?;
        if bench.profile {
            bench.tell_profile(kernel);
        }
        let units = units as f64;
        rows.push(Row {
            kernel: kernel.into(),
            unit,
            instructions: counted.instructions as f64 / units,
            cycles: counted.cycles.map(|cycles| cycles / units),
            gate,
            cmsis,
            floor,
            equal: counted.equal,
        });
        Ok(())
    };
    let slide = slide()?;
    let samples = slide.0.as_slice();
    let none: &[u8] = &[];
    count(
        "band-pass FIR with mean power",
        "sample",
        SLIDE,
        Some(60.0),
        Some(96.5 + 1.8),
        Some(45.0),
        Workload::BandPower,
        none,
        samples,
    )?;
    count(
        "window, FFT, power accumulated",
        "512 points",
        1,
        Some(24_000.0),
        Some(2.0 * 14_162.0),
        None,
        Workload::Frame,
        none,
        samples,
    )?;
    count(
        "all features of a slide",
        "slide of 3 s",
        1,
        Some(1_100_000.0),
        Some(1_650_000.0),
        None,
        Workload::Slide,
        none,
        samples,
    )?;
    let factory =
        std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/factory.tact"))
            .context("firmware/factory.tact")?;
    let paper = synthetic(Method::Paper, TEXTURES)?;
    for (name, table, method, gates) in [
        (
            "paper",
            &paper,
            Method::Paper,
            [2500.0, 2000.0, 450_000.0, 500_000.0],
        ),
        (
            "fused",
            &factory,
            Method::Fused,
            [12_000.0, 2000.0, 250_000.0, 300_000.0],
        ),
    ] {
        let [posterior, first, choice, decision] = gates;
        let is_paper = method == Method::Paper;
        let felt = felt(table, method, 50)?;
        count(
            &format!("posterior, {name}"),
            "117 textures",
            1,
            Some(posterior),
            is_paper.then_some(23_412.0),
            None,
            Workload::Observe,
            table,
            &felt.words,
        )?;
        count(
            &format!("first choice, {name}"),
            "choice",
            1,
            Some(first),
            None,
            None,
            Workload::FirstChoice,
            table,
            &felt.words,
        )?;
        count(
            &format!("choice among {} live textures, {name}", felt.live),
            "choice",
            1,
            Some(choice),
            is_paper.then_some(251_000.0),
            is_paper.then_some(154_000.0),
            Workload::Choice,
            table,
            &felt.words,
        )?;
        if !is_paper {
            let fewer = self::felt(table, method, 20)?;
            count(
                &format!("choice among {} live textures, {name}", fewer.live),
                "choice",
                1,
                Some(45_000.0),
                None,
                None,
                Workload::Choice,
                table,
                &fewer.words,
            )?;
        }
        let words = [&felt.words[..], &samples[..SLIDE]].concat();
        count(
            &format!("last sample to decision, {name}"),
            "decision",
            1,
            Some(decision),
            None,
            None,
            Workload::Decision,
            table,
            &words,
        )?;
        count(
            &format!("an explorer begins, {name}"),
            "exploration",
            1,
            None,
            None,
            None,
            Workload::Begin,
            table,
            &felt.words,
        )?;
    }
    bench.source = slide.1;
    Ok(rows)
}

/// Table bytes, and instructions of a fused decision of three movements after a typical slide.
fn growth(bench: &mut Bench, plot: Option<&Path>) -> anyhow::Result<bool> {
    bench.model = false;
    println!(
        "{:>8} {:>12} {:>12} {:>6} {:>12}",
        "textures", "table bytes", "posterior", "live", "choice"
    );
    let mut equal = true;
    let mut curves = [
        "table, KB",
        "posterior, thousands of instructions",
        "choice among up to 50 live, thousands",
    ]
    .map(|name| (name, Vec::new()));
    for textures in [20, 117, 500, workload::MOST_ROOM, 2000] {
        let table = synthetic(Method::Fused, textures)?;
        curves[0]
            .1
            .push((textures as f64, table.len() as f64 / 1024.0));
        if textures > workload::MOST_ROOM {
            println!(
                "{textures:>8} {:>12}   more than the chip's RAM has room for",
                table.len()
            );
            continue;
        }
        let felt = felt(&table, Method::Fused, textures.min(50))?;
        let posterior = bench.count(Workload::Observe, &table, &felt.words)?;
        let choice = bench.count(Workload::Choice, &table, &felt.words)?;
        equal &= posterior.equal && choice.equal;
        println!(
            "{textures:>8} {:>12} {:>12} {:>6} {:>12}",
            table.len(),
            posterior.instructions,
            felt.live,
            choice.instructions
        );
        let counts = [posterior, choice].map(|counted| counted.instructions as f64 * 1e-3);
        for ((_, points), y) in curves.iter_mut().skip(1).zip(counts) {
            points.push((textures as f64, y));
        }
    }
    if let Some(file) = plot {
        let title = "A fused decision after a slide, three movements";
        let svg = report::curves(title, "textures of the table", "", &curves)?;
        std::fs::write(file, svg).with_context(|| format!("cannot write {}", file.display()))?;
    }
    ensure!(equal, "the chip's kernels are wrong");
    Ok(true)
}
