//! The page's tests: in headless Chromium, and its module against the same code on this machine.
use std::ffi::OsStr;
use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};

use super::build::{CRATE, build};
use crate::shell::{root, run, skip, target};
use crate::toolchain::{self, BROWSER};
use crate::{emulate, firmware};

const WHAT: &str = "the page in a browser";
const NOT_AS_IT_SHOULD_BE: &str = "the page is not as it should be";
/// Longest that the probe in software takes: it may be compiled first.
const STARTING: Duration = Duration::from_secs(600);
/// Those that come with the command.
const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// Builds the page and tries it; skipped where there is no toolchain for it, no Chromium or no Node.js. The screenshots
/// that it takes are left in `target/page`.
pub(crate) fn check() -> Result<()> {
    let browser = match browser() {
        Ok(browser) => browser,
        Err(why) => return skip(WHAT, &why.to_string()),
    };
    if !starts(&"node") {
        return skip(
            WHAT,
            "no Node.js, which drives Chromium (apt-get install nodejs)",
        );
    }
    if let Err(why) = toolchain::get(BROWSER) {
        return skip(WHAT, &format!("{why:#}"));
    }
    let built = build("tested")?;
    println!("== {} bytes of WebAssembly", built.wasm_bytes);
    // requests with their replies here, a line each
    let native = left_by(
        "core_and_lab",
        "page::replies",
        "TACTUS_PAGE_REPLIES",
        "page-native.jsonl",
    )?;
    let probe = Probe::in_software()?;
    let (page, wasm) = (&built.page, &built.wasm);
    let arguments = [page, wasm, &native].map(|path| path.as_os_str());
    let mut tests = in_browser(browser, &arguments, &probe.address);
    run(&mut tests).context(NOT_AS_IT_SHOULD_BE)
}

/// Tries what the page does with a probe, with the emulated board in place of the one in software.
pub(crate) fn emulated() -> Result<()> {
    let browser = browser()?;
    let built = build("release")?;
    let probe = Probe::emulated()?;
    let (page, wasm) = (&built.page, &built.wasm);
    let arguments = [page, wasm, page].map(|path| path.as_os_str());
    let mut tests = in_browser(browser, &arguments, &probe.address);
    // one second of the board takes longer than a second
    tests.env("TACTUS_PAGE_SLOW", "10");
    tests.env("TACTUS_PAGE_ONLY", "a probe at a serial port");
    run(&mut tests).context(NOT_AS_IT_SHOULD_BE)
}

fn in_browser(browser: &str, files: &[&OsStr], probe: &str) -> Command {
    println!("== node {CRATE}/tests/page.mjs");
    let mut tests = Command::new("node");
    tests.arg(root().join(CRATE).join("tests").join("page.mjs"));
    tests.args(files).args([browser, probe]);
    tests
}

fn starts(program: &&str) -> bool {
    let mut ask = Command::new(program);
    ask.arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    ask.status().is_ok_and(|status| status.success())
}

fn browser() -> Result<&'static str> {
    let browser = BROWSERS.into_iter().find(starts);
    browser.context("no Chromium (apt-get install chromium)")
}

/// A probe whose serial port is at a TCP port; it ends with this.
struct Probe {
    child: Child,
    address: String,
}

impl Drop for Probe {
    fn drop(&mut self) {
        // it may be gone already
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Probe {
    /// The core's own probe with the simulated rig: that of the tests of `tactus device`.
    fn in_software() -> Result<Self> {
        let file = target().join("page-probe");
        // of an earlier one
        let _ = std::fs::remove_file(&file);
        let mut serves = emulate::workspace("test");
        // as the step of the tests has built it
        serves.args(["--test", "command", "--"]);
        serves.args(["device::page::serves_a_page", "--exact", "--nocapture"]);
        serves.env("TACTUS_PAGE_PORT", &file).stdin(Stdio::piped());
        let child = serves.spawn().context("cannot start cargo")?;
        let mut probe = Self {
            child,
            address: String::new(),
        };
        let began = Instant::now();
        while began.elapsed() < STARTING {
            probe.address = std::fs::read_to_string(&file).unwrap_or_default();
            if !probe.address.is_empty() {
                return Ok(probe);
            }
            if let Some(status) = probe.child.try_wait()? {
                bail!("the probe in software ended with {status}");
            }
            std::thread::sleep(Duration::from_millis(50));
        }
        bail!("the probe in software does not start in {STARTING:?}")
    }

    /// The firmware on the emulated board.
    fn emulated() -> Result<Self> {
        run(&mut emulate::build())?;
        let elf = firmware::compile(&[emulate::RIG])?.remove(0);
        let mut serves = emulate::program("serve");
        serves.args(["--port", "0", "--texture", "burlap", "--elf"]);
        let mut child = serves.arg(elf).stdout(Stdio::piped()).spawn()?;
        let said = child.stdout.take().context("the emulator says nothing")?;
        let mut probe = Self {
            child,
            address: String::new(),
        };
        let mut lines = BufReader::new(said).lines();
        for line in lines.by_ref().map_while(Result::ok) {
            if let Some((_, at)) = line.split_once("serial port at ") {
                probe.address = at.split(',').next().unwrap_or(at).trim().to_owned();
                break;
            }
        }
        ensure!(
            !probe.address.is_empty(),
            "the emulated board does not start"
        );
        // it never waits for somebody who reads
        std::thread::spawn(move || lines.for_each(drop));
        Ok(probe)
    }
}

/// Runs a test that leaves something for the page, as the step of the tests has built it: the path of that.
fn left_by(binary: &str, test: &str, variable: &str, name: &str) -> Result<PathBuf> {
    let path = target().join(name);
    let mut tests = emulate::workspace("test");
    tests.args(["--test", binary, "--", test, "--exact"]);
    run(tests.env(variable, &path))?;
    Ok(path)
}
