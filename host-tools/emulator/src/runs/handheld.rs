//! An exploration by the handheld's firmware: a hand presses and slides, and the display says what it is.

use anyhow::{Context as _, anyhow};
use clap::Args as Arguments;
use serde_json::json;
use tactus_core::sensor::FingerName;
use tactus_core::wire::{Command, Counts, Event};
use tactus_lab::sim::collection::{Collection, texture_name};
use tactus_link::Session;
use tactus_world::person::Manner;
use tactus_world::textures::TEXTURES;

use crate::board::{Display, Emulator, Error};
use crate::host::args::{Firmware, Format};
use crate::host::hand::{Holder, SLIDE_S, Seen};
use crate::host::milestones::Milestones;
use crate::host::under_finger;

/// The firmware's table is of this world.
const WORLD: u64 = 1;
const NO_VERDICT: &str = "the display shows no verdict";
/// Intended force of the slides, as the display asks for it.
const FORCE_N: f64 = 0.5;
const PACE_MM_S: f64 = 25.0;
/// Slides until there must be a verdict: ten that count, and three times as many that are made again.
const SLIDES: u32 = 40;
/// The firmware's force is a mean over so long, ns.
const MEAN_NS: u64 = 100_000_000;
/// Until then the status is here.
const ANSWERED_MS: u64 = 200;
/// Time by which the firmware hears its host, s.
const BOOTED_S: f64 = 0.5;
/// Letters that the rows below a headline have at most: longer texts are headlines.
const ROW: usize = 11;
/// Letters of a headline in the smallest font, and of a name before its question mark.
const HEADLINE: usize = 21;
const PERHAPS: usize = 20;

/// What is touched, and by whom.
#[derive(Arguments)]
pub(crate) struct Args {
    #[command(flatten)]
    firmware: Firmware,
    /// The hand, and all other chance
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(..=1_000_000))]
    seed: u64,
    /// What lies under the finger: a texture of Table 1; drawn by the seed unless given
    #[arg(long, value_name = "NAME")]
    texture: Option<String>,
    /// The probe has a sensor of motion
    #[arg(long)]
    motion: bool,
    /// The finger that the firmware is for: biotac, analog (piezo disc and load cell) or mems (accelerometer and load
    /// cell)
    #[arg(long, value_name = "NAME", default_value_t = FingerName::Biotac)]
    finger: FingerName,
    /// How long the hand slides each time, s
    #[arg(long, value_name = "S", default_value_t = SLIDE_S, value_parser = slide_s)]
    slide_s: f64,
    /// For people, or a line of JSON at the end for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

impl Args {
    /// Has a hand explore this texture, whose host sends these bytes once it is heard.
    fn explore(&self, texture: u8, host: &[u8]) -> anyhow::Result<Holder> {
        let collection = Collection::new(WORLD, Vec::new(), 1).touched_by(self.finger);
        let setup = collection.setup(texture, 100 * self.seed);
        let hand = Manner {
            // the hand holds it level
            tilt_mm: self.motion.then_some(0.0),
            ..Manner::default()
        };
        let mut holder = Holder::start(&self.firmware.elf, setup, hand, None)?;
        holder.wait(BOOTED_S)?;
        holder.board.send(host);
        match holder.explore(FORCE_N, PACE_MM_S, SLIDES, self.slide_s)? {
            true => Ok(holder),
            false => Err(anyhow!(NO_VERDICT)),
        }
    }
}

fn slide_s(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.1..=10.0).contains(&seconds) => Ok(seconds),
        _ => Err("0.1 to 10 s".into()),
    }
}

/// The display's last words.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum VerdictKind {
    Sure(&'static str),
    Perhaps(&'static str),
    Unknown,
}

pub(crate) fn run(args: &Args) -> anyhow::Result<()> {
    let text = args.format == Format::Text;
    let sha256 = args.firmware.show(text)?;
    let number = match &args.texture {
        Some(name) => under_finger::number(name)?,
        // neighbours of the table are alike
        None => TEXTURES[(args.seed * 31) as usize % TEXTURES.len()].number,
    };
    let truth = texture_name(number);
    if text {
        println!(
            "An unknown texture in a hand. Under the finger: {truth} (seed {}).",
            args.seed
        );
    }
    let mut session = Session::default();
    let mut status = Vec::new();
    // a request for the status is never too long
    let _ = session.request(Command::Status, &mut status);
    let Holder { mut board, looks } = args.explore(number, &status)?;
    let times = milestones(&board, &looks);
    let heard = Heard::of(&mut board, session)?;
    let seconds = board.now_ns() as f64 * 1e-9;
    // negative where the verdict was there before the hand stood
    let stood_ns = board.rig().slides().last().map(|slide| slide.ended_ns);
    let written_ns = board.rig().display().written_ns();
    let end_to_screen_s = stood_ns
        .zip(written_ns)
        .map(|(from, to)| (to as f64 - from as f64) * 1e-9);
    let told = told(board.rig().display()).context(NO_VERDICT)?;
    let (says, verdict) = match told {
        VerdictKind::Sure(name) if name == truth => (format!("It is {name}."), "Right"),
        VerdictKind::Sure(name) => (format!("It is {name}."), "Wrong"),
        VerdictKind::Perhaps(name) => (format!("{name}?"), "Undecided"),
        VerdictKind::Unknown => ("It is none of those known.".to_owned(), "Wrong"),
    };
    if !text {
        let line = json!({
            "finger": args.finger.as_str(),
            "truth": truth,
            "says": says,
            "verdict": verdict,
            "seconds": seconds,
            "seconds_to_ready": times.seconds_to_ready(),
            "seconds_to_verdict": times.seconds_to_verdict(),
            "slides": board.rig().slides().len(),
            "slide_end_to_screen_s": end_to_screen_s,
            "force_max_n": board.rig().world().truth().force_max_n,
            "force_errors": heard.force_errors,
            "lost": heard.lost,
            "late": heard.late,
            "damaged": heard.damaged,
            "seed": args.seed,
            "elf_sha256": sha256,
        });
        println!("{line}");
        return Ok(());
    }
    println!("{says}");
    match verdict {
        "Right" => println!("Right."),
        _ => println!("{verdict}: it was {truth}."),
    }
    let times = times.sentence("touch");
    println!("{times}{seconds:.1} s of the board's time.");
    if let Some(seconds) = end_to_screen_s {
        let when = if seconds < 0.0 { "before" } else { "after" };
        let seconds = seconds.abs();
        println!("The verdict was on the display {seconds:.2} s {when} the hand stood.");
    }
    Ok(())
}

/// Finds the milestones by the world's touches and by what the display showed.
fn milestones(board: &Emulator, seen: &[(u64, Seen)]) -> Milestones {
    let mut times = Milestones::default();
    let touched_ns = board.rig().touches().first().map(|touch| touch.began_ns);
    if let Some(touched_ns) = touched_ns {
        times.begin(touched_ns);
    }
    for &(at_ns, seen) in seen {
        match seen {
            Seen::Press if touched_ns.is_none_or(|touched_ns| at_ns <= touched_ns) => {
                times.ready(at_ns);
            }
            Seen::Over => {
                times.verdict(at_ns);
                break;
            }
            _ => {}
        }
    }
    times
}

/// The firmware's reports to its host, against the world.
struct Heard {
    /// Of each slide, by how much of the world's mean force the firmware's is off: means over the same time.
    force_errors: Vec<f64>,
    /// Samples and reports.
    lost: u64,
    /// Slots.
    late: u64,
    /// Words and frames.
    damaged: u64,
}

impl Heard {
    fn of(board: &mut Emulator, mut session: Session) -> Result<Self, Error> {
        let mut status = Vec::new();
        let _ = session.request(Command::Status, &mut status);
        board.send(&status);
        board.run_ms(ANSWERED_MS)?;
        let (mut forces, mut counts) = (Vec::new(), Counts::default());
        for (at_ns, byte) in board.received() {
            for report in session.receive(&[byte]) {
                match report.event {
                    // told at the end of a mean of 100 ms
                    Event::Live(live) => forces.push((at_ns, f64::from(live.force_mn) * 1e-3)),
                    Event::Status(status) => counts = status.counts,
                    _ => {}
                }
            }
        }
        let slides = board.rig().slides().to_vec();
        let force_errors = slides.iter().filter_map(|slide| {
            let of = slide.began_ns + MEAN_NS..slide.ended_ns;
            let told = forces.iter().filter(|(at_ns, _)| of.contains(at_ns));
            let told: Vec<f64> = told.map(|(_, newton)| *newton).collect();
            let mean_n = told.iter().sum::<f64>() / told.len() as f64;
            (!told.is_empty()).then_some((mean_n / slide.force_mean_n - 1.0).abs())
        });
        Ok(Self {
            force_errors: force_errors.collect(),
            lost: u64::from(counts.lost_samples)
                + u64::from(counts.lost_reports)
                + session.missing(),
            late: counts.late_slots.into(),
            damaged: u64::from(counts.parity_errors)
                + u64::from(counts.error_frames)
                + u64::from(counts.damaged_frames)
                + session.damaged(),
        })
    }
}

/// The headline of the verdict; `None` where there is none.
fn told(display: &Display) -> Option<VerdictKind> {
    if display.shows_large("Unknown") {
        return Some(VerdictKind::Unknown);
    }
    let is_headline = |text: &str| match text.chars().count() {
        0..=ROW => display.shows_large(text),
        _ => display.shows(text),
    };
    // a name may be a part of another
    let shown = |most: usize, mark: &str| {
        let names = TEXTURES.iter().map(|t| t.name);
        names
            .filter(|name| is_headline(&(cut(name, most) + mark)))
            .max_by_key(|name| name.len())
    };
    let perhaps = shown(PERHAPS, "?").map(VerdictKind::Perhaps);
    perhaps.or_else(|| shown(HEADLINE, "").map(VerdictKind::Sure))
}

/// As the display cuts a text: two points in place of what is missing.
fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let kept: String = text.chars().take(most - 2).collect();
    kept + ".."
}
