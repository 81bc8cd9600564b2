//! The steps of the checks, each with what it needs.
use std::process::Command;

use anyhow::Result;

use super::failures::run_tests;
use crate::shell::{cargo, run};
use crate::{bench, emulate, firmware, fuzz, page, python, size};

/// How long each parser is attacked ...
const FUZZ_S: u64 = 10;
/// ... and how long the bugs that are there on purpose may stay hidden.
const PLANTED_S: u64 = 150;

/// A step, which this program runs in a process of its own: `cargo xtask test --step NAME`.
pub(super) struct Step {
    pub(super) name: &'static str,
    /// A cargo command that is not everywhere. Without it the step is skipped.
    pub(super) wants: Option<&'static str>,
    /// Steps that must have passed.
    pub(super) after: &'static [&'static str],
    /// The folder below `target` that cargo locks while it builds: of the steps with one, one at a time.
    pub(super) folder: &'static str,
    pub(super) check: fn() -> Result<()>,
}

/// What `cargo xtask check` runs.
pub(super) const CHECK: [&str; 3] = ["formatting", "lints", "unit tests"];
/// What `cargo xtask test --quick` runs ...
pub(super) const QUICK: [&str; 5] = [
    "formatting",
    "lints",
    "licences and sources",
    "tests",
    "documentation",
];
/// ... and what it leaves out.
pub(super) const SLOW: [&str; 9] = [
    "python",
    "page",
    "fuzz",
    "firmware",
    "lints of the emulator",
    "build of the emulator",
    "emulator",
    "bench",
    "size",
];

/// All steps, in the order in which they begin if nothing else keeps them: what others wait for, and what takes long, first.
pub(super) const STEPS: [Step; 15] = [
    step("formatting", "", &[], || {
        cargo_step(&["fmt", "--all", "--check"])
    }),
    step("firmware", "chip", &[], || {
        println!("== cargo xtask build");
        firmware::build_all()
    }),
    step("lints", "debug", &[], || {
        cargo_step(&["clippy", "--workspace", "--all-targets", "--", "-Dwarnings"])
    }),
    Step {
        wants: Some("deny"),
        // advisories would need the network
        ..step("licences and sources", "", &[], || {
            cargo_step(&["deny", "check", "bans", "licenses", "sources"])
        })
    },
    step("unit tests", "debug", &[], || {
        let mut tests = cargo();
        tests.args([
            "test",
            "--package",
            "tactus-core",
            "--package",
            "tactus-link",
            "--package",
            "tactus-world",
            "--package",
            "tactus-lab",
            "--package",
            "tactus-study",
            "--package",
            "tactus-probe",
        ]);
        tests.args(["--lib", "--bins", "--no-fail-fast"]);
        announce_and_test(&mut tests)
    }),
    step("tests", "debug", &[], || {
        let mut tests = cargo();
        tests.args(["test", "--workspace", "--no-fail-fast"]);
        announce_and_test(&mut tests)
    }),
    // its tests compare with the command that was built there
    step("python", "wheel", &["tests"], || {
        println!("== the Python package");
        python::check()
    }),
    // its reference is a test that was built there
    step("page", "page", &["tests"], || {
        println!("== the page");
        page::check()
    }),
    step("lints of the emulator", "emulator", &[], || {
        emulate::lints().iter_mut().try_for_each(announce_and_run)
    }),
    step("build of the emulator", "emulator", &[], || {
        let mut tests = emulate::tests();
        announce_and_run(tests.arg("--no-run"))?;
        announce_and_run(&mut emulate::build())
    }),
    step("emulator", "", BUILT, || {
        let mut tests = emulate::tests();
        announce_and_test(emulate::with_images(&mut tests, &firmware::elves()?)?)
    }),
    step("fuzz", "fuzz", &[], || {
        fuzz::fuzz(&fuzz::Options::all(FUZZ_S, false))?;
        fuzz::fuzz(&fuzz::Options::all(PLANTED_S, true))
    }),
    step("documentation", "debug", &[], || {
        let mut doc = cargo();
        doc.args(["doc", "--workspace", "--no-deps"]);
        announce_and_run(doc.env("RUSTDOCFLAGS", "-Dwarnings"))
    }),
    step("bench", "", BUILT, || {
        println!("== cargo xtask bench");
        bench::gates()
    }),
    step("size", "", BUILT, || {
        println!("== cargo xtask size");
        size::gates()
    }),
];

/// What runs firmware on the emulated board needs both.
const BUILT: &[&str] = &["firmware", "build of the emulator"];

const fn step(
    name: &'static str,
    folder: &'static str,
    after: &'static [&'static str],
    check: fn() -> Result<()>,
) -> Step {
    Step {
        name,
        wants: None,
        after,
        folder,
        check,
    }
}

fn cargo_step(arguments: &[&str]) -> Result<()> {
    announce_and_run(cargo().args(arguments))
}

fn announce_and_run(command: &mut Command) -> Result<()> {
    announce(command);
    run(command)
}

fn announce_and_test(command: &mut Command) -> Result<()> {
    announce(command);
    run_tests(command)
}

fn announce(command: &Command) {
    let arguments: Vec<_> = command.get_args().map(|a| a.to_string_lossy()).collect();
    println!("== cargo {}", arguments.join(" "));
}
