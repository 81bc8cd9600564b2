//! What each second went to, from power-up to ready and from the command, or the touch, to the verdict: by what the firmware
//! reports and by the world's truth.

use serde_json::{Map, Value};
use tactus_core::wire::{Event, Phase};
use tactus_world::world::Truth;

use crate::board::CONTACT_N;

/// The fingertip has moved down when it is this much lower, mm: three steps.
const MOVED_MM: f64 = 0.002;

/// What time goes to, in the order in which it comes.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Part {
    /// Power-up, until the firmware says that it runs, or shows something.
    Boot,
    /// Until it begins to home, or is ready for a touch.
    SelfCheck,
    /// Until lever and stage know where they are.
    Homing,
    /// The stage goes to where the slide begins.
    Stage,
    /// The lever stands while P_DC without contact is measured.
    Zero,
    /// The lever comes down until it touches.
    Approach,
    /// From the touch until the force is right and the skin has settled.
    Settle,
    /// The still finger is measured.
    Still,
    /// The person sees what is wanted and begins.
    Reaction,
    /// The slide.
    Slide,
    /// The finger is lifted.
    Lift,
    /// From the end of what was moved to the choice or verdict.
    Decision,
}

impl Part {
    /// All of them, in order.
    pub const ALL: [Self; 12] = [
        Self::Boot,
        Self::SelfCheck,
        Self::Homing,
        Self::Stage,
        Self::Zero,
        Self::Approach,
        Self::Settle,
        Self::Still,
        Self::Reaction,
        Self::Slide,
        Self::Lift,
        Self::Decision,
    ];

    /// Its name for programs and pictures.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Boot => "boot",
            Self::SelfCheck => "self-check",
            Self::Homing => "homing",
            Self::Stage => "stage",
            Self::Zero => "zero",
            Self::Approach => "approach",
            Self::Settle => "settle",
            Self::Still => "still",
            Self::Reaction => "reaction",
            Self::Slide => "slide",
            Self::Lift => "lift",
            Self::Decision => "decision",
        }
    }
}

/// Time by what it went to.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Timeline {
    /// ns of each part.
    spent: [u64; Part::ALL.len()],
    now: Option<(Part, u64)>,
    /// Height of the fingertip when the press began, mm.
    from_mm: f64,
    ready_ns: Option<u64>,
    commanded_ns: Option<u64>,
    verdict_ns: Option<u64>,
}

impl Timeline {
    /// Of a board that was powered up at 0.
    pub fn new() -> Self {
        Self {
            now: Some((Part::Boot, 0)),
            ..Self::default()
        }
    }

    /// From now on time goes to this, or to nothing of the probe's.
    pub fn enter(&mut self, now_ns: u64, part: Option<Part>) {
        if let Some((last, since_ns)) = self.now.take()
            && let Some(spent) = self.spent.get_mut(last as usize)
        {
            *spent += now_ns.saturating_sub(since_ns);
        }
        self.now = part.map(|part| (part, now_ns));
    }

    /// It is ready: what it does until it is told to explore does not count.
    pub fn ready(&mut self, now_ns: u64) {
        if self.ready_ns.is_none() {
            self.ready_ns = Some(now_ns);
            self.enter(now_ns, None);
        }
    }

    /// It is told to explore, or touched.
    pub fn begin(&mut self, now_ns: u64, part: Part) {
        self.commanded_ns = Some(now_ns);
        self.enter(now_ns, Some(part));
    }

    /// It says what it is.
    pub fn verdict(&mut self, now_ns: u64) {
        if self.commanded_ns.is_some() && self.verdict_ns.is_none() {
            self.verdict_ns = Some(now_ns);
            self.enter(now_ns, None);
        }
    }

    /// A report of the rig.
    pub fn hear(&mut self, now_ns: u64, event: &Event, truth: &Truth) {
        if self.verdict_ns.is_some() {
            return;
        }
        let part = match event {
            Event::Booted { .. } => Part::SelfCheck,
            Event::Phase(Phase::Homing) => Part::Homing,
            Event::Phase(Phase::Ready) if self.ready_ns.is_none() => return self.ready(now_ns),
            // of its host's time nothing counts
            Event::Verdict(_) => return self.verdict(now_ns),
            _ if self.commanded_ns.is_none() => return,
            Event::Phase(Phase::Positioning) => Part::Stage,
            Event::Phase(Phase::Pressing) => {
                self.from_mm = truth.tip_mm;
                Part::Zero
            }
            Event::Phase(Phase::Background) => Part::Still,
            Event::Phase(Phase::Sliding) => Part::Slide,
            Event::Phase(Phase::Lifting) => Part::Lift,
            Event::Phase(Phase::Ready) => Part::Decision,
            _ => return,
        };
        self.enter(now_ns, Some(part));
    }

    /// The world's truth now: what the rig does not report.
    pub fn look(&mut self, now_ns: u64, truth: &Truth) {
        let part = match self.now {
            Some((Part::Zero, _)) if self.from_mm - truth.tip_mm > MOVED_MM => Part::Approach,
            Some((Part::Approach, _)) if truth.force_n > CONTACT_N => Part::Settle,
            _ => return,
        };
        self.enter(now_ns, Some(part));
    }

    /// From power-up to ready, s.
    pub fn seconds_to_ready(&self) -> Option<f64> {
        self.ready_ns.map(seconds)
    }

    /// From the command, or the first touch, to the verdict, s.
    pub fn seconds_to_verdict(&self) -> Option<f64> {
        Some(seconds(self.verdict_ns?.checked_sub(self.commanded_ns?)?))
    }

    /// Both for people, if it came to both; the verdict since that.
    pub fn sentence(&self, since: &str) -> String {
        match (self.seconds_to_ready(), self.seconds_to_verdict()) {
            (Some(ready), Some(verdict)) => {
                format!("Ready after {ready:.1} s, verdict {verdict:.1} s after the {since}. ")
            }
            _ => String::new(),
        }
    }

    /// Seconds of each part that took any.
    pub fn json(&self) -> Value {
        let parts = Part::ALL.into_iter().zip(self.spent);
        let parts = parts.filter(|(_, spent)| *spent > 0);
        let parts: Map<String, Value> = parts
            .map(|(part, spent)| (part.name().to_owned(), seconds(spent).into()))
            .collect();
        parts.into()
    }
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: u64 = 1_000_000_000;

    fn truth(tip_mm: f64, force_n: f64) -> Truth {
        Truth {
            tip_mm,
            force_n,
            ..Truth::default()
        }
    }

    #[test]
    fn all_of_the_time_goes_to_something_but_the_hosts() {
        let mut line = Timeline::new();
        let phase = |line: &mut Timeline, at: u64, phase| {
            line.hear(at * S, &Event::Phase(phase), &truth(9.0, 0.0));
        };
        phase(&mut line, 1, Phase::Homing);
        phase(&mut line, 4, Phase::Ready);
        // the host gives it a table
        phase(&mut line, 5, Phase::Positioning);
        line.begin(20 * S, Part::Stage);
        phase(&mut line, 21, Phase::Pressing);
        line.look(22 * S, &truth(9.0, 0.0));
        line.look(23 * S, &truth(8.99, 0.0));
        line.look(26 * S, &truth(5.0, 0.3));
        phase(&mut line, 28, Phase::Background);
        phase(&mut line, 29, Phase::Sliding);
        phase(&mut line, 32, Phase::Lifting);
        phase(&mut line, 33, Phase::Ready);
        line.verdict(34 * S);
        phase(&mut line, 40, Phase::Positioning);
        assert_eq!(line.seconds_to_ready(), Some(4.0));
        assert_eq!(line.seconds_to_verdict(), Some(14.0));
        let expected = serde_json::json!({
            "boot": 1.0, "homing": 3.0, "stage": 1.0, "zero": 2.0, "approach": 3.0, "settle": 2.0,
            "still": 1.0, "slide": 3.0, "lift": 1.0, "decision": 1.0,
        });
        assert_eq!(line.json(), expected);
    }

    #[test]
    fn what_did_not_happen_has_no_time() {
        let mut line = Timeline::new();
        line.verdict(S);
        assert_eq!(
            (line.seconds_to_ready(), line.seconds_to_verdict()),
            (None, None)
        );
    }
}
