//! How figures are printed.

use std::io::Write;

use clap::ValueEnum;
use serde::Serialize;
use tactus_core::explorer::Answer;
pub(crate) use tactus_lab::eval::show::percent;
use tactus_lab::eval::verdicts::Verdicts;
use tactus_lab::eval::verified::{self, Verified};

/// How a command ended that did what it was to do.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Done {
    /// With all that was asked for.
    Fully,
    /// An exploration without a name that is sure.
    NotIdentified,
}

impl Done {
    /// Whether a sample was found to be the same.
    pub(crate) fn of(verified: &Verified) -> Self {
        if verified.answer == verified::name(Answer::Same) {
            Self::Fully
        } else {
            Self::NotIdentified
        }
    }
}

/// Arguments that make no sense together, as clap says it.
#[derive(Debug, thiserror::Error)]
#[error("{0}\n\nFor more information, try '--help'.")]
pub(crate) struct UsageError(pub(crate) String);

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// For people
    Text,
    /// One object, for programs
    Json,
}

pub(crate) fn print_json(figures: &impl Serialize, out: &mut impl Write) -> anyhow::Result<()> {
    writeln!(out, "{}", serde_json::to_string_pretty(figures)?)?;
    Ok(())
}

/// Verdicts by name, as people read them, with a remark behind the share.
pub(crate) fn verdict_rows(v: &Verdicts) -> [(&'static str, f64, String); 5] {
    let named = v.changed_right.map_or(String::new(), |share| {
        format!(" (the right one in {:.1} %)", 100.0 * share)
    });
    [
        ("right", v.right, String::new()),
        ("like one, but changed", v.changed, named),
        ("none of those known", v.new, String::new()),
        ("wrong", v.wrong, String::new()),
        ("undecided", v.undecided, String::new()),
    ]
}
