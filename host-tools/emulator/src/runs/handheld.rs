//! An exploration by the handheld's firmware: a hand presses and slides, and the display says what it is.

use clap::Args as Arguments;
use serde_json::json;
use tactus::sim::person::Manner;
use tactus::sim::scenario::{Scenario, Step, texture};
use tactus::sim::textures::TEXTURES;
use tactus_core::sensor::FingerName;

use super::error::RunError;
use crate::board::Display;
use crate::host::args::{Firmware, Format};
use crate::scenario::{self, PlayError};

/// The firmware's table is of this world.
const WORLD: u64 = 1;
/// How the slides are meant: as the display asks for them.
const FORCE_N: f64 = 0.5;
const PACE_MM_S: f64 = 25.0;
/// Slides until there must be a verdict: five that count, and others that are made again.
const SLIDES: u32 = 20;
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
    /// The finger that the firmware is for: biotac, analog (piezo disc and load cell) or mems (accelerometer and load cell)
    #[arg(long, value_name = "NAME", default_value_t = FingerName::Biotac)]
    finger: FingerName,
    /// For people, or a line of JSON at the end for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
}

/// What the display says in the end.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum Told {
    Sure(&'static str),
    Perhaps(&'static str),
    Unknown,
}

/// Has a hand explore, and says what the display told it.
pub(crate) fn run(args: &Args) -> Result<(), RunError> {
    let text = args.format == Format::Text;
    let sha256 = args.firmware.show(text)?;
    let truth = match &args.texture {
        Some(name) => {
            let number = texture(name).map_err(PlayError::from)?;
            TEXTURES[usize::from(number) - 1].name
        }
        // neighbours of the table are alike
        None => TEXTURES[(args.seed * 31) as usize % TEXTURES.len()].name,
    };
    if text {
        println!(
            "An unknown texture in a hand. Under the finger: {truth} (seed {}).",
            args.seed
        );
    }
    let scenario = Scenario {
        about: "an exploration".to_owned(),
        texture: truth.to_owned(),
        world: WORLD,
        seed: args.seed,
        hand: Manner {
            // the hand holds it level
            tilt_mm: args.motion.then_some(0.0),
            ..Manner::default()
        },
        step: vec![Step::Explore {
            force_n: FORCE_N,
            pace_mm_s: PACE_MM_S,
            slides: SLIDES,
        }],
    };
    let mut board = scenario::play(&scenario, args.finger, &args.firmware.elf, None)?;
    let seconds = board.now_ns() as f64 * 1e-9;
    let told = told(board.rig().display());
    let (says, verdict) = match told {
        Some(Told::Sure(name)) => (format!("It is {name}."), name == truth),
        Some(Told::Perhaps(name)) => (format!("{name}?"), false),
        Some(Told::Unknown) => ("It is none of those known.".to_owned(), false),
        None => return Err(RunError::NoVerdict),
    };
    let open = matches!(told, Some(Told::Perhaps(_)));
    let verdict = match (verdict, open) {
        (true, _) => "Right",
        (_, true) => "Undecided",
        _ => "Wrong",
    };
    let log = board.log()?;
    // what the firmware said last
    let last = |what: &str| {
        let mut lines = log.iter().rev();
        lines.find_map(|(_, line)| Some(line.split_once(what)?.1.trim().to_owned()))
    };
    let (awake, slots) = (last("awake listening:"), last("sensor slots:"));
    if !text {
        let awake: Option<f64> = awake.and_then(|share| share.parse().ok());
        let line = json!({
            "finger": args.finger.as_str(),
            "truth": truth,
            "says": says,
            "verdict": verdict,
            "seconds": seconds,
            "awake": awake,
            "slots": slots,
            "force_max_n": board.rig().world().truth().force_max_n,
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
    println!("{seconds:.1} s of the board's time.");
    if let (Some(awake), Some(slots)) = (awake, slots) {
        println!("Awake while it listens: {awake} of the time. Sensor slots: {slots}.");
    }
    Ok(())
}

/// The headline of the verdict; `None` where there is none.
fn told(display: &Display) -> Option<Told> {
    if display.shows_large("Unknown") {
        return Some(Told::Unknown);
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
    let perhaps = shown(PERHAPS, "?").map(Told::Perhaps);
    perhaps.or_else(|| shown(HEADLINE, "").map(Told::Sure))
}

/// As the display cuts a text: two points in place of what is missing.
fn cut(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return text.to_owned();
    }
    let kept: String = text.chars().take(most - 2).collect();
    kept + ".."
}
