//! What is built of packages beside their workspace, the same wherever the sources lie.
//!
//! The page and the Python package are workspaces of their own, and depend on packages above them. Of such a dependency cargo puts the
//! folder into what tells two crates apart (rustc's `-C metadata`), and in the order of these rustc lays out its code. So this program
//! stands in rustc's place (`RUSTC_WRAPPER`), and has a crate of the repository told apart by its names.
use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Context as _, Result};

use crate::shell::root;

/// Says that cargo has called.
const CALLED: &str = "TACTUS_XTASK_IS_RUSTC";

/// Has cargo call this program, in what `build` starts.
pub(crate) fn same(build: &mut Command) -> Result<()> {
    let program = std::env::current_exe().context("cannot find this program")?;
    build.env("RUSTC_WRAPPER", program).env(CALLED, "1");
    Ok(())
}

/// What rustc came to, if cargo has called.
pub(crate) fn rustc() -> Option<Result<ExitCode>> {
    std::env::var_os(CALLED)?;
    Some(compile())
}

fn compile() -> Result<ExitCode> {
    let mut given = std::env::args_os().skip(1);
    let rustc = given.next().context("which rustc?")?;
    let variable = |name| std::env::var(name).unwrap_or_default();
    // cargo says to rustc, too, which package this is
    let folder = variable("CARGO_MANIFEST_DIR");
    let is_own = !folder.is_empty() && Path::new(&folder).starts_with(root());
    let package = is_own.then(|| {
        let [name, version] = ["CARGO_PKG_NAME", "CARGO_PKG_VERSION"].map(variable);
        format!("{name} {version}")
    });
    let arguments = told_apart(given, package.as_deref());
    let mut compiler = Command::new(&rustc);
    compiler.args(arguments).env_remove(CALLED);
    let status = compiler.status();
    let status = status.with_context(|| format!("cannot start {}", rustc.display()))?;
    let code = status.code().and_then(|code| u8::try_from(code).ok());
    Ok(ExitCode::from(code.unwrap_or(1)))
}

/// The arguments, where a crate of one of our packages is told apart by its names.
fn told_apart(given: impl Iterator<Item = OsString>, package: Option<&str>) -> Vec<OsString> {
    let mut all: Vec<OsString> = given.collect();
    let Some(package) = package else { return all };
    let after = |word: &str| {
        let at = all.iter().position(|argument| argument == word)?;
        all.get(at + 1)?.to_str()
    };
    let name = after("--crate-name").unwrap_or_default();
    let metadata = format!("metadata={package} {name}");
    for argument in &mut all {
        if argument.to_string_lossy().starts_with("metadata=") {
            *argument = OsString::from(&metadata);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    const GIVEN: &str = "--crate-name tactus_core src/lib.rs -C opt-level=3 -C metadata=0123456789abcdef -C extra-filename=-0123456789abcdef";

    fn given(package: Option<&str>) -> Vec<OsString> {
        told_apart(GIVEN.split(' ').map(OsString::from), package)
    }

    #[test]
    fn a_crate_of_ours_is_told_apart_by_its_names_and_no_other_is_changed() {
        let as_it_was: Vec<OsString> = GIVEN.split(' ').map(OsString::from).collect();
        assert_eq!(given(None), as_it_was);
        let ours = given(Some("tactus-core 0.2.0"));
        let changed: Vec<_> = ours
            .iter()
            .zip(&as_it_was)
            .filter(|(a, b)| a != b)
            .collect();
        let metadata = OsString::from("metadata=tactus-core 0.2.0 tactus_core");
        assert_eq!(changed, [(&metadata, &as_it_was[6])]);
    }
}
