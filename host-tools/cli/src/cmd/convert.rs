//! `tactus convert`: recordings and session logs for the tools of others.

pub(super) mod mcap;
mod npz;
mod to;

use std::io::Write;
use std::path::PathBuf;

use anyhow::ensure;
use clap::ArgGroup;
use serde::Serialize;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::data::replay::measure_all;

use self::to::create;
use super::output::{Format, UsageError, print_json};
use super::progress::with_progress;
use super::table_file::is_pipe;

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
    let asked = [&args.mcap, &args.npz];
    let asked: Vec<&PathBuf> = asked.into_iter().flatten().collect();
    let piped = asked.iter().filter(|path| is_pipe(path)).count();
    if piped > 1 || (piped == 1 && args.format == Format::Json) {
        let say = "one file alone can go to standard output (\"-\")";
        return Err(UsageError(say.to_owned()).into());
    }
    let is_set = args.from.is_dir();
    let from = args.from.display();
    ensure!(
        is_set || args.npz.is_none(),
        "{from}: an .npz holds recordings; name a folder of them, or write --mcap",
    );
    if is_set {
        of_recordings(args)?;
    } else if let Some(path) = &args.mcap {
        mcap::log(create(path)?, &args.from)?;
    }
    let mut files = Vec::new();
    for path in asked {
        if !is_pipe(path) {
            let bytes = std::fs::metadata(path)?.len();
            let file = path.display().to_string();
            files.push(Written { file, bytes });
        }
    }
    if args.format == Format::Json {
        print_json(&files, out)?;
    } else if piped == 0 {
        // else standard output is the file that was asked for
        for Written { file, bytes } in files {
            writeln!(out, "{file}: {bytes} bytes")?;
        }
    }
    Ok(())
}

fn of_recordings(args: &Args) -> anyhow::Result<()> {
    let set = RecordingSet::open(&args.from)?;
    let textures = set.textures().len() as u64;
    if let Some(path) = &args.mcap {
        let to = create(path)?;
        with_progress(textures, "converting textures", |done| {
            mcap::recordings(to, &set, done)
        })?;
    }
    if let Some(path) = &args.npz {
        let measured = with_progress(textures, "measuring slides", |done| {
            measure_all(&set, |_| done())
        })?;
        let to = create(path)?;
        with_progress(textures, "converting textures", |done| {
            npz::write(to, &set, &measured, done)
        })?;
    }
    Ok(())
}
