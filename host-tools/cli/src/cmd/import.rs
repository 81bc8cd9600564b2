//! `tactus import`: recordings of others in the project's format.

use std::io::Write;
use std::path::PathBuf;

use tactus_lab::data;
use tactus_lab::eval::show::count;

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

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let Args { from, to } = args;
    let bar = progress(0, "importing slides");
    let imported = data::import::import(from, to, &mut |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    let textures = count(imported.textures as u64, "texture");
    let slides = count(imported.slides as u64, "slide");
    writeln!(out, "{}: {textures}, {slides}", to.display())?;
    for slide in &imported.left_out {
        writeln!(out, "left out: {slide}")?;
    }
    for slide in &imported.clipped {
        writeln!(out, "kept: {slide}")?;
    }
    Ok(())
}
