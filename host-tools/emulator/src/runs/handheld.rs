//! An exploration by the handheld's firmware: a hand presses and slides, and the display says what it is.

use clap::Args as Arguments;
use tactus::sim::person::Manner;
use tactus::sim::scenario::{Scenario, Step, texture};
use tactus::sim::textures::TEXTURES;

use super::error::RunError;
use crate::board::Display;
use crate::host::args::Firmware;
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
    args.firmware.show(true)?;
    let truth = match &args.texture {
        Some(name) => {
            let number = texture(name).map_err(PlayError::from)?;
            TEXTURES[usize::from(number) - 1].name
        }
        // neighbours of the table are alike
        None => TEXTURES[(args.seed * 31) as usize % TEXTURES.len()].name,
    };
    println!(
        "An unknown texture in a hand. Under the finger: {truth} (seed {}).",
        args.seed
    );
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
    let board = scenario::play(&scenario, &args.firmware.elf, None)?;
    let seconds = board.now_ns() as f64 * 1e-9;
    let told = told(board.rig().display());
    match told {
        Some(Told::Sure(name)) => println!("It is {name}."),
        Some(Told::Perhaps(name)) => println!("{name}?"),
        Some(Told::Unknown) => println!("It is none of those known."),
        None => return Err(RunError::NoVerdict),
    }
    match told {
        Some(Told::Sure(name)) if name == truth => println!("Right."),
        Some(Told::Perhaps(_)) => println!("Undecided: it was {truth}."),
        _ => println!("Wrong: it was {truth}."),
    }
    println!("{seconds:.1} s of the board's time.");
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
