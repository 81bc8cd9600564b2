//! How deep the rig's stack gets: a line of JSON, bytes, for `cargo xtask size`.

use std::path::Path;

use clap::Args as Arguments;
use serde_json::{Value, json};
use tactus_core::wire::{Command, Event, Identify, Phase};
use tactus_world::world::Setup;

use super::error::RunError;
use crate::board::{Emulator, Options, StackLayout, StackLevel, StackUse};
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

/// Measures the stack of the rig's firmware while it identifies a texture among those of its factory table.
pub(crate) fn run(args: &Args) -> Result<(), RunError> {
    let elf = &args.firmware.elf;
    let mut layout = StackLayout::of(elf)?;
    let found = loop {
        let found = explore(elf, layout.clone(), args.slides)?;
        if !found.incomplete {
            break found;
        }
        eprintln!("a handler went deeper than was looked at: once more");
        layout.levels = found.levels;
    };
    let level = |level: &StackLevel| json!({"name": level.name, "runs": level.runs, "deepest": level.deepest});
    let thread = json!({"name": "thread mode", "deepest": found.thread});
    let ran = found.levels.iter().filter(|level| level.runs > 0);
    let levels = std::iter::once(thread).chain(ran.map(level));
    let bound = found.bound();
    println!(
        "{}",
        json!({"levels": Value::from_iter(levels), "used": found.used, "bound": bound})
    );
    Ok(())
}

fn explore(elf: &Path, layout: StackLayout, slides: u8) -> Result<StackUse, RunError> {
    let mut emulator = Emulator::start(elf, Setup::default(), Options::default())?;
    emulator.measure_stack(layout)?;
    let mut talk = Talk::new(emulator);
    // the firmware homes the rig when it starts
    let homed = talk.wait(
        TIMEOUT_S,
        |_, _| {},
        |event| matches!(event, Event::Phase(Phase::Ready)).then_some(Ok(())),
    );
    homed?;
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
    let measured = talk.board().stack_use()?;
    measured.filter(|_| observed > 0).ok_or(RunError::NoSlide)
}
