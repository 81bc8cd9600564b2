//! `tactus device log`: the log of a session shown again, and replayed: every decision of the session computed again from
//! its events, by the same core.

use std::fs::File;
use std::io::{self, BufRead as _, BufReader, Write};
use std::path::{Path, PathBuf};

use clap::Subcommand;
use tactus::follow::{ALLOWED, Agreement, Follower};
use tactus::show::Show;
use tactus_core::explorer::ExplorerError;
use tactus_core::features::{Plan, PropertySet};
use tactus_core::table::Table;
use tactus_core::wire::{Ask, Forget, Identify, PROTOCOL, Tell};

use super::log::Line;

/// Look into the log of a session (--log)
#[derive(Subcommand)]
pub(crate) enum Command {
    /// Compute every decision of the session again, and compare
    Replay {
        /// The log
        file: PathBuf,
    },
    /// Show the session's explorations as they were shown live
    Show {
        /// The log
        file: PathBuf,
    },
}

/// Shows or replays a log.
pub(crate) fn run(command: &Command, out: &mut impl Write) -> Result<(), ReplayError> {
    match command {
        Command::Replay { file } => replay(file, out),
        Command::Show { file } => show(file, out),
    }
}

/// Why a log cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ReplayError {
    /// The file.
    #[error("{}: {why}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        why: io::Error,
    },
    /// A line is none of a log.
    #[error(
        "{}: line {line} is no line of a session's log ({why}); `tactus device identify --log FILE` writes one",
        path.display()
    )]
    Line {
        /// The file.
        path: PathBuf,
        /// Its number, from 1.
        line: usize,
        /// What is wrong with it.
        why: serde_json::Error,
    },
    /// Messages of another version.
    #[error(
        "{}: written with version {protocol} of the messages, this program has version {PROTOCOL}: replay it with the \
         tactus that wrote it", path.display()
    )]
    Protocol {
        /// The file.
        path: PathBuf,
        /// Its version.
        protocol: u8,
    },
    /// Nothing to replay.
    #[error("{}: no exploration in this log: nothing was decided", .0.display())]
    Nothing(PathBuf),
    /// The decisions are others here.
    #[error("{}: not every decision is the same here", .0.display())]
    Differs(PathBuf),
    /// What is shown cannot be written.
    #[error(transparent)]
    Out(#[from] io::Error),
}

/// An exploration as the log has it.
struct Logged {
    asked: Identify,
    /// The table in use, or why it is not known.
    table: Result<Vec<u8>, &'static str>,
    tells: Vec<Tell>,
}

const NOT_READ: &str = "the log does not have the table that the probe used";
const CHANGED: &str = "the probe's table was changed after the log read it";

/// The explorations of a log.
fn explorations(path: &Path) -> Result<Vec<Logged>, ReplayError> {
    let io = |why| ReplayError::Io {
        path: path.to_owned(),
        why,
    };
    let file = File::open(path).map_err(io)?;
    let mut explorations: Vec<Logged> = Vec::new();
    let mut running = false;
    let mut parts = Vec::new();
    let mut table = Err(NOT_READ);
    for (line, number) in BufReader::new(file).lines().zip(1..) {
        let line = line.map_err(io)?;
        let line = serde_json::from_str(&line).map_err(|why| ReplayError::Line {
            path: path.to_owned(),
            line: number,
            why,
        })?;
        match line {
            Line::Session { protocol, .. } => {
                if protocol != PROTOCOL {
                    return Err(ReplayError::Protocol {
                        path: path.to_owned(),
                        protocol,
                    });
                }
            }
            Line::Ask(ask) => match ask.into_owned() {
                Ask::Identify(asked) => {
                    running = true;
                    explorations.push(Logged {
                        asked,
                        table: table.clone(),
                        tells: Vec::new(),
                    });
                }
                Ask::Answer(_)
                | Ask::Train(_)
                | Ask::Rename { .. }
                | Ask::Forget(Forget::Texture(_) | Forget::SelfTaught)
                | Ask::BeginTable(_)
                | Ask::CommitTable
                | Ask::FactoryTable => table = Err(CHANGED),
                _ => {}
            },
            Line::Report(report) => match report.into_owned().tell {
                Tell::TablePart {
                    offset,
                    length,
                    bytes,
                } => {
                    if offset == 0 {
                        parts.clear();
                    }
                    if offset as usize == parts.len() {
                        parts.extend_from_slice(&bytes);
                    }
                    if parts.len() == length as usize {
                        table = Ok(std::mem::take(&mut parts));
                    }
                }
                tell => {
                    if matches!(tell, Tell::Taught { .. }) {
                        table = Err(CHANGED);
                    }
                    let over = matches!(tell, Tell::Verdict { .. } | Tell::Refused { .. });
                    if running && let Some(last) = explorations.last_mut() {
                        last.tells.push(tell);
                        running = !over;
                    }
                }
            },
        }
    }
    if explorations.is_empty() {
        return Err(ReplayError::Nothing(path.to_owned()));
    }
    Ok(explorations)
}

/// Shows the explorations of a log as they were shown live.
fn show(path: &Path, out: &mut impl Write) -> Result<(), ReplayError> {
    for (logged, number) in explorations(path)?.iter().zip(1..) {
        headline(number, logged, out)?;
        let Some(table) = logged.table.as_ref().ok().and_then(|t| Table::read(t).ok()) else {
            writeln!(out, "  {NOT_READ}")?;
            continue;
        };
        let mut show = Show::new(table, &mut *out);
        for tell in &logged.tells {
            show.tell(tell)?;
        }
        writeln!(out)?;
    }
    Ok(())
}

/// Computes every decision of a log again and says what came of it.
fn replay(path: &Path, out: &mut impl Write) -> Result<(), ReplayError> {
    let mut total = Agreement::default();
    let mut same = true;
    for (logged, number) in explorations(path)?.iter().zip(1..) {
        headline(number, logged, out)?;
        let agreement = match follow(logged, out)? {
            Ok(agreement) => agreement,
            Err(why) => {
                writeln!(out, "  cannot be replayed: {why}")?;
                same = false;
                continue;
            }
        };
        total.slides += agreement.slides;
        total.choices += agreement.choices;
        total.posteriors += agreement.posteriors;
        total.verdicts += agreement.verdicts;
        for (total, here) in [
            (&mut total.properties, agreement.properties),
            (&mut total.signal, agreement.signal),
            (&mut total.posterior, agreement.posterior),
            (&mut total.outlook, agreement.outlook),
        ] {
            *total = total.max(here);
        }
        // one that was stopped before its first slide was over has decided nothing else
        let felt = logged.tells.iter().any(|t| matches!(t, Tell::Felt { .. }));
        same &= agreement.agrees()
            || !felt && agreement.other_choices.is_empty() && agreement.outlook <= ALLOWED;
    }
    if !same {
        return Err(ReplayError::Differs(path.to_owned()));
    }
    let largest = total.properties.max(total.signal);
    let largest = largest.max(total.posterior).max(total.outlook);
    writeln!(
        out,
        "\nEvery decision is the same here: {} choices, {} slides felt again from their samples, {} posteriors, {} answers; \
         largest difference {largest:e}.",
        total.choices, total.slides, total.posteriors, total.verdicts
    )?;
    Ok(())
}

fn headline(number: usize, logged: &Logged, out: &mut impl Write) -> io::Result<()> {
    let textures = logged.table.as_ref().ok().and_then(|t| Table::read(t).ok());
    let textures = textures.map_or_else(String::new, |t| format!(" among {}", t.textures()));
    writeln!(
        out,
        "Exploration {number}{textures}, threshold {}, at most {} slides",
        logged.asked.threshold, logged.asked.max_slides
    )
}

/// Follows one exploration step by step; the inner error is why it cannot be.
fn follow(logged: &Logged, out: &mut impl Write) -> Result<Result<Agreement, String>, ReplayError> {
    let table = match &logged.table {
        Ok(bytes) => Table::read(bytes).map_err(|why| why.to_string()),
        Err(why) => Err((*why).to_owned()),
    };
    let plan = Plan::new();
    // a handheld probe feels no traction, from its first slide on
    let measured = logged.tells.iter().find_map(|tell| match tell {
        Tell::Felt { felt, .. } => Some(felt.properties().measured()),
        _ => None,
    });
    let follower = table.and_then(|table| {
        let measured = measured.unwrap_or(PropertySet::ALL);
        let follower = Follower::new(table, measured, &logged.asked, &plan);
        Ok((
            table,
            follower.map_err(|why: ExplorerError| why.to_string())?,
        ))
    });
    let (table, mut follower) = match follower {
        Ok(both) => both,
        Err(why) => return Ok(Err(why)),
    };
    let words = Show::new(table, io::sink());
    let mut whole = true;
    for tell in &logged.tells {
        let before = follower.agreement().clone();
        if let Err(why) = follower.hear(tell) {
            writeln!(out, "  {why}")?;
            whole = false;
        }
        let now = follower.agreement();
        match tell {
            Tell::Chosen { slide, action, .. } => {
                let here = match now.other_choices.get(before.other_choices.len()) {
                    None => "chosen here too".to_owned(),
                    Some(other) => format!("HERE {} IS CHOSEN", words.name(other.here)),
                };
                writeln!(out, "  slide {slide}: {}: {here}", words.name(*action))?;
            }
            Tell::Felt { .. } => {
                let apart = |now: f32, before: f32, what: &str| match now > before {
                    true => format!("{what} up to {now:e} apart"),
                    false => format!("{what} the same"),
                };
                let felt = if now.slides == before.slides {
                    "samples not compared".to_owned()
                } else {
                    let now = now.properties.max(now.signal);
                    apart(now, before.properties.max(before.signal), "features")
                };
                let posterior = apart(now.posterior, before.posterior, "posterior");
                writeln!(out, "           {felt}, {posterior}")?;
            }
            Tell::Rejected { slide, why } => writeln!(out, "  slide {slide}: rejected: {why}")?,
            Tell::Verdict { name, slides, .. } => {
                let here = if now.other_verdicts == before.other_verdicts {
                    "the same here"
                } else {
                    "ANOTHER ONE HERE"
                };
                writeln!(out, "  answer after {slides}: {name}: {here}")?;
            }
            Tell::Refused { why, .. } => writeln!(out, "  ended: {why}")?,
            _ => {}
        }
    }
    let agreement = follower.agreement().clone();
    Ok(match whole {
        true => Ok(agreement),
        false => Err("a part of it is missing".to_owned()),
    })
}
