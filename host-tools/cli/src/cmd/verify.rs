//! `tactus verify`: whether slides are of one texture, whatever else they may be of.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Answer, Config, Strategy};
use tactus_core::features::{Movement, Observation, PropertySet};
use tactus_core::table::{Action, POPULATION, Table};
use tactus_lab::data::quality::SeenSlides;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::{MeasuredSlide, measure};
use tactus_lab::eval::evaluate::{Method, explorer};
use tactus_lab::eval::first::learn_first;
use tactus_lab::eval::learn::Expected;
use tactus_lab::eval::learned::LeftOut;
use tactus_lab::eval::show::count;
use tactus_lab::eval::verified::{Slide, Verified, name, print_score, print_slide, sentence};
use tactus_lab::eval::verify::{false_accept, put};
use tactus_lab::sim::collection::{Collection, calibrated, texture_name};
use tactus_lab::sim::rig::{SimError, SimRig};
use tactus_study::pictures::map::{self, Sample};

use super::args::{Only, Stop};
use super::names::find;
use super::output::{Done, Format, UsageError, print_json};
use super::plot::Plot;
use super::progress::with_progress;
use super::table_file::read_table;
use super::textures::{find_material, find_textures, measure_folder, of_one_finger};

/// Trials that a simulated probe has learned each texture from, and slides that it tries at most.
const LEARNED: u32 = 5;
const ATTEMPTS: usize = 60;

/// Say whether slides are of the same texture as a reference
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus verify --reference DIR --texture cork --sample NEW                 the other textures of DIR give the scale
  tactus verify --table TABLE --texture cork --sample NEW --material cork   a texture of a table
  tactus verify --table TABLE --reference ROLL7 --sample ROLL8              one that the table does not have
  tactus verify --reference DIR --texture cork --sample DIR --only lot=8    one lot against the others
  tactus verify --simulated --texture burlap                                live, with burlap under the simulated finger
  tactus verify --simulated --texture burlap --material marble              with something else

Slides are taken in the order of time until it is the same, different, or none is left. It is different if fewer than
--false-alarm of the reference's own slides would look so, and the same if that is more probable than --threshold.
Exit code: 0 the same, 3 different, 4 not sure.")]
pub(crate) struct Args {
    /// Recordings of the reference
    #[arg(long, value_name = "DIR", required_unless_present_any = ["table", "simulated"])]
    reference: Option<PathBuf>,
    /// The reference's texture: of the recordings, of the table, or one that the simulated probe knows
    #[arg(long, value_name = "NAME")]
    texture: Option<String>,
    /// The table that gives the scale; without it, one is learned from all textures of the reference's recordings
    #[arg(long, value_name = "TABLE")]
    table: Option<PathBuf>,
    /// Recordings of what is held against it: with --only, these slides against the others of the same folder
    #[arg(long, value_name = "DIR", required_unless_present = "simulated")]
    sample: Option<PathBuf>,
    #[command(flatten)]
    only: Only,
    /// The texture of these recordings, where they have several; what lies under the simulated finger, the reference's
    /// unless given
    #[arg(long, value_name = "NAME")]
    material: Option<String>,
    /// Slide live on the simulated rig, in place of recordings; the probe has learned the reference and others there
    #[arg(long, conflicts_with_all = ["reference", "table", "sample"], requires = "texture")]
    simulated: bool,
    /// How many textures the simulated probe knows
    #[arg(long, value_name = "N", default_value_t = 20, requires = "simulated",
        value_parser = clap::value_parser!(u8).range(4..=117))]
    among: u8,
    /// Another seed is another world, and another trial
    #[arg(long, default_value_t = 1, requires = "simulated")]
    seed: u64,
    #[command(flatten)]
    stop: Stop,
    #[command(flatten)]
    plot: Plot,
    /// How to print the answer
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

const ITSELF: &str = "--sample is the reference itself: give other slides, or --material with another texture of \
    the folder";

struct Made {
    number: u32,
    movement: Movement,
    observation: Observation,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<Done> {
    let Some(folder) = &args.sample else {
        return run_simulated(args, out);
    };
    let reference_folder = args.reference.as_deref();
    let is_itself = reference_folder.is_some_and(|reference| same_folder(reference, folder));
    ensure!(
        !is_itself || args.material.is_some() || !args.only.is_all(),
        ITSELF
    );
    // what is wrong with the question is said before what is wrong with the sample
    let of_table = match args.reference {
        Some(_) => None,
        None => Some(reference(args, folder, &[])?),
    };
    let (set, mut measured) = measure_folder(folder, &args.only)?;
    let sample = one(&set, args.material.as_deref(), folder, "--material")?;
    let sample_name = set.textures()[sample].name.clone();
    let mut slides = measured.swap_remove(sample);
    let (bytes, texture) = match of_table {
        Some(of_table) => of_table,
        None => reference(args, folder, &slides)?,
    };
    let table = Table::read(&bytes)?;
    of_one_finger(&set, table)?;
    let left_out = LeftOut::of(table, &mut slides, |slide| slide.marks.clone());
    ensure!(
        left_out.slides == 0 || !slides.is_empty(),
        "{}: the table was learned from every slide of {sample_name} here; give others",
        folder.display()
    );
    let usable = |slide: &&MeasuredSlide| {
        let at = index_of(table, slide.movement);
        at.is_some_and(|at| table.trials(texture, at) > 0)
    };
    let slides: Vec<&MeasuredSlide> = slides.iter().filter(usable).collect();
    ensure!(
        !slides.is_empty(),
        "{}: {sample_name} has no slide at a movement of the reference",
        folder.display()
    );
    let measures = slides.iter().fold(PropertySet::ALL, |all, slide| {
        all.and(slide.measurement.properties.measured())
    });
    let made = slides.into_iter().map(|slide| {
        Ok(Made {
            number: slide.number,
            movement: slide.movement,
            observation: slide.observation(),
        })
    });
    let sample = (sample_name, Some(left_out));
    hold(args, (&bytes, texture), sample, measures, made, out)
}

/// Learns on the simulated rig, then slides there, movement after movement.
fn run_simulated(args: &Args, out: &mut impl Write) -> anyhow::Result<Done> {
    let wanted = args.texture.as_ref().context("--texture NAME")?;
    let reference = find_textures(std::slice::from_ref(wanted))?[0];
    let under = match &args.material {
        Some(name) => find_textures(std::slice::from_ref(name))?[0],
        None => reference,
    };
    let collection = Collection::new(
        args.seed,
        Collection::spread(reference, args.among),
        LEARNED,
    );
    let calibration = calibrated(collection.setup(reference, 0))?;
    let textures = collection.textures.len() as u64;
    let method = Method::Fused.method();
    let bytes = with_progress(textures, "learning textures", |done| {
        collection.learn(method, calibration, done)
    })?;
    let texture = Table::read(&bytes)?.find(texture_name(reference));
    let texture = texture.context("the reference was not learned; please report this")?;
    // a trial that nothing was learned from
    let mut rig = SimRig::new(collection.setup(under, 1));
    rig.control().calibrate(calibration)?;
    rig.home()?;
    let plan = Plan::new();
    let movements = Collection::MOVEMENTS.into_iter().cycle();
    let made = movements
        .zip(1..)
        .take(ATTEMPTS)
        .filter_map(|(movement, number)| {
            let slide = match rig.record(movement) {
                // it is made again, after the others
                Err(SimError::Fault(fault)) if fault.is_of_the_movement() => return None,
                Err(why) => return Some(Err(why.into())),
                Ok(slide) => slide,
            };
            let measured = measure(&plan, &slide).ok()?;
            Some(Ok(Made {
                number,
                movement,
                observation: Observation::from(&measured),
            }))
        });
    let name = texture_name(under).to_owned();
    hold(
        args,
        (&bytes, texture),
        (name, None),
        PropertySet::ALL,
        made,
        out,
    )
}

fn index_of(table: Table<'_>, movement: Movement) -> Option<u8> {
    let mut known = (0..).zip(table.movements());
    known.find_map(|(at, other)| (other == movement).then_some(at))
}

/// Holds slides against the reference until it is told, and prints that.
fn hold(
    args: &Args,
    (bytes, texture): (&[u8], u16),
    (sample, left_out): (String, Option<LeftOut>),
    measures: PropertySet,
    slides: impl Iterator<Item = anyhow::Result<Made>>,
    out: &mut impl Write,
) -> anyhow::Result<Done> {
    let table = Table::read(bytes)?;
    let canvas = args.plot.open()?;
    let config = Config {
        strategy: Strategy::Cycling,
        open: true,
        ..args.stop.config(Method::Fused)
    };
    let mut verified = Verified::new(table, texture, &config)?;
    let mut explorer = explorer(bytes, measures, config, Some(&[texture]))?;
    verified.sample = Some(sample);
    verified.left_out = left_out;
    // a map is of one movement
    let mut shown: Option<Sample> = None;
    for slide in slides.take(args.stop.max_slides.into()) {
        let told = verified.answer != name(Answer::Unsure);
        let slide = match slide {
            Err(_) if told => break,
            slide => slide?,
        };
        let Some(movement) = index_of(table, slide.movement) else {
            continue;
        };
        let action = Action {
            movement,
            property: None,
        };
        let shown = shown.get_or_insert_with(|| Sample {
            name: verified.sample.clone().unwrap_or_default(),
            movement,
            slides: Vec::new(),
        });
        if shown.movement == movement {
            shown.slides.push((slide.number, slide.observation.clone()));
        }
        if told {
            // the picture shows the others, too
            continue;
        }
        explorer.observe(action, &slide.observation)?;
        let Some(now) = explorer.verification() else {
            continue;
        };
        verified.answer = name(now.answer);
        verified.slides.push(Slide {
            number: slide.number,
            force_n: slide.movement.known().0,
            speed_mm_s: slide.movement.known().1,
            score: now.score,
            limit: now.limit,
            answer: name(now.answer),
        });
        if now.answer != Answer::Unsure && canvas.is_none() {
            break;
        }
    }
    ensure!(
        !verified.slides.is_empty(),
        "no slide on {} was good; another --seed makes another trial",
        verified.sample.as_deref().unwrap_or("the sample")
    );
    verified.false_accept = false_accept(&explorer, texture);
    match args.format {
        Format::Json => print_json(&verified, out)?,
        Format::Text => print(&verified, out)?,
    }
    if let Some(canvas) = canvas {
        canvas.write(&[map::figure(table, shown.as_ref())?], out)?;
    }
    Ok(Done::of(verified.answer))
}

/// The table, and its texture that `slides` of the folder `sample` are held against.
fn reference(
    args: &Args,
    sample: &Path,
    slides: &[MeasuredSlide],
) -> anyhow::Result<(Vec<u8>, u16)> {
    let mut bytes = Vec::new();
    let given = match &args.table {
        Some(file) => Some((file, read_table(file, &mut bytes)?)),
        None => None,
    };
    let Some(folder) = &args.reference else {
        // clap has seen to it that there is a table
        let (file, table) = given.context("give --reference DIR or --table TABLE")?;
        let Some(wanted) = &args.texture else {
            let say = "--table without --reference: say which of its textures, with --texture NAME";
            return Err(UsageError(say.to_owned()).into());
        };
        let names: Vec<&str> = table.names().collect();
        let name = find(wanted, &names).map_err(anyhow::Error::msg);
        let name = name.with_context(|| file.display().to_string())?;
        let texture = table
            .find(name)
            .context("a name of the table is in the table")?;
        return Ok((table.as_bytes().to_vec(), texture));
    };
    let (set, mut measured) = measure_folder(folder, &Only::default())?;
    let index = one(&set, args.texture.as_deref(), folder, "--texture")?;
    let name = &set.textures()[index].name;
    let is_same_folder = same_folder(folder, sample);
    let same_texture = args
        .material
        .as_deref()
        .is_none_or(|m| find_material(&set, m).ok() == Some(index));
    ensure!(
        !(is_same_folder && same_texture && args.only.is_all()),
        ITSELF
    );
    // neither the scale nor a part of the reference is learned from what is held against it
    let held = SeenSlides::of(slides.iter().map(|slide| &slide.marks));
    for (texture, measured) in measured.iter_mut().enumerate() {
        let whole = texture == index && args.only.is_all();
        measured.retain(|slide| whole || !held.has(&slide.marks));
    }
    ensure!(
        !measured[index].is_empty(),
        "{}: no slide of {name} is left for the reference",
        folder.display()
    );
    let bytes = match given {
        Some((file, table)) => of_one_finger(&set, table)
            .and_then(|()| Ok(put(table, name, &measured[index])?))
            .with_context(|| format!("{} with the reference", file.display()))?,
        None => {
            let textures = measured.iter().filter(|slides| !slides.is_empty()).count();
            ensure!(
                textures > POPULATION,
                "{}: {} say little of how textures differ: give --table TABLE for the scale",
                folder.display(),
                count(textures as u64, "texture")
            );
            let all = measured.iter().map(Vec::len).max().unwrap_or(0);
            learn_first(
                &set,
                &measured,
                all,
                Method::Fused,
                None,
                &Expected::default(),
            )?
        }
    };
    let texture = Table::read(&bytes)?.find(name);
    let texture = texture.context("the reference was not learned; please report this")?;
    Ok((bytes, texture))
}

fn same_folder(a: &Path, b: &Path) -> bool {
    a.canonicalize()
        .ok()
        .zip(b.canonicalize().ok())
        .is_some_and(|(a, b)| a == b)
}

/// The texture that is meant: the one that is named, or the only one.
fn one(
    set: &RecordingSet,
    named: Option<&str>,
    folder: &Path,
    option: &str,
) -> anyhow::Result<usize> {
    match named {
        Some(name) => find_material(set, name),
        None => {
            let textures = set.textures();
            ensure!(
                textures.len() == 1,
                "{}: has {}; say which one with {option} NAME",
                folder.display(),
                count(textures.len() as u64, "texture")
            );
            Ok(0)
        }
    }
}

/// Slides that are printed, most: the last ones.
const PRINTED: usize = 20;

fn print(v: &Verified, out: &mut impl Write) -> anyhow::Result<()> {
    let slides = count(v.slides.len() as u64, "slide");
    let sample = v.sample.as_deref().unwrap_or("unknown");
    writeln!(out, "{}\n\n{slides} of {sample}:", sentence(v))?;
    for slide in v.slides.iter().skip(v.slides.len().saturating_sub(PRINTED)) {
        print_slide(slide, out)?;
    }
    if let Some(said) = v.left_out.and_then(|left_out| left_out.in_words()) {
        writeln!(out, "{said}")?;
    }
    Ok(print_score(v, out)?)
}
