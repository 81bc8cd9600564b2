//! The page's tests: in headless Chromium, and its module against the same code on this machine.
use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result};

use super::{CRATE, build};
use crate::shell::{cargo, root, run, skip, target};
use crate::toolchain::{self, BROWSER};

const WHAT: &str = "the page in a browser";
const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// Builds the page and tries it; skipped where there is no toolchain for it, no Chromium or no Node.js. The screenshots that it takes
/// are left in `target/page`.
pub(crate) fn check() -> Result<()> {
    let starts = |program: &&str| {
        let mut ask = Command::new(program);
        ask.arg("--version")
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        ask.status().is_ok_and(|status| status.success())
    };
    let Some(browser) = BROWSERS.into_iter().find(starts) else {
        return skip(WHAT, "no Chromium (apt-get install chromium)");
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
    let built = build()?;
    println!("== formatting of the page");
    let manifest = root().join(CRATE).join("Cargo.toml");
    run(cargo()
        .args(["fmt", "--check", "--manifest-path"])
        .arg(manifest))?;
    println!("== {} bytes of WebAssembly", built.wasm_bytes);
    let native = reference()?;
    println!("== node {CRATE}/tests/page.mjs");
    let mut tests = Command::new("node");
    tests.arg(root().join(CRATE).join("tests").join("page.mjs"));
    tests.args([&built.page, &built.wasm, &native]).arg(browser);
    run(&mut tests).context("the page is not as it should be")
}

/// What the same requests give here: the file, with a request and its reply a line.
fn reference() -> Result<PathBuf> {
    let file = target().join("page-native.jsonl");
    // as the step of the tests has built it
    let mut native = cargo();
    native.args(["test", "--workspace", "--test", "page", "--", "replies"]);
    run(native.env("TACTUS_PAGE_REPLIES", &file))?;
    Ok(file)
}
