//! `tactus device record`: slides of a real finger in the project's format.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{anyhow, ensure};
use tactus_core::table::valid_name;
use tactus_lab::data::recording::{Labels, Texture};
use tactus_lab::data::recordings::RecordingWriter;
use tactus_lab::eval::show::count;
use tactus_lab::remote::operations::{self, Wanted};
use tactus_link::operations::ask_to_lay;
use tactus_link::person::QuestionKind;

use super::bench::Bench;
use super::line::{Sample, Where};
use super::train::seed_of_now;
use crate::cmd::output::Format;

/// Record slides in the project's format, for `tactus learn` and `tactus evaluate`
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device record burlap silk --out recordings     asks for the next texture when it is due
  tactus evaluate --recordings recordings
  tactus device record burlap silk --out anna --operator Anna --lot 7     for tactus report
  tactus device record burlap silk --out turned --moved     on a turntable; the table learned from it says so
  tactus device record burlap silk --out there --same-spot   without asking to move the sample
A slide on the same track again says little about a texture. So at a terminal the rig stops after each slide of all
movements of the probe's table, its finger lifted, and you are asked to move or turn the sample. What came of that
stands beside each slide. The same command goes on with the texture at which an interrupted one stopped.")]
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
    #[arg(long, default_value = "", hide_default_value = true)]
    operator: String,
    /// Anything else that is to stand beside every slide
    #[arg(long, default_value = "", hide_default_value = true)]
    note: String,
    #[command(flatten)]
    sample: Sample,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let Args {
        textures, slides, ..
    } = args;
    let named = textures.iter().zip(1..).map(|(name, id)| Texture {
        id,
        name: name.trim().to_owned(),
    });
    // before anything moves
    for (at, name) in textures.iter().enumerate() {
        valid_name(name.trim()).map_err(|why| anyhow!("the name {name:?} {why}"))?;
        let before = textures[..at].iter().map(|name| name.trim());
        ensure!(
            !before.into_iter().any(|other| other == name.trim()),
            "{name}: is named twice; record it once, with more --slides"
        );
    }
    let command = format!(
        "tactus device record {} --slides {slides}",
        textures.join(" ")
    );
    let writer = RecordingWriter::begin(&args.out, named.collect(), &command)?;
    let mut writer = writer.by_hand();
    let (mut bench, status) = Bench::open(&args.at, Format::Text)?;
    writer.label(Labels {
        lot: args.lot.trim().to_owned(),
        operator: args.operator.trim().to_owned(),
        note: args.note.trim().to_owned(),
        moved: args.sample.said(),
        finger: status.finger,
        calibrated: status.calibrated,
        ..Labels::default()
    });
    let (probe, mut words) = (bench.probe.clone(), bench.probe.words());
    let mut written = 0;
    for (index, name) in textures.iter().enumerate() {
        let there = writer.slides(index);
        if there == usize::from(*slides) {
            writeln!(words, "{name}: its slides were recorded before.")?;
            written += there;
            continue;
        }
        // some of an interrupted recording, where nobody knows how the sample lay
        writer.forget(index)?;
        let wanted = Wanted {
            name: name.clone(),
            index,
            slides: *slides,
            sample: args.sample.known(),
            seed: args.seed.unwrap_or_else(seed_of_now),
        };
        let recorded = async {
            if textures.len() > 1 {
                ask_to_lay(&probe, name, QuestionKind::Laid).await?;
            }
            operations::record(&probe, &wanted).await
        };
        let recorded = bench.done(recorded, out)?;
        for (slide, moved) in &recorded.slides {
            writer.moved(*moved);
            writer.write(slide)?;
        }
        written += recorded.slides.len();
    }
    writer.finish()?;
    let folder = args.out.display();
    // of textures that were recorded before
    out.write_all(&probe.take_words())?;
    writeln!(
        out,
        "{folder}: {} of {}. Next: tactus features --recordings {folder}",
        count(written as u64, "slide"),
        count(textures.len() as u64, "texture")
    )?;
    Ok(())
}
