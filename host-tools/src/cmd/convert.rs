//! `tactus convert`: recordings and session logs for the tools of others.

mod mcap;
mod npz;

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use clap::ArgGroup;
use serde::Serialize;
use tactus::data::recordings::RecordingSet;
use tactus::data::replay::measure_all;

use super::output::{Format, print_json};
use super::progress::progress;

/// Convert recordings or a session's log for other tools: MCAP (Foxglove, PlotJuggler), npz (numpy)
#[derive(clap::Args)]
#[command(group(ArgGroup::new("kind").args(["mcap", "npz"]).required(true).multiple(true)), after_help = "\
Examples:
  tactus convert session.jsonl --mcap session.mcap    a log of `tactus device ... --log session.jsonl`
  tactus convert recordings --mcap recordings.mcap    all slides, one after the other
  tactus convert recordings --npz recordings.npz      numpy.load(\"recordings.npz\")

In an .npz, `pac_7`, `pdc_7`, `shear_7` and `still_7` are the streams of the slide of row 7 of `texture`, `slide`, `movement`, `properties` and
`ln_bands`. The book lists the channels of an .mcap.")]
pub(crate) struct Args {
    /// A folder of recordings, or a session's log; "-" reads a log from standard input
    from: PathBuf,
    /// Write an MCAP file
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
    /// Write an .npz file; of recordings only
    #[arg(long, value_name = "FILE")]
    npz: Option<PathBuf>,
    /// How to print what was written
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// A file in `convert --format json`.
#[derive(Serialize)]
struct Written {
    file: String,
    bytes: u64,
}

/// Writes what was asked for; a file that is there already is left alone.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let mut written = Vec::new();
    if let Some(path) = &args.mcap {
        let to = create(path)?;
        if args.from.is_dir() {
            let set = RecordingSet::open(&args.from)?;
            let bar = progress(set.textures().len() as u64, "converting textures");
            mcap::recordings(to, &set, || bar.inc(1))?;
            bar.finish_and_clear();
        } else {
            mcap::log(to, &args.from)?;
        }
        written.push(path);
    }
    if let Some(path) = &args.npz {
        ensure!(
            args.from.is_dir(),
            "{}: an .npz holds recordings; name a folder of them, or write --mcap",
            args.from.display()
        );
        let set = RecordingSet::open(&args.from)?;
        let to = create(path)?;
        let bar = progress(2 * set.textures().len() as u64, "converting textures");
        let measured = measure_all(&set, |_| bar.inc(1))?;
        npz::write(to, &set, &measured, || bar.inc(1))?.flush()?;
        bar.finish_and_clear();
        written.push(path);
    }
    let mut files = Vec::new();
    for path in written {
        let bytes = std::fs::metadata(path)?.len();
        let file = path.display().to_string();
        files.push(Written { file, bytes });
    }
    if args.format == Format::Json {
        return print_json(&files, out);
    }
    for Written { file, bytes } in files {
        writeln!(out, "{file}: {bytes} bytes")?;
    }
    Ok(())
}

fn create(path: &Path) -> anyhow::Result<BufWriter<File>> {
    let file = File::create_new(path).with_context(|| path.display().to_string())?;
    Ok(BufWriter::new(file))
}
