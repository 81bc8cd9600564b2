//! Scenarios for the handheld probe as files: a person's actions, and the expected screens.
//!
//! A scenario is JSON: the texture under the finger, the steadiness of the hand, and steps, each of which does one
//! thing ([`Step`]). The emulated board plays them.

use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::data::recordings::files::open;
use crate::sim::collection::{Collection, texture_number};
use tactus_world::person::Manner;
use tactus_world::world::Setup;

/// Longest wait of a step, s, unless it gives another.
pub const TIMEOUT_S: f64 = 8.0;
/// A scenario.
#[derive(Clone, PartialEq, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Subject of the scenario.
    pub about: String,
    /// The texture under the finger: one of Table 1, by name or number.
    pub texture: String,
    /// The world it is of; the firmware's table is of world 1.
    #[serde(default = "one")]
    pub world: u64,
    /// The hand, and all other chance.
    #[serde(default = "one")]
    pub seed: u64,
    /// The steadiness of the hand; a careful adult's by default.
    #[serde(default)]
    pub hand: Manner,
    /// The steps, in order.
    pub step: Vec<Step>,
}

fn one() -> u64 {
    1
}

/// One action or expectation.
#[derive(Clone, PartialEq, Debug, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Step {
    /// Nothing: a word to the reader.
    Note {
        /// Its text.
        text: String,
    },
    /// All of this is on the display within so many seconds.
    See {
        /// Parts of lines.
        text: Vec<String>,
        /// s.
        #[serde(default = "timeout")]
        within_s: f64,
    },
    /// None of this is on the display now.
    Miss {
        /// Parts of lines.
        text: Vec<String>,
    },
    /// The display is off within so many seconds.
    Dark {
        /// s.
        within_s: f64,
    },
    /// The buzzer has sounded about this within the last two seconds.
    Hear {
        /// Hz.
        hz: u32,
    },
    /// The hand's intention from now on; without force it lifts the finger.
    Hand {
        /// N.
        force_n: f64,
        /// mm/s.
        #[serde(default)]
        pace_mm_s: f64,
    },
    /// The hand presses until the display wants a slide, slides for so long, and lifts the finger.
    Slide {
        /// N.
        force_n: f64,
        /// mm/s.
        pace_mm_s: f64,
        /// s.
        seconds: f64,
    },
    /// Slides like that until the display wants none any more.
    Explore {
        /// N.
        force_n: f64,
        /// mm/s.
        pace_mm_s: f64,
        /// At most so many.
        slides: u32,
        /// Duration of each, s.
        #[serde(default = "explored")]
        seconds: f64,
    },
    /// The button is pressed so many times, for so long each.
    Press {
        /// ms; 600 and more is a long press.
        ms: u64,
        /// Number of presses.
        #[serde(default = "once")]
        times: u32,
    },
    /// Time passes.
    Wait {
        /// s.
        seconds: f64,
    },
    /// Another sample is put under the finger, which is up.
    Place {
        /// A texture of Table 1.
        texture: String,
    },
    /// The power is off and on again; the store stays.
    PowerCycle,
    /// The sensor's plug is out, or in again.
    Sensor {
        /// Which.
        plugged: bool,
    },
    /// The display's plug is out, or in again.
    Display {
        /// Which.
        plugged: bool,
    },
}

fn timeout() -> f64 {
    TIMEOUT_S
}

fn explored() -> f64 {
    Step::EXPLORED_S
}

fn once() -> u32 {
    1
}

/// A name that is none of Table 1.
#[derive(Debug, thiserror::Error)]
#[error("no texture {0:?} in Table 1")]
pub struct UnknownTexture(String);

impl Scenario {
    /// Reads a scenario.
    /// Errors: the file cannot be read, or is no scenario.
    pub fn read(path: &Path) -> io::Result<Self> {
        let json = io::read_to_string(open(path)?)?;
        Ok(Self::parse(json.as_bytes())?)
    }

    /// A scenario from its JSON.
    /// Errors: it is none.
    pub fn parse(json: &[u8]) -> serde_json::Result<Self> {
        serde_json::from_slice(json)
    }

    /// The rig for the board that is switched on for the `starts`th time, from 0: every time is another trial, of which
    /// nothing was learned.
    pub fn setup(&self, texture: u8, starts: u64) -> Setup {
        let collection = Collection {
            seed: self.world,
            textures: Vec::new(),
            trials: 1,
        };
        collection.setup(texture, 100 * self.seed + starts)
    }
}

/// Number of a texture of Table 1.
/// Errors: there is no such texture.
pub fn texture(name: &str) -> Result<u8, UnknownTexture> {
    texture_number(name).ok_or_else(|| UnknownTexture(name.into()))
}

impl Step {
    /// Time from a view to the reaction, ms.
    pub const REACTION_MS: u64 = 300;
    /// Default duration of a slide of [`Step::Explore`], and longest wait for its verdict, s.
    pub const EXPLORED_S: f64 = 1.8;
    /// See [`Step::EXPLORED_S`].
    pub const VERDICT_S: f64 = 1.0;
    /// Time from the end of a slide to the lifting of the finger, and from there to the end of the step, s.
    pub const HELD_S: f64 = 0.15;
    /// See [`Step::HELD_S`].
    pub const LIFTED_S: f64 = 0.5;
    /// From one press of the button to the next, ms.
    pub const RELEASED_MS: u64 = 100;
}
