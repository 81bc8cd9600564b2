//! What became of the cuts, in words and in JSON.

use serde_json::{Value, json};

/// What became of the cuts of an operation.
#[derive(Clone, Debug, Default)]
pub(crate) struct Outcome {
    /// What was stored.
    pub(crate) name: &'static str,
    /// Words that the firmware programmed and sectors that it erased.
    pub(crate) writes: usize,
    pub(crate) erases: usize,
    /// Cuts by what was left.
    pub(crate) old: usize,
    pub(crate) between: usize,
    pub(crate) new: usize,
    /// Cuts in what the firmware repaired after the first cut; they are among the others.
    pub(crate) in_recovery: usize,
    /// After so many of them the probe homed and identified what lay under its finger.
    pub(crate) probed: usize,
    /// What was neither, or did not work.
    pub(crate) wrong: Vec<String>,
}

impl Outcome {
    /// All cuts.
    pub(crate) fn cuts(&self) -> usize {
        self.old + self.between + self.new + self.wrong.len()
    }

    pub(crate) fn json(&self) -> Value {
        json!({
            "stored": self.name,
            "words_programmed": self.writes - self.erases,
            "sectors_erased": self.erases,
            "cuts": self.cuts(),
            "old": self.old,
            "between": self.between,
            "new": self.new,
            "in_recovery": self.in_recovery,
            "probed": self.probed,
            "wrong": self.wrong,
        })
    }
}

/// What became of all cuts.
#[derive(Clone, Debug)]
pub(crate) struct Cuts {
    /// Operation by operation.
    pub(crate) outcomes: Vec<Outcome>,
    /// A firmware that erases before it has copied is told from this one.
    pub(crate) planted_seen: bool,
}

impl Cuts {
    /// What is not as it must be.
    pub(crate) fn missed(&self) -> Vec<String> {
        let wrong = self.outcomes.iter().flat_map(|outcome| {
            let named = |wrong| format!("{}: {wrong}", outcome.name);
            outcome.wrong.iter().map(named)
        });
        let planted = (!self.planted_seen)
            .then(|| "a flash that was erased before it was copied is taken for a good one".into());
        wrong.chain(planted).collect()
    }

    pub(crate) fn json(&self) -> Value {
        json!({
            "operations": self.outcomes.iter().map(Outcome::json).collect::<Vec<_>>(),
            "planted_error_seen": self.planted_seen,
            "missed": self.missed(),
        })
    }

    pub(crate) fn text(&self) -> String {
        let mut lines = vec![format!(
            "\npower cuts\n{:14} {:>6} {:>6} {:>5} {:>5} {:>8} {:>5} {:>12} {:>7} {:>6}",
            "stored",
            "words",
            "erases",
            "cuts",
            "old",
            "between",
            "new",
            "in recovery",
            "probed",
            "WRONG"
        )];
        lines.extend(self.outcomes.iter().map(|o| {
            format!(
                "{:14} {:6} {:6} {:5} {:5} {:8} {:5} {:12} {:7} {:6}",
                o.name,
                o.writes - o.erases,
                o.erases,
                o.cuts(),
                o.old,
                o.between,
                o.new,
                o.in_recovery,
                o.probed,
                o.wrong.len()
            )
        }));
        let missed = self.missed();
        lines.extend(missed.iter().map(|missed| format!("MISSED: {missed}")));
        lines.join("\n")
    }
}
