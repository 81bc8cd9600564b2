//! Pictures of what an oscilloscope shows at the board's pins while the rig's firmware starts, drawn from the emulated pins.

mod draw;
pub mod error;

use std::path::{Path, PathBuf};

use clap::Args as Arguments;
use tactus_link::Request;
use tactus_world::faults::Fault;
use tactus_world::ripple::PwmPhase;
use tactus_world::world::Setup;

pub use draw::{Picture, Row, Span};
use error::ScopeError;

use super::error::RunError;
use crate::board::{BridgePwm, Emulator, Frame, Options, Output, Rig, Scope};
use crate::host::args::WriteError;
use crate::host::talk::{TIMEOUT_S, Talk, TalkError};

/// Which firmware, and where to.
#[derive(Arguments)]
pub(crate) struct Args {
    /// The rig's ELF
    #[arg(long, value_name = "FILE")]
    elf: PathBuf,
    /// Folder for the pictures
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Draws them.
pub(crate) fn run(args: &Args) -> Result<(), RunError> {
    for picture in pictures(&args.elf)? {
        let path = args.out.join(picture.file);
        std::fs::write(&path, picture.svg()).map_err(|source| WriteError {
            path: path.clone(),
            source,
        })?;
        println!("{}", path.display());
        for span in &picture.spans {
            println!("  {}: {:.2} us", span.what, span.seconds() * 1e6);
        }
    }
    Ok(())
}

/// Longest that the firmware takes to begin, ns.
const STARTS_NS: u64 = 30_000_000_000;
/// The sensor's bus without its divider, Hz: APB2.
const BUS_HZ: f64 = 84e6;
/// Speed of the slowest move that is looked at, mm/s; it is steady after so many ms, and has been seen after so many.
const MOVES_MM_S: f64 = 5.0;
const STEADY_MS: u32 = 300;
const SEEN_MS: u32 = STEADY_MS + 6;

/// All of them, of a rig without a mistake.
///
/// # Errors
/// See [`ScopeError`].
pub fn pictures(elf: &Path) -> Result<Vec<Picture>, ScopeError> {
    let options = Options {
        trace_s: STARTS_NS / 1_000_000_000,
        ..Options::default()
    };
    let mut board = Emulator::start(elf, Setup::default(), options)?;
    let enables = |(_, output): &(u64, Output)| matches!(output, Output::LeverEnable(true));
    board.run_to(STARTS_NS, 1_000_000, |rig| rig.trace().any(enables))?;
    board.run_ms(20)?;
    let trace: Vec<(u64, Output)> = board.rig().trace().copied().collect();
    let step = step(&trace)?;
    board.rig().probe_pins();
    board.run_ms(2)?;
    let scope = board.rig().probe_pins();
    let (slot, word) = (slot(&scope)?, word(&scope)?);
    let mut talk = Talk::new(board);
    talk.ready(|_, _| ())?;
    let mut steady_ms = 0;
    let mut of_move = None;
    let stopped = talk.run(Request::calibrate(), TIMEOUT_S, |board, report| {
        let mut rig = board.rig();
        if report.is_some() {
            return;
        }
        let mm_s = rig.world().truth().speed_mm_s;
        steady_ms = if mm_s > MOVES_MM_S { steady_ms + 1 } else { 0 };
        match steady_ms {
            STEADY_MS => drop(rig.probe_pins()),
            SEEN_MS => {
                let scope = rig.probe_pins();
                of_move = Some((encoder(&scope, mm_s), pwm(&mut rig, &scope, mm_s)));
                rig.world().inject(Fault::EStop);
            }
            _ => {}
        }
    });
    let (Some((encoder, pwm)), Err(TalkError::Refused(_))) = (of_move, stopped) else {
        return Err(ScopeError::NotSeen("a stage that is stopped on its way"));
    };
    let mut board = talk.into_board();
    board.run_ms(40)?;
    let scope = board.rig().probe_pins();
    let trace: Vec<(u64, Output)> = board.rig().trace().copied().collect();
    let stop = stop(&scope, &trace)?;
    Ok(vec![slot, word, step, pwm?, encoder?, stop])
}

/// The begin of the first slot that is seen whole, ns: a slot selects twice, for the command and for its answer.
fn slot_begins(scope: &Scope) -> Result<[u64; 3], ScopeError> {
    let falls = scope.select.iter().filter(|(_, high)| !high);
    let falls: Vec<u64> = falls.map(|(at_ns, _)| *at_ns).collect();
    let slot = falls.windows(4).find_map(|falls| match falls {
        &[last, command, answer, next] if command - last > answer - command => {
            Some([command, answer, next])
        }
        _ => None,
    });
    slot.ok_or(ScopeError::NotSeen("a slot of the sensor"))
}

/// The level of a pin before a time, and its edges after it until another, in ns from the first time.
fn seen(levels: &[(u64, bool)], zero_ns: u64, (from, to): (f64, f64)) -> (bool, Vec<(f64, bool)>) {
    let since = |at_ns: u64| at_ns as f64 - zero_ns as f64;
    let before = levels.iter().rfind(|(at_ns, _)| since(*at_ns) < from);
    let within = levels.iter().map(|(at_ns, high)| (since(*at_ns), *high));
    let within: Vec<(f64, bool)> = within.filter(|(at, _)| *at >= from && *at <= to).collect();
    let before = match (before, within.first()) {
        (Some((_, high)), _) => *high,
        (None, Some((_, high))) => !high,
        (None, None) => false,
    };
    (before, within)
}

fn digital(name: &str, levels: &[(u64, bool)], zero_ns: u64, window: (f64, f64)) -> Row {
    let (before, edges) = seen(levels, zero_ns, window);
    Row::levels(name, before, &edges, window)
}

/// Length of a bit, ns.
fn bit_ns(frame: &Frame) -> f64 {
    f64::from(frame.divider) / BUS_HZ * 1e9
}

/// Begin and end of a frame, ns from a time.
fn frame_ns(frame: &Frame, zero_ns: u64) -> (f64, f64) {
    let end = frame.at_ns as f64 - zero_ns as f64;
    (end - f64::from(frame.bits) * bit_ns(frame), end)
}

/// A slot of the sensor up to the next one.
fn slot(scope: &Scope) -> Result<Picture, ScopeError> {
    let [begin, answer, next] = slot_begins(scope)?;
    let since = |at_ns: u64| at_ns as f64 - begin as f64;
    let window = (-10e3, since(next) + 15e3);
    let select = digital("CS PD14", &scope.select, begin, window);
    let frames = scope.frames.iter().map(|frame| frame_ns(frame, begin));
    let bursts = frames.filter(|(from, to)| *from > window.0 && *to < window.1);
    let clock = Row {
        bursts: bursts.collect(),
        ..Row::levels("SCK PA5", false, &[], window)
    };
    let rises = |after: u64| {
        let rise = scope
            .select
            .iter()
            .find(|(at_ns, high)| *high && *at_ns > after);
        rise.map(|(at_ns, _)| since(*at_ns))
            .ok_or(ScopeError::NotSeen("the end of a select"))
    };
    Ok(Picture {
        file: "scope-slot.svg",
        title: "A slot of the sensor: command, pause, answer".to_owned(),
        from_to_ns: window,
        rows: vec![select, clock],
        spans: vec![
            Span {
                what: "pause",
                row: 0,
                from_to_ns: (rises(begin)?, since(answer)),
            },
            Span {
                what: "slot",
                row: 1,
                from_to_ns: (0.0, since(next)),
            },
        ],
    })
}

/// The answer's word, bit by bit.
fn word(scope: &Scope) -> Result<Picture, ScopeError> {
    let [_, answer, _] = slot_begins(scope)?;
    let frames = scope.frames.iter().filter(|frame| frame.at_ns > answer);
    let end = scope
        .select
        .iter()
        .find(|(at_ns, high)| *high && *at_ns > answer);
    let Some((end_ns, _)) = end else {
        return Err(ScopeError::NotSeen("the end of a word"));
    };
    let window = (-500.0, *end_ns as f64 - answer as f64 + 500.0);
    let (mut clock, mut mosi, mut miso) = (Vec::new(), Vec::new(), Vec::new());
    let mut bit = 0.0;
    for frame in frames.take_while(|frame| frame.at_ns <= *end_ns) {
        let (begin, _) = frame_ns(frame, answer);
        bit = bit_ns(frame);
        for number in 0..frame.bits {
            let at = begin + f64::from(number) * bit;
            let level = |word: u32| word >> (frame.bits - 1 - number) & 1 == 1;
            // data are set half a bit before the edge that takes them
            clock.extend([(at + bit / 2.0, true), (at + bit, false)]);
            mosi.push((at, level(frame.mosi)));
            miso.push((at, level(frame.miso)));
        }
    }
    let rises = |index: usize| clock.get(2 * index).map(|(at, _)| *at);
    let (Some(first), Some(ninth)) = (rises(0), rises(8)) else {
        return Err(ScopeError::NotSeen("the bits of a word"));
    };
    let changes = |mut edges: Vec<(f64, bool)>| {
        edges.dedup_by_key(|(_, high)| *high);
        edges
    };
    let to = window.1 - 500.0;
    Ok(Picture {
        file: "scope-word.svg",
        title: format!(
            "The answer: two bytes at {:.2} MHz, the highest bit first",
            1e3 / bit
        ),
        from_to_ns: window,
        rows: vec![
            digital("CS PD14", &scope.select, answer, window),
            Row::levels("SCK PA5", false, &clock, window),
            Row::levels("MOSI PB5", false, &changes(mosi), window),
            Row::levels("MISO PA6", false, &changes(miso), window),
        ],
        spans: vec![
            Span {
                what: "selected for",
                row: 0,
                from_to_ns: (0.0, to),
            },
            Span {
                what: "8 bits",
                row: 1,
                from_to_ns: (first, ninth),
            },
        ],
    })
}

/// What a pin of the trace did.
fn of(trace: &[(u64, Output)], pick: impl Fn(&Output) -> Option<bool>) -> Vec<(u64, bool)> {
    let picked = trace
        .iter()
        .filter_map(|(at_ns, output)| Some((*at_ns, pick(output)?)));
    picked.collect()
}

fn steps(output: &Output) -> Option<bool> {
    match output {
        Output::LeverStep(high) => Some(*high),
        _ => None,
    }
}

fn lever_enable(output: &Output) -> Option<bool> {
    match output {
        Output::LeverEnable(high) => Some(*high),
        _ => None,
    }
}

fn stage_enable(output: &Output) -> Option<bool> {
    match output {
        Output::StageEnable(high) => Some(*high),
        _ => None,
    }
}

fn bridge_on(output: &Output) -> Option<bool> {
    match output {
        Output::StageDuty(duty) => Some(*duty != 0.0),
        _ => None,
    }
}

/// The lever's first steps.
fn step(trace: &[(u64, Output)]) -> Result<Picture, ScopeError> {
    let enable = of(trace, lever_enable);
    let step = of(trace, steps);
    let dir = of(trace, |output| match output {
        Output::LeverDown(high) => Some(*high),
        _ => None,
    });
    let not_seen = ScopeError::NotSeen("steps of the lever");
    let Some((zero_ns, _)) = enable.iter().find(|(_, high)| *high) else {
        return Err(not_seen);
    };
    let window = (-1e6, 14e6);
    let (_, pulses) = seen(&step, *zero_ns, window);
    let [(first, true), (low, false), (second, true), ..] = pulses[..] else {
        return Err(not_seen);
    };
    let down = dir
        .iter()
        .rfind(|(at_ns, _)| *at_ns <= *zero_ns)
        .is_some_and(|(_, high)| *high);
    Ok(Picture {
        file: "scope-step.svg",
        title: format!(
            "The lever begins to go {}",
            if down { "down" } else { "up" }
        ),
        from_to_ns: window,
        rows: vec![
            digital("EN PE13", &enable, *zero_ns, window),
            digital("DIR PE11", &dir, *zero_ns, window),
            digital("STEP PE9", &step, *zero_ns, window),
        ],
        spans: vec![
            Span {
                what: "current before the first step",
                row: 0,
                from_to_ns: (0.0, first),
            },
            Span {
                what: "a pulse is high for",
                row: 2,
                from_to_ns: (first, low),
            },
            Span {
                what: "from step to step",
                row: 2,
                from_to_ns: (first, second),
            },
        ],
    })
}

/// Two periods of the stage's PWM, the current in them, and where in a period the converter looked.
fn pwm(rig: &mut Rig, scope: &Scope, mm_s: f64) -> Result<Picture, ScopeError> {
    const PLACES: u32 = 60;
    let BridgePwm {
        period_s,
        duty,
        since_s,
    } = rig
        .bridge_pwm()
        .ok_or(ScopeError::NotSeen("the stage's PWM"))?;
    let now_ns = rig.world().now_ns() as f64;
    let period = period_s * 1e9;
    let window = (0.0, 2.0 * period);
    let edges = [0.0, 1.0].map(|turn| {
        let begin = turn * period;
        [(begin, true), (begin + duty * period, false)]
    });
    let volt = |counts: u16| f64::from(counts) / 4096.0 * 3.3;
    let wave = (0..=2 * PLACES).map(|place| {
        let turns = f64::from(place) / f64::from(PLACES);
        let phase = PwmPhase {
            period_s,
            since_s: turns.fract() * period_s,
        };
        (turns * period, volt(rig.world().motor_adc_within(phase)))
    });
    let wave: Vec<(f64, f64)> = wave.collect();
    // those of the last 24 periods, at their places in one
    let began_ns = now_ns - since_s * 1e9;
    let recent = scope
        .current
        .iter()
        .filter(|(at_ns, _)| now_ns - *at_ns as f64 <= 24.0 * period);
    let dots = recent.map(|(at_ns, counts)| {
        let at = (*at_ns as f64 - began_ns).rem_euclid(period);
        (at, volt(*counts))
    });
    let mut dots: Vec<(f64, f64)> = dots.collect();
    // the driver of the ring looks, too
    dots.sort_by(|a, b| a.0.total_cmp(&b.0));
    dots.dedup_by(|a, b| a.0 - b.0 < 100.0);
    let volts = || wave.iter().chain(&dots).map(|(_, volt)| *volt);
    let (low, high) = (volts().fold(3.3, f64::min), volts().fold(0.0, f64::max));
    let scaled = |points: &[(f64, f64)]| {
        let level = |volt: f64| (volt - low) / (high - low).max(1e-3);
        points
            .iter()
            .map(|(at, volt)| (*at, level(*volt)))
            .collect()
    };
    Ok(Picture {
        file: "scope-pwm.svg",
        title: format!(
            "The bridge at {mm_s:.1} mm/s; PA3 from {low:.2} to {high:.2} V; dots: conversions of 24 periods"
        ),
        from_to_ns: window,
        rows: vec![
            Row::levels("PWM PC6", true, &edges.concat(), window),
            Row {
                name: "current PA3".to_owned(),
                line: scaled(&wave),
                dots: scaled(&dots),
                ..Row::default()
            },
        ],
        spans: vec![
            Span {
                what: "high for",
                row: 0,
                from_to_ns: (0.0, duty * period),
            },
            Span {
                what: "period",
                row: 0,
                from_to_ns: (0.0, period),
            },
        ],
    })
}

/// The encoder's lines at a speed, mm/s.
fn encoder(scope: &Scope, mm_s: f64) -> Result<Picture, ScopeError> {
    let edges = &scope.encoder;
    let line = |pick: fn(&(bool, bool)) -> bool| {
        let mut levels: Vec<(u64, bool)> = Vec::new();
        for edge in edges {
            let high = pick(&(edge.a, edge.b));
            if levels.last().is_none_or(|(_, before)| *before != high) {
                levels.push((edge.at_ns, high));
            }
        }
        levels
    };
    let (a, b) = (line(|(a, _)| *a), line(|(_, b)| *b));
    let rises = |levels: &[(u64, bool)]| -> Vec<u64> {
        let rises = levels.iter().skip(1).filter(|(_, high)| *high);
        rises.map(|(at_ns, _)| *at_ns).collect()
    };
    let not_seen = ScopeError::NotSeen("edges of the encoder");
    let [first, second, ..] = rises(&a)[..] else {
        return Err(not_seen);
    };
    let Some(after) = rises(&b).into_iter().find(|at_ns| *at_ns > first) else {
        return Err(not_seen);
    };
    let since = |at_ns: u64| at_ns as f64 - first as f64;
    let period = since(second);
    let window = (-0.25 * period, 2.4 * period);
    let way = if mm_s < 0.0 { "left" } else { "right" };
    Ok(Picture {
        file: "scope-encoder.svg",
        title: format!(
            "The encoder while the stage goes to the {way} at {:.1} mm/s",
            mm_s.abs()
        ),
        from_to_ns: window,
        rows: vec![
            digital("A PD12", &a, first, window),
            digital("B PD13", &b, first, window),
        ],
        spans: vec![
            Span {
                what: "A's period",
                row: 0,
                from_to_ns: (0.0, period),
            },
            Span {
                what: "A to B",
                row: 1,
                from_to_ns: (0.0, since(after)),
            },
        ],
    })
}

/// The emergency stop while the stage moves.
fn stop(scope: &Scope, trace: &[(u64, Output)]) -> Result<Picture, ScopeError> {
    let not_seen = ScopeError::NotSeen("the emergency stop");
    let opens = || scope.stop.iter().filter(|(_, high)| *high);
    let (Some((zero_ns, _)), Some((quiet_ns, _))) = (opens().next(), opens().next_back()) else {
        return Err(not_seen);
    };
    let window = (-3e6, 17e6);
    let quiet = (quiet_ns - zero_ns) as f64;
    let pwm = of(trace, bridge_on);
    let (_, edges) = seen(&pwm, *zero_ns, (0.0, window.1));
    let Some((off, _)) = edges.iter().find(|(_, on)| !on) else {
        return Err(not_seen);
    };
    Ok(Picture {
        file: "scope-stop.svg",
        title: "The emergency stop is pressed while the stage moves".to_owned(),
        from_to_ns: window,
        rows: vec![
            digital("stop PF13", &scope.stop, *zero_ns, window),
            digital("PWM PC6", &pwm, *zero_ns, window),
            digital("EN PC8", &of(trace, stage_enable), *zero_ns, window),
            digital("EN PE13", &of(trace, lever_enable), *zero_ns, window),
        ],
        spans: vec![
            Span {
                what: "bounces for",
                row: 0,
                from_to_ns: (0.0, quiet),
            },
            // three looks, 1 ms apart, may all find it open while it bounces
            Span {
                what: "stopped within",
                row: 1,
                from_to_ns: (0.0, *off),
            },
        ],
    })
}
