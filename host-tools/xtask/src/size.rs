//! What the images take of the chip's memories, and how deep the stack gets.
mod panics;

use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use clap::{Args, ValueEnum};
use serde_json::{Value, json};

use panics::{Panics, Symbol, panics, symbols};

use crate::campaign::FOLDER;
use crate::emulate::{self, ARM, MOTION};
use crate::firmware::{self, Size};
use crate::reasons;
use crate::shell::{root, run};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask size                   tables for people
  cargo xtask size --no-stack        without the exploration on the emulated board, which takes some minutes
  cargo xtask size --format json     everything on one line, for programs";

const KB: u64 = 1024;
/// Flash of an image, and of that of another finger, without the table that comes with it. An image that is not listed is not gated. The handheld had 128 KB
/// before it compared textures in spite of drift and had a link.
const MAX_FLASH: [(&str, u64); 3] = [(RIG, 160 * KB), (HANDHELD, 160 * KB), (ARM, 160 * KB)];
const HANDHELD: &str = "tactus-handheld";
const MAX_VARIABLES: u64 = 64 * KB;
/// Twice the deepest stack has to fit into what board.x leaves above the variables and the guard.
const MARGIN: u64 = 2;
/// RAM in board.x, without the variables' part and the guard.
const STACK: u64 = 192 * KB - MAX_VARIABLES - 16 * KB;
/// The image whose stack is measured.
const RIG: &str = "tactus-rig";

#[derive(Args)]
pub(crate) struct Options {
    /// Leave the stack out, and with it the emulated board
    #[arg(long)]
    no_stack: bool,
    /// For people, or a line of JSON for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

/// An image and what was measured of it.
struct Measured {
    name: String,
    size: Size,
    /// bytes of the table in it
    table: u64,
    symbols: Vec<Symbol>,
    panics: Vec<Panics>,
    /// what the emulator says
    stack: Option<Value>,
}

/// The sizes, and an error if one is over its limit.
pub(crate) fn gates() -> Result<()> {
    show(false, Format::Text)
}

pub(crate) fn size(options: &Options) -> Result<()> {
    show(options.no_stack, options.format)
}

fn show(no_stack: bool, format: Format) -> Result<()> {
    let images = measure(no_stack)?;
    match format {
        Format::Text => print!("{}", text(&images)),
        Format::Json => println!("{}", Value::from_iter(images.iter().map(json))),
    }
    let wrong = wrong(&images);
    ensure!(wrong.is_empty(), "{}", wrong.join("\n"));
    Ok(())
}

/// Builds the images and measures them.
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
            symbols: symbols(&bytes).with_context(|| name.clone())?,
            table: table(&name)?,
            name,
            stack,
        });
    }
    Ok(images)
}

/// Measures the stack on the emulated board.
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

/// Bytes of the table that comes with an image.
fn table(image: &str) -> Result<u64> {
    let image = if image == MOTION { HANDHELD } else { image };
    if image == ARM {
        return bytes_of("arm.tact");
    }
    let of = |kind, table| {
        Some(image.strip_prefix(kind)?.to_owned() + ".tact").map(|end| format!("{table}{end}"))
    };
    let Some(name) = of(RIG, "factory").or_else(|| of(HANDHELD, "handheld")) else {
        return Ok(0);
    };
    bytes_of(&name)
}

/// Bytes of a factory table.
fn bytes_of(name: &str) -> Result<u64> {
    let file = root().join(FOLDER).join(name);
    let table = std::fs::metadata(&file).with_context(|| file.display().to_string())?;
    Ok(table.len())
}

/// The stack at its worst, if it was measured: every handler at its deepest upon every other.
fn worst_stack(image: &Measured) -> Option<u64> {
    image.stack.as_ref()?.get("bound")?.as_u64()
}

/// Most flash that an image may take, the table that comes with it included.
fn max_flash(image: &Measured) -> Option<u64> {
    let of_kind = |(name, _): &&(&str, u64)| image.name.starts_with(name);
    let (_, most) = MAX_FLASH.iter().find(of_kind)?;
    Some(most + image.table)
}

/// The limits that an image misses, as far as they were measured.
fn missed(image: &Measured) -> Vec<String> {
    let Size { flash, ram, .. } = image.size;
    let stack = worst_stack(image);
    let limits = [
        (
            "code and constants",
            Some(flash),
            max_flash(image).unwrap_or(u64::MAX),
        ),
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

/// Panics of the rig's image of which nothing says why they cannot happen.
fn unexplained(image: &Measured) -> Vec<String> {
    let mut unexplained = Vec::new();
    for panics in image.panics.iter().filter(|_| image.name == RIG) {
        for caller in &panics.callers {
            if reasons::why(&panics.name, caller).is_none() {
                unexplained.push(format!(
                    "{RIG}: {caller} panics ({}): take that out, or say in xtask's reasons.rs why it cannot happen",
                    panics.name
                ));
            }
        }
    }
    unexplained
}

/// What is wrong with the images.
fn wrong(images: &[Measured]) -> Vec<String> {
    let missed = images.iter().flat_map(missed);
    missed.chain(images.iter().flat_map(unexplained)).collect()
}

fn json(image: &Measured) -> Value {
    let symbols = image.symbols.iter();
    json!({
        "image": image.name,
        "flash": image.size.flash,
        "ram": image.size.ram,
        "ccm": image.size.ccm,
        "symbols": Value::from_iter(symbols.map(|s| json!({"bytes": s.bytes, "name": s.name}))),
        "table": image.table,
        "flash_allowed": max_flash(image),
        "panics": Value::from_iter(image.panics.iter().map(|p| {
            let callers = p.callers.iter();
            let callers = callers.map(|c| json!({"name": c, "why": reasons::why(&p.name, c)}));
            json!({"name": p.name, "callers": Value::from_iter(callers)})
        })),
        "stack": image.stack,
    })
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
    for image in images {
        if let Some(flash) = max_flash(image) {
            let allowed = format!("allowed, {}", image.name.trim_start_matches("tactus-"));
            line(format_args!(
                "{allowed:20} {flash:>10} {MAX_VARIABLES:>10} {:>10} {:>10}",
                "-",
                STACK / MARGIN
            ));
            line(format_args!(
                "flash includes a table of {} bytes, the stack's share is half of what is above its guard",
                image.table
            ));
        }
    }
    for image in images {
        if let Some(stack) = &image.stack {
            line(format_args!("\n{}'s stack, bytes", image.name));
            stack_text(stack, &mut line);
        }
        line(format_args!("\n{}'s biggest symbols, bytes", image.name));
        for symbol in &image.symbols {
            line(format_args!("{:>7}  {}", symbol.bytes, symbol.name));
        }
        if image.name == RIG {
            line(format_args!(
                "\n{}'s functions that panic, why they are not called, and by whom",
                image.name
            ));
            for panics in &image.panics {
                panics_text(panics, &mut line);
            }
        }
    }
    text
}

fn panics_text(Panics { name, callers }: &Panics, line: &mut impl FnMut(std::fmt::Arguments<'_>)) {
    line(format_args!("{name}"));
    let mut by_reason = std::collections::BTreeMap::<_, Vec<&str>>::new();
    for caller in callers {
        let why = reasons::why(name, caller).unwrap_or("nobody says why not");
        by_reason.entry(why).or_default().push(caller);
    }
    for (why, callers) in by_reason {
        line(format_args!("  {why}"));
        for caller in callers {
            line(format_args!("    {caller}"));
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
        "{:>7}  in use at most, as it came\n{:>7}  all of them upon one another, with their exception frames: the bound\n\
         TIM2 and SPI1 run the sensor's slots, UART5 the servo: the table in firmware/src/rig.rs",
        number(stack, "used"),
        number(stack, "bound")
    ));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(flash: u64, ram: u64, bound: Option<u64>) -> Measured {
        Measured {
            name: RIG.into(),
            size: Size { flash, ram, ccm: 0 },
            table: 1000,
            symbols: vec![Symbol {
                bytes: 4086,
                name: "session::work".into(),
            }],
            panics: vec![Panics {
                name: "panic_bounds_check".into(),
                callers: vec!["embassy_stm32::rcc::init".into()],
            }],
            stack: bound.map(|bound| {
                let servo = json!({"name": "UART5", "deepest": 1200, "runs": 9});
                json!({"levels": [servo], "used": 7, "bound": bound})
            }),
        }
    }

    #[test]
    fn each_limit_is_a_limit() {
        let most = 160 * KB + 1000;
        let too_much = |image: Measured| wrong(&[image]);
        assert!(too_much(image(most, MAX_VARIABLES, Some(56 * KB))).is_empty());
        assert!(too_much(image(0, 0, None)).is_empty());
        let error = |image: Measured| too_much(image).join("");
        assert!(error(image(most + 1, 0, None)).contains("code and constants"));
        assert!(error(image(0, MAX_VARIABLES + 1, None)).contains("variables take 65537"));
        assert!(error(image(0, 0, Some(56 * KB + 1))).contains("twice the stack"));
        let handheld = |flash| Measured {
            name: HANDHELD.into(),
            ..image(flash, 0, None)
        };
        assert!(too_much(handheld(160 * KB + 1000)).is_empty());
        assert!(error(handheld(160 * KB + 1001)).contains("tactus-handheld: code and constants"));
        let mut other = image(most + 1, 0, None);
        other.name = "tactus-selftest".into();
        assert!(too_much(other).is_empty());
    }

    #[test]
    fn a_panic_that_nobody_explains_is_wrong() {
        let with = |name: &str, caller: &str| {
            let mut image = image(0, 0, None);
            image.name = name.into();
            image.panics[0].callers.push(caller.into());
            wrong(&[image]).join("")
        };
        assert_eq!(with(RIG, "embassy_stm32::rcc::init_pll"), "");
        let said = with(RIG, "tactus_core::rig::stage::Stage::tick");
        assert!(
            said.contains("Stage::tick panics (panic_bounds_check)"),
            "{said}"
        );
        // nothing moves by those
        assert_eq!(
            with("tactus-selftest", "tactus_core::rig::stage::Stage::tick"),
            ""
        );
    }

    #[test]
    fn people_and_programs_are_told_the_same() {
        let image = image(160_000, 52_000, Some(9000));
        assert_eq!(json(&image)["stack"]["bound"], 9000);
        assert_eq!(json(&image)["symbols"][0]["bytes"], 4086);
        let text = text(&[image]);
        for part in [
            "160000",
            "9000",
            "4086  session::work",
            "1200  UART5, runs: 9",
            "  start-up: clocks",
            "    embassy_stm32::rcc::init",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }
}
