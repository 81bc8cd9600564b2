//! An exploration by the firmware, shown as it goes.

use std::io::Write as _;
use std::time::Instant;

use indicatif::ProgressBar;
use serde_json::json;
use tactus::collection::texture_name;
use tactus::show::Show;
use tactus_core::explorer::{Outlook, Strategy, Verdict};
use tactus_core::movement::Movement;
use tactus_core::table::Table;
use tactus_core::wire::{Ask, Counts, Identify, PART, Phase, Report, Tell};
use tactus_emulator::talk::Talk;
use tactus_emulator::{Emulator, Options};

use crate::learned::{Chosen, progress};
use crate::{Cli, Format};

/// Longest that anything but an exploration takes, virtual seconds.
const PATIENCE_S: f64 = 60.0;
/// A whole exploration.
const EXPLORATION_S: f64 = 600.0;

/// Prints what the firmware logged.
pub(crate) fn print_log(board: &mut Emulator) -> Result<(), tactus_emulator::Error> {
    for (at_ns, line) in board.log()? {
        eprintln!("{:10.3} s  {line}", at_ns as f64 * 1e-9);
    }
    Ok(())
}

/// The rig's truth about what the firmware meant to do.
#[derive(Default)]
struct Truths {
    movement: Option<Movement>,
    seen: usize,
    force_error: f64,
    speed_error: f64,
    jitter_us: f64,
}

impl Truths {
    fn chosen(&mut self, movement: Movement, board: &mut Emulator) {
        self.movement = Some(movement);
        board.rig().expect_speed(movement.speed_mm_s().into());
    }

    /// Takes in slides that are over; the last one's force and speed.
    fn update(&mut self, board: &mut Emulator) -> Option<(f64, f64)> {
        let movement = self.movement?;
        let rig = board.rig();
        let new = rig.slides().get(self.seen..)?;
        for slide in new {
            let force_n = f64::from(movement.force_n());
            self.force_error = self.force_error.max((slide.force_n / force_n - 1.0).abs());
            self.speed_error = self.speed_error.max(slide.speed_error);
            self.jitter_us = self.jitter_us.max(slide.slot_jitter_us);
        }
        self.seen += new.len();
        new.last().map(|slide| (slide.force_n, slide.speed_mm_s))
    }
}

pub(crate) fn explore(cli: &Cli, chosen: &Chosen, sha256: &str) -> anyhow::Result<()> {
    let (calibration, table_bytes) = chosen.learn(cli)?;
    let table = Table::read(&table_bytes)?;
    let text = cli.format == Format::Text;
    let truth = texture_name(chosen.texture);
    if text {
        println!(
            "An unknown texture, one of {}. Under the finger: {truth} (seed {}).",
            table.textures(),
            cli.seed
        );
    }
    let began = Instant::now();
    let mut talk = Talk::new(Emulator::start(&cli.elf, chosen.setup, Options::default())?);
    let log = cli.log;
    let logged = move |board: &mut Emulator| {
        // an end of the run is reported where it is stepped
        if log {
            let _ = print_log(board);
        }
    };

    let bar = ProgressBar::new_spinner();
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    bar.set_message("booting");
    let now = |board: &Emulator| board.now_ns() as f64 * 1e-9;
    talk.wait(
        PATIENCE_S,
        |board, _| logged(board),
        |tell| matches!(tell, Tell::Booted { .. }).then_some(Ok(())),
    )?;
    let mut homing = |board: &mut Emulator, _: Option<&Report>| {
        bar.set_message(format!(
            "looking for the limit switches, {:.1} s",
            now(board)
        ));
        logged(board);
    };
    let fault = talk.wait(PATIENCE_S, &mut homing, |tell| match tell {
        Tell::Phase(Phase::Ready) => Some(Ok(None)),
        Tell::Fault(fault) => Some(Ok(Some(*fault))),
        _ => None,
    })?;
    if let Some(fault) = fault {
        bar.suspend(|| eprintln!("fault while homing: {fault}; homing again"));
        talk.ask(Ask::Home, PATIENCE_S, &mut homing)?;
    }
    bar.finish_and_clear();
    let write = Ask::WriteCalibration(calibration.to_bytes().into_iter().collect());
    talk.ask(write, PATIENCE_S, |board, _| logged(board))?;
    let bar = progress(table_bytes.len() as u64, "giving it the table");
    talk.ask(
        Ask::BeginTable(table_bytes.len() as u32),
        PATIENCE_S,
        |board, _| logged(board),
    )?;
    for (part, index) in table_bytes.chunks(PART).zip(0..) {
        let write = Ask::WriteTable {
            offset: index * PART as u32,
            bytes: part.iter().copied().collect(),
        };
        talk.ask(write, PATIENCE_S, |board, _| logged(board))?;
        bar.inc(part.len() as u64);
    }
    talk.ask(Ask::CommitTable, PATIENCE_S, |board, _| logged(board))?;
    bar.finish_and_clear();

    let identify = Ask::Identify(Identify {
        among: Default::default(),
        threshold: cli.threshold,
        max_slides: cli.max_slides,
        strategy: Strategy::Bayesian,
        seed: chosen.seed,
    });
    let bar = ProgressBar::new_spinner();
    bar.enable_steady_tick(std::time::Duration::from_millis(200));
    let mut out: Box<dyn std::io::Write> = if text {
        Box::new(std::io::stdout())
    } else {
        Box::new(std::io::sink())
    };
    let mut show = Show::new(table, &mut out);
    let mut truths = Truths::default();
    let mut verdict = None;
    let mut failed = Ok(());
    let mut forces: Vec<f32> = Vec::new();
    talk.ask(identify, EXPLORATION_S, |board, report| {
        logged(board);
        let Some(Report { tell, .. }) = report else {
            truths.update(board);
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
            Tell::Chosen {
                movement,
                action,
                outlook,
                ..
            } => {
                truths.chosen(*movement, board);
                let outlook: Vec<Outlook> = outlook
                    .iter()
                    .map(|promise| Outlook {
                        action: promise.action,
                        uncertainty: promise.uncertainty,
                        benefit: promise.benefit,
                    })
                    .collect();
                show.chosen(*action, &outlook)
            }
            Tell::Felt {
                action,
                felt,
                posterior,
                ..
            } => show.line(&pressed(&forces)).and_then(|()| {
                let properties = felt.properties();
                show.felt(*action, &properties, felt.roughness_is_bound, posterior)
            }),
            // from here on the force is about the still finger's
            Tell::Phase(Phase::Pressing) => {
                forces.clear();
                Ok(())
            }
            Tell::Rejected { why, .. } => show.line(&format!("  rejected: {why}")),
            Tell::Fault(fault) => show.line(&format!("  fault: {fault}")),
            Tell::Verdict {
                texture,
                name,
                probability,
                sure,
                slides,
            } => {
                verdict = Some((
                    Verdict {
                        texture: *texture,
                        probability: *probability,
                        sure: *sure,
                    },
                    name.clone(),
                    *slides,
                ));
                Ok(())
            }
            _ => Ok(()),
        });
        if failed.is_ok() {
            failed = shown;
        }
    })?;
    bar.finish_and_clear();
    failed?;
    let (verdict, name, slides) =
        verdict.ok_or_else(|| anyhow::anyhow!("the firmware ended without a verdict"))?;
    show.finish(verdict, slides, truth)?;
    truths.update(talk.board());
    let counts = status(&mut talk)?;
    let virtual_s = now(talk.board());
    if text {
        println!(
            "{virtual_s:.1} s of the board's time in {:.1} s. Force {:.1} %, speed {:.2} % off at most; slots within {:.2} us.",
            began.elapsed().as_secs_f64(),
            truths.force_error * 100.0,
            truths.speed_error * 100.0,
            truths.jitter_us
        );
    } else {
        let line = json!({
            "elf_sha256": sha256,
            "seed": cli.seed,
            "texture_true": truth,
            "texture_identified": name.as_str(),
            "probability": verdict.probability,
            "sure": verdict.sure,
            "slides": slides,
            "virtual_seconds": virtual_s,
            "wall_seconds": began.elapsed().as_secs_f64(),
            "lost_samples": counts.lost_samples,
            "late_slots": counts.late_slots,
            "parity_errors": counts.parity_errors,
            "force_error_max": truths.force_error,
            "speed_error_max": truths.speed_error,
            "slot_jitter_us": truths.jitter_us,
        });
        println!("{line}");
    }
    std::io::stdout().flush()?;
    Ok(())
}

fn status(talk: &mut Talk) -> anyhow::Result<Counts> {
    let mut counts = None;
    talk.ask(Ask::Status, PATIENCE_S, |_, report| {
        if let Some(Report {
            tell: Tell::Status(status),
            ..
        }) = report
        {
            counts = Some(status.counts);
        }
    })?;
    counts.ok_or_else(|| anyhow::anyhow!("the firmware did not say how it is"))
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
