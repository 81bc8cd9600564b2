//! Load and latency of the rig's own image, while it makes a slide.

use std::path::Path;

use anyhow::Context as _;
use tactus_core::rig::lever::RETRACT_STEPS_S;
use tactus_core::sensor::FingerName;
use tactus_core::wire::{Command, Event, Identify, Phase};
use tactus_world::world::Setup;

use super::gates::gate;
use super::row::Row;
use crate::board::{Emulator, Options, Output};
use crate::host::talk::Talk;

const CORE_HZ: f64 = 168e6;
/// Longest that the rig takes for anything, virtual seconds.
const TIMEOUT_S: f64 = 120.0;

/// The last sample is up to a tick of 1 ms old when the servo has the lever step up, and the first step comes a period
/// of its rate later.
const BEFORE_STEP_NS: u64 = 1_000_000 + 1_000_000_000 / RETRACT_STEPS_S.unsigned_abs() as u64;

/// When the lever's driver got its first step since the slide began: the end of the slide, as the pins show it.
fn first_step_up(board: &mut Emulator, since_ns: u64) -> Option<u64> {
    let rig = board.rig();
    rig.trace().find_map(|&(at_ns, output)| {
        (output == Output::LeverStep(true) && at_ns > since_ns).then_some(at_ns)
    })
}

/// Measures load and latency of the rig's image while it makes a slide.
pub(super) fn on_the_rig(elf: &Path, finger: FingerName) -> anyhow::Result<Vec<Row>> {
    let options = Options {
        trace_s: 2,
        ..Options::default()
    };
    let setup = Setup {
        finger,
        ..Setup::default()
    };
    let emulator = Emulator::start(elf, setup, options)?;
    // what does the slots: nothing in it waits for the wire
    let handlers = ["TIM2", "SPI1"].map(|name| emulator.symbol(name).map(|(address, _)| address));
    let handlers = handlers.into_iter().collect::<Result<Vec<_>, _>>()?;
    let mut talk = Talk::new(emulator);
    talk.ready(|_, _| ())?;
    let one_slide = Identify {
        threshold: 1.0,
        max_slides: 1,
        open: false,
        seed: 1,
        ..Identify::default()
    };
    // times in ns and instructions so far
    let (mut begun, mut over, mut told) = (None, None, None);
    let (mut lifts_ns, mut commands) = (None, 0);
    let mut failed = None;
    talk.send(Command::Identify(one_slide), TIMEOUT_S, |board, report| {
        let mut now = |board: &mut Emulator| {
            let instructions = board.instructions();
            let instructions = instructions.map_err(|why| failed = Some(why)).unwrap_or(0);
            Some((board.now_ns(), instructions))
        };
        match report.map(|report| &report.event) {
            Some(Event::Phase(Phase::Sliding)) if begun.is_none() => {
                begun = now(board);
                let counted = board.count_handlers(handlers.clone());
                failed = counted.err();
                commands = board.rig().sensor_commands();
            }
            Some(Event::Phase(Phase::Lifting)) if over.is_none() => over = now(board),
            Some(Event::Verdict(_)) => {
                told = now(board);
                lifts_ns = begun.and_then(|(from_ns, _)| first_step_up(board, from_ns));
            }
            _ => {}
        }
    })?;
    if let Some(why) = failed {
        return Err(why.into());
    }
    let counted = talk.board().handlers()?;
    let begun = begun.context("the rig: it says nothing of a slide")?;
    let over = over.context("the rig: the slide does not end")?;
    let (told_ns, _) = told.context("the rig: there is no verdict")?;
    let lifts_ns = lifts_ns.context("the rig: the finger is not lifted before the verdict")?;
    let slots = (talk.board().rig().sensor_commands() - commands) as f64;
    let seconds = (over.0 - begun.0) as f64 * 1e-9;
    let busy = (over.1 - begun.1) as f64 / (seconds * CORE_HZ);
    let row = |kernel: &str, unit, measured| Row {
        kernel: kernel.into(),
        unit,
        instructions: measured,
        gate: gate(kernel),
        cmsis: None,
        floor: None,
        equal: true,
    };
    let late_ms = (told_ns + BEFORE_STEP_NS - lifts_ns) as f64 * 1e-6;
    let slot = row("slot, not waiting", "slot", counted as f64 / slots);
    // the gate is a BioTac's; other fingers' slots have filters, and differ from each other
    let gate = slot.gate.filter(|_| finger == FingerName::Biotac);
    Ok(vec![
        Row { gate, ..slot },
        row("core busy during a slide", "% at 168 MHz", 100.0 * busy),
        row("last sample to the verdict on the link", "ms", late_ms),
    ])
}
