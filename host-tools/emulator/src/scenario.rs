//! Plays scenarios for the handheld probe, those in `scenarios/` and others: see [`tactus_lab::sim::scenario`].
//!
//! The person sees the display and nothing else, as it is decoded from the bytes on the wire.

use std::path::Path;

use tactus_core::sensor::FingerName;
use tactus_lab::eval::show::count;
use tactus_lab::sim::handheld::ground;
use tactus_lab::sim::scenario::{Scenario, Step, TIMEOUT_S, UnknownTexture, texture};
use tactus_world::faults::Fault;
use tactus_world::flow::HEIGHT_MM;
use tactus_world::person::Hand;
use tactus_world::world::{NotLifted, Setup};

use crate::board::{Display, Emulator, Error, Options, Output};

/// Time by which the firmware hears its host, ms.
const BOOTED_MS: u64 = 500;
/// Interval between the person's looks, ns.
const LOOK_NS: u64 = 20_000_000;
/// Text of the display when it waits for a touch.
const PRESS: &str = "and hold";
/// Text of the display when it wants a slide, and when it wants none any more.
const SLIDE: &str = "5 cm in 2 s";
const OVER: [&str; 2] = ["next", "yes"];
/// Text of a verdict that is open: further slides may decide.
const OPEN: &str = "Slide on to be sure";

/// Reasons why a scenario failed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlayError {
    /// An unknown texture.
    #[error(transparent)]
    Texture(#[from] UnknownTexture),
    /// The emulator.
    #[error(transparent)]
    Emulator(#[from] Error),
    /// A sample cannot be changed.
    #[error(transparent)]
    NotLifted(#[from] NotLifted),
    /// A step failed.
    #[error("step {number}, at {at_s:.2} s: {unmet}. The display:\n{display}")]
    Step {
        /// Which, from 1.
        number: usize,
        /// Its time, s of virtual time.
        at_s: f64,
        /// The unmet expectation.
        unmet: String,
        /// The text on the display.
        display: String,
    },
}

/// The person's view of an exploration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Seen {
    /// The display is on.
    Lit,
    /// It waits for a touch.
    Press,
    /// It wants a slide.
    Slide,
    /// It wants none any more.
    Over,
}

impl Seen {
    fn of(display: &Display) -> Option<Self> {
        display.picture()?;
        let over = || OVER.iter().any(|over| display.shows(over));
        if display.shows(PRESS) {
            Some(Self::Press)
        } else if display.shows(SLIDE) {
            Some(Self::Slide)
        } else {
            Some(if over() { Self::Over } else { Self::Lit })
        }
    }
}

/// A board on which a scenario was played.
pub(crate) struct PlayedBoard {
    /// As it is in the end.
    pub board: Emulator,
    /// The views of the person, and the time when each began, ns.
    pub seen: Vec<(u64, Seen)>,
}

/// Plays a scenario with a finger on a board with its ELF, which may hold a store from before. Gives the board as it is
/// in the end.
pub fn play(
    scenario: &Scenario,
    finger: FingerName,
    elf: &Path,
    store: Option<Vec<u8>>,
) -> Result<Emulator, PlayError> {
    play_to(scenario, finger, elf, store, &[]).map(|played| played.board)
}

/// The same, and its host sends these bytes when it is switched on. From then on it reports its events:
/// [`Emulator::received`].
pub(crate) fn play_to(
    scenario: &Scenario,
    finger: FingerName,
    elf: &Path,
    store: Option<Vec<u8>>,
    host: &[u8],
) -> Result<PlayedBoard, PlayError> {
    let mut played = Played {
        scenario,
        finger,
        elf,
        host,
        texture: texture(&scenario.texture)?,
        starts: 0,
        board: None,
        looks: Vec::new(),
    };
    played.power_up(store)?;
    for (step, number) in scenario.step.iter().zip(1..) {
        let done = played.act(step)?;
        if let Err(unmet) = done {
            return Err(PlayError::Step {
                number,
                at_s: played.board().now_ns() as f64 * 1e-9,
                unmet,
                display: played.shown(),
            });
        }
    }
    Ok(PlayedBoard {
        board: played.board.take().expect("it was switched on"),
        seen: played.looks,
    })
}

/// A scenario on a board.
struct Played<'s> {
    scenario: &'s Scenario,
    finger: FingerName,
    elf: &'s Path,
    host: &'s [u8],
    texture: u8,
    /// Number of times that the board was switched on: every time is another trial.
    starts: u64,
    board: Option<Emulator>,
    /// The views of an exploration, and their times.
    looks: Vec<(u64, Seen)>,
}

/// The result of a step: the unmet expectation.
type Done = Result<Result<(), String>, PlayError>;

impl Played<'_> {
    fn board(&mut self) -> &mut Emulator {
        self.board.as_mut().expect("it was switched on")
    }

    fn power_up(&mut self, store: Option<Vec<u8>>) -> Result<(), PlayError> {
        let setup = Setup {
            finger: self.finger,
            ..self.scenario.setup(self.texture, self.starts)
        };
        self.starts += 1;
        let sensor = self.scenario.hand.tilt_mm;
        let motion = sensor.map(|_| ground(self.texture, HEIGHT_MM));
        let options = Options {
            store,
            motion,
            ..Options::default()
        };
        let board = Emulator::start(self.elf, setup, options)?;
        let manner = self.scenario.hand;
        board
            .rig()
            .world()
            .hold(Hand::new(setup.trial_seed, manner));
        self.board = Some(board);
        if !self.host.is_empty() {
            self.run_s(BOOTED_MS as f64 * 1e-3)?;
            let host = self.host;
            self.board().send(host);
        }
        Ok(())
    }

    fn intend(&mut self, force_n: f64, pace_mm_s: f64) {
        if let Some(hand) = self.board().rig().world().hand() {
            hand.intend(force_n, pace_mm_s);
        }
    }

    /// Looks until the condition holds.
    fn until(&mut self, within_s: f64, seen: impl Fn(&Display) -> bool) -> Result<bool, Error> {
        let Self { board, looks, .. } = self;
        let board = board.as_mut().expect("it was switched on");
        let limit_ns = board.now_ns() + (within_s * 1e9) as u64;
        board.run_to(limit_ns, LOOK_NS, |rig| {
            let now_ns = rig.world().now_ns();
            let display = rig.display();
            if let Some(now) = Seen::of(display)
                && looks.last().is_none_or(|(_, last)| *last != now)
            {
                looks.push((now_ns, now));
            }
            seen(display)
        })
    }

    fn run_s(&mut self, seconds: f64) -> Result<(), Error> {
        self.until(seconds, |_| false).map(|_| ())
    }

    fn slide(&mut self, force_n: f64, pace_mm_s: f64, seconds: f64) -> Done {
        self.intend(force_n, 0.0);
        if !self.until(TIMEOUT_S, |display| display.shows(SLIDE))? {
            return Ok(Err("the display does not want a slide".into()));
        }
        self.run_s(Step::REACTION_MS as f64 * 1e-3)?;
        self.intend(force_n, pace_mm_s);
        self.run_s(seconds)?;
        self.intend(force_n, 0.0);
        self.run_s(Step::HELD_S)?;
        self.intend(0.0, 0.0);
        self.run_s(Step::LIFTED_S)?;
        Ok(Ok(()))
    }

    /// The buzzer's tones of the last 2 s, Hz.
    fn tones(&mut self) -> Vec<u32> {
        let now_ns = self.board().now_ns();
        let rig = self.board().rig();
        let late = rig
            .trace()
            .filter(|(at_ns, _)| at_ns + 2_000_000_000 > now_ns);
        late.filter_map(|(_, output)| match output {
            Output::Buzzer(tone) => *tone,
            _ => None,
        })
        .collect()
    }

    fn act(&mut self, step: &Step) -> Done {
        let shows =
            |display: &Display, text: &[String]| text.iter().all(|text| display.shows(text));
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
                let heard = self.tones();
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
                seconds,
            } => {
                for _ in 0..*slides {
                    if let Err(unmet) = self.slide(*force_n, *pace_mm_s, *seconds)? {
                        return Ok(Err(unmet));
                    }
                    if self.until(Step::VERDICT_S, |display| {
                        OVER.iter().any(|over| display.shows(over)) && !display.shows(OPEN)
                    })? {
                        return Ok(Ok(()));
                    }
                }
                return Ok(Err(format!("not enough: {}", count(*slides, "slide"))));
            }
            Step::Press { ms, times } => {
                for _ in 0..*times {
                    self.board().press(true)?;
                    self.board().run_ms(*ms)?;
                    self.board().press(false)?;
                    self.board().run_ms(Step::RELEASED_MS)?;
                }
            }
            Step::Wait { seconds } => self.run_s(*seconds)?,
            Step::Place { texture } => {
                self.texture = self::texture(texture)?;
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
    fn shown(&mut self) -> String {
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
