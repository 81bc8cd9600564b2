//! Where things are, and how other programs are run.
use std::io::{BufRead as _, BufReader, IsTerminal as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context as _, Result, bail, ensure};

/// Names the file to which tests that are skipped add a line each.
pub(crate) const SKIP_LOG: &str = "TACTUS_SKIP_LOG";

pub(crate) fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.ancestors().nth(2).unwrap_or(here).to_owned()
}

pub(crate) fn target() -> PathBuf {
    root().join(std::env::var_os("CARGO_TARGET_DIR").unwrap_or_else(|| "target".into()))
}

/// The cargo that runs this program, at the top of the repository.
pub(crate) fn cargo() -> Command {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.current_dir(root());
    cargo
}

pub(crate) fn tactus() -> Command {
    let mut tactus = cargo();
    tactus.args(["run", "--quiet", "--release", "--package", "tactus-probe"]);
    tactus.arg("--");
    tactus
}

pub(crate) fn has_subcommand(name: &str) -> bool {
    cargo()
        .args([name, "--version"])
        .output()
        .is_ok_and(|o| o.status.success())
}

pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Does the work with each of many, so many at a time, and shows progress on a terminal. Returns the results in no
/// order.
pub(crate) fn each_of<T: Sync, R: Send>(
    all: &[T],
    at_a_time: usize,
    work: impl Fn(&T) -> R + Sync,
) -> Vec<R> {
    let (next, ended) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..at_a_time.clamp(1, all.len().max(1)) {
            scope.spawn(|| {
                while let Some(one) = all.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let result = work(one);
                    let mut ended = ended.lock().unwrap_or_else(PoisonError::into_inner);
                    ended.push(result);
                    progress(ended.len(), all.len());
                }
            });
        }
    });
    ended.into_inner().unwrap_or_else(PoisonError::into_inner)
}

fn progress(done: usize, all: usize) {
    if std::io::stderr().is_terminal() {
        eprint!("\r{done} of {all} ");
        if done == all {
            eprintln!();
        }
        let _ = std::io::stderr().flush();
    }
}

/// Runs a command with its output where ours goes; an error unless it succeeds.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let program = command.get_program().to_owned();
    let status = command
        .status()
        .with_context(|| format!("cannot start {}", program.display()))?;
    if !status.success() {
        let name = Path::new(&program).file_name().unwrap_or(&program);
        bail!("{} ended with {status}", name.display());
    }
    Ok(())
}

/// Runs a command, passes on what it prints, and hands each line to `on_line`; an error, with the last line, unless it
/// succeeds.
pub(crate) fn hear(command: &mut Command, mut on_line: impl FnMut(&str)) -> Result<()> {
    let program = command.get_program().display().to_string();
    let child = command.stdout(Stdio::piped()).spawn();
    let mut child = child.with_context(|| format!("cannot start {program}"))?;
    let output = child.stdout.take().context("a program without output")?;
    let mut last = String::new();
    // not by lines(): a test may print bytes that are not UTF-8
    for line in BufReader::new(output).split(b'\n') {
        let line = line?;
        let line = String::from_utf8_lossy(&line);
        println!("{line}");
        on_line(&line);
        if !line.trim().is_empty() {
            line.trim().clone_into(&mut last);
        }
    }
    let status = child.wait()?;
    ensure!(status.success(), "{program} ended with {status}: {last}");
    Ok(())
}

/// Reports that something is not tested and why, where the summary of the steps lists it.
pub(crate) fn skip(what: &str, why: &str) -> Result<()> {
    eprintln!("SKIPPED {what}: {why}");
    if let Some(log) = std::env::var_os(SKIP_LOG) {
        let mut log = std::fs::OpenOptions::new()
            .append(true)
            .create(true)
            .open(log)?;
        writeln!(log, "{what}: {why}")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_that_fails_is_an_error_with_its_name() {
        assert!(run(&mut Command::new("true")).is_ok());
        let error = run(&mut Command::new("false")).unwrap_err().to_string();
        assert!(error.starts_with("false ended with"), "{error}");
        let mut heard = String::new();
        let mut fails = Command::new("sh");
        let error = hear(fails.args(["-c", "echo how; echo why; false"]), |line| {
            heard += line
        });
        assert!(error.unwrap_err().to_string().ends_with(": why"));
        assert_eq!(heard, "howwhy");
    }
}
