//! `tactus identify`: an exploration shown step by step, on recordings and on the simulated rig.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use clap::Parser;
use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{self, Config, Explorer};
use tactus_core::probe::event_of;
use tactus_core::probe::explore::{ExplorationStep, ExploreError, Rejection, explore};
use tactus_core::rig::Rig;
use tactus_core::table::{MAX_TEXTURES, Table};
use tactus_lab::data::quality::SlideMarks;
use tactus_lab::data::replay::{Replay, ReplayError};
use tactus_lab::eval::evaluate::Method;
use tactus_lab::eval::experiment::{Experiment, Protocol};
use tactus_lab::eval::first::at_least_two;
use tactus_lab::eval::learn::Expected;
use tactus_lab::eval::learned::LeftOut;
use tactus_lab::eval::show::{Show, count, is_right};
use tactus_lab::eval::transcript::{Answer, Transcript};
use tactus_lab::sim::collection::{Collection, calibrated, texture_name};
use tactus_lab::sim::rig::SimRig;
use tactus_study::pictures::exploration::Exploration;

use super::args::{Expecting, Recordings, Stop};
use super::output::{Done, Format, UsageError, print_json};
use super::plot::{Canvas, Plot};
use super::progress::{notice, with_progress};
use super::table_file::read_table;
use super::textures::{find_material, find_textures, measure_folder, of_one_finger};

pub(crate) const FIRST_STEPS: &str = "\
Try first:
  tactus                                           a simulated probe explores
  tactus identify --simulated --texture burlap     another texture
With recordings, such as those of `tactus unpack` (there with --train-slides 2):
  tactus identify --recordings DIR --material 91   recognises a recorded texture
  tactus features --recordings DIR                 what every slide measures
  tactus evaluate --recordings DIR                 how often answers are right
With a probe, or with the emulated board of `cargo xtask emulate --port 7429`:
  tactus device monitor                            what it measures, live

Recordings of a real BioTac: https://github.com/dexrob/BioTac_slide_20_50,
which `tactus import` reads. `tactus simulate` makes others.";

/// Recognise an unknown texture from its slides, and show every step
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus identify --simulated --texture burlap
  tactus identify --simulated --among 117 --method paper      as published: one property a slide, 117 textures
  tactus identify --recordings DIR --material 'bath towel'
  tactus identify --recordings DIR --material 3 --table FILE  with a table that `tactus learn` wrote
  tactus identify --simulated --plot pictures                 with pictures

--plot draws how probable each texture was (posterior), and the unknown beside its two best
candidates (spectrum).")]
pub(crate) struct Args {
    #[command(flatten)]
    from: Recordings,
    /// The recorded texture to present as unknown: its number or its name
    #[arg(long, value_name = "M")]
    material: Option<String>,
    /// Explore live on the simulated rig, in place of recordings
    #[arg(long, conflicts_with_all = ["recordings", "material", "table"])]
    simulated: bool,
    /// The texture to put under the simulated finger: its name in Table 1 or its number; drawn by the seed unless given
    #[arg(long, value_name = "NAME", requires = "simulated")]
    texture: Option<String>,
    /// How many textures the simulated probe knows; the unknown one is among them
    #[arg(long, value_name = "N", default_value_t = 20, requires = "simulated",
        value_parser = clap::value_parser!(u8).range(2..=117))]
    among: u8,
    /// Texture table to use; without it one is learned from slides drawn at random, and the rest are presented
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Slides per texture to learn from, where no table is given
    #[arg(long, value_name = "N", default_value_t = 5)]
    train_slides: usize,
    /// How to decide, and how the next movement is chosen: fused, or what the table is for
    #[arg(long, value_enum)]
    method: Option<Method>,
    #[command(flatten)]
    expecting: Expecting,
    /// It is one of the textures known: never answer that it is none, and tell names as sure
    #[arg(long)]
    closed: bool,
    #[command(flatten)]
    stop: Stop,
    /// Another seed draws other slides; with --simulated also another world, and another texture unless one is given
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How to print the exploration
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    #[command(flatten)]
    plot: Plot,
}

const WHICH: &str = "\
what is to be identified? Give one of these:
  tactus identify --recordings DIR --material M   a recorded texture, by its number or name
  tactus identify --simulated                     a texture under the simulated finger
  tactus device identify                          what lies under the finger of a probe";

#[derive(Serialize)]
struct Identification {
    /// The presented texture.
    presented: String,
    /// True if the table holds it.
    known: bool,
    /// True if the answer is right; `null` where it is undecided.
    right: Option<bool>,
    /// Textures of the table.
    textures: u16,
    method: Method,
    threshold: f32,
    max_slides: u8,
    seed: u64,
    slides: Transcript,
    /// True if it ended for want of recordings.
    recordings_ran_out: bool,
    verdict: Answer,
    /// With a table: slides that it was learned from, and that were left out.
    #[serde(flatten)]
    left_out: Option<LeftOut>,
    /// Time of the simulated rig, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    rig_s: Option<f64>,
    /// Work of sliding that wore the simulated skin, J.
    #[serde(skip_serializing_if = "Option::is_none")]
    skin_j: Option<f32>,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<Done> {
    let canvas = args.plot.open()?;
    if args.simulated {
        return identify_simulated(args, None, canvas, out);
    }
    let Some(material) = &args.material else {
        return Err(UsageError(WHICH.to_owned()).into());
    };
    identify_recorded(args, &args.from.folder()?, material, canvas, out)
}

fn identify_recorded(
    args: &Args,
    folder: &Path,
    material: &str,
    canvas: Option<Canvas>,
    out: &mut impl Write,
) -> anyhow::Result<Done> {
    let set = args.from.only.open(folder)?;
    let index = find_material(&set, material)?;
    let name = &set.textures()[index].name;
    let mut random = ChaCha8Rng::seed_from_u64(args.seed);
    let mut given = Vec::new();
    let learned;
    let given = match &args.table {
        Some(file) => Some((file, read_table(file, &mut given)?)),
        None => None,
    };
    let (_, measured) = measure_folder(folder, &args.from.only)?;
    let mut shown = set.load_texture(index)?;
    let mut left_out = None;
    let table = if let Some((file, table)) = given {
        of_one_finger(&set, table)?;
        left_out = Some(LeftOut::of(table, &mut shown, SlideMarks::of));
        ensure!(
            !shown.is_empty(),
            "{}: learned from every slide of {name} here; none is left to present",
            file.display()
        );
        table
    } else {
        let (slides, interleaved) = (args.train_slides, Protocol::Interleaved);
        let experiment =
            Experiment::recorded(set.names(), &measured, None, interleaved, slides, args.seed)?;
        let experiment = experiment.expecting(Expected {
            drift: Some(args.expecting.drift),
            ..Expected::default()
        });
        for note in &experiment.notes {
            notice(note);
        }
        let at = experiment.names.iter().position(|other| other == name);
        let at = at.with_context(|| {
            format!("{name} has too few slides to learn from, and one to present")
        })?;
        let run = experiment.run_alone(at as u64);
        learned = run.learn(args.method.unwrap_or(Method::Fused).method())?;
        let seen = &run.training()[at];
        let mut measured = measured[index].iter();
        shown.retain(|slide| {
            measured.next().is_some_and(|measured| {
                let observed_now = measured.observation();
                slide.number == measured.number
                    && !seen.iter().flatten().any(|l| *l == observed_now)
            })
        });
        Table::read(&learned)?
    };
    let is_text = args.format == Format::Text;
    if is_text && table.find(name).is_none() {
        writeln!(
            out,
            "The table does not hold {name}, so the right answer is that it is none of the known textures."
        )?;
    }
    let slides = count(shown.len() as u64, "slide");
    let known = left_out.is_none_or(|left_out| left_out.all_known);
    let mut rig = Replay::new(shown, ChaCha8Rng::from_rng(&mut random));
    if is_text {
        writeln!(
            out,
            "An unknown texture, one of {}. Presented: {name}, {slides}{} (seed {}).",
            table.textures(),
            if known { " not learned from" } else { "" },
            args.seed
        )?;
        if let Some(said) = left_out.and_then(|left_out| left_out.in_words()) {
            writeln!(out, "{said}")?;
        }
    }
    let ran_out = |why: &ReplayError| matches!(why, ReplayError::RanOut(_));
    let mut presented = Presented::new(name, table);
    let found = explore_and_show(&mut rig, &mut presented, args, &mut random, ran_out, out)?;
    let found = Identification { left_out, ..found };
    if !is_text {
        print_json(&found, out)?;
    }
    presented.draw(canvas, args, out)?;
    Ok(Done::of(found.verdict.told))
}

/// The texture under the finger, and the exploration that is drawn.
struct Presented<'t> {
    name: &'t str,
    exploration: Exploration<'t>,
}

impl<'t> Presented<'t> {
    fn new(name: &'t str, table: Table<'t>) -> Self {
        let exploration = Exploration::new(table);
        Self { name, exploration }
    }

    fn draw(
        &self,
        canvas: Option<Canvas>,
        args: &Args,
        out: &mut impl Write,
    ) -> anyhow::Result<()> {
        let Some(canvas) = canvas else { return Ok(()) };
        let figures = self.exploration.figures(args.stop.threshold)?;
        canvas.write(&figures, out)
    }
}

/// Explores with `rig` until there is an answer or, after a slide at least, until it has `ran_out` of them; as text,
/// shows every step.
fn explore_and_show<R>(
    rig: &mut R,
    presented: &mut Presented<'_>,
    args: &Args,
    random: &mut ChaCha8Rng,
    ran_out: impl Fn(&R::Error) -> bool,
    out: &mut impl Write,
) -> anyhow::Result<Identification>
where
    R: Rig<Error: std::error::Error + Send + Sync + 'static>,
{
    let truth = presented.name;
    let table = presented.exploration.table();
    let best = Method::of(explorer::Method::of(table.contents()));
    let method = args.method.unwrap_or(best);
    let config = Config {
        open: !args.closed,
        ..args.stop.config(method)
    };
    let mut explorer = Explorer::<MAX_TEXTURES>::new(table, rig.measures(), config)?;
    out.flush()?;
    let mut slides = Transcript::default();
    let mut nowhere = io::sink();
    let out: &mut dyn Write = match args.format {
        Format::Text => out,
        Format::Json => &mut nowhere,
    };
    let (mut show, mut shown) = (Show::new(table, out), Ok(()));
    let verdict = embassy_futures::block_on(explore(
        rig,
        &mut explorer,
        &Plan::new(),
        || random.next_u32(),
        |step| {
            let line = match &step {
                ExplorationStep::Rejected(_, why) => {
                    slides.rejected(why);
                    show.line(&format!("  rejected: {why}"))
                }
                // shown below: recordings that run out are no failure
                ExplorationStep::Decided { .. } | ExplorationStep::CutShort(..) => Ok(()),
                step => event_of(step, table, &config, 0).map_or(Ok(()), |event| {
                    slides.event(&event, table);
                    presented.exploration.event(&event);
                    show.event(&event)
                }),
            };
            shown = std::mem::replace(&mut shown, Ok(())).and(line);
        },
    ));
    shown?;
    let mut recordings_ran_out = false;
    let verdict = match verdict {
        Err(ExploreError::Rejected(Rejection::Rig(why)))
            if ran_out(&why) && explorer.slides() > 0 =>
        {
            show.line("\nThe recordings have run out, and none counts twice.")?;
            recordings_ran_out = true;
            explorer.best()
        }
        Err(why) => {
            if explorer.slides() > 0 {
                show.answer(explorer.best(), explorer.slides())?;
            }
            return Err(why.into());
        }
        Ok(verdict) => verdict,
    };
    show.finish(verdict, explorer.slides(), truth)?;
    Ok(Identification {
        presented: truth.to_owned(),
        known: table.find(truth).is_some(),
        right: is_right(verdict, truth, table),
        textures: table.textures(),
        method,
        threshold: args.stop.threshold,
        max_slides: args.stop.max_slides,
        seed: args.seed,
        slides,
        recordings_ran_out,
        verdict: Answer::new(verdict, explorer.slides(), table),
        left_out: None,
        rig_s: None,
        skin_j: None,
    })
}

/// The arguments of the demonstration: those of the command.
#[derive(Parser)]
struct Demonstration {
    #[command(flatten)]
    args: Args,
}

pub(crate) fn demonstrate(out: &mut impl Write) -> anyhow::Result<()> {
    writeln!(
        out,
        "Tactus tells what a surface is by touching it. A simulated fingertip has learned 60 textures, five slides\n\
         at each of three movements. It is given one of them, and is not told which. The firmware's own code\n\
         measures and decides.\n\n\
         As published in 2012, each slide shows one property. The probe chooses the movement and the property\n\
         that should tell the remaining candidates apart best.\n"
    )?;
    out.flush()?;
    let parsed = |method: &str| {
        let words = "identify --simulated --among 60 --seed 2 --method";
        Demonstration::parse_from(words.split(' ').chain([method])).args
    };
    let [paper, fused] = ["paper", "fused"].map(parsed);
    let then = "\nBy default each slide shows everything at once: traction and 26 band powers.\n\n";
    identify_simulated(&paper, Some((then, &fused)), None, out)?;
    writeln!(out, "\nWhat to try next, and all commands: tactus --help")?;
    Ok(())
}

/// Explores, and `then`, below a heading, once more with other arguments from the same slides.
fn identify_simulated(
    args: &Args,
    then: Option<(&str, &Args)>,
    mut canvas: Option<Canvas>,
    out: &mut impl Write,
) -> anyhow::Result<Done> {
    let mut random = ChaCha8Rng::seed_from_u64(args.seed);
    let unknown = match &args.texture {
        Some(name) => find_textures(std::slice::from_ref(name))?[0],
        None => random.random_range(1..=117),
    };
    at_least_two(args.train_slides)?;
    let collection = Collection::new(
        args.seed,
        Collection::spread(unknown, args.among),
        u32::try_from(args.train_slides).context("--train-slides")?,
    );
    let calibration = calibrated(collection.setup(unknown, 0))?;
    let textures = collection.textures.len() as u64;
    let slides = with_progress(textures, "learning textures", |done| {
        collection.record(calibration, done)
    })?;
    let trial = 1 + u64::from(random.next_u32() % 1000);
    let name = texture_name(unknown);
    let mut done = Done::Fully;
    for (heading, args) in [("", args)].into_iter().chain(then) {
        let method = args.method.unwrap_or(Method::Fused).method();
        let bytes = collection.learn_from(method, &slides)?;
        let table = Table::read(&bytes)?;
        let mut rig = SimRig::new(collection.setup(unknown, trial));
        rig.control().calibrate(calibration)?;
        let is_text = args.format == Format::Text;
        if is_text {
            writeln!(
                out,
                "{heading}An unknown texture, one of {}. Under the finger: {name} (seed {}).",
                table.textures(),
                args.seed
            )?;
        }
        let never = |_: &_| false;
        let mut presented = Presented::new(name, table);
        let random = &mut random.clone();
        let found = explore_and_show(&mut rig, &mut presented, args, random, never, out)?;
        let seconds = rig.now().as_secs_f64();
        let skin = rig.control().skin();
        let found = Identification {
            rig_s: Some(seconds),
            skin_j: Some(skin.energy_j()),
            ..found
        };
        if is_text {
            writeln!(
                out,
                "{seconds:.0} s of the rig's time; skin: {:.2} J of sliding{}.",
                skin.energy_j(),
                if skin.is_worn() { ", look at it" } else { "" }
            )?;
        } else {
            print_json(&found, out)?;
        }
        presented.draw(canvas.take(), args, out)?;
        done = Done::of(found.verdict.told);
    }
    Ok(done)
}
