//! How figures are printed.

use std::io::Write;

use clap::ValueEnum;
use serde::Serialize;
use tactus::eval::verdicts::Verdicts;

/// How a command ended that did what it was to do.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Done {
    /// With all that was asked for.
    Fully,
    /// An exploration without a name that is sure.
    NotIdentified,
}

/// Arguments that make no sense together, as clap says it.
#[derive(Debug, thiserror::Error)]
#[error("{0}\n\nFor more information, try '--help'.")]
pub(crate) struct UsageError(pub(crate) String);

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

/// A share as people write it: "30 %", "99.9 %".
pub(crate) fn percent(share: f64) -> String {
    let percent = format!("{:.4}", share * 100.0);
    format!("{} %", percent.trim_end_matches('0').trim_end_matches('.'))
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

#[cfg(test)]
mod tests {
    use super::percent;

    #[test]
    fn a_share_is_written_without_the_digits_of_its_binary_form() {
        let written =
            [0.3_f32, 0.99, 0.999, 1.0, 0.0, 0.123_456].map(|share| percent(share.into()));
        assert_eq!(
            written,
            ["30 %", "99 %", "99.9 %", "100 %", "0 %", "12.3456 %"]
        );
    }
}
