//! A hand that holds the emulated handheld, of a person who sees the display and nothing else, as it is decoded from
//! the bytes on the wire.

use std::path::Path;

use tactus_lab::sim::handheld::ground;
use tactus_world::flow::HEIGHT_MM;
use tactus_world::person::{Hand, Manner};
use tactus_world::world::Setup;

use crate::board::{Display, Emulator, Error, Options};

/// Interval between the person's looks, ns.
const LOOK_NS: u64 = 20_000_000;
/// Longest wait for what the display should show, s.
pub const TIMEOUT_S: f64 = 8.0;
/// Text of the display when it waits for a touch.
const PRESS: &str = "and hold";
/// Text of the display when it wants a slide, and when it wants none any more.
const SLIDE: &str = "5 cm in 2 s";
const OVER: [&str; 2] = ["next", "yes"];
/// Text of a verdict that is open: further slides may decide.
const OPEN: &str = "Slide on to be sure";
/// Time from a view to the reaction, s.
pub const REACTION_S: f64 = 0.3;
/// Duration of a slide, and longest wait for its verdict, s.
pub const SLIDE_S: f64 = 1.8;
const VERDICT_S: f64 = 1.0;
/// Time from the end of a slide to the lifting of the finger, s.
pub const HELD_S: f64 = 0.15;
/// Time from the lifting to the next action, s.
pub const LIFTED_S: f64 = 0.5;

/// The person's view of an exploration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Seen {
    /// The display is on.
    Lit,
    Press,
    Slide,
    /// It wants none any more.
    Over,
}

impl Seen {
    fn of(display: &Display) -> Option<Self> {
        display.picture()?;
        let over = || OVER.iter().any(|over| display.shows(over));
        Some(match () {
            () if display.shows(PRESS) => Self::Press,
            () if display.shows(SLIDE) => Self::Slide,
            () if over() => Self::Over,
            () => Self::Lit,
        })
    }
}

/// The hand, and the board in it.
pub struct Holder {
    /// The board, with its display.
    pub board: Emulator,
    /// The views of the person, and the time when each began, ns.
    pub(crate) looks: Vec<(u64, Seen)>,
}

impl Holder {
    /// Switches a board on that may hold a store from before; it has a sensor of motion where the hand tilts it.
    pub fn start(
        elf: &Path,
        setup: Setup,
        hand: Manner,
        store: Option<Vec<u8>>,
    ) -> Result<Self, Error> {
        let options = Options {
            store,
            motion: hand.tilt_mm.map(|_| ground(setup.texture, HEIGHT_MM)),
            ..Options::default()
        };
        let board = Emulator::start(elf, setup, options)?;
        let hand = Hand::new(setup.trial_seed, hand);
        board.rig().world().hold(hand);
        Ok(Self {
            board,
            looks: Vec::new(),
        })
    }

    /// Means to press this hard and to slide at this pace from now on; without force the finger is lifted.
    pub fn intend(&mut self, force_n: f64, pace_mm_s: f64) {
        if let Some(hand) = self.board.rig().world().hand() {
            hand.intend(force_n, pace_mm_s);
        }
    }

    /// Looks until the condition holds; false after so many seconds.
    pub fn until(&mut self, within_s: f64, seen: impl Fn(&Display) -> bool) -> Result<bool, Error> {
        let Self { board, looks } = self;
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

    /// Looks for so many seconds.
    pub fn wait(&mut self, seconds: f64) -> Result<(), Error> {
        self.until(seconds, |_| false).map(drop)
    }

    /// Presses until the display wants a slide, slides for so long, and lifts the finger; false if it wants none.
    pub fn slide(&mut self, force_n: f64, pace_mm_s: f64, seconds: f64) -> Result<bool, Error> {
        self.intend(force_n, 0.0);
        if !self.until(TIMEOUT_S, |display| display.shows(SLIDE))? {
            return Ok(false);
        }
        self.wait(REACTION_S)?;
        self.intend(force_n, pace_mm_s);
        self.wait(seconds)?;
        self.intend(force_n, 0.0);
        self.wait(HELD_S)?;
        self.intend(0.0, 0.0);
        self.wait(LIFTED_S)?;
        Ok(true)
    }

    /// Slides like that, at most so often, until the display wants none any more; false if it still does.
    pub fn explore(
        &mut self,
        force_n: f64,
        pace_mm_s: f64,
        slides: u32,
        seconds: f64,
    ) -> Result<bool, Error> {
        let is_over =
            |display: &Display| OVER.iter().any(|over| display.shows(over)) && !display.shows(OPEN);
        for _ in 0..slides {
            if !self.slide(force_n, pace_mm_s, seconds)? {
                return Ok(false);
            }
            if self.until(VERDICT_S, is_over)? {
                return Ok(true);
            }
        }
        Ok(false)
    }
}
