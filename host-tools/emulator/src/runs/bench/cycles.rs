//! The rig's image with the model of the core's cycles: what acquisition and servo take of them, and whether both keep their time
//! when the core is as slow as in its worst millisecond, and slower.

use std::num::NonZeroU64;
use std::path::Path;

use tactus_core::sensor::pressure::SLOTS_HZ;
use tactus_core::wire::{Command, Counts, Event, Identify, Phase};
use tactus_link::Request;
use tactus_world::world::Setup;

use crate::board::cycles::{CycleCount, CycleProfile, Load};
use crate::board::{Emulator, Options, Timing};
use crate::host::talk::{Talk, TalkError};

/// The core's clock.
pub const CORE_HZ: f64 = 168e6;
/// How much slower than the worst millisecond the core is made for the proof that there is time left.
pub const RESERVE: f64 = 1.3;
/// A command that ends later leaves the sensor less than its 50 us (`LATE_TICKS` of the firmware).
pub const COMMAND_US: f64 = 10.0;
/// Longest that the rig takes for a slide, virtual seconds.
const TIMEOUT_S: f64 = 120.0;

/// Acquisition: the slots' timer and their bus; the servo's executor.
const ACQUISITION: [&str; 2] = ["TIM2", "SPI1"];
const SERVO: [&str; 1] = ["UART5"];

/// What one of the tasks takes.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Share {
    /// In all.
    pub total: CycleCount,
    /// The millisecond with the most cycles per instruction.
    pub slowest: Load,
    /// The millisecond with the most cycles.
    pub busiest: Load,
}

impl Share {
    fn of(profile: &CycleProfile, groups: std::ops::Range<usize>) -> Self {
        Self {
            total: profile.total(groups.clone()),
            slowest: profile.worst(groups.clone(), CycleCount::ratio),
            busiest: profile.worst(groups, |spent| spent.cycles as f64),
        }
    }
}

/// Cycles of an exploration of one slide.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Cycles {
    /// The sensor's words.
    pub acquisition: Share,
    /// The servo.
    pub servo: Share,
    /// All that the core executed.
    pub all: Share,
    /// Seconds of the slide ...
    pub slide_s: f64,
    /// ... what was executed meanwhile ...
    pub slide: CycleCount,
    /// ... and by the acquisition.
    pub slide_acquisition: CycleCount,
    /// Instructions that were not modelled.
    pub unseen: u64,
}

impl Cycles {
    /// Cycles per instruction in the worst millisecond: of all that is executed in it, and, which is more, of acquisition and servo
    /// alone.
    pub fn worst_ratio(&self) -> f64 {
        let shares = [self.all, self.acquisition, self.servo];
        let ratios = shares.map(|share| share.slowest.spent.ratio());
        ratios.into_iter().fold(0.0, f64::max)
    }

    /// Share of the core's time that a slide takes, waits included.
    pub fn busy(&self) -> f64 {
        self.slide.cycles as f64 / (self.slide_s * CORE_HZ)
    }

    /// Cycles of the acquisition in a slot of the slide.
    pub fn of_slot(&self) -> f64 {
        self.slide_acquisition.cycles as f64 / (self.slide_s * f64::from(SLOTS_HZ))
    }
}

fn identify() -> Command {
    Command::Identify(Identify {
        threshold: 1.0,
        max_slides: 1,
        open: false,
        seed: 1,
        ..Identify::default()
    })
}

fn ready(elf: &Path, options: Options) -> Result<Talk, TalkError> {
    let mut talk = Talk::new(Emulator::start(elf, Setup::default(), options)?);
    talk.ready(|_, _| ())?;
    Ok(talk)
}

/// Follows each instruction of an exploration with a slide, for so long a time from the command on and from the beginning of each
/// phase on, ns.
///
/// # Errors
/// [`TalkError`]; silence, if there was no slide.
pub fn trace(elf: &Path, window_ns: u64) -> Result<Cycles, TalkError> {
    let mut talk = ready(elf, Options::default())?;
    let board = talk.board();
    let mut groups = Vec::new();
    for names in [&ACQUISITION[..], &SERVO] {
        let found = names.iter().map(|name| board.symbol(name));
        let found: Result<Vec<_>, _> = found.collect();
        groups.push(found?.into_iter().map(|(address, _)| address).collect());
    }
    board.trace_cycles(groups.clone(), None)?;
    let (mut cycles, mut profile) = (Cycles::default(), CycleProfile::default());
    let (mut began_ns, mut slides) = (Some(board.now_ns()), false);
    let mut each = |board: &mut Emulator, phase: Option<Phase>| -> Result<(), TalkError> {
        let now_ns = board.now_ns();
        if phase.is_none() && began_ns.is_none_or(|began_ns| now_ns - began_ns < window_ns) {
            return Ok(());
        }
        if let Some(began_ns) = began_ns.take() {
            let part = board.untrace_cycles()?;
            if slides {
                cycles.slide_s += (now_ns - began_ns) as f64 * 1e-9;
                cycles.slide += part.total(0..3);
                cycles.slide_acquisition += part.total(0..1);
            }
            profile.extend(part);
        }
        if let Some(phase) = phase {
            slides = phase == Phase::Sliding;
            began_ns = Some(now_ns);
            board.trace_cycles(groups.clone(), None)?;
        }
        Ok(())
    };
    let mut failed = None;
    talk.send(identify(), TIMEOUT_S, |board, report| {
        let phase = match report.map(|report| &report.event) {
            Some(Event::Phase(phase)) => Some(*phase),
            _ => None,
        };
        if let Err(why) = each(board, phase) {
            failed = Some(why);
        }
    })?;
    if let Some(why) = failed {
        return Err(why);
    }
    if cycles.slide_s == 0.0 {
        return Err(TalkError::Silent(TIMEOUT_S));
    }
    Ok(Cycles {
        acquisition: Share::of(&profile, 0..1),
        servo: Share::of(&profile, 1..2),
        all: Share::of(&profile, 0..3),
        unseen: profile.unseen,
        ..cycles
    })
}

/// An exploration by a core that is slower.
#[derive(Clone, Debug)]
pub struct Slowed {
    /// When slots and servo came.
    pub timing: Timing,
    /// Virtual seconds that it took.
    pub seconds: f64,
    /// What the firmware counted since it started.
    pub counts: Counts,
    /// It came to a verdict.
    pub verdict: bool,
    /// Resets of the chip.
    pub resets: usize,
}

impl Slowed {
    /// What is left of the command's time in its slot, us.
    pub fn margin_us(&self) -> f64 {
        COMMAND_US - self.timing.command_us
    }

    /// What went wrong; nothing if all kept its time.
    fn missed(&self) -> Vec<String> {
        let Counts {
            late_slots,
            lost_samples,
            parity_errors,
            error_frames,
            lost_reports,
            ..
        } = self.counts;
        let periods = self.timing.servo_periods as f64;
        let checks = [
            (self.verdict, "no verdict".into()),
            (self.resets == 0, format!("{} resets", self.resets)),
            (late_slots == 0, format!("{late_slots} late slots")),
            (lost_samples == 0, format!("{lost_samples} lost samples")),
            (lost_reports == 0, format!("{lost_reports} lost reports")),
            (
                parity_errors == 0 && error_frames == 0,
                format!("{parity_errors} parity errors, {error_frames} error frames"),
            ),
            (
                self.margin_us() > 0.0,
                format!("a command ended after {:.2} us", self.timing.command_us),
            ),
            (
                (periods - 1e3 * self.seconds).abs() <= 2.0 && self.timing.servo_gap_us < 2e3,
                format!(
                    "{periods} servo periods in {:.3} s, {:.0} us apart at most",
                    self.seconds, self.timing.servo_gap_us
                ),
            ),
        ];
        let wrong = checks.into_iter().filter(|(good, _)| !good);
        wrong.map(|(_, what)| what).collect()
    }
}

/// What went wrong on a slower core; nothing if all kept its time.
pub fn missed(slowed: &Result<Slowed, TalkError>) -> Vec<String> {
    match slowed {
        Ok(slowed) => slowed.missed(),
        Err(why) => vec![why.to_string()],
    }
}

/// Homes and explores with the core's clock divided; all else keeps its time.
///
/// # Errors
/// [`TalkError`].
pub fn slowed(elf: &Path, by: f64) -> Result<Slowed, TalkError> {
    let hz = NonZeroU64::new((CORE_HZ / by) as u64);
    let instructions_per_second = hz.unwrap_or(NonZeroU64::MIN);
    let options = Options {
        instructions_per_second,
        ..Options::default()
    };
    let mut talk = ready(elf, options)?;
    // from here on: the boot has no slots
    talk.board().timing()?;
    let begun_ns = talk.now_ns();
    let mut verdict = false;
    talk.send(identify(), TIMEOUT_S, |_, report| {
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

/// Both for people.
pub(super) fn print(cycles: &Cycles, slowed: &Result<Slowed, TalkError>) {
    println!(
        "\nCycles with the wait states of the flash and of the buses (a model, on the slow side):\n\n\
         {:12} {:>15} {:>22} {:>25}",
        "task", "per instruction", "in its worst ms", "% of the core's busiest ms"
    );
    let parts = [
        ("acquisition", cycles.acquisition),
        ("servo", cycles.servo),
        ("everything", cycles.all),
    ];
    for (name, share) in parts {
        let busiest = share.busiest.spent.cycles as f64 / (CORE_HZ * 1e-3);
        println!(
            "{name:12} {:>15.2} {:>22.2} {:>25.1}",
            share.total.ratio(),
            share.slowest.spent.ratio(),
            100.0 * busiest
        );
    }
    let by = RESERVE * cycles.worst_ratio();
    println!(
        "\nA core that is {:.2} x {RESERVE} times slower, {:.1} MHz with an instruction a cycle:",
        cycles.worst_ratio(),
        CORE_HZ * 1e-6 / by,
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
            slowed.margin_us(),
            slowed.seconds,
        );
    }
    match missed(slowed) {
        missed if missed.is_empty() => println!("Nothing missed its time."),
        missed => println!("Missed: {}.", missed.join("; ")),
    }
}
