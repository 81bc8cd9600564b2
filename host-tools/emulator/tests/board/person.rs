//! A person who holds the emulated handheld and follows its display, while a host talks to it.

use tactus_core::wire::{Event, Prompt, Report};
use tactus_world::person::{Hand, Manner};

use tactus_emulator::board::{Display, Emulator};
use tactus_emulator::host::hand::{HELD_S, LIFTED_S, REACTION_S, SLIDE_S};

/// Texts of the display when it wants a press, and a slide.
const PRESS: &str = "slide ";
const SLIDE: &str = "5 cm in 2 s";
const LIFT: &str = "Lift";
const WEIGH: &str = "Put on";
const POINT: &str = "Point it";
const TURN: &str = "Turn it";
/// The person's action, and its end, ns.
#[derive(Clone, Copy, PartialEq, Debug)]
enum At {
    Idle,
    Pressing,
    Reacting(u64),
    Sliding(u64),
    Holding(u64),
    Lifting(u64),
    Weighing,
}

/// A person who looks at the display.
#[derive(Debug)]
pub(crate) struct Person {
    at: At,
    pace_mm_s: f64,
    /// The weight that is asked for, mN.
    weight: Option<u16>,
    /// Time of the next look at the display, ns.
    looks_ns: u64,
}

/// Force that the person means to press with, N.
const FORCE_N: f64 = 0.5;
/// Interval between two looks, ns.
const LOOK_NS: u64 = 20_000_000;

impl Person {
    /// Puts the probe into a hand that means to slide so.
    pub(crate) fn hold(board: &mut Emulator, seed: u64, manner: Manner) -> Self {
        board.rig().world().hold(Hand::new(seed, manner));
        Self {
            at: At::Idle,
            pace_mm_s: 25.0,
            weight: None,
            looks_ns: 0,
        }
    }

    /// Means to slide at this pace from now on.
    pub(crate) fn slide_at(&mut self, pace_mm_s: f64) {
        self.pace_mm_s = pace_mm_s;
    }

    /// Returns true if the hand is free: it neither presses nor is on its way.
    pub(crate) fn is_idle(&self) -> bool {
        self.at == At::Idle
    }

    /// Takes a report of the probe to its host: the weight to put on the finger.
    pub(crate) fn hear(&mut self, report: &Report) {
        if let Event::Prompt(prompt) = report.event {
            self.weight = match prompt {
                Prompt::Weigh(mn) => Some(mn),
                _ => None,
            };
        }
    }

    /// Looks at the display and continues: to be called every few ms, under any host.
    pub(crate) fn look(&mut self, board: &mut Emulator) {
        let now = board.now_ns();
        if now < self.looks_ns {
            return;
        }
        self.looks_ns = now + LOOK_NS;
        let after = |seconds: f64| now + (seconds * 1e9) as u64;
        let shows = |text: &str| -> bool {
            let rig = board.rig();
            let display: &Display = rig.display();
            display.shows(text)
        };
        let turned = if shows(TURN) {
            Some(true)
        } else {
            shows(POINT).then_some(false)
        };
        let (at, intent) = match self.at {
            At::Idle if shows(WEIGH) && self.weight.is_some() => {
                let mn = self.weight.unwrap_or(0);
                (At::Weighing, Some((f64::from(mn) * 1e-3, 0.0)))
            }
            At::Idle if shows(PRESS) && !shows(LIFT) => (At::Pressing, Some((FORCE_N, 0.0))),
            At::Pressing if shows(SLIDE) => (At::Reacting(after(REACTION_S)), None),
            At::Pressing if shows(LIFT) || !shows(PRESS) => {
                (At::Lifting(after(LIFTED_S)), Some((0.0, 0.0)))
            }
            At::Reacting(until) if now >= until => {
                (At::Sliding(after(SLIDE_S)), Some((FORCE_N, self.pace_mm_s)))
            }
            At::Sliding(until) if now >= until => {
                (At::Holding(after(HELD_S)), Some((FORCE_N, 0.0)))
            }
            At::Holding(until) if now >= until => (At::Lifting(after(LIFTED_S)), Some((0.0, 0.0))),
            At::Lifting(until) if now >= until => (At::Idle, None),
            At::Weighing if !shows(WEIGH) => (At::Lifting(after(LIFTED_S)), Some((0.0, 0.0))),
            at => (at, None),
        };
        self.at = at;
        // while the display shows the same, the probe is not turned back
        let turned = turned.or((at == At::Pressing).then_some(false));
        if let Some(over) = turned
            && let Some(hand) = board.rig().world().hand()
        {
            hand.turn(over);
        }
        if let Some((force_n, pace_mm_s)) = intent
            && let Some(hand) = board.rig().world().hand()
        {
            hand.intend(force_n, pace_mm_s);
        }
    }
}
