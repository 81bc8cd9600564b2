//! What of a release runs on a PC, each as one file.
use std::path::Path;

use anyhow::{Context as _, Result};

use crate::sbom::{self, Part};
use crate::shell::{run, target};
use crate::toolchain::{self, BROWSER};
use crate::{page, python};

/// One of them.
pub(super) struct Product {
    /// As `--only` knows it.
    pub(super) name: &'static str,
    /// As people are told of it.
    pub(super) what: &'static str,
    /// What it is made of.
    pub(super) part: Part,
    /// An error where this machine lacks what builds it.
    pub(super) lacks: fn() -> Result<()>,
    /// Builds it: the name of its file, and the bytes.
    pub(super) build: fn() -> Result<(String, Vec<u8>)>,
}

/// The program `tactus` for this PC.
pub(super) const COMMAND: Product = Product {
    name: "command",
    what: "the command",
    part: sbom::COMMAND,
    lacks: || Ok(()),
    build: command,
};

/// The Python package.
pub(super) const WHEEL: Product = Product {
    name: "wheel",
    what: "the Python package",
    part: sbom::WHEEL,
    lacks: python::can_build,
    build: wheel,
};

/// The page with the simulated probe.
pub(super) const PAGE: Product = Product {
    name: "page",
    what: "the page",
    part: sbom::PAGE,
    lacks: || toolchain::get(BROWSER).map(drop),
    build: || Ok(("tactus-page.html".to_owned(), read(&page::build()?.page)?)),
};

/// The name of the program's file: "tactus-x86_64-unknown-linux-gnu".
pub(super) fn program() -> Result<String> {
    let end = std::env::consts::EXE_SUFFIX;
    Ok(format!("tactus-{}{end}", toolchain::host()?))
}

fn command() -> Result<(String, Vec<u8>)> {
    let folder = target().join("command");
    let mut build = toolchain::host_build(&folder);
    build.args(["--release", "--locked", "--package", "tactus-probe"]);
    // a panic says its place without them
    build.env("CARGO_PROFILE_RELEASE_STRIP", "symbols");
    run(build.args(["--bin", "tactus"]))?;
    let built = format!("tactus{}", std::env::consts::EXE_SUFFIX);
    Ok((program()?, read(&folder.join("release").join(built))?))
}

fn wheel() -> Result<(String, Vec<u8>)> {
    let wheel = python::wheel()?;
    let name = wheel.file_name().and_then(|name| name.to_str());
    let name = name.with_context(|| format!("{} has no name", wheel.display()))?;
    Ok((name.to_owned(), read(&wheel)?))
}

fn read(file: &Path) -> Result<Vec<u8>> {
    std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))
}
