//! How figures are printed.

use std::io::Write;

use clap::ValueEnum;
use serde::Serialize;
use tactus_lab::data::json;
pub(crate) use tactus_lab::eval::show::{about_percent, percent};
use tactus_lab::eval::verdicts::Verdicts;

/// The end of a command that did its work.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Done {
    /// With all that was asked for.
    Fully,
    /// The sample is another one, a new one, or has changed.
    Different,
    /// More slides would decide.
    Unsure,
}

impl Done {
    /// By the answer of a verification or the verdict of an exploration, in the words of their JSON.
    pub(crate) fn of(answer: &str) -> Self {
        match answer {
            "same" | "sure" => Self::Fully,
            "different" | "new" | "changed" => Self::Different,
            _ => Self::Unsure,
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
    writeln!(out, "{}", json::text(figures)?)?;
    Ok(())
}

/// Verdicts by name, as people read them.
pub(crate) fn verdict_rows(v: &Verdicts) -> Vec<(&'static str, f64)> {
    let mut rows = vec![
        ("right", v.right),
        ("none of those known", v.new),
        ("wrong", v.wrong),
        ("undecided", v.undecided),
        ("told to have changed", v.changed),
    ];
    if v.most_like > 0.0 {
        rows.push(("told as most like", v.most_like));
        rows.push(("  the right one of these", v.most_like_right / v.most_like));
    }
    rows
}
