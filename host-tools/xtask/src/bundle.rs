//! `cargo xtask bundle`: a release, with what is flashed, what runs on a PC, and how to check and flash it.
mod image;
mod licences;
pub(crate) mod printed;
mod trial;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use clap::Args;

use crate::campaign::{FOLDER, TABLES};
use crate::firmware::{self, hash, shown};
use crate::shell::{self, root, run, target};
use crate::toolchain::{self, BROWSER};
use crate::{page, python};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask bundle                  everything, into target/bundle
  cargo xtask bundle --out release    into another folder";

const SUMS: &str = "SHA256SUMS";
const LICENCES: &str = "LICENSES-DEPENDENCIES.txt";

#[derive(Args)]
pub(crate) struct Options {
    /// The folder to write; files of an earlier release in it are replaced
    #[arg(long, value_name = "DIR", default_value = "target/bundle")]
    out: PathBuf,
}

type Files = BTreeMap<String, Vec<u8>>;

/// A file of a release that runs on a PC.
struct Product {
    name: &'static str,
    /// Its manifest, its package, and the platform if it is not this machine's: whose licences count.
    made_of: (&'static str, &'static str, Option<&'static str>),
    /// An error where this machine lacks what builds it.
    lacks: fn() -> Result<()>,
    /// Builds it: the name of its file, and where it is.
    build: fn() -> Result<(String, PathBuf)>,
}

const PRODUCTS: [Product; 4] = [
    Product {
        name: "command",
        made_of: ("Cargo.toml", "tactus-probe", None),
        lacks: || Ok(()),
        build: command,
    },
    Product {
        name: "wheel",
        made_of: ("host-tools/python/Cargo.toml", "tactus-python", None),
        lacks: python::can_build,
        build: || named(python::wheel()?),
    },
    Product {
        name: "wheel for 64-bit ARM",
        made_of: (
            "host-tools/python/Cargo.toml",
            "tactus-python",
            Some(python::ARM),
        ),
        lacks: python::can_cross,
        build: || named(python::cross_wheel()?),
    },
    Product {
        name: "page",
        made_of: (
            "host-tools/page/Cargo.toml",
            "tactus-page",
            Some(BROWSER.triple),
        ),
        lacks: || toolchain::get(BROWSER).map(drop),
        build: || Ok(("tactus-page.html".to_owned(), page::build("release")?.page)),
    },
];
/// The images, as [`Product::made_of`].
const FIRMWARE: (&str, &str, Option<&str>) = (
    "Cargo.toml",
    "tactus-firmware",
    Some(toolchain::CHIP.triple),
);

fn named(file: PathBuf) -> Result<(String, PathBuf)> {
    let name = file.file_name().unwrap_or_default();
    Ok((name.to_string_lossy().into_owned(), file))
}

fn command() -> Result<(String, PathBuf)> {
    let folder = target().join("command");
    let mut build = toolchain::host_build(&folder);
    build.args([
        "--release",
        "--locked",
        "--package",
        "tactus-probe",
        "--bin",
        "tactus",
    ]);
    // a panic says its place without them
    run(build.env("CARGO_PROFILE_RELEASE_STRIP", "symbols"))?;
    let end = std::env::consts::EXE_SUFFIX;
    let built = folder.join("release").join(format!("tactus{end}"));
    Ok((format!("tactus-{}{end}", toolchain::host()?), built))
}

pub(crate) fn bundle(options: &Options) -> Result<()> {
    let out = root().join(&options.out);
    let files = files()?;
    trial::run(&files)?;
    write(&out, &files)?;
    for (name, bytes) in &files {
        println!("{:>9}  {}", bytes.len(), shown(&out.join(name)));
    }
    Ok(())
}

fn files() -> Result<Files> {
    let (mut files, mut parts) = (Files::new(), vec![FIRMWARE]);
    for elf in firmware::elves()? {
        let (name, bytes) = (firmware::name(&elf)?, read(&elf)?);
        let flat = image::flat(&bytes).with_context(|| name.to_owned())?;
        files.insert(format!("{name}.hex"), image::hex(&flat).into());
        files.insert(format!("{name}.bin"), flat);
        files.insert(format!("{name}.elf"), bytes);
    }
    for name in TABLES.into_iter().flat_map(|(_, names)| names) {
        files.insert((*name).to_owned(), read(&root().join(FOLDER).join(name))?);
    }
    for product in PRODUCTS {
        let name = product.name;
        if let Err(why) = (product.lacks)() {
            lacks(name, &why)?;
            continue;
        }
        let (file, built) =
            (product.build)().with_context(|| format!("the {name} is not built"))?;
        files.insert(file, read(&built)?);
        parts.push(product.made_of);
    }
    match printed::lacks() {
        Ok(()) => files.extend(printed::all(tempfile::tempdir()?.path())?),
        Err(why) => lacks("printed parts", &why)?,
    }
    files.insert(LICENCES.into(), licences::of(&parts)?.into());
    for ours in ["LICENSE-MIT", "LICENSE-APACHE"] {
        files.insert(ours.to_owned(), read(&root().join(ours))?);
    }
    files.insert("FLASHING.md".into(), flashing().into());
    files.insert(SUMS.into(), sums(&files).into());
    Ok(files)
}

/// A part that this machine cannot make is left out, but not of a release that CI makes.
fn lacks(name: &str, why: &anyhow::Error) -> Result<()> {
    if std::env::var("CI").as_deref() == Ok("true") {
        bail!("a release without the {name}: {why:#}");
    }
    shell::skip(&format!("the {name}"), &format!("{why:#}"))
}

fn read(file: &Path) -> Result<Vec<u8>> {
    std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))
}

fn sums(files: &Files) -> String {
    files.iter().fold(String::new(), |mut sums, (name, bytes)| {
        let _ = writeln!(sums, "{}  {name}", hash(bytes));
        sums
    })
}

fn write(out: &Path, files: &Files) -> Result<()> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    for entry in std::fs::read_dir(out).with_context(|| out.display().to_string())? {
        let name = entry?.file_name();
        ensure!(
            name.to_str().is_some_and(|name| files.contains_key(name)),
            "{} holds {}, which is no file of this release: empty it, or give another folder with --out",
            out.display(),
            name.display()
        );
    }
    // all of it, or none: a release is not mixed with an earlier one
    let part = |name: &String| out.join(format!("{name}.part"));
    let written = files.iter().try_for_each(|(name, bytes)| {
        let file = part(name);
        std::fs::write(&file, bytes).with_context(|| format!("cannot write {}", file.display()))?;
        #[cfg(unix)]
        if bytes.starts_with(b"\x7fELF") && !name.ends_with(".elf") {
            use std::os::unix::fs::PermissionsExt as _;
            std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o755))?;
        }
        Ok(())
    });
    let named = |name: &String| std::fs::rename(part(name), out.join(name));
    let written = written.and_then(|()| Ok(files.keys().try_for_each(named)?));
    if written.is_err() {
        for name in files.keys() {
            let _ = std::fs::remove_file(part(name));
        }
        let _ = std::fs::remove_dir(out);
    }
    written
}

fn flashing() -> String {
    include_str!("../flashing.md")
        .replace("{version}", env!("CARGO_PKG_VERSION"))
        .replace("{chip}", crate::flash::CHIP)
        .replace("{SUMS}", SUMS)
        .replace("{LICENCES}", LICENCES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::firmware::IMAGES;

    #[test]
    fn a_release_can_be_written_twice_and_leaves_other_files_alone() {
        let folder = tempfile::tempdir().unwrap();
        let mut files = Files::from([("factory.tact".to_owned(), b"table".to_vec())]);
        files.insert(SUMS.into(), sums(&files).into());
        write(folder.path(), &files).unwrap();
        write(folder.path(), &files).unwrap();
        let sums = std::fs::read_to_string(folder.path().join(SUMS)).unwrap();
        assert_eq!(sums, format!("{}  factory.tact\n", hash(b"table")));
        std::fs::write(folder.path().join("thesis.txt"), "mine").unwrap();
        let error = write(folder.path(), &files).unwrap_err().to_string();
        assert!(error.contains("thesis.txt"), "{error}");
    }

    #[test]
    fn the_instructions_name_every_image_and_table() {
        let text = flashing();
        let rows = text.lines().filter_map(|line| line.strip_prefix("| "));
        let files = rows.filter_map(|row| row.split(" |").next());
        let named: Vec<&str> = files.flat_map(|files| files.split(", ")).collect();
        for image in IMAGES {
            let elf = format!("{image}.elf");
            assert!(
                named.iter().any(|name| *name == image || *name == elf),
                "{image}"
            );
        }
        for table in TABLES.into_iter().flat_map(|(_, names)| names) {
            assert!(named.contains(table), "{table}");
        }
        assert!(!text.contains('{') && !text.contains('}'), "{text}");
    }
}
