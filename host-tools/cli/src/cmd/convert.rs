//! `tactus convert`: recordings and session logs for the tools of others.

mod mcap;

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use tactus_lab::data::recordings::RecordingSet;

use super::progress::with_progress;
use super::table_file::is_pipe;

/// Convert recordings or a session's log to MCAP, for Foxglove and PlotJuggler
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus convert session.jsonl --mcap session.mcap    a log of `tactus device ... --log session.jsonl`
  tactus convert recordings --mcap recordings.mcap    all slides, one after the other

The book lists the channels.")]
pub(crate) struct Args {
    /// A folder of recordings, or a session's log; "-" reads a log from standard input
    from: PathBuf,
    /// The file to write; "-" writes to standard output
    #[arg(long, value_name = "FILE")]
    mcap: PathBuf,
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let Args { from, mcap } = args;
    if from.is_dir() {
        let set = RecordingSet::open(from)?;
        let to = create(mcap)?;
        let textures = set.textures().len() as u64;
        with_progress(textures, "converting textures", |done| {
            mcap::recordings(to, &set, done)
        })?;
    } else {
        mcap::log(create(mcap)?, from)?;
    }
    if !is_pipe(mcap) {
        let bytes = std::fs::metadata(mcap)?.len();
        writeln!(out, "{}: {bytes} bytes", mcap.display())?;
    }
    Ok(())
}

type To = BufWriter<Box<dyn Write + Send>>;

fn create(path: &Path) -> anyhow::Result<To> {
    // the lock of standard output is this thread's
    Ok(BufWriter::new(if is_pipe(path) {
        Box::new(io::stdout())
    } else {
        let file = File::create_new(path);
        Box::new(file.with_context(|| path.display().to_string())?)
    }))
}
