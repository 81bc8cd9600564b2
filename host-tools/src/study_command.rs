//! `tactus study`: the stages one after the other, with what they take.

use std::io::Write;
use std::time::Instant;

use tactus::evaluate::Method;
use tactus::study::identify::{Identification, METHODS, WorldRow, experiment, of_pair, pairs};
use tactus::study::pilot::Pilot;
use tactus::study::published::PAIRS;
use tactus::study::report;
use tactus::study::signals::Signals;
use tactus::study::slides::{Recorded, StudyWorld};
use tactus::study::training::{Training, Worn};
use tactus::study::{self, Study};

use crate::cli::{self, Format, Seeds, Stage};
use crate::commands::progress;

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
        let bar = progress(length, what);
        let begun = Instant::now();
        let done = work(&|| bar.inc(1))?;
        bar.finish_and_clear();
        self.0.push((what, begun.elapsed().as_secs_f64()));
        Ok(done)
    }
}

/// Makes a study, or a part of one, and writes its report.
pub(crate) fn study(args: &cli::Study, out: &mut impl Write) -> anyhow::Result<()> {
    report::prepare(&args.out)?;
    let is = |stage| args.stage == stage || args.stage == Stage::All;
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
    if is(Stage::Pilot) {
        let pilot = times.stage("pilot study", Pilot::TEXTURES, |done| {
            Pilot::run(world, done)
        })?;
        study.pilot = Some(pilot);
    }
    if args.stage != Stage::Pilot {
        let recorded = times.stage("training and validation", StudyWorld::RECORDED, |done| {
            world.train_and_validate(done)
        })?;
        if is(Stage::Train) {
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
    report::write(&study, &args.out)?;
    match args.format {
        Format::Json => out.write_all(report::json(&study).as_bytes())?,
        Format::Text => print(args, &study, &times, out)?,
    }
    Ok(())
}

/// Pairs and identification.
fn explore(
    args: &cli::Study,
    world: StudyWorld,
    recorded: &Recorded,
    study: &mut Study,
    times: &mut Times,
) -> anyhow::Result<()> {
    let is = |stage| args.stage == stage || args.stage == Stage::All;
    let simulations = args.simulations;
    let experiment = experiment(recorded, world.seed)?;
    if is(Stage::Pairs) {
        let each = of_pair(simulations);
        let rows = times.stage("pairs", PAIRS.len() as u64 * each, |done| {
            pairs(&experiment, each, done)
        })?;
        study.pairs = Some(rows);
    }
    if is(Stage::Identify) {
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
fn command(args: &cli::Study) -> String {
    let stage = format!("{:?}", args.stage).to_lowercase();
    let mut command = format!("tactus study {stage} --seed {}", args.seed);
    if let Some(Seeds(first, last)) = args.seeds {
        command += &format!(" --seeds {first}-{last}");
    }
    command
        + &format!(
            " --simulations {} --variation {} --out {}",
            args.simulations,
            args.variation,
            args.out.display()
        )
}

fn print(
    args: &cli::Study,
    study: &Study,
    times: &Times,
    out: &mut impl Write,
) -> std::io::Result<()> {
    writeln!(
        out,
        "World {}, variation {}: {}",
        study.seed,
        study.variation,
        args.out.join("report.html").display()
    )?;
    for useful in study.pilot.iter().flat_map(|p| &p.most_useful) {
        let of = study
            .pilot
            .as_ref()
            .and_then(|p| p.movements.get(useful.movement));
        if let Some(m) = of {
            writeln!(
                out,
                "  {:<10} most useful at {:.2} N, {:.1} mm/s",
                useful.property, m.force_n, m.speed_mm_s
            )?;
        }
    }
    if let Some(pairs) = &study.pairs {
        let mean = pairs.iter().map(|p| p.correct).sum::<f64>() / pairs.len() as f64;
        writeln!(out, "  pairs      {mean:.1} % right, paper 99.6 %")?;
    }
    if let Some(identification) = &study.identification {
        for (method, column) in METHODS.into_iter().zip(&identification.columns) {
            print_column(method, column, out)?;
        }
    }
    for world in &study.worlds {
        writeln!(out, "World {}: pairs {:.1} %", world.seed, world.pairs)?;
        for (method, column) in METHODS.into_iter().zip(&world.columns) {
            print_column(method, column, out)?;
        }
    }
    for (what, seconds) in &times.0 {
        writeln!(out, "{seconds:8.1} s  {what}")?;
    }
    if let Some(mib) = peak_mib() {
        writeln!(out, "{mib:8.0} MiB at most")?;
    }
    Ok(())
}

fn print_column(
    method: Method,
    column: &study::identify::Column,
    out: &mut impl Write,
) -> std::io::Result<()> {
    writeln!(
        out,
        "  {:<10} {:5.1} % right, {:5.1} % right and sure, median {} movements",
        format!("{method:?}").to_lowercase(),
        column.correct,
        column.converged,
        column.median
    )
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
