//! The state of the rig by its reports, and the way of a moving rig to a stand with its finger lifted.

use std::time::Duration;

use tactus_core::rig::Fault;
use tactus_core::wire::{Command, Event, Phase, Report};

/// Longest way up, and some: 10 mm at 2 mm/s.
const LIFTING: Duration = Duration::from_secs(30);
/// A faulted rig reports where it is 20 times a second until it is at rest.
const AT_REST: Duration = Duration::from_millis(500);
/// Longest that a request which was stopped takes to answer: something may be stored first.
const ANSWERED: Duration = Duration::from_secs(5);
/// A rig is asked to stop so often: a request may be damaged, and stopping twice does no harm.
const AGAIN: Duration = Duration::from_millis(200);

/// Returns true for a request that has the rig move.
pub fn moves(command: &Command) -> bool {
    matches!(
        command,
        Command::Home
            | Command::Identify(_)
            | Command::Train(_)
            | Command::Calibrate
            | Command::Weigh(_)
            | Command::TurnOver
            | Command::Verify(_)
    )
}

/// The state of the rig by its reports. Times are since any moment, the same for all.
#[derive(Debug, Default)]
pub struct RigWatch {
    /// what the rig does
    phase: Option<Phase>,
    fault: Option<Fault>,
    /// when it last reported where it is
    located: Duration,
    /// the request that moves the rig, until it is over
    moving: Option<u16>,
}

impl RigWatch {
    /// Takes in a report.
    pub fn hear(&mut self, report: &Report, now: Duration) {
        match &report.event {
            Event::Phase(phase) => self.phase = Some(*phase),
            Event::Status(status) => {
                self.phase = Some(status.phase);
                self.fault = status.fault;
            }
            Event::Live(_) => self.located = now,
            Event::Done(id) | Event::Refused { id, .. } if self.moving == Some(*id) => {
                self.moving = None;
            }
            _ => {}
        }
    }

    /// The request of this number moves the rig until it is over.
    pub fn moves(&mut self, id: Option<u16>) {
        self.moving = id;
    }
}

/// The result of a stop.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Stopped {
    /// All is well.
    #[error("stopped: the finger is lifted and the stage stands")]
    Lifted,
    /// The fault is that the lever does not find its top.
    #[error("stopped, but the lever is not home: the finger may still be down. Lift it by hand")]
    NotHome,
    /// The probe did not answer, or nobody waits for it.
    #[error(
        "the probe has not said that the finger is lifted: it may still be down. Look at the rig; its emergency stop \
             lifts it"
    )]
    NotLifted,
}

/// A rig on its way to a lifted finger.
#[derive(Debug)]
pub struct Lifting {
    began: Duration,
    asked: Option<Duration>,
}

impl Lifting {
    /// Begins; earlier reports of the rig no longer count.
    pub fn begin(rig: &mut RigWatch, now: Duration) -> Self {
        (rig.phase, rig.fault) = (None, None);
        Self {
            began: now,
            asked: None,
        }
    }

    /// Returns the commands that are to be sent now.
    pub fn asks(&mut self, now: Duration) -> Option<[Command; 3]> {
        let due = self.asked.is_none_or(|at| now.saturating_sub(at) > AGAIN);
        due.then(|| {
            self.asked = Some(now);
            [Command::Stop, Command::Stream(false), Command::Status]
        })
    }

    /// The result; `None` while the rig is on its way.
    pub fn came(&self, rig: &RigWatch, now: Duration) -> Option<Stopped> {
        let since = now.saturating_sub(self.began);
        if since >= LIFTING {
            return Some(Stopped::NotLifted);
        }
        // between two slides the rig is ready, and what it was asked for is not over; an answer can be lost
        if rig.moving.is_some() && since < ANSWERED {
            return None;
        }
        let at_rest = now.saturating_sub(rig.located) > AT_REST;
        match rig.phase? {
            Phase::Ready | Phase::Parked => Some(Stopped::Lifted),
            Phase::Faulted if at_rest => match rig.fault? {
                Fault::LeverNotHome => Some(Stopped::NotHome),
                _ => Some(Stopped::Lifted),
            },
            _ => None,
        }
    }
}
