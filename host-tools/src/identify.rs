//! `tactus identify`: an exploration shown step by step, on recordings and on the simulated rig.

use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

use anyhow::{Context as _, bail};
use clap::Parser as _;
use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus::collection::{Collection, calibrated, texture_name};
use tactus::evaluate::{MAX_TEXTURES, Method};
use tactus::experiment::{Experiment, Protocol};
use tactus::recordings::{RecordingSet, Slide};
use tactus::replay::{Felt, Replay};
use tactus::show::Show;
use tactus::simulated::SimRig;
use tactus_core::explorer::{self, Config, Explorer};
use tactus_core::features::Plan;
use tactus_core::fused::Observation;
use tactus_core::movement::Movement;
use tactus_core::rig::{Rig, explore};
use tactus_core::table::Table;

use crate::cli::{Command, FIRST_STEPS, Identify, Tactus};
use crate::commands::{feel_folder, find_textures, learn_first, names, progress, read_table};

pub(crate) fn identify(
    args: &Identify,
    folder: &Path,
    material: &str,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let set = RecordingSet::open(folder)?;
    let index = find_material(&set, material)?;
    let name = &set.textures()[index].name;
    let mut random = ChaCha8Rng::seed_from_u64(args.seed);
    let mut bytes = Vec::new();
    let (table, shown): (Table<'_>, Vec<Slide>) = match &args.table {
        Some(file) => {
            let table = read_table(file, &mut bytes)?;
            let mut shown = set.load_texture(index)?;
            // a table learned from this very folder has seen the first slides of every movement
            let trials = table.trials(0, 0).into();
            let (_, felt) = feel_folder(folder)?;
            let learned_as = Method::of(explorer::Method::of(table.contents()));
            let own = learn_first(&set, &felt, trials, learned_as, None);
            if own.is_ok_and(|own| own == table.as_bytes()) {
                let mut seen: HashMap<Movement, usize> = HashMap::new();
                shown.retain(|slide| {
                    let before = seen.entry(slide.movement).or_default();
                    *before += 1;
                    *before > trials
                });
            }
            if shown.is_empty() {
                bail!(
                    "{}: learned from every slide of {name} here; none is left to present",
                    file.display()
                );
            }
            (table, shown)
        }
        None => {
            let (_, felt) = feel_folder(folder)?;
            let experiment = Experiment::recorded(
                names(&set),
                &felt,
                None,
                Protocol::Interleaved,
                args.train_slides,
                args.seed,
            )?;
            let run = experiment.run(index as u64);
            bytes = run.learn(args.method.unwrap_or(Method::Fused).method())?;
            let learned = &run.training()[index];
            let unseen = |slide: &Slide, felt: &Felt| {
                let felt_now = Observation::from(&felt.measurement);
                slide.number == felt.number && !learned.iter().flatten().any(|l| *l == felt_now)
            };
            let slides = set.load_texture(index)?.into_iter().zip(&felt[index]);
            let shown = slides
                .filter(|(slide, felt)| unseen(slide, felt))
                .map(|(slide, _)| slide)
                .collect();
            (Table::read(&bytes)?, shown)
        }
    };
    if table.find(name).is_none() {
        writeln!(
            out,
            "The table does not know {name}: whatever the answer, it will be wrong."
        )?;
    }
    let shown_count = shown.len();
    let mut rig = Replay::new(shown, ChaCha8Rng::from_rng(&mut random));
    writeln!(
        out,
        "An unknown texture, one of {}. Presented: {name}, {shown_count} slides that were not learned from (seed {}).",
        table.textures(),
        args.seed
    )?;
    show_exploration(&mut rig, table, args, &mut random, name, out)
}

/// Explores with `rig` until there is an answer, and shows every step.
fn show_exploration<R>(
    rig: &mut R,
    table: Table<'_>,
    args: &Identify,
    random: &mut ChaCha8Rng,
    truth: &str,
    out: &mut impl Write,
) -> anyhow::Result<()>
where
    R: Rig<Error: std::error::Error + Send + Sync + 'static>,
{
    let best = Method::of(explorer::Method::of(table.contents()));
    let config = Config {
        open: true,
        ..args.stop.config(args.method.unwrap_or(best))
    };
    let mut explorer = Explorer::<MAX_TEXTURES>::new(table, rig.measures(), config)?;
    out.flush()?;
    let mut show = Show::new(table, out);
    let verdict = embassy_futures::block_on(explore(
        rig,
        &mut explorer,
        &Plan::new(),
        || random.next_u32(),
        |event| show.event(event),
    ));
    show.finish(verdict?, explorer.slides(), truth)?;
    Ok(())
}

/// What a newcomer sees first.
pub(crate) fn demonstrate(out: &mut impl Write) -> anyhow::Result<()> {
    writeln!(
        out,
        "Tactus tells what a surface is by touching it. Here is a simulated probe: a BioTac fingertip on a lever, over a\n\
         stage that slides the sample. It learns twenty textures, five trials each at three movements, and is then given\n\
         one of them without being told which. It is felt, decided and controlled by the firmware's own core.\n"
    )?;
    out.flush()?;
    let Some(Command::Identify(args)) =
        Tactus::parse_from(["tactus", "identify", "--simulated"]).command
    else {
        bail!("the demonstration cannot be parsed");
    };
    identify_simulated(&args, out)?;
    writeln!(out, "\n{FIRST_STEPS}\n\nAll commands: tactus --help")?;
    Ok(())
}

pub(crate) fn identify_simulated(args: &Identify, out: &mut impl Write) -> anyhow::Result<()> {
    let mut random = ChaCha8Rng::seed_from_u64(args.seed);
    let unknown = match &args.texture {
        Some(name) => find_textures(std::slice::from_ref(name))?[0],
        None => random.random_range(1..=117),
    };
    if args.train_slides < 2 {
        bail!(
            "--train-slides {}: how slides of one texture differ takes at least two slides",
            args.train_slides
        );
    }
    let collection = Collection {
        seed: args.seed,
        textures: Collection::spread(unknown, args.among),
        trials: u32::try_from(args.train_slides).context("--train-slides")?,
    };
    let bar = progress(collection.textures.len() as u64, "learning textures");
    let calibration = calibrated(collection.setup(unknown, 0))?;
    let method = args.method.unwrap_or(Method::Fused).method();
    let bytes = collection.learn(method, calibration, || bar.inc(1))?;
    bar.finish_and_clear();
    let table = Table::read(&bytes)?;
    let mut rig = SimRig::new(collection.setup(unknown, 1 + u64::from(random.next_u32() % 1000)));
    rig.control().calibrate(calibration)?;
    writeln!(
        out,
        "An unknown texture, one of {}. Under the finger: {} (seed {}).",
        table.textures(),
        texture_name(unknown),
        args.seed
    )?;
    show_exploration(
        &mut rig,
        table,
        args,
        &mut random,
        texture_name(unknown),
        out,
    )?;
    writeln!(
        out,
        "{:.0} s of the rig's time; skin: {:.2} J of sliding{}.",
        rig.now().as_secs_f64(),
        rig.control().skin().energy_j(),
        if rig.control().skin().is_worn() {
            ", look at it"
        } else {
            ""
        }
    )?;
    Ok(())
}

fn find_material(set: &RecordingSet, wanted: &str) -> anyhow::Result<usize> {
    let number = wanted.trim_start_matches("mat").parse::<u32>().ok();
    let by_name = set
        .textures()
        .iter()
        .position(|t| t.name.eq_ignore_ascii_case(wanted));
    by_name
        .or_else(|| set.textures().iter().position(|t| Some(t.id) == number))
        .with_context(|| {
            let known: Vec<String> = set
                .textures()
                .iter()
                .map(|t| format!("{} {}", t.id, t.name))
                .collect();
            format!(
                "--material {wanted}: not in {}, which has: {}",
                set.folder().display(),
                known.join(", ")
            )
        })
}
