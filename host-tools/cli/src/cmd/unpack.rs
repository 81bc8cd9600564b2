//! `tactus unpack`: what the command brings along, as files.

use std::io::Write;
use std::path::PathBuf;

use anyhow::Context as _;
use tactus_core::table::factory;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::whole::NewOutputs;
use tactus_lab::eval::show::count;

use super::simulate;
use super::table_file::{Force, write_file};
use super::textures::collection;

/// The textures of the recordings, by their numbers in Table 1, and how often each is slid over at each movement.
const TEXTURES: [&str; 6] = ["1", "70", "91", "95", "100", "105"];
const TRIALS: u32 = 3;
const SEED: u64 = 1;
/// The folder of the recordings in that which is written.
const RECORDINGS: &str = "recordings";

/// Write what the command brings along: factory tables, and small recordings of the simulated rig
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus unpack tactus-data
  tactus table tactus-data/factory.tact
  tactus identify --recordings tactus-data/recordings --material Corduroy --train-slides 2
  tactus evaluate --recordings tactus-data/recordings --train-slides 2

The recordings have six textures at three movements, three slides each. They are made on the
simulated rig, and are byte for byte those of the project. The same command goes on where an
interrupted one stopped.")]
pub(crate) struct Args {
    /// The folder to write; a table of the same name that is another one is left alone
    folder: PathBuf,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let mut made = NewOutputs::default();
    made.folder(&args.folder)
        .with_context(|| format!("cannot make {}", args.folder.display()))?;
    for (name, table) in factory::ALL {
        let file = args.folder.join(name);
        made.file(file.clone());
        let kept = write_file(&file, table, Force::default());
        kept.context("a table of the factory; give another folder, or move it away")?;
        writeln!(out, "{}", file.display())?;
    }
    let folder = args.folder.join(RECORDINGS);
    let collection = collection(&TEXTURES.map(str::to_owned), TRIALS, SEED)?;
    let slides = match RecordingSet::open(&folder) {
        // written to their end before
        Ok(there) if there.names() == collection.names() => (0..TEXTURES.len())
            .map(|texture| there.slides(texture).len())
            .sum(),
        _ => simulate::record(&collection, &folder)?,
    };
    made.keep();
    writeln!(
        out,
        "{}: {}, {}",
        folder.display(),
        count(TEXTURES.len() as u64, "texture"),
        count(slides as u64, "slide")
    )?;
    Ok(())
}
