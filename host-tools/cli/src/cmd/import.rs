//! `tactus import`: recordings of others in the project's format.

use std::io::Write;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tactus_lab::data;
use tactus_lab::data::recordings::Result;
use tactus_lab::eval::show::count;

use super::output::{Format, print_json};
use super::progress::progress;

/// Convert recordings into the project's format (.npy files and a CSV manifest)
#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "\
Examples:
  git clone https://github.com/dexrob/BioTac_slide_20_50
  tactus import BioTac_slide_20_50 recordings
  tactus import cluster texture_dataset recordings"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    layout: Option<Layout>,
    #[command(flatten)]
    folders: Option<Folders>,
}

/// Layouts that no folder tells by itself.
#[derive(clap::Subcommand)]
enum Layout {
    /// Convert the Cluster Haptic Texture Dataset (arXiv 2407.16206): acceleration and force as the finger `mems` gives them
    #[command(after_help = "\
FROM holds sensor_data/accel, force and position. Nobody has tried this on the dataset itself, only on files that were made from its
description.

Examples:
  tactus import cluster texture_dataset recordings")]
    Cluster(Folders),
}

#[derive(clap::Args)]
struct Folders {
    /// A folder in the layout of data/biotac, or the publisher's folders of CSV files
    from: PathBuf,
    /// The folder to write; it must not hold recordings yet
    to: PathBuf,
    /// How to print what was written
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

type Import = fn(&Path, &Path, &mut dyn FnMut(usize, usize)) -> Result<data::import::Imported>;

/// What `import --format json` prints.
#[derive(Serialize)]
struct Imported {
    folder: String,
    textures: usize,
    slides: usize,
    /// Rows of 10 ms that are missing from the publisher's files.
    lost_rows: usize,
    /// Slides that are not imported, since the sensor paused in them.
    left_out: usize,
}

/// Imports a folder into another.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let (import, folders): (Import, _) = match (&args.layout, &args.folders) {
        (Some(Layout::Cluster(folders)), _) => (data::import::cluster::import, folders),
        (None, Some(folders)) => (data::import::import, folders),
        // the command line does not let this pass
        (None, None) => anyhow::bail!("name the folder to import, and the one to write"),
    };
    let Folders { from, to, format } = folders;
    let bar = progress(0, "importing slides");
    let imported = import(from, to, &mut |done, all| {
        bar.set_length(all as u64);
        bar.set_position(done as u64);
    })?;
    bar.finish_and_clear();
    if *format == Format::Json {
        let imported = Imported {
            folder: to.display().to_string(),
            textures: imported.textures,
            slides: imported.slides,
            lost_rows: imported.lost_rows,
            left_out: imported.left_out,
        };
        return print_json(&imported, out);
    }
    let textures = count(imported.textures as u64, "texture");
    let slides = count(imported.slides as u64, "slide");
    writeln!(out, "{}: {textures}, {slides}", to.display())?;
    if imported.lost_rows > 0 {
        writeln!(
            out,
            "{} of 10 ms missing from the publisher's files; what lies before and after was joined",
            count(imported.lost_rows as u64, "row")
        )?;
    }
    if imported.left_out > 0 {
        let left_out = count(imported.left_out as u64, "slide");
        writeln!(out, "{left_out} left out: the sensor paused in the middle")?;
    }
    Ok(())
}
