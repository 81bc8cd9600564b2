//! A release: what is flashed and what runs on a PC, how to check and flash it, and what it is made of.
mod image;
mod licences;
mod products;
mod reproduce;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use clap::Args;

use crate::factory::{FOLDER, TABLES};
use crate::firmware::{self, hash, released, shown};
use crate::sbom::FIRMWARE;
use crate::shell::{self, root};
use products::{COMMAND, PAGE, Product, WHEEL};
pub(crate) use reproduce::reproduce;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask bundle                         everything, into target/bundle
  cargo xtask bundle --only tactus-rig,command   one image and the command for this PC
  cargo xtask campaign --builds              everything twice, in different folders: are the bytes the same?";

const SUMS: &str = "SHA256SUMS";
/// What every dependency allows, in its own words.
const LICENCES: &str = "LICENSES-DEPENDENCIES.txt";

#[derive(Args)]
pub(crate) struct Options {
    /// The folder to write; files of an earlier release in it are replaced
    #[arg(long, value_name = "DIR", default_value = "target/bundle")]
    out: PathBuf,
    /// Some of it: images, command, wheel, page
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', value_parser = names())]
    only: Vec<String>,
}

/// Names and contents.
type Files = BTreeMap<String, Vec<u8>>;

/// All that `--only` knows.
fn names() -> Vec<&'static str> {
    let products = [COMMAND, WHEEL, PAGE].map(|product| product.name);
    [&released()[..], &products].concat()
}

/// Builds what was asked for and writes the release.
pub(crate) fn bundle(options: &Options) -> Result<()> {
    let out = root().join(&options.out);
    let files = files(&options.only)?;
    write(&out, &files)?;
    for (name, bytes) in &files {
        println!("{:>9}  {}", bytes.len(), shown(&out.join(name)));
    }
    Ok(())
}

/// Everything that is in a release, or what of it is named.
fn files(only: &[String]) -> Result<Files> {
    let wanted = |name: &str| only.is_empty() || only.iter().any(|one| one == name);
    let images: Vec<&str> = released().into_iter().filter(|name| wanted(name)).collect();
    let mut files = Files::new();
    let mut parts = Vec::new();
    if !images.is_empty() {
        for elf in firmware::compile(&images)? {
            let bytes = std::fs::read(&elf).with_context(|| elf.display().to_string())?;
            add_image(&mut files, firmware::name(&elf)?, bytes)?;
        }
        for name in TABLES.into_iter().flat_map(|(_, names)| names) {
            let table = root().join(FOLDER).join(name);
            let bytes = std::fs::read(&table).with_context(|| table.display().to_string())?;
            files.insert((*name).to_owned(), bytes);
        }
        parts.push(FIRMWARE);
    }
    for product in [COMMAND, WHEEL, PAGE] {
        if wanted(product.name) && add_product(&mut files, &product)? {
            parts.push(product.part);
        }
    }
    let mut packages = BTreeMap::new();
    for part in parts {
        let metadata = part.metadata()?;
        files.insert(part.file(), part.bill(&metadata)?);
        packages.extend(part.packages(&metadata)?);
    }
    files.insert(LICENCES.into(), licences::of(packages.values())?.into());
    let ours = [
        (
            "LICENSE-MIT",
            include_bytes!("../../../LICENSE-MIT").as_slice(),
        ),
        ("LICENSE-APACHE", include_bytes!("../../../LICENSE-APACHE")),
    ];
    files.extend(ours.map(|(name, text)| (name.to_owned(), text.to_owned())));
    files.insert("FLASHING.md".into(), flashing().into());
    files.insert(SUMS.into(), sums(&files).into());
    Ok(files)
}

fn add_image(files: &mut Files, name: &str, elf: Vec<u8>) -> Result<()> {
    let (flat, hex) = image::formats(&elf).with_context(|| name.to_owned())?;
    files.insert(format!("{name}.hex"), hex.into());
    files.insert(format!("{name}.bin"), flat);
    files.insert(format!("{name}.elf"), elf);
    Ok(())
}

/// Builds what runs on a PC. Whether there was what it takes: in CI it is an error if not.
fn add_product(files: &mut Files, product: &Product) -> Result<bool> {
    if let Err(why) = (product.lacks)() {
        if std::env::var("CI").as_deref() == Ok("true") {
            bail!("a release without {}: {why:#}", product.what);
        }
        shell::skip(product.what, &format!("{why:#}"))?;
        return Ok(false);
    }
    let (name, bytes) =
        (product.build)().with_context(|| format!("{} is not built", product.what))?;
    files.insert(name, bytes);
    Ok(true)
}

/// In the format of sha256sum.
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
    for (name, bytes) in files {
        let file = out.join(name);
        std::fs::write(&file, bytes).with_context(|| format!("cannot write {}", file.display()))?;
        #[cfg(unix)]
        if *name == products::program()? {
            use std::os::unix::fs::PermissionsExt as _;
            std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o755))?;
        }
    }
    Ok(())
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

    #[test]
    fn a_release_can_be_written_twice_and_leaves_other_files_alone() {
        let folder = tempfile::tempdir().unwrap();
        let release = || {
            let mut files = Files::from([("factory.tact".to_owned(), b"table".to_vec())]);
            files.insert(SUMS.into(), sums(&files).into());
            files
        };
        write(folder.path(), &release()).unwrap();
        let first = std::fs::read(folder.path().join(SUMS)).unwrap();
        write(folder.path(), &release()).unwrap();
        assert_eq!(std::fs::read(folder.path().join(SUMS)).unwrap(), first);
        let table = hash(b"table");
        assert_eq!(
            String::from_utf8(first).unwrap(),
            format!("{table}  factory.tact\n")
        );
        std::fs::write(folder.path().join("thesis.txt"), "mine").unwrap();
        let error = write(folder.path(), &release()).unwrap_err().to_string();
        assert!(error.contains("thesis.txt"), "{error}");
    }

    #[test]
    fn the_instructions_name_every_image_and_table() {
        let text = flashing();
        let rows = text.lines().filter_map(|line| line.strip_prefix("| "));
        let files = rows.filter_map(|row| row.split(" |").next());
        let named: Vec<&str> = files.flat_map(|files| files.split(", ")).collect();
        for image in released() {
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
