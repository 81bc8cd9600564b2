//! `tactus study`: the stages one after the other, with what they take.

use std::io::Write;
use std::path::PathBuf;

use clap::ValueEnum;
use serde::Serialize;
use serde::de::DeserializeOwned;
use tactus_study::identify::{
    Column, Identification, METHODS, WorldRow, experiment, of_pair, pairs, short_name,
};
use tactus_study::pilot::Pilot;
use tactus_study::published::PAIRS;
use tactus_study::report;
use tactus_study::signals::Signals;
use tactus_study::slides::{Recorded, StudyWorld};
use tactus_study::training::{Training, Worn};
use tactus_study::{self as study, Study};

use super::progress::{notice, with_progress};

/// Make the paper's whole study on the simulated rig, and report it beside the published numbers
#[derive(clap::Args)]
#[command(after_help = "\
pilot     ten textures, 36 movements: which three movements are most useful (figs. 5, 6, 7)
train     117 textures, three movements: the table, correlations, confusion, wear of the skin (Table 3, figs. 8, 9)
pairs     eight pairs of similar textures at 99.9 % (Table 4)
identify  16 textures among 117 at 99 %: cycling, random, Bayesian exploration, fused (Table 5, figs. 3, 4, 10)
all       all of it

The folder gets report.html, which needs nothing else, study.json with all numbers, and the tables in the
chip's format. The same command gives the same files on any number of cores. Until all is there it is called DIR.part;
the same command goes on where an interrupted one stopped.

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
    #[arg(long, value_name = "X", default_value_t = tactus_study::VARIATION, value_parser = variation)]
    variation: f64,
}

impl Args {
    fn includes(&self, stage: Stage) -> bool {
        self.stage == stage || self.stage == Stage::All
    }

    /// How many stages it takes, with so many other worlds.
    fn stages(&self, worlds: usize) -> usize {
        let pilot = usize::from(self.includes(Stage::Pilot));
        if self.stage == Stage::Pilot {
            return pilot;
        }
        let own = |(stage, number)| if self.includes(stage) { number } else { 0 };
        let own = [(Stage::Train, 1), (Stage::Pairs, 1), (Stage::Identify, 2)].map(own);
        pilot + 1 + own.iter().sum::<usize>() + worlds
    }
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Stage {
    Pilot,
    Train,
    Pairs,
    Identify,
    All,
}

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

struct Stages {
    /// those that are done are kept in it
    folder: report::Folder,
    all: usize,
    begun: usize,
}

impl Stages {
    /// Does a stage with a bar of this length, or takes what an interrupted study has kept of it.
    fn stage<T: Serialize + DeserializeOwned>(
        &mut self,
        what: &'static str,
        length: u64,
        work: impl FnOnce(&(dyn Fn() + Sync)) -> Result<T, study::StudyError>,
    ) -> anyhow::Result<T> {
        self.stage_of(what, None, length, work)
    }

    /// As [`stage`](Self::stage), of one of several worlds.
    fn stage_of<T: Serialize + DeserializeOwned>(
        &mut self,
        what: &'static str,
        world: Option<u64>,
        length: u64,
        work: impl FnOnce(&(dyn Fn() + Sync)) -> Result<T, study::StudyError>,
    ) -> anyhow::Result<T> {
        self.begun += 1;
        let name = match world {
            Some(world) => format!("{what} {world}"),
            None => what.to_owned(),
        };
        let file = name.replace(' ', "-");
        if let Some(kept) = self.folder.kept(&file) {
            notice(&format!("{name}: was done before the interruption"));
            return Ok(kept);
        }
        let bar = format!("stage {} of {}: {name}", self.begun, self.all);
        let done = with_progress(length, bar, work).map_err(|e| e.in_stage(what))?;
        self.folder.keep(&file, &done)?;
        Ok(done)
    }
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let folder = report::Folder::prepare(&args.out, &command(args))?;
    let world = StudyWorld {
        seed: args.seed,
        variation: args.variation,
    };
    let worlds = args.seeds.map(|Seeds(first, last)| first..=last);
    let worlds: Vec<u64> = worlds.into_iter().flatten().collect();
    let mut stages = Stages {
        folder,
        all: args.stages(worlds.len()),
        begun: 0,
    };
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
        let pilot = stages.stage("pilot study", Pilot::TEXTURES, |done| {
            Pilot::run(world, done)
        })?;
        study.pilot = Some(pilot);
    }
    if args.stage != Stage::Pilot {
        let recorded = stages.stage("training and validation", StudyWorld::RECORDED, |done| {
            world.train_and_validate(done)
        })?;
        if args.includes(Stage::Train) {
            let worn = stages.stage("worn skins", Worn::TEXTURES, |done| {
                Worn::record(world, done)
            })?;
            study.training = Some(Training::of(&recorded.training, &worn)?);
        }
        explore(args, world, &recorded, &mut study, &mut stages)?;
        for seed in worlds {
            let length = StudyWorld::RECORDED + WorldRow::explorations(args.simulations);
            let row = stages.stage_of("world", Some(seed), length, |done| {
                let world = StudyWorld { seed, ..world };
                let recorded = world.train_and_validate(done)?;
                WorldRow::run(world, &recorded, args.simulations, done)
            })?;
            study.worlds.push(row);
        }
    }
    report::write(&study, stages.folder)?;
    Ok(print(args, &study, out)?)
}

fn explore(
    args: &Args,
    world: StudyWorld,
    recorded: &Recorded,
    study: &mut Study,
    stages: &mut Stages,
) -> anyhow::Result<()> {
    let simulations = args.simulations;
    let experiment = experiment(recorded, world.seed)?;
    if args.includes(Stage::Pairs) {
        let each = of_pair(simulations);
        let rows = stages.stage("pairs", PAIRS.len() as u64 * each, |done| {
            pairs(&experiment, each, done)
        })?;
        study.pairs = Some(rows);
    }
    if args.includes(Stage::Identify) {
        let length = Identification::explorations(simulations);
        let identification = stages.stage("identification", length, |done| {
            Identification::run(&experiment, simulations, done)
        })?;
        study.identification = Some(identification);
        study.signals = Some(stages.stage("signals", 0, |_| Signals::run(world))?);
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
