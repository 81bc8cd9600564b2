//! The firmware build, and what is said about its result.
use std::path::{Path, PathBuf};
use std::process::Stdio;

use anyhow::{Context as _, Result, bail, ensure};
use object::{Object as _, ObjectSegment as _};
use sha2::{Digest as _, Sha256};

use crate::shell::root;
use crate::toolchain::{self, CHIP};

/// The images by profile and features that each is built with: the rig for speed, the handheld for a small chip.
const PROFILES: [(&str, &[&str], &[&str]); 9] = [
    (
        "firmware",
        &["--features=early"],
        &[
            "tactus-rig",
            "tactus-selftest",
            "tactus-silicon",
            "tactus-bench",
        ],
    ),
    ("firmware", &["--features=arm"], &["tactus-arm"]),
    ("firmware", &[ANALOG], &["tactus-rig-analog"]),
    ("firmware", &[MEMS], &["tactus-rig-mems"]),
    (
        "firmware",
        &["--no-default-features", "--features=nucleo-f767zi"],
        &OTHER_BOARD,
    ),
    (HANDHELD, &[], &["tactus-handheld"]),
    (
        HANDHELD,
        &["--features=motion"],
        &["tactus-handheld-motion"],
    ),
    (HANDHELD, &[ANALOG], &["tactus-handheld-analog"]),
    (HANDHELD, &[MEMS], &["tactus-handheld-mems"]),
];
const ANALOG: &str = "--features=finger-analog";
const MEMS: &str = "--features=finger-mems";
/// The fingers beside the BioTac, each a feature of the firmware: their names end those of their images.
const FINGERS: [&str; 2] = ["analog", "mems"];
const HANDHELD: &str = "handheld";
/// What LLVM does for speed at any `opt-level`, left out: it copies the ends of functions and splits live ranges of registers. The
/// rig's image is 1.4 KB smaller, and no kernel slower.
const FLAGS: [&str; 2] = [
    "-Cllvm-args=-disable-early-taildup",
    "-Cllvm-args=-split-spill-mode=size",
];
/// The same of the handheld, which need not be fast: LLVM computes constants and loads ahead, saves registers late, and orders
/// instructions for other cores. At `opt-level = "z"` it inlines what is worth 5 of its instructions; at 8 what is inlined is
/// still smaller than its call more often than not.
const HANDHELD_FLAGS: [&str; 5] = [
    "-Cllvm-args=--inline-threshold=8",
    "-Cllvm-args=-disable-machine-licm",
    "-Cllvm-args=-disable-post-ra",
    "-Cllvm-args=-enable-load-pre=false",
    "-Cllvm-args=-enable-shrink-wrap=false",
];
/// The images that are flashed to the reference board, and gated. The bench image is for the emulated board only.
const FLASHED: [&str; 10] = [
    "tactus-rig",
    "tactus-selftest",
    "tactus-silicon",
    "tactus-handheld",
    "tactus-handheld-motion",
    "tactus-arm",
    "tactus-rig-analog",
    "tactus-rig-mems",
    "tactus-handheld-analog",
    "tactus-handheld-mems",
];

/// The images for another board than the reference: built, and in a release, but neither emulated nor gated.
const OTHER_BOARD: [&str; 1] = ["tactus-rig-f767"];

/// The image of a kind for a finger: "tactus-rig-mems".
pub(crate) fn image_for(kind: &str, finger: Option<&str>) -> Result<String> {
    match finger {
        None | Some("biotac") => Ok(kind.to_owned()),
        Some(finger) if FINGERS.contains(&finger) => {
            let image = format!("{kind}-{finger}");
            let is_built = PROFILES
                .iter()
                .any(|(.., all)| all.contains(&image.as_str()));
            ensure!(
                is_built,
                "there is no image {image}: leave out --motion or --finger"
            );
            Ok(image)
        }
        Some(other) => bail!("no finger is called {other}: there are biotac, analog and mems"),
    }
}

/// Builds every image of the firmware that is flashed and says what came out; the ELFs.
pub(crate) fn build() -> Result<Vec<PathBuf>> {
    let elves = compile(&released())?;
    for elf in &elves {
        let bytes = std::fs::read(elf).with_context(|| elf.display().to_string())?;
        let (name, top) = (name(elf)?, stack_top(&bytes)?);
        let of_board = if OTHER_BOARD.contains(&name) {
            F767_STACK_TOP
        } else {
            F429_STACK_TOP
        };
        ensure!(
            top == of_board,
            "{name}: the stack begins at {top:#x}, so it was linked for the memory of another board"
        );
        describe(elf)?;
    }
    Ok(elves)
}

/// The end of the memory that holds the stack, by each board's board.x.
const F429_STACK_TOP: u32 = 0x2003_0000;
const F767_STACK_TOP: u32 = 0x2002_0000;

/// Where an image's stack begins: the first word of its flash.
fn stack_top(elf: &[u8]) -> Result<u32> {
    let file = object::File::parse(elf)?;
    let mut segments = file.segments();
    let vectors = segments.find(|segment| segment.address() == 0x0800_0000);
    let vectors = vectors.context("an image without vectors")?.data()?;
    let word = vectors.first_chunk().context("an image without a stack")?;
    Ok(u32::from_le_bytes(*word))
}

/// As [`build`], with the bench image: all that the other steps of `cargo xtask test` want.
pub(crate) fn build_all() -> Result<()> {
    compile(&[&released()[..], &["tactus-bench"]].concat())?;
    build().map(|_| ())
}

/// The images that are flashed, to whichever board.
pub(crate) fn released() -> Vec<&'static str> {
    [&FLASHED[..], &OTHER_BOARD].concat()
}

/// Builds every image for the reference board that is flashed: the ELFs, by name. Leaves stdout to who asks.
pub(crate) fn elves() -> Result<Vec<PathBuf>> {
    compile(&FLASHED)
}

/// Builds these images of the firmware: the ELFs, by name.
pub(crate) fn compile(images: &[&str]) -> Result<Vec<PathBuf>> {
    let toolchain = toolchain::get(CHIP)?;
    eprintln!("Building with {}", toolchain.version());
    let mut elves = Vec::new();
    for (profile, features, all) in PROFILES {
        let wanted = || images.iter().filter(|image| all.contains(image));
        if wanted().count() == 0 {
            continue;
        }
        let more: &[&str] = if profile == HANDHELD {
            &HANDHELD_FLAGS
        } else {
            &[]
        };
        let mut cargo = toolchain.cargo_build(CHIP, &[&FLAGS, more].concat());
        cargo.args(["--package", "tactus-firmware", "--profile", profile]);
        cargo.args(features);
        cargo.args(wanted().flat_map(|image| ["--bin", image]));
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
        elves.extend(executables(&String::from_utf8_lossy(&output.stdout)));
    }
    ensure!(
        elves.len() == images.len(),
        "cargo named {} of {} firmware binaries",
        elves.len(),
        images.len()
    );
    elves.sort_by(|a, b| a.file_name().cmp(&b.file_name()));
    Ok(elves)
}

/// The image of this name among those that were built.
pub(crate) fn image<'a>(elves: &'a [PathBuf], name: &str) -> Result<&'a Path> {
    let image = elves.iter().find(|elf| elf.ends_with(name));
    let image = image.with_context(|| format!("the firmware has no {name}"))?;
    Ok(image)
}

/// An image's name, "tactus-rig".
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

/// SHA-256 in hexadecimal.
pub(crate) fn hash(bytes: &[u8]) -> String {
    let digest = Sha256::digest(bytes);
    digest.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The binaries that cargo's messages name.
fn executables(messages: &str) -> Vec<PathBuf> {
    messages
        .lines()
        .filter_map(|line| serde_json::from_str::<serde_json::Value>(line).ok())
        .filter_map(|message| Some(message.get("executable")?.as_str()?.into()))
        .collect()
}

/// Says what came out.
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

/// What an image takes of the chip's memories, in bytes.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(crate) struct Size {
    /// Code, constants and the initial values of variables.
    pub(crate) flash: u64,
    /// Variables.
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

    /// Sums segments of (address at run time, size there, bytes in the file); the regions are board.x's.
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
    fn an_image_is_named_for_its_finger() {
        let mems = image_for("tactus-handheld", Some("mems")).unwrap();
        assert_eq!(mems, "tactus-handheld-mems");
        assert!(image_for("tactus-handheld-motion", Some("mems")).is_err());
        assert_eq!(
            image_for("tactus-rig", Some("biotac")).unwrap(),
            "tactus-rig"
        );
        assert!(image_for("tactus-rig", Some("piezo")).is_err());
    }

    #[test]
    fn another_boards_images_are_built_apart_from_the_reference() {
        for image in OTHER_BOARD {
            assert!(!FLASHED.contains(&image), "{image} would be gated");
            let of = |(_, _, all): &&(&str, &[&str], &[&str])| all.contains(&image);
            let built: Vec<_> = PROFILES.iter().filter(of).collect();
            let [(_, features, _)] = built[..] else {
                panic!("{image} is built {} times", built.len());
            };
            assert!(features.contains(&"--no-default-features"), "{features:?}");
        }
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
