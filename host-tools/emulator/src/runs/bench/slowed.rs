//! The rig's image on a core that is as slow as one that waits for its flash, and slower: acquisition and servo keep
//! their time.

use std::num::NonZeroU64;
use std::path::Path;

use tactus_core::wire::{Command, Counts, Event};
use tactus_link::Request;
use tactus_world::world::Setup;

use super::one_slide;
use crate::board::{Emulator, Options, Timing};
use crate::host::talk::{Talk, TalkError};

pub(crate) const CORE_HZ: f64 = 168e6;
/// Cycles per instruction of the slots' interrupts in their worst millisecond, the most of all code, by the model of
/// the core and its flash at commit 6025b56 (docs/src/performance.md).
pub(super) const WORST_RATIO: f64 = 3.09;
/// How much slower than that the core is made, so that there is time left.
pub(super) const RESERVE: f64 = 1.3;
/// A command that ends later leaves the sensor less than its 50 us (`LATE_TICKS` of the firmware).
pub(super) const COMMAND_US: f64 = 10.0;
/// Longest that the rig takes for a slide, virtual seconds.
const TIMEOUT_S: f64 = 120.0;

/// An exploration by a core that is slower.
#[derive(Clone, Debug)]
pub struct Slowed {
    pub(super) timing: Timing,
    pub(super) seconds: f64,
    counts: Counts,
    verdict: bool,
    resets: usize,
}

impl Slowed {
    /// Lists what went wrong; nothing if all kept its time.
    fn missed(&self) -> Vec<String> {
        let counts = self.counts;
        let (periods, gap_us) = (self.timing.servo_periods as f64, self.timing.servo_gap_us);
        let checks = [
            (self.verdict, "no verdict".into()),
            (self.resets == 0, format!("{} resets", self.resets)),
            (
                counts
                    == Counts {
                        slots: counts.slots,
                        erasures: counts.erasures,
                        ..Counts::default()
                    },
                format!("{counts:?}"),
            ),
            (
                self.timing.command_us < COMMAND_US,
                format!("a command ended after {:.2} us", self.timing.command_us),
            ),
            (
                (periods - 1e3 * self.seconds).abs() <= 2.0 && gap_us < 2e3,
                format!(
                    "{periods} servo periods in {:.3} s, {gap_us:.0} us apart at most",
                    self.seconds
                ),
            ),
        ];
        let wrong = checks.into_iter().filter(|(good, _)| !good);
        wrong.map(|(_, what)| what).collect()
    }
}

/// Lists what went wrong on a slower core; nothing if all kept its time.
pub fn missed(slowed: &Result<Slowed, TalkError>) -> Vec<String> {
    match slowed {
        Ok(slowed) => slowed.missed(),
        Err(why) => vec![why.to_string()],
    }
}

/// Homes and explores with the core's clock divided; all else keeps its time.
pub fn slowed(elf: &Path, by: f64) -> Result<Slowed, TalkError> {
    let hz = NonZeroU64::new((CORE_HZ / by) as u64);
    let options = Options {
        instructions_per_second: hz.unwrap_or(NonZeroU64::MIN),
        ..Options::default()
    };
    let mut talk = Talk::new(Emulator::start(elf, Setup::default(), options)?);
    talk.ready(|_, _| ())?;
    // from here on: the boot has no slots
    talk.board().timing()?;
    let begun_ns = talk.now_ns();
    let mut verdict = false;
    talk.send(Command::Identify(one_slide()), TIMEOUT_S, |_, report| {
        verdict |= matches!(report.map(|report| &report.event), Some(Event::Verdict(_)));
    })?;
    let seconds = (talk.now_ns() - begun_ns) as f64 * 1e-9;
    let timing = talk.board().timing()?;
    let status = talk.run(Request::status(), TIMEOUT_S, |_, _| ())?;
    Ok(Slowed {
        timing,
        seconds,
        counts: status.counts,
        verdict,
        resets: talk.board().resets()?.len(),
    })
}

pub(super) fn print(slowed: &Result<Slowed, TalkError>) {
    println!(
        "\nA core that is {WORST_RATIO} x {RESERVE} times slower, {:.1} MHz with an instruction a cycle:",
        CORE_HZ * 1e-6 / (WORST_RATIO * RESERVE),
    );
    if let Ok(slowed) = slowed {
        let Timing {
            command_us,
            servo_periods,
            servo_gap_us,
            ..
        } = slowed.timing;
        println!(
            "a slot's command ends {command_us:.2} us after its slot began, {:.2} us before it is late;\n\
             {servo_periods} servo periods in {:.3} s, {servo_gap_us:.0} us apart at most.",
            COMMAND_US - command_us,
            slowed.seconds,
        );
    }
    match missed(slowed) {
        missed if missed.is_empty() => println!("Nothing missed its time."),
        missed => println!("Missed: {}.", missed.join("; ")),
    }
}
