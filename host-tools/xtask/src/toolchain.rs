//! What can build for the chip, and for browsers, on this machine.
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, bail};

use crate::shell::{cargo, root, run, target};

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Target {
    pub(crate) triple: &'static str,
    /// What of the standard library is built with it, where a toolchain brings the source only.
    library: &'static str,
    /// The folder below `target`, of the active toolchain and of Debian's: neither builds the other's work anew.
    folders: [&'static str; 2],
}

/// The chip: Cortex-M4 with its FPU.
pub(crate) const CHIP: Target = Target {
    triple: "thumbv7em-none-eabihf",
    library: "core",
    folders: ["chip", "debian"],
};

/// WebAssembly in a browser.
pub(crate) const BROWSER: Target = Target {
    triple: "wasm32-unknown-unknown",
    library: "std,panic_abort",
    folders: ["page-build", "page-debian"],
};

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Toolchain {
    /// The one cargo runs with; it brings the target's library.
    Active,
    /// Debian's packages, which bring the library's source.
    Debian,
}

/// The environment variable that asks for one of the toolchains, by its [`Toolchain::name`].
pub(crate) const WANTED: &str = "TACTUS_TOOLCHAIN";

/// A toolchain for a target: the active one if it has the target, else Debian's, installed if need be.
pub(crate) fn get(target: Target) -> Result<Toolchain> {
    let (help, wanted) = (help(target), wanted()?);
    if wanted != Some(Toolchain::Debian) && active_has(target) {
        return Ok(Toolchain::Active);
    }
    let neither = || {
        anyhow::anyhow!(
            "no Rust toolchain here builds for {}.\n{help}",
            target.triple
        )
    };
    if wanted == Some(Toolchain::Active) {
        return Err(neither());
    }
    if debian_lacks().is_some() {
        let may_install =
            Path::new("/usr/bin/apt-get").exists() && stdout("id", &["-u"]).as_deref() == Some("0");
        if !may_install {
            return Err(neither());
        }
        install_debian(target)?;
    }
    match debian_lacks() {
        None => Ok(Toolchain::Debian),
        Some(what) => bail!("Debian's packages are installed, but {what}.\n{help}"),
    }
}

fn wanted() -> Result<Option<Toolchain>> {
    let Some(name) = std::env::var_os(WANTED).filter(|name| !name.is_empty()) else {
        return Ok(None);
    };
    let mut both = [Toolchain::Active, Toolchain::Debian].into_iter();
    match both.find(|toolchain| name == toolchain.name()) {
        None => bail!("{WANTED}={}: there are active and debian", name.display()),
        found => Ok(found),
    }
}

fn help(target: Target) -> String {
    format!(
        "\
Install one of:
  with rustup         rustup target add {}
  Debian 12, as root  apt-get update
                      apt-get install --no-install-recommends rustc-web cargo-web rust-web-src \
                      rust-web-llvm lld-22 llvm-22
  newer Debian        apt-get install --no-install-recommends rustc cargo rust-src lld   (Rust 1.95 or newer)
and run the command again.",
        target.triple
    )
}

impl Toolchain {
    const fn name(self) -> &'static str {
        match self {
            Self::Active => "active",
            Self::Debian => "debian",
        }
    }

    /// A `cargo build` for a target, without profile and package.
    ///
    /// What is built is not to depend on who builds it and where, so RUSTFLAGS from outside do not count and folders
    /// are left out of it. Warnings are denied in the workspace only: cargo caps the lints of dependencies.
    pub(crate) fn cargo_build(self, to: Target) -> Command {
        let mut cargo = match self {
            Self::Active => cargo(),
            Self::Debian => debian_cargo(),
        };
        cargo
            .env("CARGO_ENCODED_RUSTFLAGS", rustflags())
            .args(["build", "--locked", "--target", to.triple, "--target-dir"])
            .arg(self.folder(to));
        if self == Self::Debian {
            cargo.arg(format!("-Zbuild-std={}", to.library));
        }
        cargo
    }

    pub(crate) fn folder(self, to: Target) -> PathBuf {
        let [active, debian] = to.folders;
        target().join(match self {
            Self::Active => active,
            Self::Debian => debian,
        })
    }

    pub(crate) fn version(self) -> String {
        let (rustc, whose) = match self {
            Self::Active => ("rustc", ""),
            Self::Debian => (DEBIAN_RUSTC, "Debian's "),
        };
        let version = stdout(rustc, &["--version"]).unwrap_or_else(|| rustc.into());
        format!("{whose}{version}")
    }
}

pub(crate) fn host() -> Result<String> {
    let version = stdout("rustc", &["-vV"]).context("rustc does not run")?;
    let line = version.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(line.context("rustc does not name its host")?.to_owned())
}

/// A `cargo build` for this machine into a folder, on the same terms as [`Toolchain::cargo_build`].
pub(crate) fn host_build(folder: &Path) -> Command {
    let mut cargo = cargo();
    cargo
        .env("CARGO_ENCODED_RUSTFLAGS", rustflags())
        .args(["build", "--target-dir"])
        .arg(folder);
    cargo
}

/// The flags of every such build, then these.
pub(crate) fn rustflags() -> OsString {
    let mut flags = OsString::from("-Dwarnings");
    let mut leave_out = |folder: &Path, name: &str| {
        // cargo's separator: folders may have spaces
        flags.push("\x1f--remap-path-prefix=");
        flags.push(folder);
        flags.push(name);
    };
    // "." and not a made-up name: a debugger started at the top still finds the source
    leave_out(&root(), "=.");
    // wherever it is: build scripts' output is named in debug information. The last one that fits counts.
    leave_out(&target(), "=./target");
    let home = |name| std::env::var_os(name).map(PathBuf::from);
    if let Some(cargo) = home("CARGO_HOME").or_else(|| Some(home("HOME")?.join(".cargo"))) {
        leave_out(&cargo, "=cargo");
    }
    flags
}

const DEBIAN_RUSTC: &str = "/usr/bin/rustc";
const DEBIAN_CARGO: &str = "/usr/bin/cargo";
const OLDEST: (u32, u32) = (1, 95);

fn debian_cargo() -> Command {
    let mut cargo = Command::new(DEBIAN_CARGO);
    cargo
        .current_dir(root())
        // rustup's cargo, which runs this program, has put its own libraries and choice here
        .env_remove("LD_LIBRARY_PATH")
        .env_remove("RUSTUP_TOOLCHAIN")
        // else rustup's rustc is found on the PATH, and its sysroot has no source of `core`
        .env("RUSTC", DEBIAN_RUSTC)
        // for -Zbuild-std
        .env("RUSTC_BOOTSTRAP", "1");
    if let Some(path) = path_with_rust_lld() {
        cargo.env("PATH", path);
    }
    cargo
}

/// The part that Debian's toolchain lacks to build for another target, if any.
fn debian_lacks() -> Option<String> {
    if !Path::new(DEBIAN_CARGO).exists() {
        return Some(format!("there is no {DEBIAN_CARGO}"));
    }
    let Some(version) = stdout(DEBIAN_RUSTC, &["--version"]) else {
        return Some(format!("{DEBIAN_RUSTC} does not run"));
    };
    if parse_version(&version).is_none_or(|v| v < OLDEST) {
        return Some(format!("{version} is older than {}.{}", OLDEST.0, OLDEST.1));
    }
    let sysroot = stdout(DEBIAN_RUSTC, &["--print", "sysroot"]).unwrap_or_default();
    let source = Path::new(&sysroot).join("lib/rustlib/src/rust/library/core");
    if !source.is_dir() {
        return Some(format!("there is no {}", source.display()));
    }
    if path_with_rust_lld().is_none() {
        return Some("there is no rust-lld".into());
    }
    None
}

/// "rustc 1.96.0 (...)" -> (1, 96)
fn parse_version(text: &str) -> Option<(u32, u32)> {
    let mut numbers = text.split_whitespace().nth(1)?.split('.');
    Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
}

/// The PATH, with the folder of the active toolchain's rust-lld at its end in case Debian's is not there.
fn path_with_rust_lld() -> Option<OsString> {
    let mut folders: Vec<PathBuf> =
        std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()).collect();
    if let Some(lib) = stdout("rustc", &["--print", "target-libdir"]) {
        folders.push(Path::new(&lib).with_file_name("bin"));
    }
    let found = folders.iter().any(|f| f.join("rust-lld").exists());
    found.then(|| std::env::join_paths(folders).ok()).flatten()
}

fn install_debian(target: Target) -> Result<()> {
    let triple = target.triple;
    eprintln!("No Rust toolchain here builds for {triple}: installing Debian's packages.");
    apt_get(target, &["update"])?;
    // Debian 12 has a new Rust beside its own old one, for browsers; newer releases have only their own
    let web = stdout("apt-cache", &["policy", "rustc-web"])
        .is_some_and(|policy| policy.contains("Candidate: 1."));
    let packages: &[&str] = if web {
        &[
            "rustc-web",
            "cargo-web",
            "rust-web-src",
            "rust-web-llvm",
            "lld-22",
            "llvm-22",
        ]
    } else {
        &["rustc", "cargo", "rust-src", "lld"]
    };
    let install = ["install", "--yes", "--no-install-recommends"];
    apt_get(target, &[&install, packages].concat())
}

fn apt_get(target: Target, arguments: &[&str]) -> Result<()> {
    // somebody else's apt-get may hold the lock for a while
    let mut apt_get = Command::new("apt-get");
    apt_get.args(["--option", "DPkg::Lock::Timeout=300"]);
    apt_get.env("DEBIAN_FRONTEND", "noninteractive");
    run(apt_get.args(arguments)).with_context(|| help(target))
}

fn active_has(target: Target) -> bool {
    has_library(target.triple)
}

/// Returns true if the active toolchain has the standard library of a target.
pub(crate) fn has_library(triple: &str) -> bool {
    stdout("rustc", &["--print", "target-libdir", "--target", triple])
        .is_some_and(|folder| Path::new(&folder).is_dir())
}

fn stdout(program: &str, arguments: &[&str]) -> Option<String> {
    let output = Command::new(program).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn versions_are_compared_as_numbers() {
        let debian = "rustc 1.96.0 (ac68faa20 2026-05-25) (built from a source tarball)";
        assert_eq!(parse_version(debian), Some((1, 96)));
        assert!(parse_version("rustc 1.100.0-nightly") > Some(OLDEST));
        assert!(parse_version("rustc 1.63.0") < Some(OLDEST));
        assert_eq!(parse_version("rustc"), None);
    }

    #[test]
    fn the_oldest_rust_is_the_workspaces() {
        let manifest = std::fs::read_to_string(root().join("Cargo.toml")).unwrap();
        let line = format!("rust-version = \"{}.{}\"", OLDEST.0, OLDEST.1);
        assert!(manifest.contains(&line), "no {line}");
    }
}
