//! `cargo xtask test`: every check, and an account of what ran.
use std::fmt::Write as _;
use std::process::{Command, ExitCode};
use std::time::{Duration, Instant};

use anyhow::Result;

use crate::{cargo, firmware, has_subcommand, run as run_command, target};

/// How a step ended.
enum Outcome {
    Passed,
    Failed(String),
    /// With the reason.
    Skipped(String),
}

struct Step {
    name: &'static str,
    outcome: Outcome,
    took: Duration,
}

pub(crate) fn run(quick: bool) -> ExitCode {
    // a file of this run's own: tests add a line each to what is there
    let skip_log = target().join(format!("skipped-tests-{}", std::process::id()));
    let _ = std::fs::remove_file(&skip_log);

    let mut steps = vec![
        step("formatting", || cargo_step(&["fmt", "--all", "--check"])),
        step("lints", || {
            cargo_step(&["clippy", "--workspace", "--all-targets", "--", "-Dwarnings"])
        }),
    ];
    // advisories would need the network
    steps.push(if has_subcommand("deny") {
        step("licences and sources", || {
            cargo_step(&["deny", "check", "bans", "licenses", "sources"])
        })
    } else {
        skipped(
            "licences and sources",
            "cargo-deny is not installed (cargo install cargo-deny --locked)",
        )
    });
    steps.push(step("tests", || {
        let mut tests = cargo();
        tests.args(["test", "--workspace", "--no-fail-fast"]);
        announce_and_run(tests.env("TACTUS_SKIP_LOG", &skip_log))
    }));
    steps.push(step("documentation", || {
        let mut doc = cargo();
        doc.args(["doc", "--workspace", "--no-deps"]);
        announce_and_run(doc.env("RUSTDOCFLAGS", "-Dwarnings"))
    }));
    steps.push(if quick {
        skipped("firmware", "--quick")
    } else {
        step("firmware", || {
            println!("\n== cargo xtask build");
            firmware::build()
        })
    });

    let log = std::fs::read_to_string(&skip_log).unwrap_or_default();
    let _ = std::fs::remove_file(&skip_log);
    let mut skipped_tests: Vec<&str> = log.lines().collect();
    skipped_tests.sort_unstable();
    print!("{}", summary(&steps, &skipped_tests));
    let failed = steps
        .iter()
        .any(|step| matches!(step.outcome, Outcome::Failed(_)));
    ExitCode::from(u8::from(failed))
}

fn step(name: &'static str, check: impl FnOnce() -> Result<()>) -> Step {
    let start = Instant::now();
    let outcome = match check() {
        Ok(()) => Outcome::Passed,
        Err(e) => {
            eprintln!("error: {e:#}");
            Outcome::Failed(format!("{e:#}"))
        }
    };
    Step {
        name,
        outcome,
        took: start.elapsed(),
    }
}

fn skipped(name: &'static str, reason: &str) -> Step {
    Step {
        name,
        outcome: Outcome::Skipped(reason.into()),
        took: Duration::ZERO,
    }
}

fn cargo_step(arguments: &[&str]) -> Result<()> {
    announce_and_run(cargo().args(arguments))
}

fn announce_and_run(command: &mut Command) -> Result<()> {
    let arguments: Vec<_> = command.get_args().map(|a| a.to_string_lossy()).collect();
    println!("\n== cargo {}", arguments.join(" "));
    run_command(command)
}

/// The closing lines: a line for each step and each test that was skipped, and the count of these lines.
fn summary(steps: &[Step], skipped_tests: &[&str]) -> String {
    let (mut passed, mut failed, mut skipped) = (0, 0, skipped_tests.len());
    let mut text = String::from("\n");
    for Step {
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
                // the rest of a long message was printed where it happened
                let why = why.lines().next().unwrap_or_default();
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
            Step {
                name: "lints",
                outcome: Outcome::Passed,
                took: Duration::from_millis(1250),
            },
            Step {
                name: "tests",
                outcome: Outcome::Failed("cargo ended with 101\nand more".into()),
                took: Duration::from_secs(60),
            },
            skipped("firmware", "--quick"),
        ];
        let text = summary(&steps, &["golden: no folder x"]);
        let lines: Vec<&str> = text.trim_start().lines().collect();
        assert_eq!(
            lines,
            [
                "passed   lints (1.2 s)",
                "FAILED   tests (60.0 s): cargo ended with 101",
                "skipped  firmware: --quick",
                "skipped  test golden: no folder x",
                "1 passed, 1 failed, 2 skipped",
            ]
        );
    }

    #[test]
    fn a_failing_check_is_a_failed_step() {
        assert!(matches!(step("x", || Ok(())).outcome, Outcome::Passed));
        let failed = step("x", || Err(anyhow::anyhow!("why")));
        assert!(matches!(failed.outcome, Outcome::Failed(why) if why == "why"));
    }
}
