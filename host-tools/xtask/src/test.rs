//! `cargo xtask test`: every check, and a summary of what ran. `cargo xtask check`: the quick checks.
use std::fmt::Write as _;
use std::fs::File;
use std::iter;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Instant;

use anyhow::{Context as _, Result, anyhow, bail, ensure};

use crate::emulate::{everything, workspace};
use crate::shell::{SKIP_LOG, cargo, has_subcommand, hear, root, run, skip, target};
use crate::toolchain::{self, CHIP};
use crate::{bench, campaign, emulate, firmware, page, python, size};

/// A check, which runs in a process of its own: `cargo xtask test --step NAME`.
type Step = (&'static str, fn() -> Result<()>);

/// Two rows of steps for two cores: a build has a long tail of a single thread. Steps of a row use what those before
/// them have built.
const ROWS: [&[Step]; 2] = [
    &[
        ("formatting", formatting),
        ("lints", lints),
        ("tests", || tests(workspace("test").arg("--no-fail-fast"))),
        ("documentation", documentation),
        ("board", board),
    ],
    &[
        ("firmware", firmware::build_all),
        ("page", page::check),
        ("python", python::check),
        ("bench", bench::gates),
        ("size", size::size),
        ("licences", licences),
    ],
];
/// Steps that run where they are asked for only: what they build takes longer than what they find.
const OTHER_STEPS: &[Step] = &[("fuzz", campaign::limits)];
/// Workspaces beside the main one.
pub(crate) const OTHERS: [&str; 3] = ["host-tools/page", "host-tools/python", "tests/fuzz"];

fn formatting() -> Result<()> {
    announce(cargo().args(["fmt", "--all", "--check"]))?;
    for folder in OTHERS {
        announce(
            cargo()
                .current_dir(root().join(folder))
                .args(["fmt", "--check"]),
        )?;
    }
    Ok(())
}

fn lints() -> Result<()> {
    announce(everything("clippy").args(["--all-targets", "--", "-Dwarnings"]))
}

fn documentation() -> Result<()> {
    // of all of them: other features than those of the lints would have every crate below checked again
    let mut doc = everything("doc");
    announce(
        doc.args(["--no-deps", "--lib"])
            .env("RUSTDOCFLAGS", "-Dwarnings"),
    )
}

/// Checks every workspace with cargo-deny.
fn licences() -> Result<()> {
    if !has_subcommand("deny") {
        let why = "cargo-deny is not installed (cargo install cargo-deny --locked)";
        return skip("licences, sources and advisories", why);
    }
    let deny = |folder: &str, task: &[&str]| {
        let mut deny = cargo();
        deny.args(["deny", "--workspace", "--manifest-path"]);
        deny.arg(root().join(folder).join("Cargo.toml"));
        deny.arg("--config").arg(root().join("deny.toml"));
        deny.args(task);
        deny
    };
    let mut kinds = vec!["bans", "licenses", "sources"];
    match announce(deny("", &["fetch"]).arg("db")) {
        Ok(()) => kinds.push("advisories"),
        Err(_) => skip(
            "advisories",
            "cargo-deny cannot fetch their database: is there a network?",
        )?,
    }
    for folder in iter::once("").chain(OTHERS) {
        announce(deny(folder, &["check"]).args(&kinds))?;
    }
    Ok(())
}

fn board() -> Result<()> {
    let mut board_tests = everything("test");
    board_tests.args(["--test", "board", "--no-fail-fast"]);
    tests(emulate::with_images(&mut board_tests, &firmware::elves()?)?)
}

fn announce(command: &mut Command) -> Result<()> {
    println!("== {command:?}");
    run(command)
}

/// Runs tests. The error says again how the first ones failed: whoever sees only the end of a log must see why.
fn tests(command: &mut Command) -> Result<()> {
    println!("== {command:?}");
    let mut lines = Vec::new();
    let done = hear(command, |line| lines.push(line.to_owned()));
    done.map_err(|why| anyhow!("{why}{}", failures(&lines)))
}

/// The beginning of what each failed test printed.
fn failures(lines: &[String]) -> String {
    let is_head = |line: &&String| line.starts_with("---- ") && line.ends_with(" stdout ----");
    let mut all = String::new();
    for (at, _) in lines.iter().enumerate().filter(|(_, line)| is_head(line)) {
        let section = lines[at..]
            .iter()
            .take_while(|line| *line != "stack backtrace:");
        for line in section.filter(|line| !line.is_empty()).take(12) {
            let _ = write!(all, "\n{line}");
        }
    }
    all
}

pub(crate) fn one(name: &str) -> Result<()> {
    let steps = [&ROWS.concat(), OTHER_STEPS].concat();
    let step = steps.iter().find(|(step, _)| *step == name);
    let (_, check) = step.with_context(|| {
        let names: Vec<&str> = steps.iter().map(|(name, _)| *name).collect();
        format!("there is no step {name:?}; there are {}", names.join(", "))
    })?;
    check()
}

pub(crate) fn check() -> Result<()> {
    formatting()?;
    lints()?;
    licences()?;
    let mut unit_tests = cargo();
    unit_tests.args(["test", "--lib", "--no-fail-fast"]);
    for package in ["core", "link", "world", "lab"] {
        unit_tests.args(["--package", &format!("tactus-{package}")]);
    }
    tests(&mut unit_tests)
}

/// A step that is over: its name, the seconds that it took, and why it failed if it did.
type Ended = (&'static str, u64, Option<String>);

pub(crate) fn test() -> Result<()> {
    // cargo may put another program there meanwhile
    let program = &std::env::current_exe().context("cannot find this program")?;
    let folder = &target().join(format!("test-{}", std::process::id()));
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let one = |(name, _): &Step| {
        let began = Instant::now();
        let done = in_its_own_process(program, name, folder);
        (
            *name,
            began.elapsed().as_secs(),
            done.err().map(|why| format!("{why:#}")),
        )
    };
    let ended: Vec<Ended> = std::thread::scope(|scope| {
        let rows = ROWS.map(|row| scope.spawn(move || row.iter().map(one).collect::<Vec<_>>()));
        let ended = rows.map(|row| row.join().expect("a row does not panic"));
        ended.concat()
    });
    let skipped = std::fs::read_to_string(folder.join("skipped")).unwrap_or_default();
    let _ = std::fs::remove_dir_all(folder);
    print!("{}", summary(&ended, &skipped));
    if let Ok(toolchain) = toolchain::get(CHIP) {
        println!("The images are built by {}.", toolchain.version());
    }
    let failed = ended.iter().filter(|(.., why)| why.is_some()).count();
    ensure!(failed == 0, "failed steps: {failed}");
    Ok(())
}

/// A line for each step and for each test that was skipped, and their count.
fn summary(ended: &[Ended], skipped: &str) -> String {
    let mut text = String::from("\n");
    for (name, seconds, why) in ended {
        // writing to a String cannot fail
        let _ = match why {
            None => writeln!(text, "passed   {name} ({seconds} s)"),
            Some(why) => writeln!(text, "FAILED   {name} ({seconds} s): {why}"),
        };
    }
    let mut skipped: Vec<&str> = skipped.lines().collect();
    skipped.sort_unstable();
    for test in &skipped {
        let _ = writeln!(text, "skipped  {test}");
    }
    let failed = ended.iter().filter(|(.., why)| why.is_some()).count();
    let passed = ended.len() - failed;
    let _ = writeln!(
        text,
        "{passed} passed, {failed} failed, {} skipped",
        skipped.len()
    );
    text
}

/// Runs a step, and prints its output when it is over.
fn in_its_own_process(program: &Path, name: &str, folder: &Path) -> Result<()> {
    println!("-- {name} ...");
    let log = folder.join(name);
    let file = File::create(&log).with_context(|| log.display().to_string())?;
    let mut step = Command::new(program);
    step.args(["test", "--step", name])
        .env(SKIP_LOG, folder.join("skipped"));
    step.stdin(Stdio::null())
        .stdout(file.try_clone()?)
        .stderr(file);
    let status = step.status().context("cannot start this program again")?;
    let said = std::fs::read(&log).with_context(|| log.display().to_string())?;
    let said = String::from_utf8_lossy(&said);
    println!("\n==== {name}\n{said}");
    match said.rsplit_once("\nerror: ") {
        _ if status.success() => Ok(()),
        Some((_, why)) => bail!("{}", why.trim_end()),
        None => bail!("it ended with {status}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_counts_its_lines() {
        let ended = [
            ("lints", 1, None),
            ("tests", 60, Some("tests failed\n---- a::b".into())),
        ];
        let lines = [
            "",
            "passed   lints (1 s)",
            "FAILED   tests (60 s): tests failed",
            "---- a::b",
            "skipped  golden: no folder x",
            "1 passed, 1 failed, 1 skipped",
        ];
        let text = summary(&ended, "golden: no folder x\n");
        assert_eq!(text.lines().collect::<Vec<_>>(), lines);
    }

    #[test]
    fn failed_tests_say_why_in_a_few_lines() {
        let long = "noise\n".repeat(30);
        let printed = format!(
            "test a ... FAILED\n\nfailures:\n\n---- a stdout ----\n\nthread 'a' panicked at x.rs:1:\nleft\n\
             stack backtrace:\n  0: y\n---- b stdout ----\n{long}"
        );
        let lines: Vec<String> = printed.lines().map(str::to_owned).collect();
        let expected = format!(
            "\n---- a stdout ----\nthread 'a' panicked at x.rs:1:\nleft\n---- b stdout ----{}",
            "\nnoise".repeat(11)
        );
        assert_eq!(failures(&lines), expected);
    }
}
