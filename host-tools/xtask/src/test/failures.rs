//! Tests that cargo runs, and what the failed ones had to say.
use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail};

/// Runs tests, shows what they print, and says again at the end what the failed ones had to say: whoever sees only the end
/// of a log must see why.
pub(super) fn run_tests(command: &mut Command) -> Result<()> {
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

#[cfg(test)]
mod tests {
    use super::*;

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
}
