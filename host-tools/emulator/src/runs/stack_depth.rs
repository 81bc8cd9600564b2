//! How deep the rig's stack gets: a line of JSON, bytes, for `cargo xtask size`. The stack is painted before the first
//! instruction, and what is left of the paint in the end was never used.

use std::ops::Range;
use std::path::Path;

use anyhow::ensure;
use clap::Args as Arguments;
use object::{Object as _, ObjectSymbol as _};
use serde_json::json;
use tactus_core::wire::{Command, Event, Identify};
use tactus_world::world::Setup;

use crate::board::{Emulator, Error, Options};
use crate::host::args::Firmware;
use crate::host::talk::Talk;

/// What is measured.
#[derive(Arguments)]
pub(crate) struct Args {
    #[command(flatten)]
    firmware: Firmware,
    /// Slides
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..))]
    slides: u8,
}

/// Longer than it takes, virtual seconds.
const TIMEOUT_S: f64 = 120.0;
const PAINT: u8 = 0x7A;

/// Addresses of the stack of an ELF that cortex-m-rt was linked into.
fn stack(path: &Path) -> Result<Range<u64>, Error> {
    let elf = std::fs::read(path).map_err(|source| Error::Read {
        path: path.into(),
        source,
    })?;
    let file = object::File::parse(&*elf).map_err(|source| Error::Elf {
        path: path.into(),
        source,
    })?;
    let named = |name: &str| {
        let found = file.symbols().find(|symbol| symbol.name() == Ok(name));
        let found = found.ok_or_else(|| Error::Symbol {
            name: name.into(),
            count: 0,
            examples: String::new(),
        });
        found.map(|symbol| symbol.address())
    };
    Ok(named("__euninit")?..named("_stack_start")?)
}

/// Measures the stack of the rig's firmware while it identifies a texture among those of its factory table.
pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let (elf, slides) = (&args.firmware.elf, args.slides);
    let stack = stack(elf)?;
    let length = stack.end - stack.start;
    let mut emulator = Emulator::start(elf, Setup::default(), Options::default())?;
    emulator.write(stack.start, &vec![PAINT; length as usize])?;
    let mut talk = Talk::new(emulator);
    talk.ready(|_, _| ())?;
    let mut observed = 0;
    let identify = Identify {
        threshold: 1.0,
        max_slides: slides,
        learn: true,
        seed: 1,
        ..Identify::default()
    };
    talk.send(Command::Identify(identify), TIMEOUT_S, |board, report| {
        if let Some(report) = report
            && matches!(report.event, Event::SlideReport { .. })
        {
            observed += 1;
            eprintln!(
                "slide {observed} of {slides} at {:.1} virtual s",
                board.now_ns() as f64 * 1e-9
            );
        }
    })?;
    ensure!(
        observed > 0,
        "the exploration had no slide: the stack that was measured says nothing"
    );
    let left = talk.board().read(stack.start, length)?;
    let used = left.iter().skip_while(|byte| **byte == PAINT).count();
    println!("{}", json!({ "used": used }));
    Ok(())
}
