//! The firmware build, and what is said about its result.
use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context as _, Result, bail, ensure};
use object::{Object as _, ObjectSegment as _};
use sha2::{Digest as _, Sha256};

use crate::shell::root;
use crate::toolchain::{self, CHIP};

/// The images, all in one build configuration: the rig's, a hand's, an arm's, the self-test, and the tests of the chip
/// with the bench.
pub(crate) const IMAGES: [&str; 5] = [
    "tactus-rig",
    "tactus-handheld",
    "tactus-arm",
    "tactus-selftest",
    "tactus-silicon",
];
const PROFILE: &str = "firmware";

pub(crate) fn build_all() -> Result<()> {
    elves()?.iter().try_for_each(|elf| describe(elf))
}

/// Builds every image: the ELFs, by name. Leaves stdout to who asks.
pub(crate) fn elves() -> Result<Vec<PathBuf>> {
    compile(&IMAGES)
}

/// Builds these images of the firmware: the ELFs, by name.
pub(crate) fn compile(images: &[&str]) -> Result<Vec<PathBuf>> {
    let toolchain = toolchain::get(CHIP)?;
    eprintln!("Building with {}", toolchain.version());
    let mut cargo = toolchain.cargo_build(CHIP);
    cargo.args(["--package", "tactus-firmware", "--profile", PROFILE]);
    cargo.args(images.iter().flat_map(|image| ["--bin", image]));
    // progress and diagnostics go to stderr; stdout says where the ELFs are
    cargo.arg("--message-format=json-render-diagnostics");
    let output = cargo
        .stderr(Stdio::inherit())
        .output()
        .context("cannot start cargo")?;
    ensure!(
        output.status.success(),
        "the firmware does not build (warnings are errors here)"
    );
    let mut elves = executables(&String::from_utf8_lossy(&output.stdout));
    ensure!(
        elves.len() == images.len(),
        "cargo named {} of {} firmware binaries",
        elves.len(),
        images.len()
    );
    elves.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    Ok(elves)
}

pub(crate) fn image<'a>(elves: &'a [PathBuf], name: &str) -> Result<&'a Path> {
    let image = elves.iter().find(|elf| elf.ends_with(name));
    let image = image.with_context(|| format!("the firmware has no {name}"))?;
    Ok(image)
}

pub(crate) fn name(elf: &Path) -> Result<&str> {
    let name = elf.file_name().and_then(|name| name.to_str());
    name.with_context(|| format!("{} has no name", elf.display()))
}

/// A path as people at the top of the repository would write it.
pub(crate) fn shown(path: &Path) -> String {
    let root = root();
    path.strip_prefix(&root)
        .unwrap_or(path)
        .display()
        .to_string()
}

pub(crate) fn hash(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn executables(messages: &str) -> Vec<PathBuf> {
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter_map(|message| Some(message.get("executable")?.as_str()?.into()))
        .collect()
}

pub(crate) fn describe(elf: &Path) -> Result<()> {
    let image = std::fs::read(elf).with_context(|| elf.display().to_string())?;
    let size = Size::of(&image).with_context(|| elf.display().to_string())?;
    println!("ELF      {}", shown(elf));
    println!("SHA-256  {}", hash(&image));
    println!("flash    {} bytes", size.flash);
    println!("RAM      {} bytes, and the stack", size.ram);
    println!("CCM      {} bytes", size.ccm);
    Ok(())
}

#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(crate) struct Size {
    /// Code, constants and the initial values of variables.
    pub(crate) flash: u64,
    pub(crate) ram: u64,
    pub(crate) ccm: u64,
}

impl Size {
    pub(crate) fn of(elf: &[u8]) -> Result<Self> {
        let file = object::File::parse(elf)?;
        Self::sum(
            file.segments()
                .map(|s| (s.address(), s.size(), s.file_range().1)),
        )
    }

    /// Sums segments of (address at run time, size there, bytes in the file); the regions are those of memory.x.
    fn sum(segments: impl Iterator<Item = (u64, u64, u64)>) -> Result<Self> {
        let mut size = Self::default();
        for (address, in_memory, in_file) in segments {
            // variables with initial values have those in flash
            size.flash += in_file;
            match address >> 24 {
                0x08 => {}
                0x10 => size.ccm += in_memory,
                0x20 => size.ram += in_memory,
                _ => bail!("a segment at {address:#x} is in no memory of the chip"),
            }
        }
        Ok(size)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variables_with_initial_values_take_flash_and_ram() {
        let segments = [
            (0x0800_0000, 428, 428),
            (0x0800_01ac, 8204, 8204),
            (0x2000_0000, 80, 80),
            (0x2000_0050, 1124, 0),
            (0x1000_0000, 16, 0),
        ];
        let size = Size {
            flash: 428 + 8204 + 80,
            ram: 80 + 1124,
            ccm: 16,
        };
        assert_eq!(Size::sum(segments.into_iter()).unwrap(), size);
        assert!(Size::sum([(0x6000_0000, 4, 4)].into_iter()).is_err());
        assert!(Size::of(b"no ELF").is_err());
    }

    #[test]
    fn only_binaries_are_taken_from_cargos_messages() {
        let messages = r#"{"reason":"compiler-artifact","executable":null}
not json
{"reason":"compiler-artifact","executable":"/t/tactus-rig"}
{"reason":"build-finished","success":true}"#;
        assert_eq!(executables(messages), [Path::new("/t/tactus-rig")]);
    }
}
