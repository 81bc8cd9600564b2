//! `tactus device log --mcap FILE`: what a probe reports, as it comes, for Foxglove and PlotJuggler.

use std::io::Write;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use tactus_core::wire::Command;
use tactus_lab::eval::show::count;
use tactus_link::{ReadTable, Request};

use super::bench::Bench;
use super::line::Where;
use crate::cmd::convert::mcap::Live;
use crate::cmd::output::Format;
use crate::cmd::progress::notice;
use crate::cmd::table_file::is_pipe;

#[derive(clap::Args)]
pub(crate) struct Listen {
    /// Write an MCAP file of what the probe reports from now on, raw samples too; Ctrl-C ends it. "-": standard output
    #[arg(long, value_name = "FILE", required = true)]
    mcap: Option<PathBuf>,
    /// End after so many seconds
    #[arg(long, value_name = "S", value_parser = seconds)]
    seconds: Option<Duration>,
    #[command(flatten)]
    at: Where,
}

fn seconds(text: &str) -> Result<Duration, String> {
    match text.parse() {
        Ok(s) if (0.1..=1e6).contains(&s) => Ok(Duration::from_secs_f64(s)),
        _ => Err("seconds from 0.1 to 1000000, such as 60".to_owned()),
    }
}

/// Listens until Ctrl-C, or until the time is over: nothing is asked of the probe that moves.
pub(crate) fn run(args: &Listen, out: &mut impl Write) -> anyhow::Result<()> {
    let path = args.mcap.as_deref().context("--mcap")?;
    let (mut bench, _) = Bench::open(&args.at, Format::Text)?;
    let mut file = Live::create(path, &bench.name)?;
    let (probe, mut written) = (bench.probe(), Ok(()));
    // with the names of its textures
    let table = probe.run(ReadTable::default(), |report| {
        file.hear(report, &mut written);
        Ok(())
    });
    bench.done(table, out)?;
    bench.get(Request::command(Command::Stream(true)))?;
    notice("Listening; Ctrl-C ends it.");
    let (began, mut reports) = (Instant::now(), 0_u64);
    while args.seconds.is_none_or(|s| began.elapsed() < s) && !bench.interrupt().take() {
        bench.listen(&mut |report| {
            reports += 1;
            file.hear(report, &mut written);
        })?;
        if written.is_err() {
            break;
        }
    }
    bench.get(Request::command(Command::Stream(false)))?;
    written?;
    file.finish()?;
    if !is_pipe(path) {
        let path = path.display();
        writeln!(out, "{path}: {}", count(reports, "report"))?;
    }
    Ok(())
}
