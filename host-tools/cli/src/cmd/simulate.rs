//! `tactus simulate`: recordings of the simulated rig.

use std::io::Write;
use std::path::{Path, PathBuf};

use tactus_core::sensor::FingerName;
use tactus_lab::data::recording::Recording;
use tactus_lab::eval::show::count;
use tactus_lab::sim::collection::{Collection, calibrated};

use super::progress::progress;
use super::textures::collection;

/// Record slides on the simulated rig, in the project's format
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus simulate --out DIR --textures burlap,47 --trials 10
  tactus simulate --out DIR --seed 2                       all 117 textures of another world
  tactus simulate --out DIR --finger mems                  with another finger
The same command goes on where an interrupted one stopped.")]
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
    /// The finger that slides: biotac, analog (piezo disc and load cell) or mems (accelerometer and load cell)
    #[arg(long, value_name = "NAME", default_value_t = FingerName::Biotac)]
    finger: FingerName,
}

/// Records a collection into a folder, or what an interrupted command has not come to. Gives the number of slides that
/// are there then.
pub(crate) fn record(collection: &Collection, folder: &Path) -> anyhow::Result<usize> {
    let textures = collection.textures.len();
    let mut writer = collection.writer(folder)?;
    let calibration = calibrated(collection.setup(collection.textures[0], 0))?;
    let each = Collection::MOVEMENTS.len() * collection.trials as usize;
    // those that an interrupted command has not come to
    let todo: Vec<(usize, u8)> = (0..)
        .zip(collection.textures.iter().copied())
        .filter(|&(texture, _)| writer.slides(texture) < each)
        .collect();
    let bar = progress(textures as u64, "sliding over textures");
    bar.set_position((textures - todo.len()) as u64);
    // a few textures at a time: a large set does not fit into memory
    for some in todo.chunks(rayon::current_num_threads().min(8)) {
        let part = Collection {
            textures: some.iter().map(|(_, number)| *number).collect(),
            ..collection.clone()
        };
        let recorded = part.record(calibration, || bar.inc(1))?;
        for (slides, &(texture, _)) in recorded.into_iter().zip(some) {
            for slide in slides {
                if !writer.has(texture, slide.number) {
                    writer.write(&Recording { texture, ..slide })?;
                }
            }
        }
    }
    bar.finish_and_clear();
    writer.finish()?;
    Ok(textures * each)
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let collection = collection(&args.textures, args.trials, args.seed)?.touched_by(args.finger);
    let textures = collection.textures.len();
    let slides = record(&collection, &args.out)?;
    let (folder, seed) = (args.out.display(), args.seed);
    writeln!(
        out,
        "{folder}: {}, {}, world {seed}",
        count(textures as u64, "texture"),
        count(slides as u64, "slide")
    )?;
    Ok(())
}
