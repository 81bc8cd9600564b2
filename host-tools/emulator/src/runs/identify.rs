//! An exploration by the firmware, shown as it goes.

use std::io::Write as _;
use std::time::Instant;

use anyhow::bail;
use clap::Args as Arguments;
use tactus_core::table::Table;
use tactus_core::wire::{Event, Identify, Report};
use tactus_lab::eval::show::{Show, count, is_right};

use crate::board::{self, Emulator, Options};
use crate::host::args::{Format, World};
use crate::host::exploration::{self, Exploration};
use crate::host::learned::Chosen;
use crate::host::milestones::Milestones;
use crate::host::progress;
use crate::host::talk::Talk;
use crate::host::under_finger::RECORDED_LIMITS;

/// What is identified, and how.
#[derive(Arguments)]
pub(crate) struct Args {
    #[command(flatten)]
    world: World,
    /// For people, or a line of JSON at the end for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

pub(crate) fn print_log(board: &mut Emulator) -> Result<(), board::Error> {
    for (at_ns, line) in board.log()? {
        eprintln!("{:10.3} s  {line}", at_ns as f64 * 1e-9);
    }
    Ok(())
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let world = &args.world;
    let text = args.format == Format::Text;
    let sha256 = world.firmware.show(text)?;
    let chosen = Chosen::new(world)?;
    let known = chosen.learn(world.method.method())?;
    let table = Table::read(&known.table)?;
    let truth = &chosen.unknown.name;
    if text {
        println!(
            "An unknown texture, one of {}. Under the finger: {truth} (seed {}).",
            table.textures(),
            world.seed
        );
    }
    let (began, elf) = (Instant::now(), &world.firmware.elf);
    let mut talk = Talk::new(chosen.unknown.start(elf, Options::default())?);
    let logged = |board: &mut Emulator| {
        // an end of the run is reported where it is stepped
        if world.log {
            let _ = print_log(board);
        }
    };
    let bar = progress::spinner("looking for the limit switches");
    let mut times = Milestones::default();
    let fault = talk.ready(|board, report| {
        if let Some(report) = report {
            times.hear(board.now_ns(), &report.event);
        }
        logged(board);
    })?;
    if let Some(fault) = fault {
        bar.suspend(|| eprintln!("fault while homing: {fault}; homed again"));
    }
    bar.set_message("giving it the table");
    times.ready(talk.now_ns());
    talk.teach(&known.calibration, &known.table, |board, _| logged(board))?;

    bar.set_message("exploring");
    let identify = Identify {
        method: Some(world.method.method()),
        strategy: world.method.strategy(),
        seed: chosen.seed,
        ..Identify::default()
    };
    let mut out: Box<dyn std::io::Write> = match text {
        true => Box::new(std::io::stdout()),
        false => Box::new(std::io::sink()),
    };
    let (mut show, mut shown) = (Show::new(table, &mut out), Ok(()));
    times.begin(talk.now_ns());
    let each = |board: &mut Emulator, report: Option<&Report>| {
        logged(board);
        let Some(Report { event, .. }) = report else {
            return;
        };
        times.hear(board.now_ns(), event);
        // a verdict is shown at the end, with whether it is right
        if shown.is_ok() && !matches!(event, Event::Live(_) | Event::Verdict(_)) {
            shown = bar.suspend(|| show.event(event));
        }
    };
    let explored = exploration::explore(&mut talk, &known.table, identify, truth, each)?;
    bar.finish_and_clear();
    shown?;
    show.finish((&explored.found).into(), explored.found.slides, truth)?;
    let wall_s = began.elapsed().as_secs_f64();
    if text {
        summary(&explored, &times, wall_s, world.recording.is_some());
    } else {
        let mut line = explored.json();
        let right = is_right((&explored.found).into(), truth, table);
        let verdict = right.map_or("Undecided", |right| if right { "Right" } else { "Wrong" });
        line["verdict"] = verdict.into();
        line["elf_sha256"] = sha256.into();
        line["seed"] = world.seed.into();
        line["wall_seconds"] = wall_s.into();
        line["seconds_to_ready"] = times.seconds_to_ready().into();
        line["seconds_to_verdict"] = times.seconds_to_verdict().into();
        println!("{line}");
    }
    std::io::stdout().flush()?;
    match explored.missed() {
        missed if missed.is_empty() => Ok(()),
        missed => bail!("not as it must be: {}", missed.join("; ")),
    }
}

fn summary(explored: &Exploration, times: &Milestones, wall_s: f64, recorded: bool) {
    println!(
        "{}{:.1} s of the board's time in {wall_s:.1} s. Force {:.1} %, speed {:.2} % off at most; slots within \
         {:.2} us.",
        times.sentence("command"),
        explored.virtual_s,
        explored.force_error().1 * 100.0,
        explored.speed_error() * 100.0,
        explored.jitter_us()
    );
    println!("{}.", explored.followed());
    if recorded {
        let clipped = count(explored.played.clipped, "sample");
        println!("{RECORDED_LIMITS} Clipped: {clipped}.");
    }
}
