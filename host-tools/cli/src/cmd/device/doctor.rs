//! `tactus device doctor`: whether PC, line, probe and table are fit for work, and what to do where they are not.

use std::io::{self, Write};
use std::time::{Duration, Instant};

use anyhow::ensure;
use serde::Serialize;
use tactus_core::rig::Fault;
use tactus_core::rig::skin::WARN_J;
use tactus_core::table::Table;
use tactus_core::wire::{Command, PROTOCOL, Status};
use tactus_lab::eval::show::{count, day};
use tactus_link::Request;
use tactus_link::line::LineError;
use time::{Date, Month, OffsetDateTime};

use super::bench::{Bench, BenchError};
use super::history::{Remembered, What};
use super::line::{OpenError, Where};
use crate::cmd::output::{Format, print_json};

/// Check PC, port, probe and table, and say what to do about each fault
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus device doctor
  tactus device doctor --port /dev/ttyACM1
  tactus device doctor --format json > doctor.json    to send to somebody

Nothing moves. It takes some five seconds, since the probe's clock is held against this PC's. The probe writes one of its settings again,
as it is, to show that its store works. Last faults, and how old the table is, are what this PC has seen of the probe at this port. Exit code: 0 if nothing is wrong, 1 otherwise; what is only worth a look leaves 0.")]
pub(crate) struct Args {
    #[command(flatten)]
    at: Where,
    /// How to print it
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// How the clocks are compared: so many looks at the beginning and at the end of so long.
const LOOKS: usize = 20;
const CLOCK: Duration = Duration::from_secs(4);
/// A crystal is within 100 ppm; a look is as exact as a millisecond and what the line adds.
const MAX_PPM: f64 = 1500.0;
/// A clock that is off by more is none that runs in real time: an emulated board's.
const EMULATED_PPM: f64 = 50_000.0;
/// A load cell drifts, and a BioTac loses water, in half a year.
const OLD_DAYS: i64 = 180;
/// So many of the last faults are shown.
const FAULTS: usize = 5;
/// Damaged words of all words: the firmware's own limit within a second.
const MAX_DAMAGED: f64 = 0.005;

/// What came of a check.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "lowercase")]
enum State {
    Good,
    /// Worth a look; nothing is wrong with it.
    Look,
    Bad,
}

/// A check, what was seen, and what to do.
#[derive(Serialize)]
struct Check {
    name: &'static str,
    state: State,
    saw: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    remedy: Option<String>,
}

/// What `device doctor --format json` prints.
#[derive(Serialize)]
struct Summary<'a> {
    tactus: &'static str,
    protocol: u8,
    checks: &'a [Check],
    /// The last ones that this PC saw at this port, the newest first.
    faults: &'a [Past],
    /// `null`: it cannot be read.
    table: Option<&'a InUse>,
}

/// A fault that is over.
#[derive(Serialize)]
struct Past {
    /// Day and time, UTC.
    at: String,
    fault: String,
    remedy: String,
}

/// The table in use.
#[derive(Serialize)]
struct InUse {
    finger: String,
    textures: u16,
    checksum: String,
    factory: bool,
    /// Day of the force scale that it was learned by; `null`: none, or not known.
    calibrated: Option<String>,
    /// The day on which this PC saw it first at this port.
    seen_since: String,
    days: i64,
}

#[derive(Default)]
struct Checks {
    all: Vec<Check>,
    faults: Vec<Past>,
    table: Option<InUse>,
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
        self.all.push(Check {
            name,
            state,
            saw,
            remedy,
        });
    }

    fn print(&self, out: &mut impl Write) -> anyhow::Result<()> {
        for check in &self.all {
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

/// Checks everything, prints it, and fails where something is wrong.
pub(crate) fn run(args: &Args, out: &mut impl Write) -> anyhow::Result<()> {
    let mut checks = Checks::default();
    match Bench::open(&args.at, args.format) {
        Ok((mut bench, status)) => examine(&mut bench, &status, &mut checks)?,
        Err(why) if why.is_interrupt() => return Err(why.into()),
        Err(why) => unreached(&why, &mut checks),
    }
    match args.format {
        Format::Text => checks.print(out)?,
        Format::Json => {
            let summary = Summary {
                tactus: env!("CARGO_PKG_VERSION"),
                protocol: PROTOCOL,
                checks: &checks.all,
                faults: &checks.faults,
                table: checks.table.as_ref(),
            };
            print_json(&summary, out)?;
        }
    }
    let bad = checks.all.iter().filter(|check| check.state == State::Bad);
    let bad = bad.count() as u64;
    ensure!(bad == 0, "{} failed", count(bad, "check"));
    Ok(())
}

/// Why the probe is not reached; the sentence says what to do.
fn unreached(why: &BenchError, checks: &mut Checks) {
    match why {
        BenchError::Open(why) => {
            let remedy = match why {
                OpenError::Line(LineError::Denied(_)) => UDEV,
                _ => "`tactus device list` shows the ports of this PC",
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

/// For those who may not open the port.
const UDEV: &str = "\
or, for all who sit at this PC, a rule for udev:
  echo 'SUBSYSTEM==\"tty\", ATTRS{idVendor}==\"0483\", TAG+=\"uaccess\"' | sudo tee /etc/udev/rules.d/70-tactus.rules
  sudo udevadm control --reload && sudo udevadm trigger";

fn examine(bench: &mut Bench, status: &Status, checks: &mut Checks) -> Result<(), BenchError> {
    checks.good("port", bench.name.clone());
    let ours = env!("CARGO_PKG_VERSION");
    checks.good(
        "versions",
        format!("messages of version {PROTOCOL} at both ends; tactus {ours}"),
    );
    clock_and_line(bench, checks)?;
    match status.fault {
        Some(fault) => checks.bad("rig", fault.to_string(), remedy(fault)),
        None => checks.good("rig", "no fault".to_owned()),
    }
    last_faults(bench.history().faults(FAULTS), now(), checks);
    acquisition(status, checks);
    table(bench, status, checks)?;
    force_scale(status.calibrated, now().date(), checks);
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
        Err(why) if why.is_interrupt() => return Err(why),
        Err(why) => {
            let remedy = "pull the table (`tactus device table pull FILE`), flash the firmware again, push the table";
            checks.bad("store", why.to_string(), remedy);
        }
    }
    Ok(())
}

/// What this PC has seen of the probe; a fault of the last day is worth a look.
fn last_faults(faults: Vec<Remembered>, now: OffsetDateTime, checks: &mut Checks) {
    let lasts = faults
        .iter()
        .any(|one| now - one.time() < time::Duration::DAY);
    checks.faults = faults.iter().map(Past::from).collect();
    let (newest, remedy) = match checks.faults.first() {
        None => {
            checks.good("last faults", "none that this PC saw".to_owned());
            return;
        }
        Some(newest) => (
            format!("{}, {}", newest.fault, newest.at),
            checks.faults.iter().map(|past| {
                let Past { at, fault, remedy } = past;
                format!("{at}: {fault}. {remedy}")
            }),
        ),
    };
    let remedy = remedy.collect::<Vec<_>>().join("\n");
    let state = if lasts { State::Look } else { State::Good };
    checks.add("last faults", state, newest, Some(remedy));
}

impl From<&Remembered> for Past {
    fn from(one: &Remembered) -> Self {
        let (fault, remedy) = match &one.what {
            What::Fault(fault) => (fault.to_string(), remedy(*fault)),
            What::Died(words) => (
                format!("the firmware gave up: {words}"),
                "a mistake of the firmware: flash the newest, and tell its authors these words"
                    .to_owned(),
            ),
            What::Table(_) => Default::default(),
        };
        let at = one.time();
        let (day, hour, minute) = (day_of(at.date()), at.hour(), at.minute());
        let at = format!("{day} {hour:02}:{minute:02} UTC");
        Self { at, fault, remedy }
    }
}

fn remedy(fault: Fault) -> String {
    format!("{} (`tactus device home`)", fault.recovery())
}

/// The probe's clock against this PC's, and how long an answer takes.
fn clock_and_line(bench: &mut Bench, checks: &mut Checks) -> Result<(), BenchError> {
    let mut taken = Vec::new();
    let began = Instant::now();
    // what the line holds up only adds: the least of some looks is right
    let mut offset = |bench: &mut Bench| {
        let mut least = f64::INFINITY;
        for _ in 0..LOOKS {
            let asked = Instant::now();
            let (mut at_ms, probe) = (None, bench.probe());
            let status = probe.run(Request::status(), |report| {
                at_ms = Some(report.at_ms);
                Ok(())
            });
            bench.done(status, &mut io::sink())?;
            taken.push(asked.elapsed());
            if let Some(at_ms) = at_ms {
                let here = began.elapsed().as_secs_f64() * 1e3;
                least = least.min(here - f64::from(at_ms));
            }
        }
        Ok::<f64, BenchError>(least)
    };
    let before = offset(bench)?;
    let middle = Instant::now();
    while middle.elapsed() < CLOCK {
        bench.listen(&mut |_| ())?;
    }
    let after = offset(bench)?;
    // a clock that is fast gains on this one
    let ppm = (before - after) / CLOCK.as_secs_f64() * 1e3;
    let seen = format!("{ppm:+.0} ppm against this PC's, {MAX_PPM:.0} allowed");
    if ppm.abs() > EMULATED_PPM {
        checks.look(
            "clock",
            "does not go in real time".to_owned(),
            "an emulated board's time is not this PC's; a real board's clock would be broken",
        );
    } else if ppm.abs() > MAX_PPM {
        let remedy = "the 8 MHz of the ST-LINK do not reach the chip: leave its half on the board, and its solder bridges (MCO to PH0) as delivered";
        checks.bad("clock", seen, remedy);
    } else {
        checks.good("clock", seen);
    }
    taken.sort_unstable();
    let median = taken.get(taken.len() / 2).copied().unwrap_or_default();
    let longest = taken.last().copied().unwrap_or_default();
    let (damaged, missing) = bench.losses();
    let seen = format!(
        "an answer takes {:.1} ms, at most {:.1}; {}, {}",
        median.as_secs_f64() * 1e3,
        longest.as_secs_f64() * 1e3,
        count(damaged, "frame") + " damaged",
        count(missing, "report") + " lost",
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
    let damaged = counts.parity_errors + counts.error_frames;
    let share = f64::from(damaged) / f64::from(counts.slots.max(1));
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
    } else if damaged + counts.late_slots + counts.lost_samples > 0 {
        let remedy = "slides with lost words did not count; does the number grow?";
        checks.look("sensor", seen, remedy);
    } else {
        checks.good("sensor", seen);
    }
}

fn table(bench: &mut Bench, status: &Status, checks: &mut Checks) -> Result<(), BenchError> {
    let bytes = match bench.table() {
        Ok(bytes) => bytes,
        Err(why) if why.is_interrupt() => return Err(why),
        Err(why) => {
            let remedy = "`tactus device table factory`, or push one";
            checks.bad("table", why.to_string(), remedy);
            return Ok(());
        }
    };
    let table = match Table::read(&bytes) {
        Ok(table) => table,
        Err(why) => {
            let remedy = "`tactus device table factory`, or push one";
            checks.bad("table", why.to_string(), remedy);
            return Ok(());
        }
    };
    let since = bench.history().table_since(table.crc(), now());
    let in_use = InUse {
        finger: table.finger().to_string(),
        textures: table.textures(),
        checksum: format!("{:08x}", table.crc()),
        factory: status.factory,
        calibrated: date(table.calibrated()).map(day_of),
        seen_since: day_of(since.date()),
        days: (now() - since).whole_days(),
    };
    let textures = count(table.textures(), "texture");
    let (finger, since, days) = (&in_use.finger, &in_use.seen_since, in_use.days);
    let age = count(days.unsigned_abs(), "day");
    let seen = format!("{textures}, finger {finger}, here since {since} ({age})");
    checks.table = Some(in_use);
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
        checks.look(
            "table",
            seen,
            "`tactus device refresh` moves it to this scale",
        );
    } else if days > OLD_DAYS {
        let remedy = "`tactus device refresh` moves it to the finger as it is now";
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

fn day_of(date: Date) -> String {
    let (year, month, day) = date.to_calendar_date();
    format!("{year}-{:02}-{day:02}", u8::from(month))
}

fn now() -> OffsetDateTime {
    OffsetDateTime::now_utc()
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
        checks.all.iter().map(|check| check.state).collect()
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
    fn a_fault_of_today_is_worth_a_look_and_has_its_remedy() {
        let line = r#"{"at":1795000000,"port":"here","what":{"fault":"StageStall"}}"#;
        let fault: Remembered = serde_json::from_str(line).unwrap();
        let mut checks = Checks::default();
        last_faults(Vec::new(), fault.time(), &mut checks);
        for days in [0, 2] {
            let now = fault.time() + time::Duration::days(days);
            last_faults(vec![fault.clone()], now, &mut checks);
        }
        assert_eq!(states(&checks), [State::Good, State::Look, State::Good]);
        let Past { at, fault, remedy } = &checks.faults[0];
        assert_eq!(
            (&at[..], &fault[..]),
            ("2026-11-18 11:06 UTC", "stage blocked")
        );
        assert!(remedy.contains("tactus device home"), "{remedy}");
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
                fault: None,
                textures: 0,
                table_bytes: 0,
                table_crc: 0,
                factory: false,
                calibrated: 0,
                counts,
                skin_mj: (0, 0),
                false_alarm: None,
                high_force: false,
                finger: Default::default(),
            };
            let mut checks = Checks::default();
            acquisition(&status, &mut checks);
            checks.all[0].state
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
        let why = OpenError::from(LineError::Denied("/dev/ttyACM0".into()));
        unreached(&BenchError::Open(why), &mut checks);
        let mut told = Vec::new();
        checks.print(&mut told).unwrap();
        let told = String::from_utf8(told).unwrap();
        for words in ["BAD   port", "dialout", "uaccess", "0483"] {
            assert!(told.contains(words), "{told}");
        }
    }
}
