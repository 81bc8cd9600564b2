//! What the images take of the chip's memories, and how deep the stack gets.
use std::path::Path;

use anyhow::{Context as _, Result, ensure};
use clap::{Args, ValueEnum};
use object::{Object as _, ObjectSymbol as _, SymbolKind};
use serde_json::{Value, json};

use crate::firmware::{self, Size};
use crate::{emulate, run};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask size                   tables for people
  cargo xtask size --no-stack        without the exploration on the emulated board, which takes some minutes
  cargo xtask size --format json     everything on one line, for programs";

const KB: u64 = 1024;
const MAX_FLASH: u64 = 256 * KB;
/// The handheld's, without its table.
const MAX_HANDHELD: u64 = 128 * KB;
const HANDHELD: &str = "tactus-handheld";
const MAX_VARIABLES: u64 = 128 * KB;
/// RAM in memory.x; stack and variables are both in it.
const RAM: u64 = 192 * KB;
const SYMBOLS: usize = 20;
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

/// A function, constant or variable, and its bytes.
#[derive(PartialEq, Eq, PartialOrd, Ord, Debug)]
struct Symbol {
    bytes: u64,
    name: String,
}

/// An image and what was measured of it.
struct Measured {
    name: String,
    size: Size,
    symbols: Vec<Symbol>,
    /// bytes of the table in it
    table: u64,
    /// what the emulator's stack-depth says
    stack: Option<Value>,
}

pub(crate) fn size(options: &Options) -> Result<()> {
    let mut images = Vec::new();
    for elf in firmware::elves()? {
        let name = firmware::name(&elf)?.to_owned();
        let bytes = std::fs::read(&elf).with_context(|| elf.display().to_string())?;
        let stack = if name == RIG && !options.no_stack {
            Some(stack(&elf)?)
        } else {
            None
        };
        images.push(Measured {
            size: Size::of(&bytes).with_context(|| name.clone())?,
            symbols: symbols(&bytes).with_context(|| name.clone())?,
            table: table(&name)?,
            name,
            stack,
        });
    }
    match options.format {
        Format::Text => print!("{}", text(&images)),
        Format::Json => println!("{}", Value::from_iter(images.iter().map(json))),
    }
    let too_much: Vec<String> = images.iter().flat_map(too_much).collect();
    ensure!(too_much.is_empty(), "{}", too_much.join("\n"));
    Ok(())
}

/// Measures the stack on the emulated board.
fn stack(elf: &Path) -> Result<Value> {
    run(&mut emulate::build())?;
    let program = emulate::folder().join("release/stack-depth");
    let output = std::process::Command::new(program)
        .arg(elf)
        .stderr(std::process::Stdio::inherit())
        .output()
        .context("cannot start stack-depth")?;
    ensure!(output.status.success(), "the stack was not measured");
    serde_json::from_slice(&output.stdout).context("stack-depth does not answer in JSON")
}

/// The biggest symbols.
fn symbols(elf: &[u8]) -> Result<Vec<Symbol>> {
    let file = object::File::parse(elf)?;
    let sized = file.symbols().filter(|symbol| {
        matches!(symbol.kind(), SymbolKind::Text | SymbolKind::Data) && symbol.is_definition()
    });
    let mut symbols = sized
        .map(|symbol| {
            Ok(Symbol {
                bytes: symbol.size(),
                name: format!("{:#}", rustc_demangle::demangle(symbol.name()?)),
            })
        })
        .collect::<Result<Vec<_>>>()?;
    symbols.sort_by(|a, b| b.cmp(a));
    symbols.dedup();
    symbols.truncate(SYMBOLS);
    Ok(symbols)
}

/// The stack at its worst, if it was measured: every handler at its deepest upon every other.
fn worst_stack(image: &Measured) -> Option<u64> {
    image.stack.as_ref()?.get("bound")?.as_u64()
}

/// Bytes of the handheld's table; the rig's counts as its constants.
fn table(image: &str) -> Result<u64> {
    if image != HANDHELD {
        return Ok(0);
    }
    let file = crate::root().join("firmware/handheld.tact");
    let table = std::fs::metadata(&file).with_context(|| file.display().to_string())?;
    Ok(table.len())
}

/// Why an image is too big.
fn too_much(image: &Measured) -> Vec<String> {
    let Size { flash, ram, .. } = image.size;
    let mut why = Vec::new();
    let mut gate = |what: &str, bytes: u64, most: u64| {
        if bytes > most {
            why.push(format!(
                "{}: {what} take {bytes} bytes, at most {most} are allowed",
                image.name
            ));
        }
    };
    if image.name == HANDHELD {
        let most = MAX_HANDHELD + image.table;
        gate("code and constants with the table", flash, most);
    } else {
        gate("code and constants", flash, MAX_FLASH);
    }
    gate("variables", ram, MAX_VARIABLES);
    if let Some(stack) = worst_stack(image) {
        gate("variables and stack", ram + stack, RAM);
    }
    why
}

fn json(image: &Measured) -> Value {
    let symbols = image.symbols.iter();
    json!({
        "image": image.name,
        "flash": image.size.flash,
        "ram": image.size.ram,
        "ccm": image.size.ccm,
        "symbols": Value::from_iter(symbols.map(|s| json!({"bytes": s.bytes, "name": s.name}))),
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
    line(format_args!(
        "{:20} {MAX_FLASH:>10} {MAX_VARIABLES:>10} {:>10} {RAM:>10} with the variables",
        "allowed", "-"
    ));
    for image in images {
        if let Some(stack) = &image.stack {
            line(format_args!("\n{}'s stack, bytes", image.name));
            stack_text(stack, &mut line);
        }
        line(format_args!("\n{}'s biggest symbols, bytes", image.name));
        for symbol in &image.symbols {
            line(format_args!("{:>7}  {}", symbol.bytes, symbol.name));
        }
    }
    text
}

fn stack_text(stack: &Value, line: &mut impl FnMut(std::fmt::Arguments<'_>)) {
    let number = |of: &Value, name: &str| of.get(name).and_then(Value::as_u64).unwrap_or_default();
    let levels = stack.get("levels").and_then(Value::as_array);
    for level in levels.into_iter().flatten() {
        let name = level.get("name").and_then(Value::as_str).unwrap_or("?");
        let deepest = number(level, "deepest");
        match level.get("runs").and_then(Value::as_u64) {
            Some(runs) => line(format_args!("{deepest:>7}  {name}, {runs} runs")),
            None => line(format_args!("{deepest:>7}  {name}")),
        }
    }
    line(format_args!(
        "{:>7}  in use at most, as it came\n{:>7}  all of them upon one another, with their exception frames: the bound\n\
         UART4 runs the acquisition, UART5 the servo: the table in firmware/src/rig.rs",
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
            symbols: vec![Symbol {
                bytes: 4086,
                name: "session::work".into(),
            }],
            table: 0,
            stack: bound.map(|bound| {
                let servo = json!({"name": "UART5", "deepest": 1200, "runs": 9});
                json!({"levels": [servo], "used": 7, "bound": bound})
            }),
        }
    }

    #[test]
    fn each_limit_is_a_limit() {
        assert!(too_much(&image(MAX_FLASH, MAX_VARIABLES, Some(64 * KB))).is_empty());
        assert!(too_much(&image(0, 0, None)).is_empty());
        let error = |image: Measured| too_much(&image).join("");
        assert!(error(image(MAX_FLASH + 1, 0, None)).contains("code and constants"));
        let handheld = |flash| Measured {
            name: HANDHELD.into(),
            table: 9000,
            ..image(flash, 0, None)
        };
        assert!(too_much(&handheld(MAX_HANDHELD + 9000)).is_empty());
        assert!(error(handheld(MAX_HANDHELD + 9001)).contains("with the table"));
        assert!(error(image(0, MAX_VARIABLES + 1, None)).contains("variables take 131073"));
        assert!(error(image(0, 128 * KB, Some(64 * KB + 1))).contains("variables and stack"));
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
            "1200  UART5, 9 runs",
        ] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }
}
