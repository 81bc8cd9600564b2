//! Scenarios for the handheld probe: what a person does, and what must be seen, as files in `scenarios/`.
//!
//! A scenario is JSON: the texture under the finger, how the hand is kept, and steps, each of which does one thing
//! ([`Step`]). The person sees the display and nothing else, as it is decoded from the bytes on the wire.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use tactus::collection::{Collection, texture_number};
use tactus::sim::faults::Fault;
use tactus::sim::hand::{Hand, Manner};
use tactus::sim::world::NotLifted;

use crate::board::{Emulator, Error, Options};
use crate::rig::Output;

/// How often the person looks, ns.
const LOOK_NS: u64 = 20_000_000;
/// What the display says when it wants a slide, and when it wants none any more.
const SLIDE: &str = "5 cm in 2 s";
const OVER: &str = "next";
/// From what is seen to what is done, ms.
const REACTION_MS: u64 = 300;
/// Longest that anything is waited for, s, unless a step says otherwise.
const PATIENCE_S: f64 = 8.0;

/// A scenario.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// What it shows.
    pub about: String,
    /// What lies under the finger: a texture of Table 1, by name or number.
    pub texture: String,
    /// The world it is of; the firmware's table is of world 1.
    #[serde(default = "one")]
    pub world: u64,
    /// The hand, and all other chance.
    #[serde(default = "one")]
    pub seed: u64,
    /// How the hand is kept; as a careful adult's unless said.
    #[serde(default)]
    pub hand: Kept,
    /// What is done and seen, one after the other.
    pub step: Vec<Step>,
}

fn one() -> u64 {
    1
}

/// See [`Manner`].
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Kept {
    /// Relative to the force, rms.
    pub tremor: f64,
    /// Relative to the force, rms.
    pub wander: f64,
    /// Relative to the pace, rms.
    pub uneven: f64,
}

impl Default for Kept {
    fn default() -> Self {
        let Manner {
            tremor,
            wander,
            uneven,
        } = Manner::default();
        Self {
            tremor,
            wander,
            uneven,
        }
    }
}

/// One thing that is done or must be seen.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Step {
    /// Nothing: a word to the reader.
    Note {
        /// What it says.
        text: String,
    },
    /// All of this is on the display within so many seconds.
    See {
        /// Parts of lines.
        text: Vec<String>,
        /// s.
        #[serde(default = "patience")]
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
    /// The hand means to do this from now on; without force it lifts the finger.
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
    },
    /// The button is pressed so many times, for so long each.
    Press {
        /// ms; 600 and more is a long press.
        ms: u64,
        /// How often.
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

fn patience() -> f64 {
    PATIENCE_S
}

fn once() -> u32 {
    1
}

/// Why a scenario did not come out as it says.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// It cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// Its path.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no scenario.
    #[error("{}: {source}", path.display())]
    Parse {
        /// Its path.
        path: PathBuf,
        /// Why.
        source: serde_json::Error,
    },
    /// No such texture.
    #[error("no texture {0} in Table 1")]
    Texture(String),
    /// The emulator.
    #[error(transparent)]
    Emulator(#[from] Error),
    /// A sample cannot be changed.
    #[error(transparent)]
    NotLifted(#[from] NotLifted),
    /// A step did not come out.
    #[error("step {number}, at {at_s:.2} s: {what}. The display:\n{display}")]
    Step {
        /// Which, from 1.
        number: usize,
        /// When, s of virtual time.
        at_s: f64,
        /// What was wrong.
        what: String,
        /// What was seen.
        display: String,
    },
}

impl Scenario {
    /// Reads a scenario.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn read(path: &Path) -> Result<Self, ScenarioError> {
        let text = std::fs::read_to_string(path).map_err(|source| ScenarioError::Read {
            path: path.into(),
            source,
        })?;
        serde_json::from_str(&text).map_err(|source| ScenarioError::Parse {
            path: path.into(),
            source,
        })
    }

    /// Plays it on a board with this ELF, which may hold a store from before. Gives the board as it is in the end.
    ///
    /// # Errors
    /// See [`ScenarioError`].
    pub fn play(&self, elf: &Path, store: Option<Vec<u8>>) -> Result<Emulator, ScenarioError> {
        let mut played = Played {
            scenario: self,
            elf,
            texture: number(&self.texture)?,
            starts: 0,
            board: None,
        };
        played.power_up(store)?;
        for (step, number) in self.step.iter().zip(1..) {
            let done = played.act(step)?;
            if let Err(what) = done {
                return Err(ScenarioError::Step {
                    number,
                    at_s: played.board().now_ns() as f64 * 1e-9,
                    what,
                    display: played.seen(),
                });
            }
        }
        Ok(played.board.take().expect("it was switched on"))
    }
}

fn number(texture: &str) -> Result<u8, ScenarioError> {
    texture_number(texture).ok_or_else(|| ScenarioError::Texture(texture.into()))
}

/// A scenario on a board.
struct Played<'s> {
    scenario: &'s Scenario,
    elf: &'s Path,
    texture: u8,
    /// How often the board was switched on: every time is another trial.
    starts: u64,
    board: Option<Emulator>,
}

/// What a step comes to: what was wrong.
type Done = Result<Result<(), String>, ScenarioError>;

impl Played<'_> {
    fn board(&mut self) -> &mut Emulator {
        self.board.as_mut().expect("it was switched on")
    }

    fn power_up(&mut self, store: Option<Vec<u8>>) -> Result<(), ScenarioError> {
        let collection = Collection {
            seed: self.scenario.world,
            textures: Vec::new(),
            trials: 1,
        };
        // trials that nothing was learned from
        let trial = 100 * self.scenario.seed + self.starts;
        self.starts += 1;
        let setup = collection.setup(self.texture, trial);
        let options = Options {
            store,
            ..Options::default()
        };
        let board = Emulator::start(self.elf, setup, options)?;
        let Kept {
            tremor,
            wander,
            uneven,
        } = self.scenario.hand;
        let manner = Manner {
            tremor,
            wander,
            uneven,
        };
        board
            .rig()
            .world()
            .hold(Hand::new(setup.trial_seed, manner));
        self.board = Some(board);
        Ok(())
    }

    fn intend(&mut self, force_n: f64, pace_mm_s: f64) {
        if let Some(hand) = self.board().rig().world().hand() {
            hand.intend(force_n, pace_mm_s);
        }
    }

    /// Looks until it is so.
    fn until(
        &mut self,
        within_s: f64,
        seen: impl Fn(&crate::Display) -> bool,
    ) -> Result<bool, Error> {
        let limit_ns = self.board().now_ns() + (within_s * 1e9) as u64;
        self.board()
            .run_to(limit_ns, LOOK_NS, |rig| seen(rig.display()))
    }

    fn run_s(&mut self, seconds: f64) -> Result<(), Error> {
        self.board().run_ms((seconds * 1e3) as u64)
    }

    fn slide(&mut self, force_n: f64, pace_mm_s: f64, seconds: f64) -> Done {
        self.intend(force_n, 0.0);
        if !self.until(PATIENCE_S, |display| display.shows(SLIDE))? {
            return Ok(Err("the display does not want a slide".into()));
        }
        self.board().run_ms(REACTION_MS)?;
        self.intend(force_n, pace_mm_s);
        self.run_s(seconds)?;
        self.intend(force_n, 0.0);
        self.run_s(0.15)?;
        self.intend(0.0, 0.0);
        self.run_s(0.5)?;
        Ok(Ok(()))
    }

    fn act(&mut self, step: &Step) -> Done {
        let shows =
            |display: &crate::Display, text: &[String]| text.iter().all(|text| display.shows(text));
        match step {
            Step::Note { .. } => {}
            Step::See { text, within_s } => {
                if !self.until(*within_s, |display| shows(display, text))? {
                    return Ok(Err(format!("{text:?} is not seen within {within_s} s")));
                }
            }
            Step::Miss { text } => {
                let rig = self.board().rig();
                if let Some(text) = text.iter().find(|text| rig.display().shows(text)) {
                    return Ok(Err(format!("{text:?} is seen")));
                }
            }
            Step::Dark { within_s } => {
                if !self.until(*within_s, |display| display.picture().is_none())? {
                    return Ok(Err("the display is not off".into()));
                }
            }
            Step::Hear { hz } => {
                let now_ns = self.board().now_ns();
                let rig = self.board().rig();
                let heard: Vec<u32> = rig
                    .trace()
                    .filter(|(at_ns, _)| at_ns + 2_000_000_000 > now_ns)
                    .filter_map(|(_, output)| match output {
                        Output::Buzzer(tone) => *tone,
                        _ => None,
                    })
                    .collect();
                if !heard.iter().any(|tone| tone.abs_diff(*hz) * 50 <= *hz) {
                    return Ok(Err(format!("{hz} Hz are not heard, but {heard:?}")));
                }
            }
            Step::Hand { force_n, pace_mm_s } => self.intend(*force_n, *pace_mm_s),
            Step::Slide {
                force_n,
                pace_mm_s,
                seconds,
            } => return self.slide(*force_n, *pace_mm_s, *seconds),
            Step::Explore {
                force_n,
                pace_mm_s,
                slides,
            } => {
                for _ in 0..*slides {
                    if let Err(what) = self.slide(*force_n, *pace_mm_s, 1.8)? {
                        return Ok(Err(what));
                    }
                    if self.until(1.0, |display| display.shows(OVER))? {
                        return Ok(Ok(()));
                    }
                }
                return Ok(Err(format!("{slides} slides were not enough")));
            }
            Step::Press { ms, times } => {
                for _ in 0..*times {
                    self.board().press(true)?;
                    self.board().run_ms(*ms)?;
                    self.board().press(false)?;
                    self.board().run_ms(100)?;
                }
            }
            Step::Wait { seconds } => self.run_s(*seconds)?,
            Step::Place { texture } => {
                self.texture = number(texture)?;
                let texture = self.texture;
                self.board().rig().world().place(texture)?;
            }
            Step::PowerCycle => {
                let store = self.board().store()?;
                // one board at a time
                self.board = None;
                self.power_up(Some(store))?;
            }
            Step::Sensor { plugged: false } => self.board().inject(Fault::SensorUnplugged),
            Step::Sensor { plugged: true } => self.board().rig().world().clear(),
            Step::Display { plugged } => self.board().rig().display_mut().plug(*plugged),
        }
        Ok(Ok(()))
    }

    /// The display in letters: two rows of points in each.
    fn seen(&mut self) -> String {
        let rig = self.board().rig();
        let Some(picture) = rig.display().picture() else {
            return "(off)".into();
        };
        let mut text = String::new();
        for y in (0..64).step_by(2) {
            text.extend(
                (0..128).map(|x| match (picture.is_lit(x, y), picture.is_lit(x, y + 1)) {
                    (true, true) => '█',
                    (true, false) => '▀',
                    (false, true) => '▄',
                    (false, false) => ' ',
                }),
            );
            text.push('\n');
        }
        text
    }
}
