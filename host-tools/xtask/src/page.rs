//! `cargo xtask page`: builds the page with the simulated probe, and makes the README's film of it; its checks are a
//! step of `cargo xtask test`.
mod build;
mod check;

use anyhow::Result;

pub(crate) use build::build;
pub(crate) use check::check;

/// Builds the page; with `film` the README's picture, too.
pub(crate) fn page(film: bool) -> Result<()> {
    let built = build("release")?;
    if film {
        check::film(&built)?;
    }
    println!(
        "{}\n{} bytes of WebAssembly",
        built.page.display(),
        built.wasm_bytes
    );
    Ok(())
}
