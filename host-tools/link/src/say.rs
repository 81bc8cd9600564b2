//! Sentences about a probe and operations on it: those of `tactus device` and of the page.

use std::io::{self, Write};

use tactus_core::features::Property;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::most_mn;
use tactus_core::sensor::pressure::Calibration;
use tactus_core::table::{Name, NameError, Table, valid_name};
use tactus_core::wire::{Event, Forget, Phase, Prompt, Report, Status};

use super::operations::Settings;
use super::request::Identified;

/// A number of things: "1 movement", "3 movements".
pub fn count(number: impl Into<u64>, thing: &str) -> String {
    match number.into() {
        1 => format!("1 {thing}"),
        number => format!("{number} {thing}s"),
    }
}

/// A share as people write it: "30 %", "99.9 %".
pub fn percent(share: f64) -> String {
    let percent = format!("{:.4}", share * 100.0);
    format!("{} %", percent.trim_end_matches('0').trim_end_matches('.'))
}

/// The same to a tenth of a per cent, for what is estimated.
pub fn about_percent(share: f64) -> String {
    percent((share * 1000.0).round() / 1000.0)
}

/// A day as messages, tables and recordings have it, in words; nothing for 0.
pub fn day(date: u32) -> Option<String> {
    let (year, month, day) = (date / 10_000, date / 100 % 100, date % 100);
    (date != 0).then(|| format!("{year}-{month:02}-{day:02}"))
}

/// The requests of a handheld probe to the person who holds it: each once, although the probe repeats it.
#[derive(Debug, Default)]
pub struct Prompts(Option<Prompt>);

impl Prompts {
    /// Prints what the person is asked to do, or a fault and its recovery, if the report is one of these.
    pub fn show(&mut self, report: &Report, out: &mut impl Write) -> io::Result<()> {
        match &report.event {
            Event::Prompt(prompt) if self.0.replace(*prompt) != Some(*prompt) => {
                writeln!(out, "the display says: {prompt}")?;
            }
            Event::Fault(fault) => {
                let recovery = fault.recovery();
                writeln!(out, "FAULT: {fault}. {recovery}: tactus device home")?;
            }
            Event::Trouble(why) => writeln!(out, "trouble: {why}")?,
            _ => return Ok(()),
        }
        out.flush()
    }
}

pub(crate) fn status_rows(
    name: &str,
    status: &Status,
    calibration: &RigCalibration,
    (damaged, missing): (u64, u64),
) -> Vec<(&'static str, String)> {
    let (joule, wear) = status.skin_mj;
    let [joule, wear] = [joule, wear].map(|mj| f64::from(mj) * 1e-3);
    let mut rows = vec![
        ("probe", format!("at {name}")),
        ("finger", status.finger.to_string()),
        ("rig", phase_name(status.phase).to_owned()),
    ];
    if let Some(fault) = &status.fault {
        let fault = format!("{fault}: {} (tactus device home)", fault.recovery());
        rows.push(("FAULT", fault));
    }
    let whose = if status.factory {
        ", the firmware's own"
    } else {
        ""
    };
    let counts = &status.counts;
    rows.extend([
        (
            "table",
            format!(
                "{}, {} bytes, checksum {:08x}{whose}",
                count(status.textures, "texture"),
                status.table_bytes,
                status.table_crc
            ),
        ),
        (
            "acquisition",
            format!(
                "{}; {} late, {}, {}, {} lost",
                count(counts.slots, "slot"),
                counts.late_slots,
                count(counts.parity_errors, "parity error"),
                count(counts.error_frames, "error frame"),
                count(counts.lost_samples, "sample")
            ),
        ),
        (
            "link",
            format!(
                "probe: {} dropped, {} damaged; PC: {} damaged, {} lost",
                count(counts.lost_reports, "report"),
                count(counts.damaged_frames, "request"),
                count(damaged, "frame"),
                count(missing, "report")
            ),
        ),
        (
            "flash",
            format!(
                "{} erased since the start",
                count(counts.erasures, "sector")
            ),
        ),
        (
            "skin",
            format!("{joule:.1} J of sliding, {wear:.1} J of it wear"),
        ),
    ]);
    rows.push(("limits", limits(status.false_alarm)));
    if status.high_force {
        rows.push(("HIGH FORCE", movements(true)));
    }
    rows.extend(calibration_rows(calibration));
    rows
}

/// A text that names no texture.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the name {name:?} {why}")]
pub struct InvalidName {
    name: String,
    why: NameError,
}

/// The name of a texture as the probe keeps it.
pub fn name_of(name: &str) -> Result<Name, InvalidName> {
    let name = name.trim();
    valid_name(name).map_err(|why| InvalidName {
        name: name.to_owned(),
        why,
    })
}

/// The false alarms that the probe's limits are for.
pub fn limits(false_alarm: Option<f32>) -> String {
    match false_alarm {
        Some(share) => format!(
            "for {} false alarms, as set (tactus device settings)",
            percent(share.into())
        ),
        None => "for the table's own false alarms".to_owned(),
    }
}

/// The force that movements may press with.
pub fn movements(high_force: bool) -> String {
    let most_n = f32::from(most_mn(high_force)) * 1e-3;
    let set = if high_force {
        ", as set: keep the mount that yields, or the stop (tactus device settings)"
    } else {
        ""
    };
    format!("up to {most_n:.2} N{set}")
}

/// Facts that a person must know who turns high forces on.
pub(crate) const HIGH_FORCE: &str = "\
With high forces on, movements may press with up to 2 N, and the guard acts at 2.1 N by P_DC. Above 2 N the skin lies
on the finger's core, and P_DC no longer tells the force; where P_DC says too little, or the skin is torn, the lever
presses on. What keeps the finger whole then is no program: a mount whose spring yields (preloaded to
2.05 N, 0.009 N/mm), or a hard stop that the lever cannot push beyond 2.2 N. The usual mount, of 1.45 N, yields before
2 N are reached.

A rig on a board with a button allows it only when that is pressed (the blue one, within 30 s of your answer): a person
is there then. Where there is no button, the link suffices: whoever has it may allow high forces.";
/// The question to such a person.
pub(crate) const YIELDS: &str = "Does the finger's mount yield, or does a stop hold the lever?";

pub(crate) fn show_settings(settings: &Settings, out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "The probe's limits are {}.",
        limits(settings.false_alarm)
    )?;
    match settings.table_false_alarm {
        Some(share) => writeln!(out, "Its table was learned for {}.", percent(share.into()))?,
        None => writeln!(
            out,
            "Its table has no limits: learn it again, with --method fused."
        )?,
    }
    writeln!(
        out,
        "A rig's movements press with {}.",
        movements(settings.high_force)
    )
}

/// The things that the probe is to forget, in words.
pub fn forgotten(what: &Forget) -> String {
    match what {
        Forget::Texture(name) => name.to_string(),
        Forget::Training(name) => format!("the training of {name}"),
        Forget::SelfLearned => "what it learned by itself".to_owned(),
    }
}

pub(crate) fn move_sample(name: &str) -> String {
    format!("Move or turn {name} under the finger, so that the next slide is on another track")
}

/// The reason why a note on the sample is not in the table.
pub fn not_noted(why: &str) -> String {
    format!("Whether the sample was moved is not noted in the table: {why}")
}

pub(crate) fn uses_factory(now: &Status) -> String {
    let (textures, crc) = (count(now.textures, "texture"), now.table_crc);
    format!("The probe uses the firmware's own table: {textures}, checksum {crc:08x}")
}

/// The rig's phase in a word.
pub fn phase_name(phase: Phase) -> &'static str {
    match phase {
        Phase::Parked => "parked: position not known, home it first",
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

pub(crate) fn calibration_rows(c: &RigCalibration) -> Vec<(&'static str, String)> {
    let (offset_ma, slope_ma) = (c.unloaded_a.0 * 1e3, c.unloaded_a.1 * 1e3);
    let motor = format!("{offset_ma:.1} mA + {slope_ma:.3} mA per mm/s without load");
    let mn = c.pressure.force_mn_per_count;
    let whose = if mn == Calibration::PAPER.force_mn_per_count {
        "the paper's "
    } else {
        ""
    };
    let air = if c.air_known {
        ""
    } else {
        ", which nobody measured"
    };
    let mut rows = vec![
        (
            "force scale",
            match date(c) {
                None => format!("not measured ({whose}{mn:.1} mN a count)"),
                Some(day) => format!("{mn:.2} mN a count, measured on {day}"),
            },
        ),
        (
            "sensor",
            sensor(c).unwrap_or_else(|| "not known".to_owned()),
        ),
        (
            "P_DC",
            format!("{:.1} counts in the air{air}", c.pressure.pdc_no_contact),
        ),
        ("motor current", motor),
        (
            "shear",
            format!("{:.2} N/A above that", c.newton_per_ampere),
        ),
    ];
    if let Some(day) = turned(c) {
        let mg = c.pressure.pac_pa_per_count;
        rows.push((
            "accelerometer",
            format!("{mg:.4} mg a count, turned over on {day}"),
        ));
    }
    rows
}

pub(crate) fn show_rows(rows: &[(&str, String)], out: &mut impl Write) -> io::Result<()> {
    rows.iter()
        .try_for_each(|(name, value)| writeln!(out, "{name:<15} {value}"))
}

/// The day of the force scale, "2026-11-21"; nothing for a scale that was not measured.
pub fn date(c: &RigCalibration) -> Option<String> {
    day(c.scale_day()?)
}

/// The day on which its accelerometer was turned over, in the same way.
pub fn turned(c: &RigCalibration) -> Option<String> {
    day(c.turned)
}

/// The sensor's serial number.
pub fn sensor(c: &RigCalibration) -> Option<String> {
    let serial = String::from_utf8_lossy(&c.serial);
    let serial = serial.trim_matches('\0');
    (!serial.is_empty()).then(|| serial.to_owned())
}

/// Prints what follows an exploration: what the probe learned, what it asks, and the frames and reports that were
/// damaged or lost.
pub(crate) fn show_identified(
    identified: &Identified,
    (damaged, missing): (u64, u64),
    mut out: impl Write,
) -> io::Result<()> {
    if identified.learned > 0 {
        writeln!(
            out,
            "It has learned from {} of these slides.",
            identified.learned
        )?;
    }
    if identified.verdict.wants_label {
        writeln!(
            out,
            "It is not certain. If you know what it is: tactus device teach NAME"
        )?;
    }
    if damaged + missing > 0 {
        writeln!(
            out,
            "Damaged or lost on the line: {} and {}.",
            count(damaged, "frame"),
            count(missing, "report")
        )?;
    }
    Ok(())
}

pub(crate) fn show_training(
    report: &Report,
    prompts: &mut Prompts,
    out: &mut impl Write,
) -> io::Result<()> {
    match &report.event {
        Event::TrainingSlide {
            movement,
            trial,
            left,
            observed,
        } => {
            let value = |p: Property| Some(format!("{p} {:.3}", observed.properties().get(p)?));
            let properties: Vec<String> = Property::ALL.into_iter().filter_map(value).collect();
            let properties = properties.join(", ");
            writeln!(
                out,
                "trial {trial} of {movement}: {properties}; {left} to go"
            )?;
        }
        Event::Rejected { why, .. } => writeln!(out, "rejected, and repeated: {why}")?,
        _ => prompts.show(report, out)?,
    }
    out.flush()
}

/// Prints what a verification shows of a report that judges no slide.
pub fn show_verifying(
    report: &Report,
    prompts: &mut Prompts,
    out: &mut impl Write,
) -> io::Result<()> {
    match &report.event {
        Event::Rejected { why, .. } => writeln!(out, "  rejected, and repeated: {why}"),
        _ => prompts.show(report, out),
    }
}

pub(crate) fn of_sample(moved: Option<bool>) -> &'static str {
    match moved {
        Some(true) => "Its sample was moved between trials.",
        Some(false) => {
            "Its sample was not moved: slides on the same track say little about a texture. More trials elsewhere on \
                 it would help."
        }
        None => {
            "The table does not know whether its sample was moved between all trials (--moved and --same-spot say so)."
        }
    }
}

/// The textures of a table that are not in another, which takes its place.
pub fn replaced(old: &Table<'_>, new: Option<&Table<'_>>) -> String {
    let lost: Vec<&str> = (0..old.textures())
        .filter_map(|texture| old.name(texture))
        .filter(|name| new.is_none_or(|new| new.find(name).is_none()))
        .collect();
    let all = match old.textures() {
        1 => "the texture".to_owned(),
        n => count(n, "texture"),
    };
    match lost.as_slice() {
        [] => {
            format!("The probe's table of {all} is replaced; all their names are in the new one.")
        }
        names => format!(
            "The probe's table of {all} is replaced. No longer known: {}.",
            names.join(", ")
        ),
    }
}
