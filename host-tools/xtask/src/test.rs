//! `cargo xtask test`: every check, two at a time, and an account of what ran. `cargo xtask check`: the quick ones.
mod failures;
mod steps;
mod summary;

use std::fs::File;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Instant;

use anyhow::{Context as _, Result, bail};

use crate::shell::{SKIP_LOG, has_subcommand, target};
use steps::{CHECK, QUICK, SLOW, STEPS, Step};
use summary::{Outcome, Ran, summary};

/// A build has one long tail of a single thread, and a step waits for the one before: two at a time keep two cores busy.
const AT_ONCE: usize = 2;

/// Runs one step here.
pub(crate) fn one(name: &str) -> Result<()> {
    let step = STEPS.iter().find(|step| step.name == name);
    let step = step.with_context(|| format!("there is no step {name:?}"))?;
    (step.check)()
}

/// Formatting, lints and unit tests.
pub(crate) fn check() -> Result<ExitCode> {
    run(&CHECK, &[])
}

/// Every check, or those without the firmware.
pub(crate) fn test(quick: bool) -> Result<ExitCode> {
    if quick {
        run(&QUICK, &SLOW)
    } else {
        run(&[&QUICK[..], &SLOW].concat(), &[])
    }
}

fn run(wanted: &[&str], left_out: &[&'static str]) -> Result<ExitCode> {
    // cargo may put another program there meanwhile
    let program = std::env::current_exe().context("cannot find this program")?;
    let folder = target().join(format!("test-{}", std::process::id()));
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    let skip_log = folder.join("skipped");
    let todo: Vec<&Step> = STEPS.iter().filter(|s| wanted.contains(&s.name)).collect();
    let mut ran = all(todo, |step| {
        in_its_own_process(&program, step, &folder, &skip_log)
    });
    ran.extend(left_out.iter().map(|name| Ran::skipped(name, "--quick")));
    let log = std::fs::read_to_string(&skip_log).unwrap_or_default();
    let _ = std::fs::remove_dir_all(&folder);
    let mut skipped_tests: Vec<&str> = log.lines().collect();
    skipped_tests.sort_unstable();
    print!("{}", summary(&ran, &skipped_tests));
    let failed = |ran: &Ran| matches!(ran.outcome, Outcome::Failed(_));
    Ok(ExitCode::from(u8::from(ran.iter().any(failed))))
}

/// What is still to be done, what is being done, and what is over.
struct Progress<'s> {
    todo: Vec<&'s Step>,
    running: Vec<&'s Step>,
    ran: Vec<Ran>,
}

impl<'s> Progress<'s> {
    /// The next step that nothing keeps: what it waits for is not to come any more, and its folder is free.
    fn next(&mut self) -> Option<&'s Step> {
        let (todo, running) = (&self.todo, &self.running);
        let is_free = |step: &&Step| {
            let mut ahead = todo.iter().chain(running);
            let mut folders = running.iter().map(|other| other.folder);
            !ahead.any(|other| step.after.contains(&other.name))
                && !folders.any(|folder| !folder.is_empty() && folder == step.folder)
        };
        let step = self.todo.remove(todo.iter().position(is_free)?);
        self.running.push(step);
        Some(step)
    }

    /// A step that this one needs, and that has not passed.
    fn lacks(&self, step: &Step) -> Option<&'static str> {
        let passed = |name: &str| {
            let passed = |ran: &Ran| matches!(ran.outcome, Outcome::Passed);
            self.ran.iter().any(|ran| ran.name == name && passed(ran))
        };
        step.after.iter().find(|name| !passed(name)).copied()
    }
}

/// Runs the steps, some at a time, in an order that each allows.
fn all(todo: Vec<&Step>, check: impl Fn(&Step) -> Result<()> + Sync) -> Vec<Ran> {
    let progress = Mutex::new(Progress {
        todo,
        running: Vec::new(),
        ran: Vec::new(),
    });
    let changed = Condvar::new();
    let locked = || progress.lock().unwrap_or_else(PoisonError::into_inner);
    let work = || {
        let mut now = locked();
        while !now.todo.is_empty() {
            let Some(step) = now.next() else {
                now = changed.wait(now).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            let lacks = now.lacks(step);
            drop(now);
            let ran = match lacks {
                Some(other) => Ran::skipped(step.name, format!("{other} has not passed")),
                None => timed(step, &check),
            };
            now = locked();
            now.running.retain(|other| other.name != step.name);
            now.ran.push(ran);
            changed.notify_all();
        }
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 1..cores.min(AT_ONCE) {
            scope.spawn(work);
        }
        work();
    });
    progress
        .into_inner()
        .unwrap_or_else(PoisonError::into_inner)
        .ran
}

fn timed(step: &Step, check: impl Fn(&Step) -> Result<()>) -> Ran {
    if let Some(command) = step.wants.filter(|command| !has_subcommand(command)) {
        let why =
            format!("cargo-{command} is not installed (cargo install cargo-{command} --locked)");
        return Ran::skipped(step.name, why);
    }
    let start = Instant::now();
    let outcome = match check(step) {
        Ok(()) => Outcome::Passed,
        Err(e) => Outcome::Failed(format!("{e:#}")),
    };
    Ran {
        name: step.name,
        outcome,
        took: start.elapsed(),
    }
}

/// Runs a step, and prints what it had to say when it is over.
fn in_its_own_process(program: &Path, step: &Step, folder: &Path, skip_log: &Path) -> Result<()> {
    let name = step.name;
    println!("-- {name} ...");
    let log = folder.join(name);
    let file = File::create(&log).with_context(|| log.display().to_string())?;
    let mut run = Command::new(program);
    run.args(["test", "--step", name]).env(SKIP_LOG, skip_log);
    run.stdin(Stdio::null())
        .stdout(file.try_clone()?)
        .stderr(file);
    let status = run.status().context("cannot start this program again")?;
    let said = std::fs::read(&log).with_context(|| log.display().to_string())?;
    let said = String::from_utf8_lossy(&said);
    println!("\n==== {name}\n{said}");
    if status.success() {
        return Ok(());
    }
    match said.rsplit_once("\nerror: ") {
        Some((_, why)) => bail!("{}", why.trim_end()),
        None => bail!("it ended with {status}"),
    }
}

#[cfg(test)]
mod tests {
    use anyhow::ensure;

    use super::*;

    fn names(ran: &[Ran]) -> Vec<&str> {
        ran.iter().map(|ran| ran.name).collect()
    }

    #[test]
    fn every_step_is_in_a_suite_and_every_suite_has_its_steps() {
        for step in &STEPS {
            let suites = [&CHECK[..], &QUICK, &SLOW].concat();
            assert!(suites.contains(&step.name), "{}", step.name);
            for after in step.after {
                assert!(STEPS.iter().any(|other| other.name == *after));
            }
        }
        for name in [&CHECK[..], &QUICK, &SLOW].concat() {
            assert!(STEPS.iter().any(|step| step.name == name), "{name}");
        }
    }

    #[test]
    fn all_steps_run_and_each_after_what_it_needs() {
        let wanted = [&QUICK[..], &SLOW].concat();
        let todo: Vec<&Step> = STEPS.iter().filter(|s| wanted.contains(&s.name)).collect();
        let count = todo.len();
        let busy = Mutex::new(Vec::new());
        let ran = all(todo, |step| {
            let folder = step.folder;
            if !folder.is_empty() {
                let mut busy = busy.lock().unwrap();
                assert!(!busy.contains(&folder), "{folder} twice at once");
                busy.push(folder);
            }
            std::thread::sleep(std::time::Duration::from_millis(2));
            busy.lock().unwrap().retain(|other| *other != folder);
            Ok(())
        });
        assert_eq!(ran.len(), count);
        let ran = names(&ran);
        let at = |name: &str| ran.iter().position(|ran| *ran == name).unwrap();
        for after in ["emulator", "bench", "size"] {
            assert!(at("firmware") < at(after), "{ran:?}");
            assert!(at("build of the emulator") < at(after), "{ran:?}");
        }
    }

    #[test]
    fn what_needs_a_step_that_failed_is_skipped() {
        let todo = STEPS.iter().collect();
        let ran = all(todo, |step| {
            ensure!(step.name != "firmware", "why");
            Ok(())
        });
        let outcome = |name: &str| {
            ran.iter()
                .find(|ran| ran.name == name)
                .unwrap()
                .outcome
                .clone()
        };
        assert!(matches!(outcome("firmware"), Outcome::Failed(why) if why == "why"));
        let skipped = outcome("emulator");
        assert!(matches!(skipped, Outcome::Skipped(why) if why == "firmware has not passed"));
        assert!(matches!(outcome("lints"), Outcome::Passed));
    }
}
