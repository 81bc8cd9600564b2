//! Scenarios for the handheld probe, the files in `scenarios/`: what a person does, and what the display must show.
//!
//! A scenario is JSON: the texture under the finger, the steadiness of the hand, and steps, each of which does one
//! thing ([`Step`]).

use std::path::{Path, PathBuf};

use serde::Deserialize;
use tactus_emulator::board::{Display, Emulator, Output};
use tactus_emulator::host::hand::{Holder, SLIDE_S, TIMEOUT_S};
use tactus_lab::sim::collection::{Collection, texture_number};
use tactus_world::faults::Fault;
use tactus_world::person::Manner;
use tactus_world::world::Setup;

/// From one press of the button to the next, ms.
const RELEASED_MS: u64 = 100;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Scenario {
    /// Its subject.
    #[serde(rename = "about")]
    _about: String,
    /// One of Table 1, by name or number.
    texture: String,
    /// The firmware's table is of world 1.
    #[serde(default = "one")]
    world: u64,
    /// The hand, and all other chance.
    #[serde(default = "one")]
    seed: u64,
    #[serde(default)]
    hand: Manner,
    step: Vec<Step>,
}

fn one() -> u64 {
    1
}

/// One action or expectation.
#[derive(Deserialize, Debug)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
enum Step {
    /// A word to the reader.
    Note {
        #[serde(rename = "text")]
        _text: String,
    },
    /// All of this is on the display within so many seconds.
    See {
        text: Vec<String>,
        #[serde(default = "timeout")]
        within_s: f64,
    },
    /// None of this is on the display now.
    Miss { text: Vec<String> },
    /// The display is off within so many seconds.
    Dark { within_s: f64 },
    /// The buzzer has sounded about this within the last two seconds.
    Hear { hz: u32 },
    /// The hand's intention from now on; without force it lifts the finger.
    Hand {
        force_n: f64,
        #[serde(default)]
        pace_mm_s: f64,
    },
    /// The hand presses until the display wants a slide, slides for so long, and lifts the finger.
    Slide {
        force_n: f64,
        pace_mm_s: f64,
        seconds: f64,
    },
    /// Slides like that until the display wants none any more, at most so many.
    Explore {
        force_n: f64,
        pace_mm_s: f64,
        slides: u32,
        #[serde(default = "explored")]
        seconds: f64,
    },
    /// The button is pressed so many times, for so long each; 600 ms and more is a long press.
    Press {
        ms: u64,
        #[serde(default = "once")]
        times: u32,
    },
    /// Time passes.
    Wait { seconds: f64 },
    /// The power is off and on again; the store stays.
    PowerCycle,
    /// The sensor's plug is out, or in again.
    Sensor { plugged: bool },
    /// The display's plug is out, or in again.
    Display { plugged: bool },
}

fn timeout() -> f64 {
    TIMEOUT_S
}

fn explored() -> f64 {
    SLIDE_S
}

fn once() -> u32 {
    1
}

impl Scenario {
    pub(crate) fn parse(json: &[u8]) -> Self {
        serde_json::from_slice(json).unwrap()
    }

    /// Plays it on a board with this ELF, which it gives back as it is in the end.
    pub(crate) fn play(&self, elf: &Path) -> Emulator {
        let mut played = Played {
            elf: elf.into(),
            scenario: self,
            starts: 0,
            holder: None,
        };
        played.power_up(None);
        for (number, step) in (1..).zip(&self.step) {
            if let Err(unmet) = played.act(step) {
                let at_s = played.holder().board.now_ns() as f64 * 1e-9;
                let shown = shown(played.holder().board.rig().display());
                panic!("step {number}, at {at_s:.2} s: {unmet}. The display:\n{shown}");
            }
        }
        played.holder.unwrap().board
    }
}

struct Played<'s> {
    elf: PathBuf,
    scenario: &'s Scenario,
    /// Number of times that the board was switched on: every time is another trial, of which nothing was learned.
    starts: u64,
    holder: Option<Holder>,
}

impl Played<'_> {
    fn holder(&mut self) -> &mut Holder {
        self.holder.as_mut().unwrap()
    }

    fn power_up(&mut self, store: Option<Vec<u8>>) {
        let Scenario {
            texture,
            world,
            seed,
            hand,
            ..
        } = self.scenario;
        let collection = Collection::new(*world, Vec::new(), 1);
        let texture = texture_number(texture).unwrap();
        let setup: Setup = collection.setup(texture, 100 * seed + self.starts);
        self.starts += 1;
        self.holder = Some(Holder::start(&self.elf, setup, *hand, store).unwrap());
    }

    /// The unmet expectation.
    fn act(&mut self, step: &Step) -> Result<(), String> {
        let holder = self.holder();
        let met = match step {
            Step::Note { .. } => true,
            Step::See { text, within_s } => {
                let shows = |display: &Display| text.iter().all(|text| display.shows(text));
                holder.until(*within_s, shows).unwrap()
            }
            Step::Miss { text } => {
                let rig = holder.board.rig();
                !text.iter().any(|text| rig.display().shows(text))
            }
            Step::Dark { within_s } => {
                let is_dark = |display: &Display| display.picture().is_none();
                holder.until(*within_s, is_dark).unwrap()
            }
            Step::Hear { hz } => tones(&holder.board)
                .iter()
                .any(|tone| tone.abs_diff(*hz) * 50 <= *hz),
            Step::Hand { force_n, pace_mm_s } => {
                holder.intend(*force_n, *pace_mm_s);
                true
            }
            Step::Slide {
                force_n,
                pace_mm_s,
                seconds,
            } => holder.slide(*force_n, *pace_mm_s, *seconds).unwrap(),
            Step::Explore {
                force_n,
                pace_mm_s,
                slides,
                seconds,
            } => holder
                .explore(*force_n, *pace_mm_s, *slides, *seconds)
                .unwrap(),
            Step::Press { ms, times } => {
                for _ in 0..*times {
                    holder.board.press(true).unwrap();
                    holder.board.run_ms(*ms).unwrap();
                    holder.board.press(false).unwrap();
                    holder.board.run_ms(RELEASED_MS).unwrap();
                }
                true
            }
            Step::Wait { seconds } => {
                holder.wait(*seconds).unwrap();
                true
            }
            Step::PowerCycle => {
                let store = holder.board.store().unwrap();
                // one board at a time
                self.holder = None;
                self.power_up(Some(store));
                true
            }
            Step::Sensor { plugged: false } => {
                holder.board.inject(Fault::SensorUnplugged);
                true
            }
            Step::Sensor { plugged: true } => {
                holder.board.rig().world().clear();
                true
            }
            Step::Display { plugged } => {
                holder.board.rig().display_mut().plug(*plugged);
                true
            }
        };
        met.then_some(()).ok_or_else(|| match step {
            Step::Hear { .. } => format!("{step:?}, but {:?}", tones(&self.holder().board)),
            step => format!("{step:?}"),
        })
    }
}

/// The buzzer's tones of the last 2 s, Hz.
fn tones(board: &Emulator) -> Vec<u32> {
    let (rig, now_ns) = (board.rig(), board.now_ns());
    let late = rig
        .trace()
        .filter(|(at_ns, _)| at_ns + 2_000_000_000 > now_ns);
    late.filter_map(|(_, output)| match output {
        Output::Buzzer(tone) => *tone,
        _ => None,
    })
    .collect()
}

/// The display in letters: two rows of points in each.
fn shown(display: &Display) -> String {
    let Some(picture) = display.picture() else {
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
