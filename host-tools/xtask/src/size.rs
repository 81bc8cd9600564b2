//! What the images take of the chip's memories, and how deep the stack gets.
mod panics;

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use serde_json::Value;

use panics::{Kind, Panic, panics};

use crate::emulate;
use crate::firmware::{self, Size};
use crate::shell::run;

const KB: u64 = 1024;
/// Flash of an image, with all tables that come with it: half of the bank that it has, so that compilers have room.
const MAX_FLASH: u64 = 512 * KB;
const MAX_VARIABLES: u64 = 64 * KB;
/// Two and a half times the deepest stack have to fit into what memory.x leaves above the variables and the guard. An
/// exploration need not have all interrupts upon its deepest place; they take 6 % of it.
const MARGIN: f64 = 2.5;
/// RAM in memory.x, without the variables' part and the guard.
const STACK: u64 = 192 * KB - MAX_VARIABLES - 16 * KB;
/// Images that move the finger, or take slides: nothing of ours panics in them.
const MOVING: [&str; 3] = ["tactus-rig", "tactus-arm", "tactus-handheld"];
const RIG: &str = "tactus-rig";

struct Measured {
    name: String,
    size: Size,
    panics: Vec<Panic>,
    stack: Option<u64>,
}

/// Prints the sizes with the stack; an error if one is over its limit.
pub(crate) fn size() -> Result<()> {
    let images = measure()?;
    print!("{}", text(&images));
    let wrong = wrong(&images);
    ensure!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(())
}

fn measure() -> Result<Vec<Measured>> {
    let mut images = Vec::new();
    for elf in firmware::elves()? {
        let name = firmware::name(&elf)?.to_owned();
        let bytes = std::fs::read(&elf).with_context(|| elf.display().to_string())?;
        eprintln!("{}  {}", firmware::hash(&bytes), firmware::shown(&elf));
        let stack = (name == RIG).then(|| stack(&elf)).transpose()?;
        images.push(Measured {
            panics: panics(&bytes).with_context(|| name.clone())?,
            size: Size::of(&bytes).with_context(|| name.clone())?,
            name,
            stack,
        });
    }
    Ok(images)
}

/// The most bytes of the stack that were in use in an exploration.
fn stack(elf: &Path) -> Result<u64> {
    run(&mut emulate::build())?;
    let output = emulate::program("stack")
        .arg("--elf")
        .arg(elf)
        .stderr(std::process::Stdio::inherit())
        .output()
        .context("cannot start the emulator")?;
    ensure!(output.status.success(), "the stack was not measured");
    let said: Value = serde_json::from_slice(&output.stdout)?;
    let used = said["used"].as_u64();
    used.context("the emulator does not say how deep the stack gets")
}

fn missed(image: &Measured) -> Vec<String> {
    let Size { flash, ram, .. } = image.size;
    let stack = image.stack.map(|used| (MARGIN * used as f64) as u64);
    let limits = [
        ("code and constants", Some(flash), MAX_FLASH),
        ("variables", Some(ram), MAX_VARIABLES),
        ("two and a half stacks", stack, STACK),
    ];
    let missed = limits.into_iter().filter_map(|(what, bytes, most)| {
        let bytes = bytes.filter(|bytes| *bytes > most)?;
        let name = &image.name;
        Some(format!(
            "{name}: {what} take {bytes} bytes, at most {most} are allowed"
        ))
    });
    missed.collect()
}

/// Checks of our own that panic, in images that move something.
fn ours(image: &Measured) -> Vec<String> {
    let moves = MOVING.contains(&image.name.as_str());
    let ours = |panic: &&Panic| moves && panic.kind == Kind::Ours;
    let said = |panic: &Panic| {
        format!(
            "{}: {} panics at {}: take that out",
            image.name, panic.function, panic.place
        )
    };
    image.panics.iter().filter(ours).map(said).collect()
}

fn wrong(images: &[Measured]) -> Vec<String> {
    let missed = images.iter().flat_map(missed);
    missed.chain(images.iter().flat_map(ours)).collect()
}

fn text(images: &[Measured]) -> String {
    use std::fmt::Write as _;
    let mut text = String::new();
    // writing to a string does not fail
    let mut line = |arguments: std::fmt::Arguments<'_>| {
        let _ = writeln!(text, "{arguments}");
    };
    line(format_args!(
        "{:20} {:>10} {:>10} {:>10} {:>10}",
        "bytes", "flash", "variables", "CCM", "stack"
    ));
    for image in images {
        let stack = image.stack.map_or("-".into(), |bytes| bytes.to_string());
        let Size { flash, ram, ccm } = image.size;
        line(format_args!(
            "{:20} {flash:>10} {ram:>10} {ccm:>10} {stack:>10}",
            image.name
        ));
    }
    line(format_args!(
        "{:20} {MAX_FLASH:>10} {MAX_VARIABLES:>10} {:>10} {:>10}",
        "allowed",
        "-",
        (STACK as f64 / MARGIN) as u64
    ));
    line(format_args!(
        "{MARGIN} times the stack fit into what is above its guard."
    ));
    for image in images {
        panics_text(image, &mut line);
    }
    text
}

fn panics_text(image: &Measured, line: &mut impl FnMut(std::fmt::Arguments<'_>)) {
    line(format_args!(
        "\n{}'s calls of functions that panic, by kind",
        image.name
    ));
    for (kind, what) in Kind::ALL {
        let calls: Vec<&Panic> = image.panics.iter().filter(|p| p.kind == kind).collect();
        line(format_args!("{:>7}  {what}", calls.len()));
        for panic in calls.iter().filter(|_| kind == Kind::Ours) {
            line(format_args!(
                "         {} in {}",
                panic.place, panic.function
            ));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panic(kind: Kind) -> Panic {
        Panic {
            kind,
            place: "./shared/src/rig/stage.rs:7".into(),
            function: "tactus_core::rig::stage::Stage::tick".into(),
        }
    }

    fn image(flash: u64, ram: u64, stack: Option<u64>) -> Measured {
        Measured {
            name: RIG.into(),
            size: Size { flash, ram, ccm: 0 },
            panics: vec![panic(Kind::Dependency)],
            stack,
        }
    }

    #[test]
    fn each_limit_is_a_limit() {
        let most = 512 * KB;
        let too_much = |image: Measured| wrong(&[image]);
        assert!(too_much(image(most, MAX_VARIABLES, Some(STACK * 2 / 5))).is_empty());
        assert!(too_much(image(0, 0, None)).is_empty());
        let error = |image: Measured| too_much(image).join("");
        assert!(error(image(most + 1, 0, None)).contains("code and constants"));
        assert!(error(image(0, MAX_VARIABLES + 1, None)).contains("variables take 65537"));
        assert!(error(image(0, 0, Some(STACK * 2 / 5 + 1))).contains("two and a half stacks"));
    }

    #[test]
    fn nothing_of_ours_panics_where_something_moves() {
        let with = |name: &str, kind: Kind| {
            let mut image = image(0, 0, None);
            image.name = name.into();
            image.panics.push(panic(kind));
            wrong(&[image]).join("")
        };
        for kind in [Kind::Dependency, Kind::Resumed, Kind::Merged] {
            assert_eq!(with(RIG, kind), "");
        }
        for image in MOVING {
            let said = with(image, Kind::Ours);
            assert!(said.contains("Stage::tick panics at ./shared"), "{said}");
        }
        assert_eq!(with("tactus-selftest", Kind::Ours), "");
    }

    #[test]
    fn sizes_and_panics_are_told() {
        let image = image(160_000, 52_000, Some(9000));
        let text = text(&[image]);
        for part in [
            "160000",
            "9000",
            "      1  checks in dependencies",
            "      0  checks of our own",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }
}
