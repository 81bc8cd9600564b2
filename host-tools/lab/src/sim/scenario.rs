//! Scenarios for the handheld probe as files: a person's actions, and the expected screens.
//!
//! A scenario is JSON: the texture under the finger, the steadiness of the hand, and steps, each of which does one
//! thing ([`Step`]). The file is not trusted: a scenario that is accepted ([`Scenario::parse`]) can be played, in a
//! time that has an end ([`Scenario::longest_s`]). The emulated board plays them.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::sim::collection::{Collection, texture_number};
use tactus_world::person::Manner;
use tactus_world::world::Setup;

/// Longest wait of a step, s, unless it gives another.
pub const TIMEOUT_S: f64 = 8.0;
/// Limits of a scenario: bytes of a file, steps, and virtual seconds that they may take.
const MAX_BYTES: u64 = 256 << 10;
const MAX_STEPS: usize = 1000;
const MAX_S: f64 = 3600.0;
/// A finger is not pressed harder, N, or moved faster, mm/s.
const MAX_FORCE_N: f64 = 10.0;
const MAX_PACE_MM_S: f64 = 500.0;
/// Largest relative deviation of a hand.
const MAX_DEVIATION: f64 = 1.0;
const MAX_TILT_MM: f64 = 10.0;
/// Seeds have room for trials behind them.
const MAX_SEED: u64 = 1_000_000;
/// Tones that a person can hear, Hz.
const MAX_HZ: u32 = 20_000;

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

/// Reasons why a file is no scenario.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// It cannot be read.
    #[error("{} cannot be read", path.display())]
    Read {
        /// Its path.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// It is invalid.
    #[error("{}: {why}", path.display())]
    Invalid {
        /// Its path.
        path: PathBuf,
        /// The reason.
        why: InvalidScenario,
    },
}

/// Faults in a scenario.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidScenario {
    /// It is longer than any.
    #[error("more than {MAX_BYTES} bytes")]
    TooLong,
    /// It is no JSON, or has unknown fields.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// No such texture.
    #[error("no texture {0:?} in Table 1")]
    Texture(String),
    /// A seed without room for trials behind it.
    #[error("{what} is {is}: 0 to {MAX_SEED}")]
    Seed {
        /// Which.
        what: &'static str,
        /// Its value.
        is: u64,
    },
    /// More than there is time for.
    #[error("{0} steps: at most {MAX_STEPS}")]
    Steps(usize),
    /// A number beyond its range.
    #[error("{whose}: {what} is {is}: {low} to {high}")]
    Number {
        /// The hand, or the number of the step.
        whose: String,
        /// Which.
        what: &'static str,
        /// Its value.
        is: f64,
        /// Least.
        low: f64,
        /// Most.
        high: f64,
    },
    /// A step that looks for nothing.
    #[error("step {0} looks for no text")]
    Nothing(usize),
    /// It takes too long.
    #[error("it may take {0:.0} s: at most {MAX_S} s")]
    Endless(f64),
}

impl Scenario {
    /// Reads a scenario.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn read(path: &Path) -> Result<Self, ScenarioError> {
        use std::io::Read as _;
        let read = |source| ScenarioError::Read {
            path: path.into(),
            source,
        };
        let file = std::fs::File::open(path).map_err(read)?;
        let mut bytes = Vec::new();
        file.take(MAX_BYTES + 1)
            .read_to_end(&mut bytes)
            .map_err(read)?;
        Self::parse(&bytes).map_err(|why| ScenarioError::Invalid {
            path: path.into(),
            why,
        })
    }

    /// A scenario from its JSON.
    ///
    /// # Errors
    /// See [`InvalidScenario`].
    pub fn parse(json: &[u8]) -> Result<Self, InvalidScenario> {
        if json.len() as u64 > MAX_BYTES {
            return Err(InvalidScenario::TooLong);
        }
        let scenario: Self = serde_json::from_slice(json)?;
        scenario.check()?;
        Ok(scenario)
    }

    fn check(&self) -> Result<(), InvalidScenario> {
        texture(&self.texture)?;
        for (what, is) in [("world", self.world), ("seed", self.seed)] {
            if is > MAX_SEED {
                return Err(InvalidScenario::Seed { what, is });
            }
        }
        if self.step.len() > MAX_STEPS {
            return Err(InvalidScenario::Steps(self.step.len()));
        }
        let Manner {
            tremor,
            wander,
            uneven,
            force_spread,
            pace_spread,
            tilt_mm,
        } = self.hand;
        for (what, is) in [
            ("tremor", tremor),
            ("wander", wander),
            ("uneven", uneven),
            ("force_spread", force_spread),
            ("pace_spread", pace_spread),
        ] {
            within("the hand", what, is, 0.0, MAX_DEVIATION)?;
        }
        within(
            "the hand",
            "tilt_mm",
            tilt_mm.unwrap_or(0.0),
            0.0,
            MAX_TILT_MM,
        )?;
        for (step, number) in self.step.iter().zip(1..) {
            step.check(number)?;
        }
        let longest_s = self.longest_s();
        if longest_s > MAX_S {
            return Err(InvalidScenario::Endless(longest_s));
        }
        Ok(())
    }

    /// Virtual seconds that it takes at most.
    pub fn longest_s(&self) -> f64 {
        self.step.iter().map(Step::longest_s).sum()
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
///
/// # Errors
/// There is no such texture.
pub fn texture(name: &str) -> Result<u8, InvalidScenario> {
    texture_number(name).ok_or_else(|| InvalidScenario::Texture(name.into()))
}

fn within(
    whose: &str,
    what: &'static str,
    is: f64,
    low: f64,
    high: f64,
) -> Result<(), InvalidScenario> {
    // a NaN is in no range
    if (low..=high).contains(&is) {
        return Ok(());
    }
    Err(InvalidScenario::Number {
        whose: whose.into(),
        what,
        is,
        low,
        high,
    })
}

impl Step {
    fn check(&self, number: usize) -> Result<(), InvalidScenario> {
        let whose = format!("step {number}");
        let time = |is| within(&whose, "its time in s", is, 0.0, MAX_S);
        let force = |is| within(&whose, "force_n", is, 0.0, MAX_FORCE_N);
        let pace = |is| within(&whose, "pace_mm_s", is, -MAX_PACE_MM_S, MAX_PACE_MM_S);
        match self {
            Self::See { text, within_s } => {
                if text.iter().all(String::is_empty) {
                    return Err(InvalidScenario::Nothing(number));
                }
                time(*within_s)
            }
            Self::Miss { text } => {
                // nothing is on every display
                if text.is_empty() || text.iter().any(String::is_empty) {
                    return Err(InvalidScenario::Nothing(number));
                }
                Ok(())
            }
            Self::Dark { within_s } => time(*within_s),
            Self::Hear { hz } => within(&whose, "hz", f64::from(*hz), 1.0, f64::from(MAX_HZ)),
            Self::Hand { force_n, pace_mm_s } => {
                force(*force_n)?;
                pace(*pace_mm_s)
            }
            Self::Slide {
                force_n,
                pace_mm_s,
                seconds,
            }
            | Self::Explore {
                force_n,
                pace_mm_s,
                seconds,
                ..
            } => {
                force(*force_n)?;
                pace(*pace_mm_s)?;
                time(*seconds)
            }
            Self::Wait { seconds } => time(*seconds),
            Self::Place { texture: name } => texture(name).map(|_| ()),
            // their time is counted
            Self::Press { .. }
            | Self::Note { .. }
            | Self::PowerCycle
            | Self::Sensor { .. }
            | Self::Display { .. } => Ok(()),
        }
    }

    /// Virtual seconds that it takes at most.
    fn longest_s(&self) -> f64 {
        match self {
            Self::See { within_s, .. } | Self::Dark { within_s } => *within_s,
            Self::Slide { seconds, .. } => slide_s(*seconds),
            Self::Explore {
                slides, seconds, ..
            } => f64::from(*slides) * (slide_s(*seconds) + Self::VERDICT_S),
            Self::Press { ms, times } => {
                f64::from(*times) * (*ms as f64 + Self::RELEASED_MS as f64) * 1e-3
            }
            Self::Wait { seconds } => *seconds,
            Self::Note { .. }
            | Self::Miss { .. }
            | Self::Hear { .. }
            | Self::Hand { .. }
            | Self::Place { .. }
            | Self::PowerCycle
            | Self::Sensor { .. }
            | Self::Display { .. } => 0.0,
        }
    }

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

/// Duration of a slide of so many seconds, with all waits.
fn slide_s(seconds: f64) -> f64 {
    TIMEOUT_S + Step::REACTION_MS as f64 * 1e-3 + seconds + Step::HELD_S + Step::LIFTED_S
}

#[cfg(test)]
mod tests;
