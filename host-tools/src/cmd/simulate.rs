//! `tactus simulate`: recordings of the simulated rig.

use std::io::Write;
use std::path::PathBuf;

use tactus::collection::{Collection, calibrated, texture_name};
use tactus::recordings::{RecordingWriter, Slide, Texture};

use super::progress::progress;
use super::textures::collection;

/// Record slides on the simulated rig, in the project's format
#[derive(clap::Args)]
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
}

/// Records the textures asked for.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let collection = collection(&args.textures, args.trials, args.seed)?;
    let named = collection.textures.iter().map(|&number| Texture {
        id: number.into(),
        name: texture_name(number).to_owned(),
    });
    let mut writer = RecordingWriter::create(&args.out, named.collect())?;
    let bar = progress(collection.textures.len() as u64, "sliding over textures");
    let calibration = calibrated(collection.setup(collection.textures[0], 0))?;
    let (mut done, mut slides) = (0, 0);
    // a few textures at a time: a large set does not fit into memory
    for textures in collection.textures.chunks(8) {
        let part = Collection {
            textures: textures.to_vec(),
            ..collection.clone()
        };
        for (index, recorded) in part
            .record(calibration, || bar.inc(1))?
            .into_iter()
            .enumerate()
        {
            for slide in recorded {
                let texture = done + index;
                writer.write(&Slide { texture, ..slide })?;
                slides += 1;
            }
        }
        done += textures.len();
    }
    writer.finish()?;
    bar.finish_and_clear();
    writeln!(
        out,
        "{}: {} textures, {} slides, world {}",
        args.out.display(),
        collection.textures.len(),
        slides,
        args.seed
    )?;
    Ok(())
}
