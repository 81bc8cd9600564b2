//! The project's own commands: `cargo xtask --help` lists them.
mod bench;
mod bundle;
mod campaign;
mod docs;
mod emulate;
mod firmware;
mod flash;
mod page;
mod python;
mod shell;
mod size;
mod test;
#[cfg(test)]
mod tests;
mod toolchain;

use std::ffi::OsString;
use std::process::ExitCode;

use clap::Parser;

/// Builds, tests and measures Tactus.
///
/// `cargo xtask test` is the whole check, as CI runs it. For one test use cargo itself:
/// `cargo test -p tactus-core grid`.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
enum Cli {
    /// Run the quick checks: formatting, lints, licences, and the unit tests of core and lab
    ///
    /// For every day; `cargo xtask test` is the whole check.
    Check,
    /// Run every check: formatting, lints, licences, tests, documentation, firmware
    ///
    /// All of them run even when one fails, in two rows side by side; the output of each comes when it is over. The
    /// last lines say what ran and how long it took, and what was skipped and why; tests that want recordings are
    /// skipped where there are none (TACTUS_REQUIRE_DATA=1 makes them fail instead). Longer checks:
    /// `cargo xtask campaign`.
    ///
    /// The images are built by the active toolchain if it has their target, or else by Debian's;
    /// TACTUS_TOOLCHAIN=debian or TACTUS_TOOLCHAIN=active asks for one of them. The last line names the compiler that
    /// made them.
    Test {
        /// Run this step only, in this process; `fuzz` is one that does not run otherwise
        #[arg(long, value_name = "NAME")]
        step: Option<String>,
    },
    /// Run the firmware on the emulated board, where it identifies a texture of the simulated rig
    ///
    /// Builds the firmware and the emulator first; that takes some minutes the first time.
    #[command(after_help = emulate::EXAMPLES)]
    #[command(disable_help_flag = true)]
    Emulate {
        /// Options for the emulator
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        options: Vec<OsString>,
    },
    /// Run a long check or all of them: many explorations, power cuts, faults, fuzzing
    ///
    /// Each part says in one sentence how it ended: a row of the table in docs/src/tests.md. An error if one misses a
    /// limit.
    #[command(after_help = campaign::EXAMPLES)]
    Campaign(campaign::Options),
    /// Judge every data set that is there, with the defaults: the tables of the book's page of evidence
    ///
    /// What is told of known and of new textures, and one slide's forced name beside scikit-learn's classifiers, split
    /// by split; ten minutes on two cores. It needs Python and the data sets, see DATA.md.
    Evidence(python::Evidence),
    /// Count what the core's kernels cost on the chip
    ///
    /// Instructions of the bench in the silicon image on the emulated board, the same code as in the rig's image, on a
    /// slide of a real finger where there is one; every result is compared with the plain kernels' on this PC. An error
    /// if a kernel misses its gate.
    #[command(after_help = bench::EXAMPLES)]
    Bench(bench::Options),
    /// Build the firmware; list each image with its hash, its memory and the rig's deepest stack
    ///
    /// The stack is measured on the emulated board, during an exploration. An error if an image takes more flash or
    /// variables than it may, or if twice the stack does not fit beside them. Lists the functions that panic.
    ///
    /// Builds with the active Rust toolchain if that has the target thumbv7em-none-eabihf
    /// (`rustup target add thumbv7em-none-eabihf`). If it has not, Debian's Rust packages build it, and where those are
    /// missing too, root gets them installed by apt-get.
    Size,
    /// Build the firmware and flash it to the board (NUCLEO-F429ZI) with probe-rs
    ///
    /// Tables and settings that the board has stored stay: they are in sectors of their own.
    #[command(after_help = flash::EXAMPLES)]
    Flash(flash::Options),
    /// Build the page with a simulated probe for a browser: target/page/index.html
    ///
    /// One file without any network: a double click opens it. Builds for WebAssembly with the active Rust toolchain if
    /// that has the target wasm32-unknown-unknown (`rustup target add wasm32-unknown-unknown`), otherwise with Debian's
    /// packages.
    Page {
        /// Make the README's film of it, too: docs/src/page.webp; needs Chromium and Node.js
        #[arg(long)]
        film: bool,
    },
    /// Build the book, or check and write what is generated in README and book
    #[command(after_help = docs::EXAMPLES)]
    Docs(docs::Options),
    /// Make a release: images, command, Python package, page, tables, licences, hash sums, and how to flash without a
    /// checkout
    ///
    /// An ELF has the symbols that `probe-rs attach` reads the log with; .bin is the same image for other programmers.
    /// What this machine cannot build is left out, and said; with CI=true that is an error.
    #[command(after_help = bundle::EXAMPLES)]
    Bundle(bundle::Options),
}

fn main() -> ExitCode {
    let done = match Cli::parse() {
        Cli::Check => test::check(),
        Cli::Test { step: None } => test::test(),
        Cli::Test { step: Some(name) } => test::one(&name),
        Cli::Emulate { options } => emulate::emulate(&options),
        Cli::Campaign(options) => campaign::campaign(&options),
        Cli::Evidence(options) => python::evidence(&options),
        Cli::Bench(options) => bench::bench(&options),
        Cli::Size => size::size(),
        Cli::Flash(options) => flash::flash(&options),
        Cli::Page { film } => page::page(film),
        Cli::Docs(options) => docs::docs(&options),
        Cli::Bundle(options) => bundle::bundle(&options),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("error: {why:#}");
            ExitCode::FAILURE
        }
    }
}
