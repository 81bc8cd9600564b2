//! `tactus study`: the stages one after the other.

use std::io::Write;
use std::path::PathBuf;

use anyhow::Context as _;
use clap::ValueEnum;
use tactus_study::identify::{
    Column, Identification, METHODS, experiment, of_pair, pairs, pairs_mean, short_name,
};
use tactus_study::pilot::Pilot;
use tactus_study::published::PAIRS;
use tactus_study::report::{self, Study};
use tactus_study::slides::{StudyWorld, VARIATION};
use tactus_study::training::Training;

use super::output::Format;
use super::progress::with_progress;

/// Make the paper's whole study on the simulated rig, and report it beside the published numbers
#[derive(clap::Args)]
#[command(after_help = "\
Stages:
  pilot      ten textures, 36 movements: which movements are most useful (fig. 7)
  train      117 textures, three movements: the table (Table 3, fig. 9)
  pairs      eight pairs of similar textures at 99.9 % (Table 4)
  identify   16 textures among 117 at 99 %, in four ways (Table 5)
  all        all of it

The folder gets report.html, which needs nothing else, study.json with all numbers, and the tables in the
chip's format. The same command gives the same files on any number of cores.

Example:
  tactus study all --out study")]
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
    /// Virtual explorations of each way of exploring; each of the eight pairs has an eighth of them
    #[arg(long, value_name = "N", default_value_t = 8000,
        value_parser = clap::value_parser!(u64).range(16..=1_000_000))]
    simulations: u64,
    /// How much one touch of a texture differs from the next, 0 to 3: the world's one free knob
    #[arg(long, value_name = "X", default_value_t = VARIATION, value_parser = variation)]
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

fn variation(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(x) if (0.0..=3.0).contains(&x) => Ok(x),
        _ => Err("a factor from 0 to 3, such as 1".to_owned()),
    }
}

/// Does a stage with a bar of this length.
fn stage<T>(
    what: String,
    length: u64,
    work: impl FnOnce(&(dyn Fn() + Sync)) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    with_progress(length, what.clone(), work).context(what)
}

/// Makes a study, or a part of one, and writes its report.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let mut folder = report::prepare(&args.out)?;
    let study = study(args)?;
    report::write(&study, &mut folder)?;
    match args.format {
        Format::Json => out.write_all(report::json(&study)?.as_bytes())?,
        Format::Text => print(args, &study, out)?,
    }
    Ok(())
}

fn study(args: &Args) -> anyhow::Result<Study> {
    let world = StudyWorld {
        seed: args.seed,
        variation: args.variation,
    };
    let simulations = args.simulations;
    let mut study = Study {
        version: env!("CARGO_PKG_VERSION"),
        command: command(args),
        seed: args.seed,
        variation: args.variation,
        simulations,
        pilot: None,
        training: None,
        pairs: None,
        identification: None,
    };
    if args.includes(Stage::Pilot) {
        let pilot = stage("pilot study".into(), Pilot::TEXTURES, |done| {
            Pilot::run(world, done)
        });
        study.pilot = Some(pilot?);
    }
    if args.stage == Stage::Pilot {
        return Ok(study);
    }
    let recorded = stage(
        "training and validation".into(),
        StudyWorld::RECORDED,
        |done| world.train_and_validate(done),
    )?;
    if args.includes(Stage::Train) {
        study.training = Some(Training::of(&recorded.training)?);
    }
    let experiment = experiment(&recorded, world.seed)?;
    if args.includes(Stage::Pairs) {
        let each = of_pair(simulations);
        let rows = stage("pairs".into(), PAIRS.len() as u64 * each, |done| {
            pairs(&experiment, each, done)
        });
        study.pairs = Some(rows?);
    }
    if args.includes(Stage::Identify) {
        let length = Identification::explorations(simulations);
        let identification = stage("identification".into(), length, |done| {
            Identification::run(&experiment, simulations, done)
        });
        study.identification = Some(identification?);
    }
    Ok(study)
}

/// The command that was given, without what does not change the report.
fn command(args: &Args) -> String {
    let stage = format!("{:?}", args.stage).to_lowercase();
    format!(
        "tactus study {stage} --seed {} --simulations {} --variation {} --out {}",
        args.seed,
        args.simulations,
        args.variation,
        args.out.display()
    )
}

fn print(args: &Args, study: &Study, out: &mut impl Write) -> std::io::Result<()> {
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
        let mean = pairs_mean(pairs);
        let paper = PAIRS.iter().map(|pair| pair.machine).sum::<f64>() / PAIRS.len() as f64;
        writeln!(out, "  pairs      {mean:.1} % right, paper {paper:.1} %")?;
    }
    if let Some(identification) = &study.identification {
        print_columns(&identification.columns, out)?;
    }
    Ok(())
}

fn print_columns(columns: &[Column], out: &mut impl Write) -> std::io::Result<()> {
    for (method, column) in METHODS.into_iter().zip(columns) {
        let method = short_name(method);
        writeln!(
            out,
            "  {method:<10} {:5.1} % right, {:5.1} % right and sure, median {} movement{}",
            column.correct,
            column.converged,
            column.median,
            if column.median == 1.0 { "" } else { "s" }
        )?;
    }
    Ok(())
}
