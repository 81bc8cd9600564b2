//! `tactus device`: the probe at the other end of the serial link, and everything that is done with it at the bench.

mod bench;
mod log;
mod monitor;
mod port;
mod record;

use std::ffi::OsString;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, bail, ensure};
use clap::{Args, Subcommand};
use tactus::evaluate::Method;
use tactus::link::{Found, PushTable, Question};
use tactus::recordings::{RecordingWriter, Texture};
use tactus::show::{Show, show_table};
use tactus_core::explorer::Strategy;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::table::Table;
use tactus_core::wire::{Ask, Forget, Identify, Name, Phase, Report, Status, Tell, Train};

use crate::cli::{Format, Stop};
use crate::commands::{read_table, write_table};
pub(crate) use bench::BenchError;
use bench::{Bench, wait_for_enter};
use port::Where;
use record::Recorder;

pub(crate) const EXAMPLES: &str = "\
Try first:
  tactus device list                         the serial ports, and which of them is a board
  tactus device monitor --emulated           the emulated board, live (cargo xtask emulate builds it)
  tactus device status                       how the probe is that is plugged in
  tactus device identify --log visit.jsonl   what lies under its finger
  tactus device log replay visit.jsonl       the same decisions, computed again on this PC

Ctrl-C stops the rig and waits until the finger is lifted; the exit code is 130 then.";

#[derive(Subcommand)]
pub(crate) enum Device {
    /// List the serial ports, boards first
    List,
    /// Say how the probe is: rig, faults, table, counters
    Status {
        #[command(flatten)]
        at: Where,
        /// How to print it
        #[arg(long, value_enum, default_value_t = Format::Text)]
        format: Format,
    },
    /// Watch the probe live, and have it identify, home or stop by a key
    Monitor {
        #[command(flatten)]
        at: Where,
        #[command(flatten)]
        how: Exploration,
    },
    /// Have the probe find out what lies under its finger, and show every step
    Identify {
        #[command(flatten)]
        at: Where,
        #[command(flatten)]
        how: Exploration,
    },
    /// Have the probe learn the texture under its finger from new slides; an unfinished training goes on where it stood
    Train {
        #[command(flatten)]
        at: Where,
        /// What lies under the finger
        name: String,
        /// How often each movement is to have been made in the end
        #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u8).range(1..))]
        trials: u8,
        /// All movements of the grid up to 1.26 N instead of the table's: to find out which tell textures apart
        #[arg(long)]
        pilot: bool,
        /// Where on the sample slides begin; drawn anew unless given
        #[arg(long)]
        seed: Option<u32>,
    },
    /// Tell the probe what it felt in its last exploration; it learns that
    Teach {
        #[command(flatten)]
        at: Where,
        /// What lies under the finger: a texture that it knows, or a new one
        name: String,
    },
    /// Give a texture of the probe another name
    Rename {
        #[command(flatten)]
        at: Where,
        /// Its name
        from: String,
        /// Its new name
        to: String,
    },
    /// Have the probe forget a texture, an unfinished training, or all that it learned by itself
    Forget {
        #[command(flatten)]
        at: Where,
        #[command(flatten)]
        what: What,
    },
    /// Record slides in the project's format, for `tactus learn` and `tactus evaluate`
    Record {
        #[command(flatten)]
        at: Where,
        /// The textures to record, in the order in which they are laid under the finger
        #[arg(required = true)]
        textures: Vec<String>,
        /// The folder to write; it must not hold recordings yet
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
        /// Slides of each texture; movements of the probe's table take turns
        #[arg(long, value_name = "N", default_value_t = 15, value_parser = clap::value_parser!(u8).range(1..=254))]
        slides: u8,
        /// Where on the sample slides begin; drawn anew unless given
        #[arg(long)]
        seed: Option<u32>,
    },
    /// Look at the probe's texture table, fetch it, give it another
    #[command(subcommand)]
    Table(TableCommand),
    /// Measure what differs from rig to rig, or show and set it
    #[command(after_help = "\
Examples:
  tactus device calibrate                   measures the motor's current without load; the date is today's
  tactus device calibrate --show            what is in use
  tactus device calibrate --drifted         for a finger that says in the air that it is not: forgets the old date first
  tactus device calibrate --newton-per-ampere 16.2 --force-mn-per-count 11.4
                                            also takes what was measured on an incline and on a scale")]
    Calibrate {
        #[command(flatten)]
        at: Where,
        #[command(flatten)]
        how: Constants,
    },
    /// End a fault and find the limit switches
    Home {
        #[command(flatten)]
        at: Where,
    },
    /// Stop what is being done and lift the finger
    Stop {
        #[command(flatten)]
        at: Where,
    },
    /// Flash a firmware image with probe-rs
    #[command(after_help = "\
Examples:
  tactus device flash target/debian/thumbv7em-none-eabihf/firmware/tactus-rig
  tactus device flash ELF -- --probe 0483:374b:SER   if there are several: `probe-rs list` names them
`cargo xtask flash` builds the firmware and flashes it.")]
    Flash(Flash),
    /// Look into the log of a session (--log)
    #[command(subcommand)]
    Log(LogCommand),
}

/// How to explore.
#[derive(Args, Clone)]
pub(crate) struct Exploration {
    #[command(flatten)]
    stop: Stop,
    /// How to decide and to choose the next movement; the best for the probe's table unless given
    #[arg(long, value_enum)]
    method: Option<Method>,
    /// The textures that it may be; all unless given
    #[arg(long, value_name = "T,T,...", value_delimiter = ',')]
    among: Vec<String>,
    /// It is one of the textures known: never answer that it is none
    #[arg(long)]
    closed: bool,
    /// Let the probe learn from an answer that it is certain of
    #[arg(long)]
    learn: bool,
    /// Where on the sample slides begin, and random choices; drawn anew unless given
    #[arg(long)]
    seed: Option<u32>,
}

#[derive(Args)]
#[group(required = true, multiple = false)]
pub(crate) struct What {
    /// A texture, whoever taught it
    #[arg(long, value_name = "NAME", id = "forgotten")]
    name: Option<String>,
    /// An unfinished training
    #[arg(long, value_name = "NAME")]
    training: Option<String>,
    /// All that the probe has learned by itself: its table is again as it was taught
    #[arg(long)]
    self_taught: bool,
}

#[derive(Subcommand)]
pub(crate) enum TableCommand {
    /// Print what the probe's table holds
    Show {
        #[command(flatten)]
        at: Where,
    },
    /// Write the probe's table to a file
    Pull {
        #[command(flatten)]
        at: Where,
        /// The file to write
        file: PathBuf,
    },
    /// Check a table, give it to the probe, and compare what it holds then
    Push {
        #[command(flatten)]
        at: Where,
        /// The table, as `tactus learn` or `table pull` wrote it
        file: PathBuf,
    },
    /// Go back to the table that came with the firmware
    Factory {
        #[command(flatten)]
        at: Where,
    },
}

#[derive(Args)]
pub(crate) struct Constants {
    /// Print what is in use, and change nothing
    #[arg(long, conflicts_with_all = ["drifted", "date", "newton_per_ampere", "force_mn_per_count"])]
    show: bool,
    /// The finger has drifted further than the probe believes: forget what P_DC was in the air, and measure it anew
    #[arg(long)]
    drifted: bool,
    /// The day of the calibration, as 20261121; today unless given
    #[arg(long, value_name = "YYYYMMDD", value_parser = clap::value_parser!(u32).range(20_000_101..=29_991_231))]
    date: Option<u32>,
    /// Shear per motor current, N/A, from pulls on an inclined stage
    #[arg(long, value_name = "X")]
    newton_per_ampere: Option<f32>,
    /// Contact force per count of P_DC, mN, from presses on a scale
    #[arg(long, value_name = "X")]
    force_mn_per_count: Option<f32>,
}

#[derive(Args)]
pub(crate) struct Flash {
    /// The image: what `cargo xtask build` names
    elf: PathBuf,
    /// Stay attached and show the image's log until Ctrl-C
    #[arg(long)]
    attach: bool,
    /// Print what would be run
    #[arg(long)]
    dry_run: bool,
    /// Options for probe-rs
    #[arg(last = true)]
    options: Vec<OsString>,
}

#[derive(Subcommand)]
pub(crate) enum LogCommand {
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

/// Does what is asked for.
pub(crate) fn run(device: &Device, out: &mut impl Write) -> anyhow::Result<()> {
    match device {
        Device::List => port::list(out)?,
        Device::Status { at, format } => {
            let (mut bench, status) = Bench::open(at)?;
            match format {
                Format::Json => {
                    serde_json::to_writer_pretty(&mut *out, &status)?;
                    writeln!(out)?;
                }
                Format::Text => {
                    let calibration = bench.run(Question::read_calibration(), |_| Ok(()))?;
                    show_status(&bench, &status, &calibration, out)?;
                }
            }
        }
        Device::Monitor { at, how } => {
            let (mut bench, status) = Bench::open(at)?;
            let names = bench.names()?;
            let wanted = how.wanted(&names)?;
            monitor::run(&mut bench, status, names, wanted)?;
        }
        Device::Identify { at, how } => {
            let (mut bench, _) = Bench::open(at)?;
            identify(&mut bench, how, out)?;
        }
        Device::Train {
            at,
            name,
            trials,
            pilot,
            seed,
        } => {
            let wanted = Train {
                name: name_of(name)?,
                trials: *trials,
                pilot: *pilot,
                seed: seed.unwrap_or_else(seed_of_now),
            };
            let (mut bench, _) = Bench::open(at)?;
            let slides = bench.run(Question::train(wanted), |report| trained(report, out))?;
            writeln!(out, "{name}: {slides} slides made.")?;
        }
        Device::Teach { at, name } => {
            let question = Question::answer(name_of(name)?);
            let (mut bench, _) = Bench::open(at)?;
            let taught = bench.run(question, |_| Ok(()))?;
            writeln!(
                out,
                "The probe has learned {} from {} slides.",
                taught.name, taught.slides
            )?;
        }
        Device::Rename { at, from, to } => {
            let question = Question::rename(name_of(from)?, name_of(to)?);
            let (mut bench, _) = Bench::open(at)?;
            bench.run(question, |_| Ok(()))?;
            writeln!(out, "{from} is {to} now.")?;
        }
        Device::Forget { at, what } => {
            let (what, said) = match what {
                What {
                    name: Some(name), ..
                } => (Forget::Texture(name_of(name)?), name.clone()),
                What {
                    training: Some(name),
                    ..
                } => (
                    Forget::Training(name_of(name)?),
                    format!("the training of {name}"),
                ),
                What { .. } => (Forget::SelfTaught, "what it learned by itself".to_owned()),
            };
            let (mut bench, _) = Bench::open(at)?;
            bench.run(Question::forget(what), |_| Ok(()))?;
            writeln!(out, "The probe has forgotten {said}.")?;
        }
        Device::Record {
            at,
            textures,
            out: folder,
            slides,
            seed,
        } => record(at, textures, folder, *slides, *seed, out)?,
        Device::Table(table) => run_table(table, out)?,
        Device::Calibrate { at, how } => calibrate(at, how, out)?,
        Device::Home { at } => {
            let (mut bench, _) = Bench::open(at)?;
            bench.run(Question::command(Ask::Home), |report| moved(report, out))?;
            writeln!(
                out,
                "Ready: lever and stage have found their limit switches."
            )?;
        }
        Device::Stop { at } => {
            let (mut bench, _) = Bench::open(at)?;
            match bench.lift() {
                BenchError::Stopped => {
                    writeln!(out, "Stopped: the finger is lifted and the stage stands.")?;
                }
                why => return Err(why.into()),
            }
        }
        Device::Flash(options) => flash(options, out)?,
        Device::Log(LogCommand::Replay { file }) => log::replay(file, out)?,
        Device::Log(LogCommand::Show { file }) => log::show(file, out)?,
    }
    Ok(())
}

fn name_of(name: &str) -> anyhow::Result<Name> {
    let name = name.trim();
    ensure!(!name.is_empty(), "a texture needs a name");
    Name::try_from(name).map_err(|_| {
        anyhow::anyhow!("{name:?} is longer than the 40 bytes that the probe keeps: shorten it")
    })
}

/// Another number every time.
fn seed_of_now() -> u32 {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    now.map_or(1, |now| now.as_secs() as u32 ^ now.subsec_nanos())
}

impl Exploration {
    /// The request, for a probe that knows these textures.
    fn wanted(&self, names: &[String]) -> anyhow::Result<Identify> {
        let mut among = Vec::new();
        for wanted in &self.among {
            let wanted = wanted.trim();
            let index = names.iter().position(|n| n.eq_ignore_ascii_case(wanted));
            let Some(index) = index else {
                bail!(
                    "--among {wanted}: the probe does not know it. It knows: {}",
                    names.join(", ")
                );
            };
            among.push(u16::try_from(index)?);
        }
        Ok(Identify {
            among: among.into_iter().collect(),
            threshold: self.stop.threshold,
            max_slides: self.stop.max_slides,
            method: self.method.map(Method::method),
            strategy: self.method.map(Method::strategy).unwrap_or_default(),
            open: !self.closed,
            learn: self.learn,
            seed: self.seed.unwrap_or_else(seed_of_now),
        })
    }
}

fn identify(bench: &mut Bench, how: &Exploration, out: &mut impl Write) -> anyhow::Result<()> {
    // it is in the log then, too
    let bytes = bench.table()?;
    let table = Table::read(&bytes)?;
    let names: Vec<String> = table.names().map(str::to_owned).collect();
    let wanted = how.wanted(&names)?;
    let among = match wanted.among.len() {
        0 => names.len(),
        among => among,
    };
    writeln!(
        out,
        "An unknown texture, one of {among} (seed {}).",
        wanted.seed
    )?;
    out.flush()?;
    // for the log: with its samples every slide can be felt again
    bench.run(Question::command(Ask::Stream(true)), |_| Ok(()))?;
    let mut show = Show::new(table, &mut *out);
    let found: Found = bench.run(Question::identify(wanted), |report| show.tell(&report.tell))?;
    bench.run(Question::command(Ask::Stream(false)), |_| Ok(()))?;
    if found.learned > 0 {
        writeln!(
            out,
            "It has learned from {} of these slides.",
            found.learned
        )?;
    }
    if found.asks {
        writeln!(
            out,
            "It is not certain. If you know what it is: tactus device teach NAME"
        )?;
    }
    let (damaged, missing) = bench.losses();
    if damaged + missing > 0 {
        writeln!(
            out,
            "On the line {damaged} frames were damaged and {missing} reports lost."
        )?;
    }
    Ok(())
}

/// What a training shows of a report.
fn trained(report: &Report, out: &mut impl Write) -> io::Result<()> {
    match &report.tell {
        Tell::Learned {
            movement,
            trial,
            left,
            felt,
        } => {
            let properties: Vec<String> = tactus_core::features::Property::ALL
                .into_iter()
                .filter_map(|p| Some(format!("{p} {:.3}", felt.properties().get(p)?)))
                .collect();
            writeln!(
                out,
                "trial {trial} of {movement}: {}; {left} to go",
                properties.join(", ")
            )?;
        }
        Tell::Rejected { why, .. } => writeln!(out, "rejected, and made again: {why}")?,
        _ => moved(report, out)?,
    }
    out.flush()
}

/// What a movement shows of a report: faults, and what they ask for.
fn moved(report: &Report, out: &mut impl Write) -> io::Result<()> {
    if let Tell::Fault(fault) = &report.tell {
        let recovery = fault.row().map_or("reset", |row| row.recovery);
        writeln!(out, "FAULT: {fault}. {recovery}: tactus device home")?;
        out.flush()?;
    }
    Ok(())
}

fn record(
    at: &Where,
    textures: &[String],
    folder: &Path,
    slides: u8,
    seed: Option<u32>,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let named = textures.iter().zip(1..).map(|(name, id)| Texture {
        id,
        name: name.trim().to_owned(),
    });
    // before anything moves
    let mut writer = RecordingWriter::create(folder, named.collect())?;
    let (mut bench, _) = Bench::open(at)?;
    let calibration = bench.run(Question::read_calibration(), |_| Ok(()))?;
    bench.run(Question::command(Ask::Stream(true)), |_| Ok(()))?;
    let mut written = 0;
    for (index, name) in textures.iter().enumerate() {
        if textures.len() > 1 {
            let prompt = format!("Lay {name} under the finger and press Enter: ");
            wait_for_enter(bench.interrupt(), &prompt)?;
        }
        // never sure: all slides are made
        let wanted = Identify {
            among: Default::default(),
            threshold: 1.0,
            max_slides: slides,
            method: None,
            strategy: Strategy::Cycling,
            open: false,
            learn: false,
            seed: seed.unwrap_or_else(seed_of_now),
        };
        let mut recorder = Recorder::new(calibration.pressure);
        let mut lost = Vec::new();
        let mut kept = Vec::new();
        bench.run(Question::identify(wanted), |report| {
            match recorder.hear(index, report) {
                Some(Ok(slide)) => {
                    writeln!(
                        out,
                        "{name}, slide {} of {slides}: {}",
                        slide.number, slide.movement
                    )?;
                    kept.push(slide);
                }
                Some(Err(why)) => lost.push(why),
                None => moved(report, out)?,
            }
            out.flush()
        })?;
        for slide in &kept {
            writer.write(slide)?;
            written += 1;
        }
        for why in &lost {
            writeln!(out, "{name}: a slide is not recorded: {why}")?;
        }
        ensure!(
            !kept.is_empty(),
            "{name}: no slide arrived whole; check the cable, then record again"
        );
    }
    bench.run(Question::command(Ask::Stream(false)), |_| Ok(()))?;
    writer.finish()?;
    writeln!(
        out,
        "{}: {written} slides of {} textures. Next: tactus features --recordings {0}",
        folder.display(),
        textures.len()
    )?;
    Ok(())
}

fn run_table(command: &TableCommand, out: &mut impl Write) -> anyhow::Result<()> {
    match command {
        TableCommand::Show { at } => {
            let (mut bench, status) = Bench::open(at)?;
            let bytes = bench.table()?;
            let whose = if status.factory {
                "came with the firmware"
            } else {
                "was given to the probe or taught to it"
            };
            writeln!(out, "The table {whose}.")?;
            show_table(Table::read(&bytes)?, out)?;
        }
        TableCommand::Pull { at, file } => {
            let (mut bench, _) = Bench::open(at)?;
            let bytes = bench.table()?;
            write_table(file, &bytes)?;
            let table = Table::read(&bytes)?;
            writeln!(
                out,
                "{}: {} textures, {} bytes, checksum {:08x}",
                file.display(),
                table.textures(),
                bytes.len(),
                table.crc()
            )?;
        }
        TableCommand::Push { at, file } => {
            let mut bytes = Vec::new();
            let table = read_table(file, &mut bytes)?;
            let push =
                PushTable::new(table.as_bytes()).with_context(|| file.display().to_string())?;
            let (mut bench, _) = Bench::open(at)?;
            bench.run(push, |_| Ok(()))?;
            // not what was sent counts, but what the probe uses from now on
            let status = bench.run(Question::status(), |_| Ok(()))?;
            ensure!(
                status.table_crc == table.crc(),
                "the probe uses the table {:08x} and not {:08x}, the one pushed: push it again",
                status.table_crc,
                table.crc()
            );
            writeln!(
                out,
                "{}: the probe uses it now: {} textures, checksum {:08x}",
                file.display(),
                status.textures,
                status.table_crc
            )?;
        }
        TableCommand::Factory { at } => {
            let (mut bench, _) = Bench::open(at)?;
            bench.run(Question::command(Ask::FactoryTable), |_| Ok(()))?;
            let status = bench.run(Question::status(), |_| Ok(()))?;
            writeln!(
                out,
                "The probe uses the firmware's own table: {} textures, checksum {:08x}",
                status.textures, status.table_crc
            )?;
        }
    }
    Ok(())
}

fn calibrate(at: &Where, how: &Constants, out: &mut impl Write) -> anyhow::Result<()> {
    let (mut bench, _) = Bench::open(at)?;
    let mut calibration: RigCalibration = bench.run(Question::read_calibration(), |_| Ok(()))?;
    if how.show {
        return Ok(show_calibration(&calibration, out)?);
    }
    if how.drifted {
        calibration.date = 0;
        bench.run(Question::write_calibration(&calibration)?, |_| Ok(()))?;
        bench.run(Question::command(Ask::Home), |report| moved(report, out))?;
    }
    writeln!(out, "Measuring the motor's current without load ...")?;
    out.flush()?;
    calibration = bench.run(Question::calibrate(), |report| moved(report, out))?;
    calibration.date = how.date.unwrap_or_else(today);
    if let Some(newton_per_ampere) = how.newton_per_ampere {
        calibration.newton_per_ampere = newton_per_ampere;
    }
    if let Some(force_mn_per_count) = how.force_mn_per_count {
        calibration.pressure.force_mn_per_count = force_mn_per_count;
    }
    bench.run(Question::write_calibration(&calibration)?, |_| Ok(()))?;
    let kept = bench.run(Question::read_calibration(), |_| Ok(()))?;
    ensure!(
        kept == calibration,
        "the probe keeps other constants than it was given: calibrate again"
    );
    show_calibration(&kept, out)?;
    Ok(())
}

fn today() -> u32 {
    let today = time::OffsetDateTime::now_utc().date();
    let year = u32::try_from(today.year()).unwrap_or(0);
    year * 10_000 + u32::from(u8::from(today.month())) * 100 + u32::from(today.day())
}

fn show_calibration(c: &RigCalibration, out: &mut impl Write) -> io::Result<()> {
    let p = &c.pressure;
    let date = match c.date {
        0 => "never: constants that nobody measured".to_owned(),
        date => format!(
            "{}-{:02}-{:02}",
            date / 10_000,
            date / 100 % 100,
            date % 100
        ),
    };
    let serial = String::from_utf8_lossy(&c.serial);
    let serial = serial.trim_matches('\0');
    writeln!(out, "calibrated      {date}")?;
    writeln!(
        out,
        "sensor          {}",
        if serial.is_empty() {
            "not known"
        } else {
            serial
        }
    )?;
    writeln!(
        out,
        "P_DC            {:.1} counts in the air",
        p.pdc_no_contact
    )?;
    writeln!(
        out,
        "force           {:.2} mN per count",
        p.force_mn_per_count
    )?;
    writeln!(
        out,
        "motor current   {:.1} mA + {:.3} mA per mm/s without load",
        c.unloaded_a.0 * 1e3,
        c.unloaded_a.1 * 1e3
    )?;
    writeln!(
        out,
        "shear           {:.2} N/A above that",
        c.newton_per_ampere
    )
}

fn show_status(
    bench: &Bench,
    status: &Status,
    calibration: &RigCalibration,
    out: &mut impl Write,
) -> io::Result<()> {
    writeln!(out, "probe           at {}", bench.name)?;
    writeln!(out, "rig             {}", phase_name(status.phase))?;
    if let Some(fault) = status.fault {
        let recovery = fault.row().map_or("reset", |row| row.recovery);
        writeln!(
            out,
            "FAULT           {fault}: {recovery} (tactus device home)"
        )?;
    }
    writeln!(
        out,
        "table           {} textures, {} bytes, checksum {:08x}{}",
        status.textures,
        status.table_bytes,
        status.table_crc,
        if status.factory {
            ", the firmware's own"
        } else {
            ""
        }
    )?;
    let counts = &status.counts;
    writeln!(
        out,
        "acquisition     {} slots; {} late, {} parity errors, {} error frames, {} samples lost",
        counts.slots,
        counts.late_slots,
        counts.parity_errors,
        counts.error_frames,
        counts.lost_samples
    )?;
    let (damaged, missing) = bench.losses();
    writeln!(
        out,
        "link            {} reports found no room, {} requests damaged; here {damaged} frames damaged, {missing} reports lost",
        counts.lost_reports, counts.damaged_frames
    )?;
    writeln!(
        out,
        "skin            {:.1} J of sliding, {:.1} J of it wear",
        f64::from(status.skin_mj.0) * 1e-3,
        f64::from(status.skin_mj.1) * 1e-3
    )?;
    show_calibration(calibration, out)
}

/// What the rig does, in a word.
fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Parked => "parked: does not know where it is",
        Phase::Homing => "homing",
        Phase::Ready => "ready",
        Phase::Positioning => "positioning",
        Phase::Pressing => "pressing",
        Phase::Background => "background",
        Phase::Sliding => "sliding",
        Phase::Lifting => "lifting",
        Phase::Unloaded => "unloaded run",
        Phase::Faulted => "faulted",
    }
}

/// The chip's name in probe-rs.
const CHIP: &str = "STM32F429ZITx";

fn flash(options: &Flash, out: &mut impl Write) -> anyhow::Result<()> {
    ensure!(
        options.dry_run || options.elf.is_file(),
        "{}: no such file; `cargo xtask build` builds the firmware and names it",
        options.elf.display()
    );
    if !options.dry_run {
        look_for_probe("probe-rs")?;
    }
    for mut command in flash_commands(options) {
        let words = std::iter::once(command.get_program()).chain(command.get_args());
        let words: Vec<_> = words.map(|word| word.to_string_lossy()).collect();
        writeln!(out, "{}", words.join(" "))?;
        out.flush()?;
        if !options.dry_run {
            let status = command.status().context("probe-rs does not start")?;
            ensure!(
                status.success(),
                "probe-rs ended with {status}: is the board's USB plug at CN1, and no other program at its probe? LD4 must be lit"
            );
        }
    }
    Ok(())
}

/// What is run: an image to attach to is watched, others are left alone.
fn flash_commands(options: &Flash) -> Vec<Command> {
    let probe_rs = |verb: &str| {
        let mut command = Command::new("probe-rs");
        command.args([verb, "--chip", CHIP]).args(&options.options);
        command
    };
    if options.attach {
        let mut run = probe_rs("run");
        run.arg(&options.elf);
        vec![run]
    } else {
        let mut download = probe_rs("download");
        download.arg("--verify").arg(&options.elf);
        vec![download, probe_rs("reset")]
    }
}

/// That the program is here, and a debug probe.
fn look_for_probe(program: &str) -> anyhow::Result<()> {
    let list = match Command::new(program).arg("list").output() {
        Err(e) if e.kind() == io::ErrorKind::NotFound => bail!(
            "probe-rs is not installed. Install it with
  cargo install probe-rs-tools --locked
or as https://probe.rs/docs/getting-started/installation says. Without it: cargo xtask bundle, and see FLASHING.md there"
        ),
        list => list.context("probe-rs does not start")?,
    };
    let said = String::from_utf8_lossy(&list.stdout);
    ensure!(
        list.status.success() && !said.contains("No debug probes"),
        "no debug probe found. Plug the board's USB socket CN1 into this PC. On Linux the user needs the right to use it:
https://probe.rs/docs/getting-started/probe-setup (udev rules)"
    );
    Ok(())
}
