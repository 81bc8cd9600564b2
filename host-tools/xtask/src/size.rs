//! What the images take of the chip's memories, and how deep the stack gets.
mod panics;

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use clap::Args;
use serde_json::Value;

use panics::{Kind, Panic, panics};

use crate::emulate;
use crate::firmware::{self, Size};
use crate::shell::run;

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask size                   all of it
  cargo xtask size --no-stack        without the exploration on the emulated board, which takes some minutes";

const KB: u64 = 1024;
/// Flash of an image, with all tables that come with it: half of the bank that it has, so that compilers have room.
const MAX_FLASH: u64 = 512 * KB;
const MAX_VARIABLES: u64 = 64 * KB;
/// Twice the deepest stack has to fit into what memory.x leaves above the variables and the guard.
const MARGIN: u64 = 2;
/// RAM in memory.x, without the variables' part and the guard.
const STACK: u64 = 192 * KB - MAX_VARIABLES - 16 * KB;
/// Images that move the finger, or take slides: nothing of ours panics in them.
const MOVING: [&str; 3] = ["tactus-rig", "tactus-arm", "tactus-handheld"];
const RIG: &str = "tactus-rig";

#[derive(Args, Default)]
pub(crate) struct Options {
    /// Leave the stack out, and with it the emulated board
    #[arg(long)]
    no_stack: bool,
}

struct Measured {
    name: String,
    size: Size,
    panics: Vec<Panic>,
    /// what the emulator says
    stack: Option<Value>,
}

/// The sizes with the stack, and an error if one is over its limit.
pub(crate) fn gates() -> Result<()> {
    size(&Options::default())
}

pub(crate) fn size(options: &Options) -> Result<()> {
    let images = measure(options.no_stack)?;
    print!("{}", text(&images));
    let wrong = wrong(&images);
    ensure!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(())
}

fn measure(no_stack: bool) -> Result<Vec<Measured>> {
    let mut images = Vec::new();
    for elf in firmware::elves()? {
        let name = firmware::name(&elf)?.to_owned();
        let bytes = std::fs::read(&elf).with_context(|| elf.display().to_string())?;
        eprintln!("{}  {}", firmware::hash(&bytes), firmware::shown(&elf));
        let stack = if name == RIG && !no_stack {
            Some(stack(&elf)?)
        } else {
            None
        };
        images.push(Measured {
            panics: panics(&bytes).with_context(|| name.clone())?,
            size: Size::of(&bytes).with_context(|| name.clone())?,
            name,
            stack,
        });
    }
    Ok(images)
}

fn stack(elf: &Path) -> Result<Value> {
    run(&mut emulate::build())?;
    let output = emulate::program("stack")
        .arg("--elf")
        .arg(elf)
        .stderr(std::process::Stdio::inherit())
        .output()
        .context("cannot start the emulator")?;
    ensure!(output.status.success(), "the stack was not measured");
    serde_json::from_slice(&output.stdout).context("the emulator does not answer in JSON")
}

/// The stack at its worst, if it was measured: every handler at its deepest upon every other.
fn worst_stack(image: &Measured) -> Option<u64> {
    image.stack.as_ref()?.get("bound")?.as_u64()
}

fn missed(image: &Measured) -> Vec<String> {
    let Size { flash, ram, .. } = image.size;
    let stack = worst_stack(image);
    let limits = [
        ("code and constants", Some(flash), MAX_FLASH),
        ("variables", Some(ram), MAX_VARIABLES),
        ("twice the stack", stack.map(|stack| MARGIN * stack), STACK),
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
        let stack = worst_stack(image).map_or("-".into(), |bytes| bytes.to_string());
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
        STACK / MARGIN
    ));
    line(format_args!(
        "The stack's share is half of what is above its guard."
    ));
    for image in images {
        if let Some(stack) = &image.stack {
            line(format_args!("\n{}'s stack, bytes", image.name));
            stack_text(stack, &mut line);
        }
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

fn stack_text(stack: &Value, line: &mut impl FnMut(std::fmt::Arguments<'_>)) {
    let number = |of: &Value, name: &str| of.get(name).and_then(Value::as_u64).unwrap_or_default();
    let levels = stack.get("levels").and_then(Value::as_array);
    for level in levels.into_iter().flatten() {
        let name = level.get("name").and_then(Value::as_str).unwrap_or("?");
        let deepest = number(level, "deepest");
        match level.get("runs").and_then(Value::as_u64) {
            Some(runs) => line(format_args!("{deepest:>7}  {name}, runs: {runs}")),
            None => line(format_args!("{deepest:>7}  {name}")),
        }
    }
    line(format_args!(
        "{:>7}  in use at most, as it came\n{:>7}  all of them upon one another, with their exception frames: the \
         bound\n\
         TIM2 and SPI1 run the sensor's slots, UART5 the servo: the table in firmware/src/rig.rs",
        number(stack, "used"),
        number(stack, "bound")
    ));
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn panic(kind: Kind) -> Panic {
        Panic {
            kind,
            place: "./shared/src/rig/stage.rs:7".into(),
            function: "tactus_core::rig::stage::Stage::tick".into(),
        }
    }

    fn image(flash: u64, ram: u64, bound: Option<u64>) -> Measured {
        Measured {
            name: RIG.into(),
            size: Size { flash, ram, ccm: 0 },
            panics: vec![panic(Kind::Dependency)],
            stack: bound.map(|bound| {
                let servo = json!({"name": "UART5", "deepest": 1200, "runs": 9});
                json!({"levels": [servo], "used": 7, "bound": bound})
            }),
        }
    }

    #[test]
    fn each_limit_is_a_limit() {
        let most = 512 * KB;
        let too_much = |image: Measured| wrong(&[image]);
        assert!(too_much(image(most, MAX_VARIABLES, Some(56 * KB))).is_empty());
        assert!(too_much(image(0, 0, None)).is_empty());
        let error = |image: Measured| too_much(image).join("");
        assert!(error(image(most + 1, 0, None)).contains("code and constants"));
        assert!(error(image(0, MAX_VARIABLES + 1, None)).contains("variables take 65537"));
        assert!(error(image(0, 0, Some(56 * KB + 1))).contains("twice the stack"));
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
            "1200  UART5, runs: 9",
            "      1  checks in dependencies",
            "      0  checks of our own",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }
}
