//! `tactus import`: recordings of others in the project's format.

use std::io::Write;
use std::path::PathBuf;

use super::progress::progress;

/// Convert recordings into the project's format (.npy files and a CSV manifest)
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  git clone https://github.com/dexrob/BioTac_slide_20_50
  tactus import BioTac_slide_20_50 recordings")]
pub(crate) struct Args {
    /// A folder in the layout of data/biotac, or the publisher's folders of CSV files
    from: PathBuf,
    /// The folder to write; it must not hold recordings yet
    to: PathBuf,
}

/// Imports a folder into another.
pub(crate) fn run(Args { from, to }: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let bar = progress(0, "importing slides");
    let imported = tactus::data::import::import(from, to, &mut |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    let (to, textures, slides) = (to.display(), imported.textures, imported.slides);
    writeln!(out, "{to}: {textures} textures, {slides} slides")?;
    if imported.lost_rows > 0 {
        writeln!(
            out,
            "{} rows of 10 ms are missing from the publisher's files; what lies before and after them was joined",
            imported.lost_rows
        )?;
    }
    Ok(())
}
