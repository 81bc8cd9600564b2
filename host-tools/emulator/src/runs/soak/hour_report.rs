//! What became of an hour on the emulated board, and what it must be.

use serde_json::{Value, json};
use tactus_core::table::TableError;
use tactus_core::wire::Reset;
use tactus_lab::eval::show::count;
use tactus_lab::sim::rig::SimError;

use super::episodes::{Episodes, MOST_N};
use crate::board::Error;
use crate::host::exploration::ExploreError;
use crate::host::talk::TalkError;

/// Slots that may lie between a count and the time at which it arrives.
const SLOTS_OFF: f64 = 10.0;
/// Reports say whole milliseconds, and are looked for every one.
const DRIFT_MS: f64 = 2.0;
/// Bytes by which the high-water mark may rise: the exception frames of two interrupts that came when the stack was deepest,
/// which is a matter of luck. A leak would grow with every episode.
const FRAMES: u32 = 2 * 108;
/// Episodes that an hour must have; a shorter time, its share of them.
const EPISODES: f64 = 30.0;
/// Why there is no hour to judge.
#[derive(Debug, thiserror::Error)]
pub(crate) enum HourError {
    #[error(transparent)]
    Emulator(#[from] Error),
    #[error("at {at_s:.0} virtual s: {why}")]
    Talk { at_s: f64, why: TalkError },
    #[error("at {at_s:.0} virtual s: {why}")]
    Explore { at_s: f64, why: ExploreError },
    #[error("the simulated rig: {0}")]
    Rig(#[from] SimError),
    #[error("the table in force: {0}")]
    Table(#[from] TableError),
}

/// A reset of the chip, and what the firmware said of it.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Restart {
    /// What was done to it; nothing for one that nobody wanted.
    pub(crate) done: Option<&'static str>,
    /// Why it started, by its own account.
    pub(crate) reset: Reset,
    /// What it said before it gave up.
    pub(crate) last_words: Option<String>,
}

/// What became of an hour.
#[derive(Clone, Debug, Default)]
pub(crate) struct Hour {
    /// Virtual seconds over one boot, before the restarts on purpose.
    pub(crate) virtual_s: f64,
    /// The episodes.
    pub(crate) episodes: Episodes,
    /// How far the firmware's clock has gone from the emulator's, ms.
    pub(crate) drift_ms: f64,
    /// Slots by the firmware's count, by the time, and sample commands that the sensor got.
    pub(crate) slots: (u64, f64, u64),
    /// What the firmware counted, over all boots.
    pub(crate) late_slots: u64,
    pub(crate) lost_samples: u64,
    pub(crate) lost_reports: u64,
    /// Slots of slides in which the sensor was not asked, by the sensor.
    pub(crate) missed_slots: u64,
    /// Most bytes of stack at each quarter of the time.
    pub(crate) stack: Vec<u32>,
    /// Resets that the emulator saw.
    pub(crate) resets: usize,
    /// What the firmware reported of them.
    pub(crate) restarts: Vec<Restart>,
    /// Most force on the finger, N.
    pub(crate) force_max_n: f64,
    /// Sectors of the store that were erased.
    pub(crate) erases: usize,
    /// What is not as it must be.
    pub(crate) missed: Vec<String>,
}

impl Hour {
    pub(crate) fn json(&self) -> Value {
        let restart = |restart: &Restart| {
            json!({
                "done_to_it": restart.done,
                "reset": format!("{:?}", restart.reset),
                "last_words": restart.last_words,
            })
        };
        let mut json = self.episodes.json();
        json["virtual_seconds"] = self.virtual_s.into();
        json["drift_ms"] = self.drift_ms.into();
        json["slots_firmware"] = self.slots.0.into();
        json["slots_due"] = self.slots.1.into();
        json["slots_sensor"] = self.slots.2.into();
        json["late_slots"] = self.late_slots.into();
        json["lost_samples"] = self.lost_samples.into();
        json["lost_reports"] = self.lost_reports.into();
        json["missed_slots_true"] = self.missed_slots.into();
        json["stack_bytes_at_quarters"] = json!(self.stack);
        json["resets"] = self.resets.into();
        json["restarts_told"] = self.restarts.iter().map(restart).collect();
        json["force_max_n"] = self.force_max_n.into();
        json["sectors_erased"] = self.erases.into();
        json["missed"] = json!(self.missed);
        json
    }

    pub(crate) fn text(&self) -> String {
        let told: Vec<String> = self
            .restarts
            .iter()
            .map(|r| format!("{:?}", r.reset))
            .collect();
        format!(
            "emulated board: {:.3} virtual hours over one boot\n  {}\n  clock {:.2} ms off; slots: {} of {:.1} ({} by the sensor), {} \
             late, {} missed; {} and {} lost\n  stack {} bytes at the quarters; {} sectors erased; force {:.3} N at most\n  \
             {} resets, all on purpose: {}",
            self.virtual_s / 3600.0,
            self.episodes.text(),
            self.drift_ms,
            self.slots.0,
            self.slots.1,
            self.slots.2,
            self.late_slots,
            self.missed_slots,
            count(self.lost_samples, "sample"),
            count(self.lost_reports, "report"),
            self.stack
                .iter()
                .map(u32::to_string)
                .collect::<Vec<_>>()
                .join(", "),
            self.erases,
            self.force_max_n,
            self.resets,
            told.join(", ")
        )
    }
}

/// What an hour must be; an empty list is good.
pub(super) fn missed(hour: &Hour, virtual_s: f64) -> Vec<String> {
    let mut missed = Vec::new();
    let mut check = |good: bool, what: String| {
        if !good {
            missed.push(what);
        }
    };
    let wanted = EPISODES * virtual_s / 3600.0;
    check(
        f64::from(hour.episodes.sound) >= wanted.floor(),
        format!(
            "{} without a fault, {wanted:.0} wanted",
            count(hour.episodes.sound, "episode")
        ),
    );
    check(
        hour.drift_ms.abs() <= DRIFT_MS,
        format!("the clock has gone {:.2} ms off", hour.drift_ms),
    );
    let (told, due, seen) = hour.slots;
    check(
        (told as f64 - due).abs() <= SLOTS_OFF && (seen as f64 - told as f64).abs() <= SLOTS_OFF,
        format!("slots told: {told}, {due:.1} are due, the sensor saw {seen}"),
    );
    let lost = [
        (hour.late_slots, "slots late"),
        (hour.missed_slots, "slots missed by the sensor"),
        (hour.lost_samples, "samples lost"),
        (hour.lost_reports, "reports lost"),
    ];
    for (count, what) in lost {
        check(count == 0, format!("{count} {what}"));
    }
    let grown = hour.stack.first().zip(hour.stack.last());
    check(
        grown.is_some_and(|(first, last)| *last <= first + FRAMES),
        format!("the stack has grown: {:?} bytes", hour.stack),
    );
    check(
        hour.force_max_n <= MOST_N,
        format!("{:.3} N on the finger", hour.force_max_n),
    );
    check(
        hour.resets == hour.restarts.len(),
        format!(
            "{} resets, {} are told and on purpose",
            hour.resets,
            hour.restarts.len()
        ),
    );
    for restart in &hour.restarts {
        let said = |words: &str| {
            let last = restart.last_words.as_ref();
            last.is_some_and(|last| last.contains(words))
        };
        let why = match restart.done {
            Some("the tasks of thread mode hang") => {
                restart.reset == Reset::Watchdog && said("check in")
            }
            Some("the servo hangs") => restart.reset == Reset::Watchdog,
            Some("the servo crashes") => restart.reset == Reset::Software && said("hard fault"),
            Some(_) => restart.reset == Reset::Pin,
            None => false,
        };
        check(
            why,
            format!("it does not say why it restarted: {restart:?}"),
        );
    }
    missed
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As it must be.
    fn good() -> Hour {
        let restart = |done, reset, words: Option<&str>| Restart {
            done: Some(done),
            reset,
            last_words: words.map(str::to_owned),
        };
        let mut hour = Hour {
            drift_ms: 0.4,
            slots: (15_839_920, 15_839_924.4, 15_839_921),
            stack: vec![9000, 9000, 9000],
            resets: 4,
            restarts: vec![
                restart(
                    "the tasks of thread mode hang",
                    Reset::Watchdog,
                    Some("the tasks in thread mode did not check in for 2 s"),
                ),
                restart("the servo hangs", Reset::Watchdog, None),
                restart(
                    "the servo crashes",
                    Reset::Software,
                    Some("hard fault at 0x08001234"),
                ),
                restart("the reset pin", Reset::Pin, None),
            ],
            force_max_n: 2.19,
            ..Hour::default()
        };
        hour.episodes.sound = 30;
        hour
    }

    #[test]
    fn every_bar_can_be_missed() {
        assert_eq!(missed(&good(), 3600.0), [""; 0]);
        let breaks: [fn(&mut Hour); 11] = [
            |hour| hour.episodes.sound = 29,
            |hour| hour.drift_ms = -2.1,
            |hour| hour.slots.0 -= 11,
            |hour| hour.late_slots = 1,
            |hour| hour.missed_slots = 1,
            |hour| hour.lost_samples = 1,
            |hour| hour.lost_reports = 1,
            |hour| hour.stack[2] = 9217,
            |hour| hour.force_max_n = 2.21,
            // one that nobody reported
            |hour| hour.resets = 5,
            |hour| hour.restarts[2].last_words = None,
        ];
        for (number, change) in breaks.into_iter().enumerate() {
            let mut hour = good();
            change(&mut hour);
            assert_eq!(missed(&hour, 3600.0).len(), 1, "{number}");
        }
    }
}
