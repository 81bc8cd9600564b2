//! `cargo xtask test`: every check, and an account of what ran.
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader};
use std::process::{Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};

use crate::{
    bench, cargo, emulate, firmware, fuzz, has_subcommand, run as run_command, size, target,
};

/// How long each parser is attacked ...
const FUZZ_S: u64 = 10;
/// ... and how long the bugs that are there on purpose may stay hidden.
const PLANTED_S: u64 = 150;

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
        tests.env("TACTUS_SKIP_LOG", &skip_log);
        announce(&tests);
        run_tests(&mut tests)
    }));
    steps.push(step("documentation", || {
        let mut doc = cargo();
        doc.args(["doc", "--workspace", "--no-deps"]);
        announce_and_run(doc.env("RUSTDOCFLAGS", "-Dwarnings"))
    }));
    if quick {
        steps.extend(
            ["fuzz", "firmware", "emulator", "bench", "size"].map(|name| skipped(name, "--quick")),
        );
    } else {
        steps.push(step("fuzz", || {
            fuzz::fuzz(&fuzz::Options::all(FUZZ_S, false))?;
            fuzz::fuzz(&fuzz::Options::all(PLANTED_S, true))
        }));
        let mut elves = None;
        steps.push(step("firmware", || {
            println!("\n== cargo xtask build");
            elves = Some(firmware::build()?);
            Ok(())
        }));
        steps.push(step("lints of the emulator", || {
            emulate::lints().iter_mut().try_for_each(announce_and_run)
        }));
        steps.push(match elves {
            Some(elves) => step("emulator", || {
                let mut tests = emulate::tests(&elves)?;
                tests.env("TACTUS_SKIP_LOG", &skip_log);
                announce(&tests);
                run_tests(&mut tests)
            }),
            None => skipped("emulator", "there is no firmware to run on it"),
        });
        steps.push(step("bench", || {
            println!("\n== cargo xtask bench");
            bench::gates()
        }));
        steps.push(step("size", || {
            println!("\n== cargo xtask size");
            size::gates()
        }));
    }

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
    announce(command);
    run_command(command)
}

fn announce(command: &Command) {
    let arguments: Vec<_> = command.get_args().map(|a| a.to_string_lossy()).collect();
    println!("\n== cargo {}", arguments.join(" "));
}

/// Runs tests, shows what they print, and says again at the end what the failed ones had to say: whoever sees only the end
/// of a log must see why.
fn run_tests(command: &mut Command) -> Result<()> {
    let mut tests = command
        .stdout(Stdio::piped())
        .spawn()
        .context("cannot start cargo")?;
    let mut failures = Failures::default();
    if let Some(output) = tests.stdout.take() {
        // not by lines(): a test may print bytes that are not UTF-8
        for line in BufReader::new(output).split(b'\n') {
            let line = line.context("cannot read what the tests print")?;
            let line = String::from_utf8_lossy(&line);
            println!("{line}");
            failures.hear(&line);
        }
    }
    let status = tests.wait().context("cargo vanished")?;
    if !status.success() {
        bail!("cargo ended with {status}{}", failures.told);
    }
    Ok(())
}

/// What the failed tests of a run printed, from the sections that libtest prints of them.
#[derive(Default)]
struct Failures {
    told: String,
    inside: bool,
}

impl Failures {
    /// Lines of one section that are kept: what was wrong comes first.
    const LINES: usize = 12;

    fn hear(&mut self, line: &str) {
        if line.starts_with("---- ") && line.ends_with(" stdout ----") {
            self.inside = true;
        } else if line == "failures:" || line == "stack backtrace:" {
            self.inside = false;
        }
        let in_section = self.told.rsplit("\n---- ").next().unwrap_or_default();
        if self.inside && !line.is_empty() && in_section.lines().count() < Self::LINES {
            self.told.push('\n');
            self.told.push_str(line);
        }
    }
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
                outcome: Outcome::Failed("cargo ended with 101\n---- a::b".into()),
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
                "---- a::b",
                "skipped  firmware: --quick",
                "skipped  test golden: no folder x",
                "1 passed, 1 failed, 2 skipped",
            ]
        );
    }

    #[test]
    fn what_failed_tests_printed_is_kept_up_to_a_few_lines() {
        let long = "noise\n".repeat(30);
        let printed = format!(
            "test a ... FAILED\n\nfailures:\n\n---- a stdout ----\n\nthread 'a' panicked at x.rs:1:\nleft\nstack backtrace:\n  0: y\n\n\n---- b stdout ----\n{long}\n\nfailures:\n    a\n    b\n"
        );
        let mut failures = Failures::default();
        printed.lines().for_each(|line| failures.hear(line));
        let expected = format!(
            "\n---- a stdout ----\nthread 'a' panicked at x.rs:1:\nleft\n---- b stdout ----{}",
            "\nnoise".repeat(Failures::LINES - 1)
        );
        assert_eq!(failures.told, expected);
    }

    #[test]
    fn a_failing_check_is_a_failed_step() {
        assert!(matches!(step("x", || Ok(())).outcome, Outcome::Passed));
        let failed = step("x", || Err(anyhow::anyhow!("why")));
        assert!(matches!(failed.outcome, Outcome::Failed(why) if why == "why"));
    }
}
