//! The Python package: built by pip as a user has it, and held against the command by pytest, in a virtual environment.
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, bail, ensure};

use crate::emulate;
use crate::shell::{self, cargo, root, run, target};
use crate::toolchain::{has_library, rustflags};

/// The package, from the top.
const PACKAGE: &str = "host-tools/python";
/// Without these there is no test.
const NEEDED: [&str; 2] = ["numpy", "pytest"];
/// Without these some examples are skipped.
const WELCOME: [&str; 2] = ["matplotlib", "scikit-learn>=1.6"];
/// What the package asks for.
const OLD_ENOUGH: &str =
    "import sys, venv, ensurepip; sys.exit(0 if sys.version_info >= (3, 9) else 1)";

/// Fails where a package is not there, in any version.
const THERE: &str =
    "import importlib.metadata as m, re, sys; m.version(re.split('[<>=]', sys.argv[1])[0])";
/// Linux on 64-bit ARM.
pub(crate) const ARM: &str = "aarch64-unknown-linux-gnu";

#[derive(clap::Args)]
pub(crate) struct Evidence {
    /// Only these of biotac, fabricslide, boreal, worlds and simulated
    sets: Vec<String>,
    /// Folder of the data sets; TACTUS_DATA or ../shared/data unless given
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Write tables and picture into the book, in place of printing the tables
    #[arg(long, conflicts_with = "sets")]
    write: bool,
}

/// Lints the package, has pip build and install it, and runs its tests. Skipped where there is no Python or no way to
/// what pip needs; in CI that is an error.
pub(crate) fn check() -> Result<()> {
    let python = match environment() {
        Ok(python) => python,
        Err(why) => return skip(&format!("{why:#}")),
    };
    println!("== pip install ./{PACKAGE}");
    let mut install = pip(&python);
    install.env("MATURIN_PEP517_ARGS", "--profile tested");
    // one build for both: clippy compiles the package itself
    install.env("RUSTC_WORKSPACE_WRAPPER", "clippy-driver");
    install.env("CLIPPY_ARGS", "-Dwarnings__CLIPPY_HACKERY__");
    run(install.arg(root().join(PACKAGE)))?;
    println!("== pytest {PACKAGE}");
    let command = target().join("debug").join(program("tactus"));
    if !command.is_file() {
        run(cargo().args(["build", "--package", "tactus-probe", "--bin", "tactus"]))?;
    }
    let mut tests = Command::new(&python);
    tests.args(["-m", "pytest", "-rs"]);
    tests.current_dir(root().join(PACKAGE));
    tests.env("TACTUS_COMMAND", command);
    if has(&python, "scikit-learn") {
        // a test that would skip itself then fails
        tests.env("TACTUS_REQUIRE_SKLEARN", "1");
    }
    run(tests.env("PYTHONDONTWRITEBYTECODE", "1"))?;
    println!("== a session with a probe in software");
    let mut session = emulate::workspace("test");
    // as the step of the tests has built it
    session.args(["--test", "command"]);
    session
        .args(["--", "device::package::"])
        .env("TACTUS_PYTHON", python);
    run(&mut session)
}

/// Runs `docs/evidence.py` on the data sets, with this command and this package.
pub(crate) fn evidence(options: &Evidence) -> Result<()> {
    let data = options
        .data
        .clone()
        .or_else(|| std::env::var_os("TACTUS_DATA").map(PathBuf::from));
    let data = data.unwrap_or_else(|| root().join("../shared/data"));
    ensure!(
        data.is_dir(),
        "{}: no such folder; --data or TACTUS_DATA says where the data sets are (DATA.md)",
        data.display()
    );
    let python = environment()?;
    ensure!(
        has(&python, "scikit-learn"),
        "scikit-learn cannot be installed, and ours is shown beside it"
    );
    run(cargo().args([
        "build",
        "--release",
        "--package",
        "tactus-probe",
        "--bin",
        "tactus",
    ]))?;
    run(pip(&python).arg(root().join(PACKAGE)))?;
    let mut judge = Command::new(&python);
    judge.arg(root().join("docs/evidence.py"));
    judge
        .arg(target().join("release").join(program("tactus")))
        .arg(data);
    if options.write {
        judge.arg("--write").arg(root().join("docs/src"));
    }
    run(judge.args(&options.sets))
}

/// An error where there is nothing here that builds the package.
pub(crate) fn can_build() -> Result<()> {
    let mut pip = Command::new("python3");
    pip.args(["-m", "pip", "--version"]).stdout(Stdio::null());
    let has_pip = pip.stderr(Stdio::null()).status();
    if !fits(Path::new("python3")) || !has_pip.is_ok_and(|status| status.success()) {
        bail!(
            "no Python 3.9 or newer with venv and pip (apt-get install python3-venv python3-pip)"
        );
    }
    Ok(())
}

/// What builds for [`ARM`].
const CROSS: [&str; 2] = ["maturin>=1.7,<2", "ziglang"];

/// An error where there is nothing here that builds the package for [`ARM`].
pub(crate) fn can_cross() -> Result<()> {
    can_build()?;
    if cfg!(not(target_os = "linux")) {
        bail!("it is built on Linux");
    }
    if !has_library(ARM) {
        bail!("no Rust for {ARM} (rustup target add {ARM})");
    }
    cross().map(drop)
}

/// The Python of `target/cross`, with maturin and a linker for any Linux: zig.
fn cross() -> Result<PathBuf> {
    environment_in("cross", &CROSS)
}

/// The wheel for this machine.
pub(crate) fn wheel() -> Result<PathBuf> {
    let mut pip = Command::new("python3");
    pip.args(["-m", "pip", "wheel", "--quiet", "--no-deps"]);
    pip.args(["--no-cache-dir", "--disable-pip-version-check"]);
    pip.env("MATURIN_PEP517_ARGS", "--locked");
    wheel_by(pip, "wheels", "--wheel-dir")
}

/// The wheel for Linux on 64-bit ARM.
pub(crate) fn cross_wheel() -> Result<PathBuf> {
    let python = cross()?;
    let bin = python.parent().map(Path::to_owned).unwrap_or_default();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths([bin].into_iter().chain(std::env::split_paths(&path)))?;
    let mut maturin = Command::new(&python);
    maturin.args(["-m", "maturin", "build", "--quiet", "--release", "--locked"]);
    maturin.args(["--target", ARM, "--zig", "--compatibility", "manylinux2014"]);
    maturin.env("PATH", path).arg("--manifest-path");
    wheel_by(maturin, "wheels-cross", "--out")
}

/// The wheel that a command writes into a folder below `target`.
fn wheel_by(mut command: Command, folder: &str, option: &str) -> Result<PathBuf> {
    let out = target().join(folder);
    // an earlier version's would be found, too
    let _ = std::fs::remove_dir_all(&out);
    command.env("CARGO_ENCODED_RUSTFLAGS", rustflags());
    command.env("CARGO_TARGET_DIR", target().join("wheel"));
    // the time of the files in it: the oldest that a zip file can say
    command.env("SOURCE_DATE_EPOCH", "315532800");
    let package = root().join(PACKAGE);
    match option {
        "--out" => command.arg(package.join("Cargo.toml")),
        _ => command.arg(package),
    };
    run(command.arg(option).arg(&out))?;
    let files = std::fs::read_dir(&out).with_context(|| out.display().to_string())?;
    let mut files = files.filter_map(|file| Some(file.ok()?.path()));
    let wheel = files.find(|file| file.extension() == Some("whl".as_ref()));
    wheel.with_context(|| format!("there is no wheel in {}", out.display()))
}

/// The Python of `target/python`, with what the tests need.
fn environment() -> Result<PathBuf> {
    let python = environment_in("python", &NEEDED)?;
    if let Err(why) = install(&python, &WELCOME) {
        if std::env::var("CI").as_deref() == Ok("true") {
            bail!("without {}: {why:#}", WELCOME.join(" and "));
        }
        println!("without {}: their tests are skipped", WELCOME.join(" and "));
    }
    Ok(python)
}

/// The Python of a virtual environment in a folder below `target`, with these packages.
fn environment_in(folder: &str, packages: &[&str]) -> Result<PathBuf> {
    let folder = target().join(folder);
    let python = folder.join(if cfg!(windows) { "Scripts" } else { "bin" });
    let python = python.join(program("python"));
    if !fits(&python) {
        if !fits(Path::new("python3")) {
            bail!("no Python 3.9 or newer with venv (apt-get install python3-venv)");
        }
        let mut make = Command::new("python3");
        run(make.args(["-m", "venv", "--clear"]).arg(&folder))?;
    }
    install(&python, packages)?;
    Ok(python)
}

fn has(python: &Path, package: &str) -> bool {
    let mut ask = Command::new(python);
    ask.args(["-c", THERE, package]).stderr(Stdio::null());
    ask.status().is_ok_and(|status| status.success())
}

/// Installs packages that are not there.
fn install(python: &Path, packages: &[&str]) -> Result<()> {
    if packages.iter().all(|package| has(python, package)) {
        return Ok(());
    }
    // not its script: that one names the folder in which it was made
    let installed = run(pip(python).args(packages));
    installed.with_context(|| {
        format!(
            "pip cannot install {}: is there a network?",
            packages.join(" and ")
        )
    })
}

fn fits(python: &Path) -> bool {
    let mut ask = Command::new(python);
    ask.args(["-c", OLD_ENOUGH]).stderr(Stdio::null());
    ask.status().is_ok_and(|status| status.success())
}

fn pip(python: &Path) -> Command {
    let mut pip = Command::new(python);
    pip.args(["-m", "pip", "install", "--quiet"]);
    pip.arg("--disable-pip-version-check");
    pip
}

fn program(name: &str) -> String {
    format!("{name}{}", std::env::consts::EXE_SUFFIX)
}

/// Says that the tests are skipped, where xtask lists it; in CI that is an error.
fn skip(why: &str) -> Result<()> {
    let is = |variable: &str, value: &str| std::env::var(variable).as_deref() == Ok(value);
    if is("CI", "true") || is("TACTUS_REQUIRE_DATA", "1") {
        bail!("the Python package is not tested: {why}");
    }
    shell::skip("the Python package", why)
}
