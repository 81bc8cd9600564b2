//! `cargo xtask fuzz`: libFuzzer against the parsers. Its flags are those of cargo-fuzz without a sanitizer, which stable Rust
//! takes: memory is safe here, and what is looked for are panics, overflows and memory without bounds.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context as _, Result, bail};
use clap::Args;

use crate::shell::{cargo, root, run, target};

/// What is attacked: the binaries of tests/fuzz.
const TARGETS: [&str; 5] = ["wire", "table", "store", "recordings", "scenario"];
/// Longest input, bytes.
const MAX_LEN: usize = 8192;

#[derive(Args)]
pub(crate) struct Options {
    /// What to attack; all unless given
    #[arg(value_name = "TARGET", value_parser = TARGETS)]
    targets: Vec<String>,
    /// How long, each
    #[arg(long, default_value_t = 600, value_parser = clap::value_parser!(u64).range(1..))]
    seconds: u64,
    /// With a bug in every target, which must be found
    #[arg(long)]
    planted: bool,
}

impl Options {
    /// All targets.
    pub(crate) fn all(seconds: u64, planted: bool) -> Self {
        let targets = Vec::new();
        Self {
            targets,
            seconds,
            planted,
        }
    }
}

/// How a target ended.
struct Ended {
    name: String,
    /// Inputs that were tried.
    tried: u64,
    /// Branches that were reached.
    reached: u64,
    /// What broke it, and how it is repeated.
    broken: Option<String>,
}

pub(crate) fn fuzz(options: &Options) -> Result<()> {
    let programs = build(options.planted)?;
    let names: Vec<String> = if options.targets.is_empty() {
        TARGETS.map(String::from).into()
    } else {
        options.targets.clone()
    };
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let rounds = names.len().div_ceil(cores) as u64;
    let what = if options.planted {
        ", planted bugs"
    } else {
        ""
    };
    println!(
        "{} for {} s each{what}: at most {} s on {cores} cores",
        names.join(", "),
        options.seconds,
        rounds * options.seconds,
    );
    let (next, ended) = (AtomicUsize::new(0), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for _ in 0..cores.min(names.len()) {
            scope.spawn(|| {
                while let Some(name) = names.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let one = attack(&programs, name, options);
                    if let Ok(Ended { tried, reached, .. }) = &one {
                        println!("{name:12} {tried:>10} inputs, {reached:>6} branches reached");
                    }
                    ended.lock().unwrap_or_else(|e| e.into_inner()).push(one);
                }
            });
        }
    });
    let ended = ended.into_inner().unwrap_or_else(|e| e.into_inner());
    let mut wrong = Vec::new();
    for one in ended {
        let Ended { name, broken, .. } = one?;
        match broken {
            Some(why) if options.planted && why.contains("planted") => {
                println!("{name:12} found its planted bug");
            }
            Some(why) => wrong.push(format!("{name}: {why}")),
            None if options.planted => wrong.push(format!("{name}: the planted bug was not found")),
            None => {}
        }
    }
    if !wrong.is_empty() {
        bail!("{}", wrong.join("\n"));
    }
    Ok(())
}

/// Builds the targets; the folder of their programs.
fn build(planted: bool) -> Result<PathBuf> {
    if !["c++", "g++", "clang++"].iter().any(|c| runs(c)) {
        bail!(
            "libFuzzer is C++, and there is no compiler for it: `apt install g++`, or what your system calls it"
        );
    }
    let host = host()?;
    let folder = target().join("fuzz");
    let mut build = cargo();
    build.current_dir(root().join("tests/fuzz"));
    build.args(["build", "--release", "--locked", "--target", &host]);
    build.arg("--target-dir").arg(&folder);
    if planted {
        build.args(["--features", "planted"]);
    }
    let level = [
        "-sanitizer-coverage-level=4",
        "-sanitizer-coverage-inline-8bit-counters",
        "-sanitizer-coverage-pc-table",
        "-sanitizer-coverage-trace-compares",
    ];
    let flags = level.map(|flag| format!("-Cllvm-args={flag}")).join(" ");
    build.env(
        "RUSTFLAGS",
        format!("-Cpasses=sancov-module {flags} --cfg fuzzing -Ccodegen-units=1"),
    );
    // it would come first
    build.env_remove("CARGO_ENCODED_RUSTFLAGS");
    run(&mut build)?;
    Ok(folder.join(host).join("release"))
}

fn runs(program: &str) -> bool {
    let mut command = Command::new(program);
    command.arg("--version").stdout(Stdio::null());
    command
        .stderr(Stdio::null())
        .status()
        .is_ok_and(|s| s.success())
}

fn host() -> Result<String> {
    let rustc = Command::new("rustc").arg("-vV").output();
    let told = rustc.context("cannot start rustc")?.stdout;
    let told = String::from_utf8_lossy(&told).into_owned();
    let host = told.lines().find_map(|line| line.strip_prefix("host: "));
    host.map(str::to_owned)
        .context("rustc does not say what it runs on")
}

fn attack(programs: &Path, name: &str, options: &Options) -> Result<Ended> {
    let folder = target().join("fuzz");
    let seeds = folder.join("seeds").join(name);
    run(Command::new(programs.join(name)).env("TACTUS_SEEDS", &seeds))?;
    // a planted bug is found from the seeds alone
    let corpus = folder.join(if options.planted { "planted" } else { "corpus" });
    let corpus = corpus.join(name);
    if options.planted {
        let _ = std::fs::remove_dir_all(&corpus);
    }
    std::fs::create_dir_all(&corpus)?;
    let mut fuzzer = Command::new(programs.join(name));
    fuzzer.arg(&corpus).arg(&seeds);
    // inputs that broke it once
    let kept = root().join("tests/fuzz/corpus").join(name);
    if kept.is_dir() && !options.planted {
        fuzzer.arg(kept);
    }
    let broken = folder.join(format!("{name}-"));
    fuzzer.arg(format!("-max_total_time={}", options.seconds));
    fuzzer.arg(format!("-max_len={MAX_LEN}"));
    fuzzer.arg(format!("-artifact_prefix={}", broken.display()));
    fuzzer.args(["-seed=1", "-timeout=20", "-rss_limit_mb=1024"]);
    fuzzer.arg("-print_final_stats=1");
    let output = fuzzer.stdin(Stdio::null()).output();
    let output =
        output.with_context(|| format!("cannot start {}", programs.join(name).display()))?;
    let log = String::from_utf8_lossy(&output.stderr);
    let number = |text: &str| -> Option<u64> { text.split_whitespace().next()?.parse().ok() };
    let tried = log
        .lines()
        .find_map(|line| number(line.strip_prefix("stat::number_of_executed_units:")?));
    let reached = log
        .lines()
        .rev()
        .find_map(|line| number(line.split_once("cov: ")?.1));
    let broken = (!output.status.success()).then(|| why(&log));
    Ok(Ended {
        name: name.to_owned(),
        tried: tried.unwrap_or_default(),
        reached: reached.unwrap_or_default(),
        broken,
    })
}

/// What a fuzzer that ended early had to say.
fn why(log: &str) -> String {
    let told = |line: &&str| {
        line.contains("panicked at")
            || line.contains("ERROR: libFuzzer")
            || line.contains("Test unit written to")
    };
    let mut lines: Vec<&str> = Vec::new();
    let mut after_panic = false;
    for line in log.lines() {
        if told(&line) || after_panic {
            lines.push(line.trim());
        }
        after_panic = line.contains("panicked at");
    }
    if lines.is_empty() {
        lines.extend(log.lines().rev().take(5));
    }
    lines.join("\n  ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crash_says_what_and_where() {
        let log = "#12 NEW cov: 40\nthread 'main' panicked at src/lib.rs:3:5:\nplanted\nnote: backtrace\n==1== ERROR: libFuzzer: deadly signal\nartifact_prefix='x'; Test unit written to x-1\n";
        let why = why(log);
        assert!(why.contains("src/lib.rs:3:5") && why.contains("planted") && why.contains("x-1"));
        assert!(!why.contains("backtrace"));
    }
}
