//! Whether the sample was moved or turned between the trials of a training or a recording: asked of whoever stands beside it,
//! and noted in the probe's table, or beside the slides.

use std::io::IsTerminal as _;

use tactus::eval::samples::{note, of_all};
use tactus::link::{LinkError, PortError, PushTable};
use tactus_core::table::Table;

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
    let prompt = format!(
        "Move or turn {name} under the finger, so that the next slide is on another track, then press Enter (n: it stays): "
    );
    let answer = read_answer(bench.interrupt(), &prompt)?;
    Ok(!matches!(
        answer.trim().to_lowercase().as_str(),
        "n" | "no" | "s"
    ))
}

/// How the trials of a texture were made: what was said of those of a training, and of those before it.
#[derive(Debug, Default)]
pub(crate) struct Trials {
    answers: Vec<Option<bool>>,
}

impl Trials {
    /// These were made before this training.
    pub(crate) fn before(&mut self, moved: Option<bool>) {
        self.answers.push(moved);
    }

    /// This was said of the next ones; `None`: nothing.
    pub(crate) fn said(&mut self, moved: Option<bool>) {
        self.answers.push(moved);
    }

    /// What was said before a trial, from 0. Of the first one nobody is asked: it is as all others are.
    pub(crate) fn before_trial(&self, trial: usize) -> Option<bool> {
        match trial.checked_sub(1) {
            Some(asked) => *self.answers.get(asked)?,
            None => self.moved(),
        }
    }

    /// What is to be noted: what is true of all of them.
    pub(crate) fn moved(&self) -> Option<bool> {
        of_all(self.answers.iter().copied())
    }
}

/// Notes it in the table that the probe uses. `None`: done, or there was nothing to note; else why not, in a sentence.
pub(crate) fn note_in_table(
    bench: &mut Bench,
    name: &str,
    moved: Option<bool>,
) -> anyhow::Result<Option<String>> {
    let bytes = bench.table()?;
    let table = Table::read(&bytes)?;
    let Some(texture) = table.find(name).filter(|&t| table.moved(t) != moved) else {
        return Ok(None);
    };
    // it cannot be read without what the probe has learned by itself, which must not become a part of it
    if (0..table.textures()).any(|texture| table.tally(texture).itself > 0) {
        let why = "the probe has learned by itself, and its table cannot be replaced without mixing that in";
        return Ok(Some(why.to_owned()));
    }
    let noted = note(&bytes, |other| match other == texture {
        true => moved,
        false => table.moved(other),
    })?;
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_noted_is_true_of_all_trials() {
        let of = |before: Option<Option<bool>>, said: &[bool]| {
            let mut trials = Trials::default();
            if let Some(before) = before {
                trials.before(before);
            }
            said.iter().for_each(|moved| trials.said(Some(*moved)));
            trials.moved()
        };
        assert_eq!(of(None, &[]), None);
        assert_eq!(of(None, &[true, true]), Some(true));
        assert_eq!(of(None, &[false, false]), Some(false));
        assert_eq!(of(None, &[true, false]), None);
        assert_eq!(of(Some(None), &[true, true]), None);
        assert_eq!(of(Some(Some(true)), &[true]), Some(true));
        assert_eq!(of(Some(Some(false)), &[true]), None);
        assert_eq!(of(Some(Some(true)), &[]), Some(true));
    }

    #[test]
    fn a_trial_is_noted_as_it_was_said_and_the_first_one_as_all_others() {
        let of = |said: &[bool]| -> Vec<Option<bool>> {
            let mut trials = Trials::default();
            said.iter().for_each(|moved| trials.said(Some(*moved)));
            (0..=said.len())
                .map(|trial| trials.before_trial(trial))
                .collect()
        };
        assert_eq!(of(&[true, true]), [Some(true); 3]);
        assert_eq!(of(&[false]), [Some(false); 2]);
        assert_eq!(of(&[true, false]), [None, Some(true), Some(false)]);
        assert_eq!(of(&[]), [None]);
    }
}
