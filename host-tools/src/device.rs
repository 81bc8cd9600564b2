//! `tactus device`: the probe at the other end of the serial link, and everything that is done with it at the bench.

mod bench;
mod cli;
mod log;
mod monitor;
mod port;
mod record;

use std::io::{self, Write};
use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, bail, ensure};
use tactus::evaluate::Method;
use tactus::link::{Found, PushTable, Question};
use tactus::recordings::{RecordingWriter, Texture};
use tactus::show::{Show, show_table};
use tactus_core::explorer::Strategy;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::table::Table;
use tactus_core::wire::{Ask, Forget, Identify, Name, Phase, Report, Status, Tell, Train};

use crate::cli::Format;
use crate::commands::{read_table, write_table};
pub(crate) use bench::BenchError;
use bench::{Bench, wait_for_enter};
use cli::{Constants, Exploration, Flash, LogCommand, TableCommand, What};
pub(crate) use cli::{Device, EXAMPLES};
use port::Where;
use record::Recorder;

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
