//! Whether the sample was moved or turned between the trials of a training or a recording: asked of whoever stands beside it,
//! and noted in the probe's table, or beside the slides.

use std::io::IsTerminal as _;

use tactus_lab::eval::samples::{Noting, noting};
use tactus_lab::remote::say::move_sample;
use tactus_link::{LinkError, PortError, PushTable};

use super::bench::{Bench, BenchError, read_answer};

/// What a person says of the sample.
#[derive(clap::Args, Clone, Copy, Debug)]
pub(crate) struct Sample {
    /// Note that the sample was moved or turned from slide to slide, and do not ask for it
    #[arg(long, conflicts_with = "same_spot")]
    moved: bool,
    /// Note that the sample stayed where it was, and do not ask to move it
    #[arg(long)]
    same_spot: bool,
}

impl Sample {
    /// What was said on the command line.
    pub(crate) fn said(self) -> Option<bool> {
        (self.moved || self.same_spot).then_some(self.moved)
    }

    /// Whether there is somebody to be asked between trials.
    pub(crate) fn asks(self) -> bool {
        self.said().is_none() && std::io::stdin().is_terminal()
    }
}

/// Has the sample moved before the next trial; whether it was.
pub(crate) fn ask_to_move(bench: &Bench, name: &str) -> Result<bool, BenchError> {
    let prompt = format!("{}, then press Enter (n: it stays): ", move_sample(name));
    let answer = read_answer(bench.interrupt(), &prompt)?;
    Ok(!matches!(
        answer.trim().to_lowercase().as_str(),
        "n" | "no" | "s"
    ))
}

/// Notes it in the table that the probe uses. `None`: done, or there was nothing to note; else why not, in a sentence.
pub(crate) fn note_in_table(
    bench: &mut Bench,
    name: &str,
    moved: Option<bool>,
) -> anyhow::Result<Option<String>> {
    let noted = match noting(&bench.table()?, name, moved)? {
        Noting::Nothing => return Ok(None),
        Noting::Impossible(why) => return Ok(Some(why.to_owned())),
        Noting::Table(noted) => noted,
    };
    let pushed = PushTable::new(&noted).map(|push| bench.get(push));
    match pushed {
        Ok(Ok(())) => Ok(None),
        Ok(Err(BenchError::Port {
            why: PortError::Link(why @ LinkError::Refused(_)),
            ..
        })) => Ok(Some(why.to_string())),
        Ok(Err(why)) => Err(why.into()),
        Err(why) => Ok(Some(why.to_string())),
    }
}
