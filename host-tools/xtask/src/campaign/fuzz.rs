//! libFuzzer against the parsers. Its flags are those of cargo-fuzz without a sanitizer, which stable Rust takes:
//! memory is safe here, and what is looked for are panics, overflows and memory without bounds.
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, ensure};
use clap::Parser;

use crate::shell::{self, cargo, root, run, target};
use crate::toolchain;

const TARGETS: [&str; 9] = [
    "wire",
    "table",
    "store",
    "recordings",
    "log",
    "samples",
    "signals",
    "import",
    "page",
];
const MAX_LEN: usize = 8192;

/// Attacks the parsers.
#[derive(Parser)]
#[command(name = "cargo xtask campaign fuzz --")]
struct Options {
    /// Target to attack; all unless given
    #[arg(value_name = "TARGET", value_parser = TARGETS)]
    targets: Vec<String>,
    /// Seconds for each target
    #[arg(long, default_value_t = 600, value_parser = clap::value_parser!(u64).range(1..))]
    seconds: u64,
}

/// Attacks the targets; an error if one breaks.
pub(super) fn fuzz(options: &[OsString]) -> Result<String> {
    let options = Options::parse_from([&["fuzz".into()], options].concat());
    let programs = build()?;
    let names = match &options.targets[..] {
        [] => TARGETS.map(String::from).into(),
        some => some.to_vec(),
    };
    let ended = shell::each_of(&names, shell::cores(), |name| {
        attack(&programs, name, &options)
    });
    let (mut lines, mut wrong) = (Vec::new(), Vec::new());
    for one in ended {
        let (line, broken) = one?;
        println!("{line}");
        match broken {
            Some(why) => wrong.push(format!("{line}: {why}")),
            None => lines.push(line),
        }
    }
    ensure!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(format!("Nothing broke: {}.", lines.join(", ")))
}

/// Attacks every target for some seconds and with 10 MB, with limits of time and memory: without libFuzzer, and with
/// the same inputs every time.
pub(crate) fn limits() -> Result<()> {
    let mut limits = cargo();
    limits.current_dir(root().join("tests/fuzz"));
    limits.args(["run", "--release", "--locked", "--target-dir"]);
    limits.arg(target().join("fuzz"));
    run(limits.args(["--bin", "limits", "--", "4"]))
}

fn build() -> Result<PathBuf> {
    let runs = |program: &&str| Command::new(program).arg("--version").output().is_ok();
    ensure!(
        ["c++", "g++", "clang++"].iter().any(runs),
        "libFuzzer is C++, and there is no compiler for it: `apt install g++`, or what your system calls it"
    );
    let (host, folder) = (toolchain::host()?, target().join("fuzz"));
    let mut build = cargo();
    build.current_dir(root().join("tests/fuzz"));
    build.args(["build", "--release", "--locked", "--features", "libfuzzer"]);
    build.args(["--target", &host]);
    build.arg("--target-dir").arg(&folder);
    let coverage = [
        "level=4",
        "inline-8bit-counters",
        "pc-table",
        "trace-compares",
    ];
    let flags = coverage
        .map(|flag| format!("-Cllvm-args=-sanitizer-coverage-{flag}"))
        .join(" ");
    let flags = format!("-Cpasses=sancov-module {flags} --cfg fuzzing -Ccodegen-units=1");
    // the other variable would come first
    run(build
        .env("RUSTFLAGS", flags)
        .env_remove("CARGO_ENCODED_RUSTFLAGS"))?;
    Ok(folder.join(host).join("release"))
}

fn attack(programs: &Path, name: &str, options: &Options) -> Result<(String, Option<String>)> {
    let folder = target().join("fuzz");
    let seeds = folder.join("seeds").join(name);
    run(Command::new(programs.join(name)).env("TACTUS_SEEDS", &seeds))?;
    let corpus = folder.join("corpus").join(name);
    std::fs::create_dir_all(&corpus)?;
    let mut fuzzer = Command::new(programs.join(name));
    fuzzer.arg(&corpus).arg(&seeds);
    // inputs that broke it once
    let kept = root().join("tests/fuzz/corpus").join(name);
    if kept.is_dir() {
        fuzzer.arg(kept);
    }
    let broken = folder.join(format!("{name}-"));
    fuzzer.arg(format!("-max_total_time={}", options.seconds));
    fuzzer.arg(format!("-max_len={MAX_LEN}"));
    fuzzer.arg(format!("-artifact_prefix={}", broken.display()));
    fuzzer.args([
        "-seed=1",
        "-timeout=10",
        "-rss_limit_mb=1024",
        "-print_final_stats=1",
    ]);
    let output = fuzzer
        .stdin(Stdio::null())
        .output()
        .with_context(|| format!("cannot start {name}"))?;
    let log = String::from_utf8_lossy(&output.stderr);
    let tried = log
        .lines()
        .find_map(|line| line.strip_prefix("stat::number_of_executed_units:"));
    let line = format!("{name} {} inputs", tried.unwrap_or("0").trim());
    Ok((line, (!output.status.success()).then(|| why(&log))))
}

/// The lines of a fuzzer's log that say what broke.
fn why(log: &str) -> String {
    const MARKS: [&str; 3] = ["panicked at", "ERROR: libFuzzer", "Test unit written to"];
    let lines: Vec<&str> = log.lines().collect();
    let is_marked = |line: &str| MARKS.iter().any(|mark| line.contains(mark));
    let says = |at: usize| is_marked(lines[at]) || at > 0 && lines[at - 1].contains(MARKS[0]);
    let said: Vec<&str> = (0..lines.len())
        .filter(|at| says(*at))
        .map(|at| lines[at].trim())
        .collect();
    match &said[..] {
        [] => lines[lines.len().saturating_sub(5)..].join("\n  "),
        said => said.join("\n  "),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crash_says_what_and_where() {
        let log = "#12 NEW cov: 40\nthread 'main' panicked at src/lib.rs:3:5:\nplanted\nnote: backtrace\n\
                   ==1== ERROR: libFuzzer: deadly signal\nartifact_prefix='x'; Test unit written to x-1\n";
        let why = why(log);
        assert!(why.contains("src/lib.rs:3:5") && why.contains("planted") && why.contains("x-1"));
        assert!(!why.contains("backtrace"));
    }
}
