//! An exploration by the firmware, shown as it goes.

use std::io::Write as _;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args as Arguments;
use tactus_core::table::Table;
use tactus_core::wire::{Event, Identify, Phase, Report};
use tactus_lab::eval::show::{Show, count, is_right};

use super::error::RunError;
use crate::board::{self, Emulator, Options};
use crate::host::args::{Format, World};
use crate::host::exploration::{self, ExploreError};
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
    /// Table to give to the firmware instead of one learned for this world
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Stop when a texture is more probable than this
    #[arg(long, value_name = "P", default_value_t = 0.99)]
    threshold: f32,
    /// Stop after so many slides
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u8).range(1..))]
    max_slides: u8,
    /// For people, or a line of JSON at the end for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// Prints what the firmware logged.
pub(crate) fn print_log(board: &mut Emulator) -> Result<(), board::Error> {
    for (at_ns, line) in board.log()? {
        eprintln!("{:10.3} s  {line}", at_ns as f64 * 1e-9);
    }
    Ok(())
}

/// Has the firmware identify what lies under its finger, and shows it as it goes.
pub(crate) fn run(args: &Args) -> Result<(), RunError> {
    let world = &args.world;
    let text = args.format == Format::Text;
    let sha256 = world.firmware.show(text)?;
    let chosen = Chosen::new(world)?;
    let known = chosen.learn(world.method.method(), args.table.as_deref())?;
    let table = Table::read(&known.table).map_err(ExploreError::from)?;
    let truth = &chosen.unknown.name;
    if text {
        println!(
            "An unknown texture, one of {}. Under the finger: {truth} (seed {}).",
            table.textures(),
            world.seed
        );
    }
    let began = Instant::now();
    let mut talk = Talk::new(
        chosen
            .unknown
            .start(&world.firmware.elf, Options::default())?,
    );
    let log = world.log;
    let logged = move |board: &mut Emulator| {
        // an end of the run is reported where it is stepped
        if log {
            let _ = print_log(board);
        }
    };

    let bar = progress::spinner("");
    let now = |board: &Emulator| board.now_ns() as f64 * 1e-9;
    let mut times = Milestones::default();
    let fault = talk.ready(|board, report| {
        if let Some(report) = report {
            times.hear(board.now_ns(), &report.event);
        }
        let now = now(board);
        bar.set_message(format!("looking for the limit switches, {now:.1} s"));
        logged(board);
    })?;
    if let Some(fault) = fault {
        bar.suspend(|| eprintln!("fault while homing: {fault}; homed again"));
    }
    bar.set_message("giving it the table");
    times.ready(talk.now_ns());
    talk.teach(&known.calibration, &known.table, |board, _| logged(board))?;

    let identify = Identify {
        threshold: args.threshold,
        max_slides: args.max_slides,
        // a table from a file may be for any method
        method: args.table.is_none().then(|| world.method.method()),
        strategy: world.method.strategy(),
        seed: chosen.seed,
        ..Identify::default()
    };
    let mut out: Box<dyn std::io::Write> = if text {
        Box::new(std::io::stdout())
    } else {
        Box::new(std::io::sink())
    };
    let mut show = Show::new(table, &mut out);
    let mut failed = Ok(());
    let mut forces: Vec<f32> = Vec::new();
    times.begin(talk.now_ns());
    let explored =
        exploration::explore(&mut talk, &known.table, identify, truth, |board, report| {
            logged(board);
            let Some(Report { event, .. }) = report else {
                return;
            };
            times.hear(board.now_ns(), event);
            // not within `suspend`, which holds the bar
            if let Event::Live(live) = event {
                forces.push(f32::from(live.force_mn) * 1e-3);
                bar.set_message(format!(
                    "{:6.1} s  finger {:4.2} N  stage {:5.1} mm, {:5.1} mm/s  motor {:4} mA",
                    now(board),
                    f32::from(live.force_mn) * 1e-3,
                    live.stage_um as f32 * 1e-3,
                    live.speed_um_s as f32 * 1e-3,
                    live.current_ma
                ));
                return;
            }
            let shown = bar.suspend(|| match event {
                // from here on the force is about the still finger's
                Event::Phase(Phase::Pressing) => {
                    forces.clear();
                    Ok(())
                }
                // shown at the end, with whether it is right
                Event::Verdict(_) => Ok(()),
                Event::SlideReport { .. } => show
                    .line(&pressed(&forces))
                    .and_then(|()| show.event(event)),
                _ => show.event(event),
            });
            if failed.is_ok() {
                failed = shown;
            }
        })?;
    bar.finish_and_clear();
    failed?;
    let found = &explored.found;
    show.finish(found.into(), found.slides, truth)?;
    let wall_s = began.elapsed().as_secs_f64();
    if text {
        println!(
            "{}{:.1} s of the board's time in {wall_s:.1} s. Force {:.1} %, speed {:.2} % off at most; slots within {:.2} us.",
            times.sentence("command"),
            explored.virtual_s,
            explored.force_error().1 * 100.0,
            explored.speed_error() * 100.0,
            explored.jitter_us()
        );
        println!("{}.", explored.followed());
        if world.recording.is_some() {
            println!(
                "{RECORDED_LIMITS} Clipped: {}.",
                count(explored.played.clipped, "sample")
            );
        }
    } else {
        let mut line = explored.json();
        let right = is_right(found.into(), truth, table);
        line["verdict"] = right
            .map_or("Undecided", |right| if right { "Right" } else { "Wrong" })
            .into();
        line["elf_sha256"] = sha256.into();
        line["seed"] = world.seed.into();
        line["wall_seconds"] = wall_s.into();
        line["seconds_to_ready"] = times.seconds_to_ready().into();
        line["seconds_to_verdict"] = times.seconds_to_verdict().into();
        println!("{line}");
    }
    std::io::stdout().flush()?;
    let missed = explored.missed();
    if !missed.is_empty() {
        return Err(RunError::Missed(missed));
    }
    Ok(())
}

/// The force of a slide over time.
fn pressed(forces: &[f32]) -> String {
    const LEVELS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    const WIDTH: usize = 48;
    let highest = forces.iter().copied().fold(0.0, f32::max);
    let each = forces.len().div_ceil(WIDTH).max(1);
    let line: String = forces
        .chunks(each)
        .map(|part| {
            let mean = part.iter().sum::<f32>() / part.len() as f32;
            let level = mean / highest.max(f32::MIN_POSITIVE) * (LEVELS.len() - 1) as f32;
            LEVELS[(level.round().max(0.0) as usize).min(LEVELS.len() - 1)]
        })
        .collect();
    format!("  pressed {line} up to {highest:.2} N")
}
