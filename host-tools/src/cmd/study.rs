//! `tactus study`: the stages one after the other, with what they take.

use std::io::Write;
use std::path::PathBuf;
use std::time::Instant;

use clap::ValueEnum;
use tactus::study::identify::{
    Column, Identification, METHODS, WorldRow, experiment, of_pair, pairs,
};
use tactus::study::pilot::Pilot;
use tactus::study::published::PAIRS;
use tactus::study::report;
use tactus::study::signals::Signals;
use tactus::study::slides::{Recorded, StudyWorld};
use tactus::study::training::{Training, Worn};
use tactus::study::{self, Study};

use super::output::Format;
use super::progress::with_progress;

/// Make the paper's whole study on the simulated rig, and report it beside the published numbers
#[derive(clap::Args)]
#[command(after_help = "\
pilot     ten textures, 36 movements: which three movements are most useful (figs. 5, 6, 7)
train     117 textures, three movements: the table, correlations, confusion, wear of the skin (Table 3, figs. 8, 9)
pairs     eight pairs of similar textures at 99.9 % (Table 4)
identify  16 textures among 117 at 99 %: cycling, random, Bayesian exploration, fused (Table 5, figs. 3, 4, 10)
all       all of it

The folder gets report.html, which needs nothing else, every figure as .svg, every table as .csv, the tables in the chip's
format, and study.json. The same command gives the same files on any number of cores.

Examples:
  tactus study all --out study
  tactus study identify --seeds 11-20 --out worlds     the same in ten worlds")]
pub(crate) struct Args {
    /// Which part of it
    #[arg(value_enum)]
    stage: Stage,
    /// The folder to write: new, or empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Another seed is another world: other textures of the same names, another finger and rig
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Pairs and identification in these worlds, too
    #[arg(long, value_name = "A-B", value_parser = seeds)]
    seeds: Option<Seeds>,
    /// Virtual explorations of each way of exploring; each of the eight pairs has an eighth of them
    #[arg(long, value_name = "N", default_value_t = 8000, value_parser = clap::value_parser!(u64).range(16..=1_000_000))]
    simulations: u64,
    /// How much one touch of a texture differs from the next, 0 to 3: the world's one free knob
    #[arg(long, value_name = "X", default_value_t = tactus::study::VARIATION, value_parser = variation)]
    variation: f64,
    /// How to print the figures; json is what study.json holds
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

impl Args {
    fn includes(&self, stage: Stage) -> bool {
        self.stage == stage || self.stage == Stage::All
    }
}

/// Parts of the study.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Stage {
    Pilot,
    Train,
    Pairs,
    Identify,
    All,
}

/// Worlds from the first to the last.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
struct Seeds(u64, u64);

/// Most worlds of one study: each takes minutes.
const MAX_WORLDS: u64 = 100;

fn seeds(text: &str) -> Result<Seeds, String> {
    let (first, last) = text.split_once('-').unwrap_or((text, text));
    match (first.parse(), last.parse()) {
        (Ok(first), Ok(last)) if first <= last && last - first < MAX_WORLDS => {
            Ok(Seeds(first, last))
        }
        _ => Err(format!(
            "the first and the last seed, at most {MAX_WORLDS} of them, such as 11-20"
        )),
    }
}

fn variation(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if (0.0..=3.0).contains(&x) => Ok(x),
        _ => Err("a factor from 0 to 3, such as 1".to_owned()),
    }
}

/// What the stages took, for people to see: no part of the report, which is the same each time.
#[derive(Default)]
struct Times(Vec<(&'static str, f64)>);

impl Times {
    /// Does a stage with a bar of this length.
    fn stage<T>(
        &mut self,
        what: &'static str,
        length: u64,
        work: impl FnOnce(&(dyn Fn() + Sync)) -> Result<T, study::StudyError>,
    ) -> Result<T, study::StudyError> {
        let begun = Instant::now();
        let done = with_progress(length, what, work).map_err(|e| e.in_stage(what))?;
        self.0.push((what, begun.elapsed().as_secs_f64()));
        Ok(done)
    }
}

/// Makes a study, or a part of one, and writes its report.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let folder = report::Folder::prepare(&args.out)?;
    let world = StudyWorld {
        seed: args.seed,
        variation: args.variation,
    };
    let mut times = Times::default();
    let mut study = Study {
        version: env!("CARGO_PKG_VERSION"),
        command: command(args),
        seed: args.seed,
        variation: args.variation,
        simulations: args.simulations,
        pilot: None,
        training: None,
        pairs: None,
        identification: None,
        signals: None,
        worlds: Vec::new(),
    };
    if args.includes(Stage::Pilot) {
        let pilot = times.stage("pilot study", Pilot::TEXTURES, |done| {
            Pilot::run(world, done)
        })?;
        study.pilot = Some(pilot);
    }
    if args.stage != Stage::Pilot {
        let recorded = times.stage("training and validation", StudyWorld::RECORDED, |done| {
            world.train_and_validate(done)
        })?;
        if args.includes(Stage::Train) {
            let worn = times.stage("worn skins", Worn::TEXTURES, |done| {
                Worn::record(world, done)
            })?;
            study.training = Some(Training::of(&recorded.training, &worn)?);
        }
        explore(args, world, &recorded, &mut study, &mut times)?;
        if let Some(Seeds(first, last)) = args.seeds {
            let explorations = WorldRow::explorations(args.simulations);
            let length = (last - first + 1) * (StudyWorld::RECORDED + explorations);
            study.worlds = times.stage("worlds", length, |done| {
                let row = |seed| {
                    let world = StudyWorld { seed, ..world };
                    let recorded = world.train_and_validate(done)?;
                    WorldRow::run(world, &recorded, args.simulations, done)
                };
                (first..=last).map(row).collect()
            })?;
        }
    }
    report::write(&study, &folder)?;
    match args.format {
        Format::Json => out.write_all(report::json(&study)?.as_bytes())?,
        Format::Text => print(args, &study, &times, out)?,
    }
    Ok(())
}

/// Pairs and identification.
fn explore(
    args: &Args,
    world: StudyWorld,
    recorded: &Recorded,
    study: &mut Study,
    times: &mut Times,
) -> anyhow::Result<()> {
    let simulations = args.simulations;
    let experiment = experiment(recorded, world.seed)?;
    if args.includes(Stage::Pairs) {
        let each = of_pair(simulations);
        let rows = times.stage("pairs", PAIRS.len() as u64 * each, |done| {
            pairs(&experiment, each, done)
        })?;
        study.pairs = Some(rows);
    }
    if args.includes(Stage::Identify) {
        let length = METHODS.len() as u64 * simulations;
        let identification = times.stage("identification", length, |done| {
            Identification::run(&experiment, simulations, done)
        })?;
        study.identification = Some(identification);
        study.signals = Some(times.stage("signals", 0, |_| Signals::run(world))?);
    }
    Ok(())
}

/// The command that was given, without what does not change the report.
fn command(args: &Args) -> String {
    let stage = format!("{:?}", args.stage).to_lowercase();
    let seeds = args
        .seeds
        .map(|Seeds(first, last)| format!(" --seeds {first}-{last}"));
    format!(
        "tactus study {stage} --seed {}{} --simulations {} --variation {} --out {}",
        args.seed,
        seeds.unwrap_or_default(),
        args.simulations,
        args.variation,
        args.out.display()
    )
}

fn print(args: &Args, study: &Study, times: &Times, out: &mut impl Write) -> std::io::Result<()> {
    writeln!(
        out,
        "World {}, variation {}: {}",
        study.seed,
        study.variation,
        args.out.join("report.html").display()
    )?;
    if let Some(pilot) = &study.pilot {
        for useful in &pilot.most_useful {
            let (property, m) = (&useful.property, &pilot.movements[useful.movement]);
            let (force_n, speed_mm_s) = (m.force_n, m.speed_mm_s);
            writeln!(
                out,
                "  {property:<10} most useful at {force_n:.2} N, {speed_mm_s:.1} mm/s"
            )?;
        }
    }
    if let Some(pairs) = &study.pairs {
        let mean = pairs.iter().map(|p| p.correct).sum::<f64>() / pairs.len() as f64;
        writeln!(out, "  pairs      {mean:.1} % right, paper 99.6 %")?;
    }
    if let Some(identification) = &study.identification {
        print_columns(&identification.columns, out)?;
    }
    for world in &study.worlds {
        writeln!(out, "World {}: pairs {:.1} %", world.seed, world.pairs)?;
        print_columns(&world.columns, out)?;
    }
    for (what, seconds) in &times.0 {
        writeln!(out, "{seconds:8.1} s  {what}")?;
    }
    if let Some(mib) = peak_mib() {
        writeln!(out, "{mib:8.0} MiB at most")?;
    }
    Ok(())
}

fn print_columns(columns: &[Column], out: &mut impl Write) -> std::io::Result<()> {
    for (method, column) in METHODS.into_iter().zip(columns) {
        let method = format!("{method:?}").to_lowercase();
        writeln!(
            out,
            "  {method:<10} {:5.1} % right, {:5.1} % right and sure, median {} movements",
            column.correct, column.converged, column.median
        )?;
    }
    Ok(())
}

/// Most memory that this process has held, where the system tells.
fn peak_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().strip_suffix(" kB")?.trim().parse().ok()?;
    Some(kib / 1024.0)
}
