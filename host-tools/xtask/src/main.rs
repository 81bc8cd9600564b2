//! The project's own commands: `cargo xtask --help` lists them.
mod anywhere;
mod bench;
mod bundle;
mod docs;
mod emulate;
mod factory;
mod firmware;
mod flash;
mod fuzz;
mod page;
mod python;
mod reasons;
mod sbom;
mod seeds;
mod shell;
mod size;
mod test;
#[cfg(test)]
mod tests;
mod toolchain;

use std::ffi::OsString;
use std::process::ExitCode;

use anyhow::{Result, bail};
use clap::Parser;

use shell::{cargo, has_subcommand, run};

/// Builds, tests and measures Tactus.
///
/// `cargo xtask test` is the whole check, as CI runs it. For one test use cargo itself: `cargo test -p tactus-core grid`.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
enum Cli {
    /// Build the firmware for the chip, with warnings as errors
    ///
    /// Prints where each ELF is, its SHA-256 and what it takes of the chip; `tactus-rig-f767` is for another board. Builds with
    /// the active Rust toolchain if that has the target thumbv7em-none-eabihf (`rustup target add thumbv7em-none-eabihf`). If
    /// it has not, Debian's Rust packages build it, and where those are missing too, root gets them installed by apt-get.
    Build,
    /// Run the quick checks: formatting, lints, and the unit tests of core and host tools
    ///
    /// Some minutes at most, for every day; `cargo xtask test` is the whole check.
    Check,
    /// Run every check: formatting, lints, licences, tests, documentation, firmware
    ///
    /// All of them run even when one fails, two at a time; what each prints comes when it is over. The last lines say what
    /// ran and how long it took, and what was skipped and why; tests that want recordings are skipped where there are none
    /// (TACTUS_REQUIRE_DATA=1 makes them fail instead).
    Test {
        /// Leave out the firmware build
        #[arg(long)]
        quick: bool,
        /// Run this step only, in this process
        #[arg(long, value_name = "NAME", conflicts_with = "quick")]
        step: Option<String>,
    },
    /// Run the firmware on the emulated board, where it identifies a texture of the simulated rig
    ///
    /// Builds the firmware and the emulator first; that takes some minutes the first time.
    #[command(after_help = "Examples:
  cargo xtask emulate --texture 10 --log     with the firmware's own log
  cargo xtask emulate --finger mems          with another finger: analog or mems
  cargo xtask emulate --handheld             a hand that explores with the handheld
  cargo xtask emulate --handheld --motion    the handheld with a sensor of motion, in a hand
  cargo xtask emulate --port 7429            serves its serial port at tcp:127.0.0.1:7429 instead
  cargo xtask emulate --help                 all options")]
    #[command(disable_help_flag = true)]
    Emulate {
        /// Options for the emulator
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        options: Vec<OsString>,
    },
    /// Build the firmware and flash it to the board (NUCLEO-F429ZI) with probe-rs
    ///
    /// Tables and settings that the board has stored stay: they are in sectors of their own.
    #[command(after_help = flash::EXAMPLES)]
    Flash(flash::Options),
    /// Say what each image takes of the chip, and how deep the rig's stack gets
    ///
    /// The stack is measured on the emulated board, during an exploration. An error if the rig's image or the handheld's
    /// takes more than 160 KB of flash without its table, if variables take more than 64 KB, or if twice the stack does not
    /// fit beside them into the 192 KB there are. Lists the largest symbols, and the functions that panic with their
    /// callers.
    #[command(after_help = size::EXAMPLES)]
    Size(size::Options),
    /// Make a release: images, command, Python package, page, hash sums, and how to flash without a checkout
    ///
    /// The same commit built by the same Rust gives the same bytes. An ELF has the symbols that `probe-rs attach` reads the
    /// log with; .bin and .hex are the same image for other programmers. Beside the images there are the command for this PC,
    /// the Python package, the page with the simulated probe, the factory tables, what each is made of (CycloneDX), and the
    /// licences of dependencies. What this machine cannot build is left out, and said; with CI=true that is an error.
    #[command(after_help = bundle::EXAMPLES)]
    Bundle(bundle::Options),
    /// Make the tables that come with the firmware, shared/tables/*.tact
    ///
    /// Simulates 5 trials of 3 movements on each of the 117 textures of world 1 and learns them, and 15 slides of a hand for
    /// the handheld probe, which takes a minute or two for each finger: those of another one have its name.
    Factory {
        /// Leave the committed file alone; an error if it is not byte for byte what is made now
        #[arg(long)]
        check: bool,
    },
    /// Build the page with a simulated probe for a browser: target/page/index.html
    ///
    /// One file without any network: a double click opens it. Builds for WebAssembly with the active Rust toolchain if that has the
    /// target wasm32-unknown-unknown (`rustup target add wasm32-unknown-unknown`), otherwise with Debian's Rust packages.
    #[command(after_help = page::EXAMPLES)]
    Page(page::Options),
    /// Run many explorations and power cuts on emulated boards and hold them against the bars
    ///
    /// In a simulated world and on recordings of a real finger, side by side on all cores; then the power is cut at every word
    /// of what the firmware stores. With --faults the PC's simulated rig breaks instead, at any moment of whatever its probe does.
    /// Exit code 1 if a bar is missed.
    #[command(after_help = "Examples:
  cargo xtask campaign                                  20 of each, and cuts; some twenty minutes on two cores
  cargo xtask campaign --simulated 4 --recordings 0 --cuts 0     fewer
  cargo xtask campaign --simulated 0 --recordings 0     power cuts only
  cargo xtask campaign --format json --out result.json  for programs
  cargo xtask campaign --faults 2000                    seeds 1 to 2000 of the PC's rig with one to three faults
  cargo xtask campaign --faults 1 --seed 17 --again     one of them once more
  cargo xtask campaign --faults 300 --board             the same on emulated boards, with the firmware
  cargo xtask campaign --builds                         the release, built twice in different folders: are its bytes the same?
  cargo xtask campaign --builds tactus-rig,command      some of it")]
    #[command(disable_help_flag = true)]
    Campaign {
        /// Options for the campaign
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        options: Vec<OsString>,
    },
    /// Have the probe work for a day on the simulated rig and for an hour on the emulated board, with random faults
    ///
    /// The probe learns, deletes and identifies textures, and in every fourth episode something breaks. Judged are its
    /// clock, its slots, its stack, its restarts, what it has stored, and the force on the finger. Exit code 1 if a bar is
    /// missed.
    #[command(after_help = "Examples:
  cargo xtask soak                                  some 25 minutes on an idle core, 3 of them for the PC's 24 hours
  cargo xtask soak --pc-hours 1 --board-hours 0     the simulated rig only
  cargo xtask soak --help                           what is judged, and all options")]
    #[command(disable_help_flag = true)]
    Soak {
        /// Options for the soak
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        options: Vec<OsString>,
    },
    /// Run what draws from a seed with many seeds, and list what failed and what was wrong
    ///
    /// Each run is a process of its own. Prints a line for each that failed, with the command that repeats it, and one for
    /// each wrong or open verdict; a summary is left in target/seeds. An error if a run failed.
    #[command(after_help = seeds::EXAMPLES)]
    Seeds(seeds::Options),
    /// Show what the core's tests would miss: run them on copies of the core with one thing changed
    ///
    /// Changes the sensor, table and explorer modules (cargo-mutants). A mutant that survives is a change no test sees.
    #[command(after_help = "Examples:
  cargo xtask mutants --list             what would be changed
  cargo xtask mutants --jobs 2           two at a time
  cargo xtask mutants --in-diff my.diff  only what a diff touches")]
    Mutants {
        /// Options for cargo-mutants
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        options: Vec<OsString>,
    },
    /// Attack the parsers with libFuzzer: frames, tables, the store's flash, recordings, scenarios
    ///
    /// Runs on stable Rust; wants a C++ compiler. What breaks a target is kept in target/fuzz and named: copy it to
    /// tests/fuzz/corpus, where every later run begins with it.
    #[command(after_help = "Examples:
  cargo xtask fuzz                       ten minutes each
  cargo xtask fuzz table --seconds 60    one of them
  cargo xtask fuzz --planted             with a bug in each, which must be found")]
    Fuzz(fuzz::Options),
    /// Count what the core's kernels cost on the chip
    ///
    /// Instructions of the bench image on the emulated board, the same code as in the rig's image, on a slide of a real finger
    /// where there is one; every result is compared with the plain kernels' on this PC. An error if a kernel misses its gate.
    #[command(after_help = bench::EXAMPLES)]
    Bench(bench::Options),
    /// Build the book, or check and write what is generated in README and book
    #[command(after_help = docs::EXAMPLES)]
    Docs(docs::Options),
}

fn main() -> ExitCode {
    if let Some(compiled) = anywhere::rustc() {
        return ended(compiled);
    }
    let done = match Cli::parse() {
        Cli::Build => firmware::build().map(|_| ()),
        Cli::Emulate { options } => emulate::emulate(&options),
        Cli::Campaign { options } => match emulate::builds(&options) {
            Some(only) => bundle::reproduce(&only),
            None => emulate::campaign(&options),
        },
        Cli::Soak { options } => emulate::start("soak", &options),
        Cli::Check => return ended(test::check()),
        Cli::Test { step: None, quick } => return ended(test::test(quick)),
        Cli::Test {
            step: Some(name), ..
        } => test::one(&name),
        Cli::Flash(options) => flash::flash(&options),
        Cli::Size(options) => size::size(&options),
        Cli::Bundle(options) => bundle::bundle(&options),
        Cli::Factory { check } => factory::factory(check),
        Cli::Page(options) => page::page(&options),
        Cli::Seeds(options) => seeds::seeds(&options),
        Cli::Mutants { options } => mutants(options),
        Cli::Fuzz(options) => fuzz::fuzz(&options),
        Cli::Bench(options) => bench::bench(&options),
        Cli::Docs(options) => docs::docs(&options),
    };
    ended(done.map(|()| ExitCode::SUCCESS))
}

fn ended(done: Result<ExitCode>) -> ExitCode {
    done.unwrap_or_else(|e| {
        eprintln!("error: {e:#}");
        ExitCode::FAILURE
    })
}

fn mutants(options: Vec<OsString>) -> Result<()> {
    if !has_subcommand("mutants") {
        bail!("cargo-mutants is not installed: cargo install cargo-mutants --locked");
    }
    let mut cargo = cargo();
    cargo.args(["mutants", "--package", "tactus-core"]);
    cargo.args(["--test-package", "tactus-core", "--profile", "mutants"]);
    for module in ["sensor", "table", "explorer"] {
        cargo.args(["--file", &format!("shared/src/{module}*")]);
        cargo.args(["--file", &format!("shared/src/{module}*/**")]);
    }
    run(cargo.args(options))
}
