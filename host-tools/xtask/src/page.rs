//! `cargo xtask page`: builds the page with the simulated probe; its checks are a step of `cargo xtask test`.
mod build;
mod check;

use anyhow::Result;

pub(crate) use build::build;
pub(crate) use check::check;

pub(crate) fn page() -> Result<()> {
    let built = build("release")?;
    println!(
        "{}\n{} bytes of WebAssembly",
        built.page.display(),
        built.wasm_bytes
    );
    Ok(())
}
