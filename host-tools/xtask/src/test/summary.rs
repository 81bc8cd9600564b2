//! The account of what ran.
use std::fmt::Write as _;
use std::time::Duration;

/// How a step ended.
#[derive(Clone)]
pub(super) enum Outcome {
    Passed,
    Failed(String),
    /// With the reason.
    Skipped(String),
}

/// A step that is over.
#[derive(Clone)]
pub(super) struct Ran {
    pub(super) name: &'static str,
    pub(super) outcome: Outcome,
    pub(super) took: Duration,
}

impl Ran {
    pub(super) fn skipped(name: &'static str, reason: impl Into<String>) -> Self {
        Self {
            name,
            outcome: Outcome::Skipped(reason.into()),
            took: Duration::ZERO,
        }
    }
}

/// The closing lines: a line for each step and each test that was skipped, and the count of these lines.
pub(super) fn summary(steps: &[Ran], skipped_tests: &[&str]) -> String {
    let (mut passed, mut failed, mut skipped) = (0, 0, skipped_tests.len());
    let mut text = String::from("\n");
    for Ran {
        name,
        outcome,
        took,
    } in steps
    {
        let seconds = took.as_secs_f64();
        // writing to a String cannot fail
        let _ = match outcome {
            Outcome::Passed => {
                passed += 1;
                writeln!(text, "passed   {name} ({seconds:.1} s)")
            }
            Outcome::Failed(why) => {
                failed += 1;
                writeln!(text, "FAILED   {name} ({seconds:.1} s): {why}")
            }
            Outcome::Skipped(why) => {
                skipped += 1;
                writeln!(text, "skipped  {name}: {why}")
            }
        };
    }
    for test in skipped_tests {
        let _ = writeln!(text, "skipped  test {test}");
    }
    let _ = writeln!(text, "{passed} passed, {failed} failed, {skipped} skipped");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_counts_its_lines() {
        let steps = [
            Ran {
                name: "lints",
                outcome: Outcome::Passed,
                took: Duration::from_millis(1250),
            },
            Ran {
                name: "tests",
                outcome: Outcome::Failed("cargo ended with 101\n---- a::b".into()),
                took: Duration::from_secs(60),
            },
            Ran::skipped("firmware", "--quick"),
        ];
        let text = summary(&steps, &["golden: no folder x"]);
        let lines: Vec<&str> = text.trim_start().lines().collect();
        assert_eq!(
            lines,
            [
                "passed   lints (1.2 s)",
                "FAILED   tests (60.0 s): cargo ended with 101",
                "---- a::b",
                "skipped  firmware: --quick",
                "skipped  test golden: no folder x",
                "1 passed, 1 failed, 2 skipped",
            ]
        );
    }
}
