//! `tactus device doctor`: whether PC, line, probe and table are fit for work, and what to do where they are not.

use std::io::Write;
use std::time::Instant;

use anyhow::ensure;
use serde::Serialize;
use tactus_core::rig::Fault;
use tactus_core::rig::skin::WARN_J;
use tactus_core::table::Table;
use tactus_core::wire::{Command, Status};
use tactus_lab::eval::show::{count, day};
use tactus_link::Request;
use tactus_link::line::LineError;
use time::{Date, Month, OffsetDateTime};

use super::bench::{Bench, BenchError};
use super::line::Where;
use crate::cmd::output::{Format, print_json};

/// Check PC, port, probe and table, and say what to do about each fault
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device doctor
  tactus device doctor --port /dev/ttyACM1
  tactus device doctor --format json > doctor.json    to send to somebody

Nothing moves. The probe writes one of its settings again, as it is, to show that its store works. Exit code: 0 if
nothing is wrong, 1 otherwise; what is only worth a look leaves 0.")]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    /// How to print it
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

const LOOKS: usize = 20;
/// A load cell drifts, and a BioTac loses water, in half a year.
const OLD_DAYS: i64 = 180;
/// Damaged words of all words: the firmware's own limit within a second.
const MAX_DAMAGED: f64 = 0.005;

#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
enum State {
    Good,
    /// Worth a look; nothing is wrong with it.
    Look,
    Bad,
}

#[derive(Serialize)]
struct Check {
    name: &'static str,
    state: State,
    saw: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    remedy: Option<String>,
}

/// The output of `device doctor --format json`.
#[derive(Default, Serialize)]
struct Checks {
    checks: Vec<Check>,
}

impl Checks {
    fn good(&mut self, name: &'static str, saw: String) {
        self.add(name, State::Good, saw, None);
    }

    fn look(&mut self, name: &'static str, saw: String, remedy: impl Into<String>) {
        self.add(name, State::Look, saw, Some(remedy.into()));
    }

    fn bad(&mut self, name: &'static str, saw: String, remedy: impl Into<String>) {
        self.add(name, State::Bad, saw, Some(remedy.into()));
    }

    fn add(&mut self, name: &'static str, state: State, saw: String, remedy: Option<String>) {
        self.checks.push(Check {
            name,
            state,
            saw,
            remedy,
        });
    }

    fn print(&self, out: &mut impl Write) -> anyhow::Result<()> {
        for check in &self.checks {
            let state = match check.state {
                State::Good => "good",
                State::Look => "look",
                State::Bad => "BAD",
            };
            writeln!(out, "{state:<5} {:<12} {}", check.name, check.saw)?;
            for line in check.remedy.iter().flat_map(|remedy| remedy.lines()) {
                writeln!(out, "                   {line}")?;
            }
        }
        Ok(())
    }
}

pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let mut checks = Checks::default();
    let examined = match Bench::open(&args.at, args.format) {
        Ok((mut bench, status)) => examine(&mut bench, &status, &mut checks),
        Err(why) => Err(why),
    };
    match examined {
        Ok(()) => {}
        Err(why) if why.is_interrupt() => return Err(why.into()),
        Err(why) => unreached(&why, &mut checks),
    }
    match args.format {
        Format::Text => checks.print(out)?,
        Format::Json => print_json(&checks, out)?,
    }
    let bad = checks
        .checks
        .iter()
        .filter(|check| check.state == State::Bad);
    let bad = bad.count() as u64;
    ensure!(bad == 0, "{} failed", count(bad, "check"));
    Ok(())
}

/// Says why the probe is not reached, and what to do.
fn unreached(why: &BenchError, checks: &mut Checks) {
    match why {
        BenchError::Open(why) => {
            let remedy = match why {
                LineError::Denied(_) => UDEV,
                _ => "is the board plugged in, and lit (LD4)?",
            };
            checks.bad("port", why.to_string(), remedy);
        }
        _ => checks.bad(
            "probe",
            why.to_string(),
            "then `tactus device doctor` again",
        ),
    }
}

const UDEV: &str = "\
or, for all who sit at this PC, a rule for udev:
  echo 'SUBSYSTEM==\"tty\", ATTRS{idVendor}==\"0483\", TAG+=\"uaccess\"' | sudo tee /etc/udev/rules.d/70-tactus.rules
  sudo udevadm control --reload && sudo udevadm trigger";

fn examine(bench: &mut Bench, status: &Status, checks: &mut Checks) -> Result<(), BenchError> {
    checks.good("port", bench.name.clone());
    line(bench, checks)?;
    match status.fault {
        Some(fault) => checks.bad("rig", fault.to_string(), remedy(fault)),
        None => checks.good("rig", "no fault".to_owned()),
    }
    acquisition(status, checks);
    table(bench, status, checks)?;
    force_scale(status.calibrated, OffsetDateTime::now_utc().date(), checks);
    let wear_j = status.skin_mj.1 as f32 * 1e-3;
    let worn = format!("{wear_j:.1} of {WARN_J:.0} J of wear");
    if wear_j < WARN_J {
        checks.good("skin", worn);
    } else {
        let remedy = "replace the skin, then `tactus device refresh`";
        checks.bad("skin", worn, remedy);
    }
    // as it is, so that nothing changes but its place in the flash
    let again = Command::SetFalseAlarm(status.false_alarm);
    match bench.get(Request::command(again)) {
        Ok(()) => checks.good("store", "a setting was written again".to_owned()),
        Err(BenchError::Operation(why)) if why.refusal().is_none() => return Err(why.into()),
        Err(why) => {
            let remedy = "pull the table (`tactus device table pull FILE`), flash the firmware again, push the table";
            checks.bad("store", why.to_string(), remedy);
        }
    }
    Ok(())
}

fn remedy(fault: Fault) -> String {
    format!("{} (`tactus device home`)", fault.recovery())
}

/// Checks the time of an answer, and what was lost.
fn line(bench: &mut Bench, checks: &mut Checks) -> Result<(), BenchError> {
    let mut taken = Vec::new();
    for _ in 0..LOOKS {
        let asked = Instant::now();
        bench.get(Request::status())?;
        taken.push(asked.elapsed());
    }
    taken.sort_unstable();
    let median = taken.get(taken.len() / 2).copied().unwrap_or_default();
    let longest = taken.last().copied().unwrap_or_default();
    let (damaged, missing) = bench.probe.losses();
    let seen = format!(
        "an answer takes {:.1} ms, at most {:.1}; {} damaged, {} lost",
        median.as_secs_f64() * 1e3,
        longest.as_secs_f64() * 1e3,
        count(damaged, "frame"),
        count(missing, "report"),
    );
    if damaged + missing == 0 {
        checks.good("line", seen);
    } else {
        let remedy = "another cable, no hub between, nothing else at this port";
        checks.bad("line", seen, remedy);
    }
    Ok(())
}

fn acquisition(status: &Status, checks: &mut Checks) {
    let counts = &status.counts;
    let damaged = u64::from(counts.parity_errors) + u64::from(counts.error_frames);
    let share = damaged as f64 / f64::from(counts.slots.max(1));
    let seen = format!(
        "{}, {} damaged, {} late, {} lost",
        count(counts.slots, "word"),
        damaged,
        counts.late_slots,
        count(counts.lost_samples, "sample"),
    );
    if counts.slots == 0 || share > MAX_DAMAGED {
        let remedy =
            "cable, ground and supply of the sensor; `tactus device bringup` looks at each";
        checks.bad("sensor", seen, remedy);
    } else if damaged > 0 || counts.late_slots > 0 || counts.lost_samples > 0 {
        let remedy = "slides with lost words did not count; does the number grow?";
        checks.look("sensor", seen, remedy);
    } else {
        checks.good("sensor", seen);
    }
}

fn table(bench: &mut Bench, status: &Status, checks: &mut Checks) -> Result<(), BenchError> {
    let bytes = match bench.table() {
        Err(why) if why.is_interrupt() => return Err(why),
        read => read.map_err(|why| why.to_string()),
    };
    let table = match &bytes {
        Ok(bytes) => Table::read(bytes).map_err(|why| why.to_string()),
        Err(why) => Err(why.clone()),
    };
    let table = match table {
        Ok(table) => table,
        Err(why) => {
            checks.bad("table", why, "`tactus device table factory`, or push one");
            return Ok(());
        }
    };
    let textures = count(table.textures(), "texture");
    let seen = format!("{textures}, finger {}", table.finger());
    if let Err(why) = table.of_finger(status.finger) {
        checks.bad("table", why.to_string(), "push a table of this finger");
    } else if status.factory {
        let remedy = "it was learned in a simulation, from no real finger: train textures, or push a table of your own";
        checks.look("table", format!("{seen}, the firmware's own"), remedy);
    } else if table.calibrated() != status.calibrated {
        let of = |date| day(date).unwrap_or_else(|| "no scale".to_owned());
        let seen = format!(
            "{seen}, learned by the force scale of {}, and the probe's is of {}",
            of(table.calibrated()),
            of(status.calibrated)
        );
        let remedy = "`tactus device refresh` moves it to this scale";
        checks.look("table", seen, remedy);
    } else {
        checks.good("table", seen);
    }
    Ok(())
}

/// The day that a message means by 20261121.
fn date(of: u32) -> Option<Date> {
    let month = Month::try_from(u8::try_from(of / 100 % 100).ok()?).ok()?;
    let year = i32::try_from(of / 10_000).ok()?;
    Date::from_calendar_date(year, month, u8::try_from(of % 100).ok()?).ok()
}

fn force_scale(calibrated: u32, today: Date, checks: &mut Checks) {
    const REMEDY: &str = "`tactus device calibrate --weights 30g,60g,90g,120g,150g`";
    match (day(calibrated), date(calibrated)) {
        (None, _) => checks.look(
            "force scale",
            "the paper's, not measured".to_owned(),
            REMEDY,
        ),
        (Some(_), None) => checks.good("force scale", "measured; nobody knew the day".to_owned()),
        (Some(day), Some(date)) => {
            let days = (today - date).whole_days();
            let seen = format!("measured on {day}");
            if days > OLD_DAYS {
                checks.look("force scale", format!("{seen}, {days} days ago"), REMEDY);
            } else if days < -1 {
                checks.bad(
                    "force scale",
                    format!("{seen}, which is to come"),
                    "set this PC's clock",
                );
            } else {
                checks.good("force scale", seen);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use tactus_core::wire::Counts;

    use super::*;

    fn states(checks: &Checks) -> Vec<State> {
        checks.checks.iter().map(|check| check.state).collect()
    }

    #[test]
    fn a_force_scale_grows_old() {
        let today = Date::from_calendar_date(2026, Month::November, 26).unwrap();
        let mut checks = Checks::default();
        for calibrated in [0, 1, 20_261_126, 20_260_601, 20_260_528, 20_271_001] {
            force_scale(calibrated, today, &mut checks);
        }
        use State::{Bad, Good, Look};
        assert_eq!(states(&checks), [Look, Good, Good, Good, Look, Bad]);
    }

    #[test]
    fn words_that_are_damaged_now_and_then_are_worth_a_look() {
        let with = |slots, parity_errors, lost_samples| {
            let counts = Counts {
                slots,
                parity_errors,
                lost_samples,
                ..Counts::default()
            };
            let status = Status {
                phase: tactus_core::wire::Phase::Ready,
                counts,
                ..Status::default()
            };
            let mut checks = Checks::default();
            acquisition(&status, &mut checks);
            checks.checks[0].state
        };
        assert_eq!(with(1000, 0, 0), State::Good);
        assert_eq!(with(1000, 5, 0), State::Look);
        assert_eq!(with(1000, 0, 1), State::Look);
        assert_eq!(with(1000, 6, 0), State::Bad);
        assert_eq!(with(0, 0, 0), State::Bad);
    }

    #[test]
    fn a_port_that_may_not_be_opened_has_a_rule_for_udev() {
        let mut checks = Checks::default();
        let why = LineError::Denied("/dev/ttyACM0".into());
        unreached(&BenchError::Open(why), &mut checks);
        let mut told = Vec::new();
        checks.print(&mut told).unwrap();
        let told = String::from_utf8(told).unwrap();
        for words in ["BAD   port", "dialout", "uaccess", "0483"] {
            assert!(told.contains(words), "{told}");
        }
    }
}
