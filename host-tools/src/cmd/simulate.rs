//! `tactus simulate`: recordings of the simulated rig.

use std::io::Write;
use std::path::PathBuf;

use serde::Serialize;
use tactus::data::recording::{Recording, Texture};
use tactus::data::recordings::RecordingWriter;
use tactus::sim::collection::{Collection, calibrated, texture_name};

use super::output::{Format, print_json};
use super::progress::with_progress;
use super::textures::collection;

/// Record slides on the simulated rig, in the project's format
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus simulate --out DIR --textures burlap,47 --trials 10
  tactus simulate --out DIR --seed 2                       all 117 textures of another world")]
pub(crate) struct Args {
    /// The folder to write; it must not hold recordings yet
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Textures of Table 1, by number or name; all 117 unless given
    #[arg(long, value_name = "T,T,...", value_delimiter = ',')]
    textures: Vec<String>,
    /// Trials per texture and movement
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    trials: u32,
    /// Another seed is another world: other textures of the same names
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How to print what was written
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// What `simulate --format json` prints.
#[derive(Serialize)]
struct Simulated {
    folder: String,
    textures: usize,
    slides: u64,
    seed: u64,
}

/// Records the textures asked for.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let collection = collection(&args.textures, args.trials, args.seed)?;
    let named = collection.textures.iter().map(|&number| Texture {
        id: number.into(),
        name: texture_name(number).to_owned(),
    });
    let mut writer = RecordingWriter::create(&args.out, named.collect())?;
    let calibration = calibrated(collection.setup(collection.textures[0], 0))?;
    let textures = collection.textures.len();
    let mut slides = 0;
    with_progress(textures as u64, "sliding over textures", |done| {
        // a few textures at a time: a large set does not fit into memory
        for (part, first) in collection.textures.chunks(8).zip((0..).step_by(8)) {
            let part = Collection {
                textures: part.to_vec(),
                ..collection.clone()
            };
            for (recorded, texture) in part.record(calibration, done)?.into_iter().zip(first..) {
                for slide in recorded {
                    writer.write(&Recording { texture, ..slide })?;
                    slides += 1;
                }
            }
        }
        anyhow::Ok(())
    })?;
    writer.finish()?;
    if args.format == Format::Json {
        let simulated = Simulated {
            folder: args.out.display().to_string(),
            textures,
            slides,
            seed: args.seed,
        };
        return print_json(&simulated, out);
    }
    let (folder, seed) = (args.out.display(), args.seed);
    writeln!(
        out,
        "{folder}: {textures} textures, {slides} slides, world {seed}"
    )?;
    Ok(())
}
