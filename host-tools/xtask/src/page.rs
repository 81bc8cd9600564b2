//! `cargo xtask page`: builds the page, serves it, films it, or tries it.
mod build;
mod check;
mod serve;

use std::process::Command;

use anyhow::{Context as _, Result};

use crate::shell::{root, run};
use build::CRATE;

pub(crate) use build::build;
pub(crate) use check::check;

pub(crate) const EXAMPLES: &str = "Examples:
  cargo xtask page                      builds target/page/index.html
  cargo xtask page --serve              and serves it at http://127.0.0.1:8017
  cargo xtask page --film               films it for the README: docs/src/page.webp
  cargo xtask page --emulated           tries it with the firmware on the emulated board
  cargo xtask test --step page          builds it and tries it in headless Chromium";

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Serve the page to this machine, until Ctrl-C
    #[arg(long)]
    serve: bool,
    /// Port to serve it at
    #[arg(long, default_value_t = 8017, requires = "serve")]
    port: u16,
    /// Film an exploration of the page, for the README
    #[arg(long, conflicts_with = "serve")]
    film: bool,
    /// Have the page work with the emulated board, in headless Chromium
    #[arg(long, conflicts_with_all = ["serve", "film"])]
    emulated: bool,
}

/// The README's moving picture, from the top.
const FILM: &str = "docs/src/page.webp";

/// Builds the page, and serves it.
pub(crate) fn page(options: &Options) -> Result<()> {
    if options.emulated {
        return check::emulated();
    }
    let built = build()?;
    let (file, wasm) = (built.page.display(), built.wasm_bytes);
    println!("{file}\n{wasm} bytes of WebAssembly");
    if options.film {
        let mut film = Command::new("node");
        film.arg(root().join(CRATE).join("tests").join("film.mjs"));
        film.args([&built.page, &root().join(FILM)])
            .arg(check::browser()?);
        run(&mut film).context("the page is not filmed")?;
    }
    if options.serve {
        serve::serve(built.folder()?, options.port)?;
    }
    Ok(())
}
