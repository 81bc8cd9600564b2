//! An exploration by the firmware, shown as it goes.

use std::io::Write as _;
use std::time::Instant;

use anyhow::{Context as _, bail};
use indicatif::ProgressBar;
use tactus::show::Show;
use tactus_core::explorer::Verdict;
use tactus_core::table::Table;
use tactus_core::wire::{Identify, Phase, Report, Tell};
use tactus_emulator::lessons::RECORDED_LIMITS;
use tactus_emulator::talk::Talk;
use tactus_emulator::{Emulator, Options, exploration};

use crate::learned::Chosen;
use crate::{Cli, Format};

/// Prints what the firmware logged.
pub(crate) fn print_log(board: &mut Emulator) -> Result<(), tactus_emulator::Error> {
    for (at_ns, line) in board.log()? {
        eprintln!("{:10.3} s  {line}", at_ns as f64 * 1e-9);
    }
    Ok(())
}

pub(crate) fn explore(cli: &Cli, chosen: &Chosen, sha256: &str) -> anyhow::Result<()> {
    let known = chosen.learn(cli)?;
    let table = Table::read(&known.table).context("the table is damaged: learn it anew")?;
    let text = cli.format == Format::Text;
    let truth = &chosen.unknown.name;
    if text {
        println!(
            "An unknown texture, one of {}. Under the finger: {truth} (seed {}).",
            table.textures(),
            cli.seed
        );
    }
    let began = Instant::now();
    let mut talk = Talk::new(chosen.unknown.start(&cli.elf, Options::default())?);
    let log = cli.log;
    let logged = move |board: &mut Emulator| {
        // an end of the run is reported where it is stepped
        if log {
            let _ = print_log(board);
        }
    };

    let bar = ProgressBar::new_spinner();
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    let now = |board: &Emulator| board.now_ns() as f64 * 1e-9;
    let fault = talk.ready(|board, _| {
        let now = now(board);
        bar.set_message(format!("looking for the limit switches, {now:.1} s"));
        logged(board);
    })?;
    if let Some(fault) = fault {
        bar.suspend(|| eprintln!("fault while homing: {fault}; homed again"));
    }
    bar.set_message("giving it the table");
    talk.teach(&known.calibration, &known.table, |board, _| logged(board))?;

    let identify = Identify {
        among: Default::default(),
        threshold: cli.threshold,
        max_slides: cli.max_slides,
        // a table from a file may be for any method
        method: cli.table.is_none().then(|| cli.method.method()),
        strategy: cli.method.strategy(),
        open: true,
        learn: false,
        seed: chosen.seed,
    };
    let mut out: Box<dyn std::io::Write> = if text {
        Box::new(std::io::stdout())
    } else {
        Box::new(std::io::sink())
    };
    let mut show = Show::new(table, &mut out);
    let mut failed = Ok(());
    let mut forces: Vec<f32> = Vec::new();
    let explored =
        exploration::explore(&mut talk, &known.table, identify, truth, |board, report| {
            logged(board);
            let Some(Report { tell, .. }) = report else {
                return;
            };
            // not within `suspend`, which holds the bar
            if let Tell::Live(live) = tell {
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
            let shown = bar.suspend(|| match tell {
                // from here on the force is about the still finger's
                Tell::Phase(Phase::Pressing) => {
                    forces.clear();
                    Ok(())
                }
                // shown at the end, with whether it is right
                Tell::Verdict { .. } => Ok(()),
                Tell::Felt { .. } => show.line(&pressed(&forces)).and_then(|()| show.tell(tell)),
                _ => show.tell(tell),
            });
            if failed.is_ok() {
                failed = shown;
            }
        })?;
    bar.finish_and_clear();
    failed?;
    let verdict = Verdict {
        texture: explored.found.texture,
        probability: explored.found.probability,
        sure: explored.found.sure,
        unknown: explored.found.unknown,
        log_odds: explored.found.log_odds,
    };
    show.finish(verdict, explored.found.slides, truth)?;
    let wall_s = began.elapsed().as_secs_f64();
    if text {
        println!(
            "{:.1} s of the board's time in {wall_s:.1} s. Force {:.1} %, speed {:.2} % off at most; slots within {:.2} us.",
            explored.virtual_s,
            explored.force_error().1 * 100.0,
            explored.speed_error() * 100.0,
            explored.jitter_us()
        );
        println!("{}.", explored.followed());
        if cli.recording.is_some() {
            println!(
                "{RECORDED_LIMITS} {} samples were clipped.",
                explored.played.clipped
            );
        }
    } else {
        let mut line = explored.json();
        line["elf_sha256"] = sha256.into();
        line["seed"] = cli.seed.into();
        line["wall_seconds"] = wall_s.into();
        println!("{line}");
    }
    std::io::stdout().flush()?;
    let missed = explored.missed();
    if !missed.is_empty() {
        bail!("not as it must be: {}", missed.join("; "));
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
