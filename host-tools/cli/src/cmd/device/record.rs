//! `tactus device record`: slides of a real finger in the project's format.

use std::io::Write;
use std::path::PathBuf;

use anyhow::ensure;
use serde::Serialize;
use tactus_core::table::Table;
use tactus_core::wire::Command;
use tactus_lab::data::recorder::Recorder;
use tactus_lab::data::recording::{Labels, Texture};
use tactus_lab::data::recordings::RecordingWriter;
use tactus_lab::eval::samples::Trials;
use tactus_lab::eval::show::count;
use tactus_link::Request;

use super::bench::{Bench, Prompts, wait_for_enter};
use super::line::Where;
use super::samples::{Sample, ask_to_move};
use super::train::seed_of_now;
use crate::cmd::output::{Format, print_json};

/// Record slides in the project's format, for `tactus learn` and `tactus evaluate`
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device record burlap silk --out recordings     asks for the next texture when it is due
  tactus evaluate --recordings recordings
  tactus device record burlap silk --out anna --operator Anna --lot 7     for tactus report
  tactus device record burlap silk --out turned --moved     on a turntable; the table learned from it says so
  tactus device record burlap silk --out there --same-spot  without asking to move the sample
A slide on the same track again says little about a texture. So at a terminal the rig stops after each slide of all movements of
the probe's table, its finger lifted, and you are asked to move or turn the sample. What came of that stands beside each slide.
The same command goes on with the texture at which an interrupted one stopped.")]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    /// The textures to record, in the order in which they are laid under the finger
    #[arg(required = true)]
    textures: Vec<String>,
    /// The folder to write; it must not hold recordings yet
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Slides of each texture; movements of the probe's table take turns
    #[arg(long, value_name = "N", default_value_t = 15, value_parser = clap::value_parser!(u8).range(1..=254))]
    slides: u8,
    /// Where on the sample slides begin; drawn anew unless given
    #[arg(long)]
    seed: Option<u32>,
    /// Batch or piece that the samples are from, for `tactus report`
    #[arg(long, default_value = "", hide_default_value = true)]
    lot: String,
    /// Who makes the slides, for `tactus report`
    #[arg(
        long,
        value_name = "NAME",
        default_value = "",
        hide_default_value = true
    )]
    operator: String,
    /// Anything else that is to stand beside every slide
    #[arg(
        long,
        value_name = "TEXT",
        default_value = "",
        hide_default_value = true
    )]
    note: String,
    #[command(flatten)]
    sample: Sample,
    /// How to print what was recorded
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// What `device record` prints with `--format json`.
#[derive(Serialize)]
struct Recorded<'a> {
    folder: String,
    textures: usize,
    /// In the folder, those of an interrupted recording included.
    slides: usize,
    lost: Vec<Lost<'a>>,
}

/// A slide that was made and is not recorded.
#[derive(Serialize)]
struct Lost<'a> {
    texture: &'a str,
    why: String,
}

/// Records each texture in turn.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let Args {
        textures, slides, ..
    } = args;
    let named = textures.iter().zip(1..).map(|(name, id)| Texture {
        id,
        name: name.trim().to_owned(),
    });
    // before anything moves
    let command = format!(
        "tactus device record {} --slides {slides}",
        textures.join(" ")
    );
    let mut writer = RecordingWriter::begin(&args.out, named.collect(), &command)?;
    let (mut bench, status) = Bench::open(&args.at)?;
    writer.label(Labels {
        lot: args.lot.trim().to_owned(),
        operator: args.operator.trim().to_owned(),
        note: args.note.trim().to_owned(),
        moved: args.sample.said(),
        finger: status.finger,
        calibrated: status.calibrated,
    });
    let calibration = bench.get(Request::read_calibration())?;
    bench.get(Request::command(Command::Stream(true)))?;
    // a slide of each movement, then the sample is moved
    let part = match args.sample.asks() {
        true => Table::read(&bench.table()?)?.movements().len() as u8,
        false => *slides,
    };
    let (mut written, mut all_lost) = (0, Vec::new());
    let text = args.format == Format::Text;
    for (index, name) in textures.iter().enumerate() {
        let there = writer.slides(index);
        if there == usize::from(*slides) {
            if text {
                writeln!(out, "{name}: its slides were recorded before.")?;
            }
            written += there;
            continue;
        }
        // some of an interrupted recording, where nobody knows how the sample lay
        writer.forget(index)?;
        if textures.len() > 1 {
            let prompt = format!("Lay {name} under the finger and press Enter: ");
            wait_for_enter(bench.interrupt(), &prompt)?;
        }
        let seed = args.seed.unwrap_or_else(seed_of_now);
        let mut recorder = Recorder::new(calibration.pressure);
        let (mut lost, mut kept) = (Vec::new(), Vec::new());
        let (mut prompts, mut trials) = (Prompts::default(), Trials::default());
        for (trial, begin) in (0..*slides).step_by(part.max(1).into()).enumerate() {
            if trial > 0 {
                trials.said(Some(ask_to_move(&bench, name)?));
            }
            let wanted = Recorder::wanted(trial, part.min(slides - begin), seed);
            bench.run(Request::identify(wanted), |report| {
                match recorder.hear(index, report) {
                    Some(Ok(slide)) => {
                        let (number, movement) = (slide.number, slide.movement);
                        if text {
                            writeln!(out, "{name}, slide {number} of {slides}: {movement}")?;
                        }
                        kept.push((trial, slide));
                    }
                    Some(Err(why)) => lost.push(why),
                    None if text => prompts.show(report, out)?,
                    None => {}
                }
                out.flush()
            })?;
        }
        for (trial, slide) in &kept {
            if args.sample.asks() {
                writer.moved(trials.before_trial(*trial));
            }
            writer.write(slide)?;
        }
        written += kept.len();
        if text {
            for why in &lost {
                writeln!(out, "{name}: a slide is not recorded: {why}")?;
            }
        }
        all_lost.extend(lost.into_iter().map(|why| Lost {
            texture: name.trim(),
            why: why.to_string(),
        }));
        ensure!(
            !kept.is_empty(),
            "{name}: no slide arrived whole; check the cable, then record again"
        );
    }
    bench.get(Request::command(Command::Stream(false)))?;
    writer.finish()?;
    let folder = args.out.display();
    if !text {
        let recorded = Recorded {
            folder: folder.to_string(),
            textures: textures.len(),
            slides: written,
            lost: all_lost,
        };
        return print_json(&recorded, out);
    }
    writeln!(
        out,
        "{folder}: {} of {}. Next: tactus features --recordings {folder}",
        count(written as u64, "slide"),
        count(textures.len() as u64, "texture")
    )?;
    Ok(())
}
