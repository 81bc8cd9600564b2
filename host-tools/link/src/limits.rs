//! The longest time that a request takes, and the most bytes that come meanwhile: none is without an end.

use std::time::Duration;

use tactus_core::table::MAX_MOVEMENTS;
use tactus_core::wire::{Command, Identify};

/// The firmware's own limit of a movement and of the lifting after it, s.
const MOVEMENT_S: u32 = 135;
/// A movement that fails is made once more, then left out.
const TRIES: u32 = 2;
/// Longest that a person takes for what the probe asks of them, s.
const PERSON_S: u32 = 600;
/// Longest time to an answer without motion, s: five tries of 5 s, and some.
const ANSWER_S: u32 = 30;
/// A table is read or written within this, s: 128 KB by a line of 9600 baud.
const TABLE_S: u32 = 300;
/// Bytes that the line carries in a second.
const BYTES_S: u64 = 921_600 / 10;

/// The limits of a request, from its beginning on.
#[derive(Clone, Debug)]
pub(crate) struct Limits {
    /// the request; parts of a table are one
    request: Option<u16>,
    began: Duration,
    bytes: u64,
    longest: Duration,
}

impl Limits {
    /// Those of a request that begins now, when so many bytes have come; `movements`: those of the table, if known.
    pub(crate) fn new(
        (request, command): (Option<u16>, &Command),
        movements: Option<usize>,
        (began, bytes): (Duration, u64),
    ) -> Self {
        let longest = Duration::from_secs(longest_s(command, movements).into());
        let request = request.filter(|_| !is_of_table(command));
        Self {
            request,
            began,
            bytes,
            longest,
        }
    }

    /// Returns true while they are those of this request.
    pub(crate) fn are_of(&self, request: Option<u16>, command: &Command) -> bool {
        match self.request {
            None => is_of_table(command),
            known => known == request,
        }
    }

    /// Returns the limit that is passed now.
    pub(crate) fn passed(&self, now: Duration, bytes: u64) -> Option<Duration> {
        let most = self.longest.as_secs() * BYTES_S;
        let is_long = now.saturating_sub(self.began) >= self.longest;
        let is_much = bytes.saturating_sub(self.bytes) > most;
        (is_long || is_much).then_some(self.longest)
    }
}

fn is_of_table(command: &Command) -> bool {
    matches!(
        command,
        Command::ReadTable(_)
            | Command::BeginTable(_)
            | Command::WriteTable { .. }
            | Command::CommitTable
    )
}

fn longest_s(command: &Command, movements: Option<usize>) -> u32 {
    let movements = movements.map_or(MAX_MOVEMENTS, |known| known.min(MAX_MOVEMENTS)) as u32;
    let explores =
        |wanted: &Identify| (u32::from(wanted.max_slides) + TRIES * movements) * MOVEMENT_S;
    match command {
        Command::Identify(wanted) | Command::Verify(wanted) => ANSWER_S + explores(wanted),
        Command::Train(wanted) => {
            let movements = if wanted.pilot {
                MAX_MOVEMENTS as u32
            } else {
                movements
            };
            ANSWER_S + u32::from(wanted.trials) * movements * TRIES * MOVEMENT_S
        }
        Command::Home => TRIES * MOVEMENT_S,
        // the motor runs without load at four speeds, there and back
        Command::Calibrate => 8 * MOVEMENT_S,
        // the probe waits 30 s for a press of its button
        Command::SetHighForce(true) => 30 + ANSWER_S,
        Command::Weigh(_) | Command::TurnOver => PERSON_S,
        command if is_of_table(command) => TABLE_S,
        _ => ANSWER_S,
    }
}
