//! How figures are printed.

use std::io::Write;

use clap::ValueEnum;
use serde::Serialize;

/// For whom figures are printed.
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

/// Prints values, each after its name.
pub(crate) fn print_rows(rows: &[(&str, String)], out: &mut impl Write) -> anyhow::Result<()> {
    for (name, value) in rows {
        writeln!(out, "{name:<15} {value}")?;
    }
    Ok(())
}
