//! The times at which a board is ready, is asked to explore, and tells its verdict.

use tactus_core::wire::{Event, Phase};

/// The times of one exploration, ns since power-up.
#[derive(Clone, Copy, Debug, Default)]
pub struct Milestones {
    ready_ns: Option<u64>,
    commanded_ns: Option<u64>,
    verdict_ns: Option<u64>,
}

impl Milestones {
    /// Notes that the board is ready, the first time.
    pub fn ready(&mut self, now_ns: u64) {
        self.ready_ns.get_or_insert(now_ns);
    }

    /// Notes the command to explore, or the first touch.
    pub fn begin(&mut self, now_ns: u64) {
        self.commanded_ns = Some(now_ns);
    }

    /// Notes the verdict, the first after [`begin`](Self::begin).
    pub fn verdict(&mut self, now_ns: u64) {
        if self.commanded_ns.is_some() {
            self.verdict_ns.get_or_insert(now_ns);
        }
    }

    /// Takes in a report of the rig.
    pub fn hear(&mut self, now_ns: u64, event: &Event) {
        match event {
            Event::Phase(Phase::Ready) => self.ready(now_ns),
            Event::Verdict(_) => self.verdict(now_ns),
            _ => {}
        }
    }

    pub(crate) fn seconds_to_ready(&self) -> Option<f64> {
        Some(self.ready_ns? as f64 * 1e-9)
    }

    /// Returns the time from the command, or the first touch, to the verdict, s.
    pub fn seconds_to_verdict(&self) -> Option<f64> {
        Some(self.verdict_ns?.checked_sub(self.commanded_ns?)? as f64 * 1e-9)
    }

    /// Says both times, if there are both; `since` names the beginning of the second.
    pub fn sentence(&self, since: &str) -> String {
        let times = self.seconds_to_ready().zip(self.seconds_to_verdict());
        times.map_or_else(String::new, |(ready, verdict)| {
            format!("Ready after {ready:.1} s, verdict {verdict:.1} s after the {since}. ")
        })
    }
}
