//! The page's tests: in headless Chromium, and its module against the same code on this machine.
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};

use super::build::{Built, CRATE, build};
use crate::emulate;
use crate::shell::{root, run, skip, target};
use crate::toolchain::{self, BROWSER};

const WHAT: &str = "the page in a browser";
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
    println!("== node {CRATE}/tests/page.mjs");
    let mut tests = Command::new("node");
    tests.arg(root().join(CRATE).join("tests").join("page.mjs"));
    tests.args([page, wasm, &native]);
    run(tests.args([browser, &probe.address])).context("the page is not as it should be")
}

/// Makes the README's film: the first visit, in Chromium.
pub(super) fn film(built: &Built) -> Result<()> {
    let mut film = Command::new("node");
    film.arg(root().join(CRATE).join("tests").join("film.mjs"));
    film.arg(&built.page).arg(browser()?);
    run(film.arg(root().join("docs/src/page.webp"))).context("the film is not made")
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
}

/// Runs a test that leaves something for the page, as the step of the tests has built it: the path of that.
fn left_by(binary: &str, test: &str, variable: &str, name: &str) -> Result<PathBuf> {
    let path = target().join(name);
    let mut tests = emulate::workspace("test");
    tests.args(["--test", binary, "--", test, "--exact"]);
    run(tests.env(variable, &path))?;
    Ok(path)
}
