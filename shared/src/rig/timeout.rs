//! Longest time of a movement. One that takes longer is stopped, and its finger is lifted before the error is reported.

/// A movement that takes longer than this does not end.
const LONGEST_MS: u32 = 120_000;
/// Stopping and lifting take less: the whole travel and a quarter are 10 s.
const LIFTING_MS: u32 = 15_000;

/// The next action of the code that waits for a movement.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Wait {
    /// Keeps waiting.
    On,
    /// Stops it and keeps waiting: the finger is being lifted.
    Stop,
    /// The rig is at rest.
    Over,
    /// The movement did not end by itself. The rig is at rest now, or does not even stop.
    Hangs,
}

/// Waits for a movement.
#[derive(Clone, Copy, Debug)]
pub struct MovementTimeout {
    left_ms: u32,
    stopped: bool,
}

impl Default for MovementTimeout {
    fn default() -> Self {
        Self {
            left_ms: LONGEST_MS,
            stopped: false,
        }
    }
}

impl MovementTimeout {
    /// Takes another `ms`, and whether the rig is at rest.
    pub fn wait(&mut self, ms: u32, at_rest: bool) -> Wait {
        if at_rest {
            return if self.stopped {
                Wait::Hangs
            } else {
                Wait::Over
            };
        }
        self.left_ms = self.left_ms.saturating_sub(ms);
        match (self.left_ms, self.stopped) {
            (1.., _) => Wait::On,
            (0, true) => Wait::Hangs,
            (0, false) => {
                self.stopped = true;
                self.left_ms = LIFTING_MS;
                Wait::Stop
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_timeout_first_stops_the_rig_and_then_gives_up() {
        let mut timeout = MovementTimeout::default();
        let mut waited = |times: u32| (0..times).map(|_| timeout.wait(10, false)).last();
        assert_eq!(waited(LONGEST_MS / 10 - 1), Some(Wait::On));
        assert_eq!(waited(1), Some(Wait::Stop));
        assert_eq!(waited(LIFTING_MS / 10 - 1), Some(Wait::On));
        let mut lifted = timeout;
        assert_eq!(lifted.wait(10, true), Wait::Hangs);
        assert_eq!(timeout.wait(10, false), Wait::Hangs);
        assert_eq!(MovementTimeout::default().wait(10, true), Wait::Over);
    }
}
