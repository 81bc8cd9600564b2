//! The campaign's result in words and in JSON.

use serde_json::{Value, json};
use tactus_lab::eval::evaluate::Method;
use tactus_lab::eval::show::count;

use super::explorations::{Bars, Results};
use crate::host::exploration::{Exploration, FORCE_N, FORCE_SHARE, JITTER_US, SPEED_SHARE};
use crate::host::under_finger::RECORDED_LIMITS;
use crate::runs::cuts::Cuts;

/// All that was made.
pub(super) struct Report {
    /// Of the firmware.
    pub(super) sha256: String,
    pub(super) seed: u64,
    pub(super) method: Method,
    pub(super) results: Vec<Results>,
    pub(super) cuts: Option<Cuts>,
    /// Seconds that it took.
    pub(super) wall_s: f64,
}

impl Report {
    fn bars(&self) -> Bars {
        Bars::of(self.method)
    }

    /// Whether all bars are met.
    pub(super) fn met(&self) -> bool {
        let missed = |results: &Results| !results.missed(self.bars()).is_empty();
        !self.results.iter().any(missed)
            && self
                .cuts
                .as_ref()
                .is_none_or(|cuts| cuts.missed().is_empty())
    }

    pub(super) fn json(&self) -> Value {
        let bars = self.bars();
        let mut object = json!({
            "elf_sha256": self.sha256,
            "seed": self.seed,
            "method": self.method,
            "wall_seconds": self.wall_s,
            "bars": {
                "right_share": bars.right_share,
                "median_slides": bars.median_slides,
                "force_error": FORCE_SHARE,
                "force_error_or_n": FORCE_N,
                "speed_error": SPEED_SHARE,
                "slot_jitter_us": JITTER_US,
                "lost_samples": 0,
                "late_slots": 0,
                "parity_errors": 0,
                "resets": 0,
            },
            "met": self.met(),
        });
        for results in &self.results {
            let explorations = results.explorations.iter().map(|result| match result {
                Ok(exploration) => exploration.json(),
                Err(why) => json!({ "crashed": why.to_string() }),
            });
            object[results.name] = json!({
                "explorations": explorations.collect::<Vec<_>>(),
                "right": results.right(),
                "of": results.explorations.len(),
                "median_slides": results.median_slides(),
                "missed": results.missed(bars),
            });
            if results.name == "recordings" {
                object[results.name]["limits"] = RECORDED_LIMITS.into();
            }
        }
        if let Some(cuts) = &self.cuts {
            object["power_cuts"] = cuts.json();
        }
        object
    }

    pub(super) fn text(&self) -> String {
        let mut lines: Vec<String> = Vec::new();
        for results in &self.results {
            group(&mut lines, results, self.bars());
        }
        if let Some(cuts) = &self.cuts {
            lines.push(cuts.text());
        }
        let verdict = if self.met() {
            "All bars are met."
        } else {
            "A bar is missed."
        };
        lines.push(format!("\n{verdict} ({:.0} s)\n", self.wall_s));
        lines.join("\n")
    }
}

fn group(lines: &mut Vec<String>, results: &Results, bars: Bars) {
    lines.push(format!(
        "\n{}\n{:22} {:22} {:5} {:>6} {:>6} {:>7} {:>12} {:>7} {:>6} {:>14} {:>9}",
        results.name,
        "under the finger",
        "identified",
        "right",
        "p",
        "slides",
        "time",
        "force off",
        "speed",
        "slots",
        "lost/late/bad",
        "PC"
    ));
    let rows = results.explorations.iter();
    lines.extend(rows.map(|result| match result {
        Ok(exploration) => row(exploration),
        Err(why) => format!("CRASHED: {why}"),
    }));
    for wrong in results.verdicts().filter(|e| !e.right()) {
        let found = match &wrong.found {
            found if found.unknown => "unknown",
            found => found.name.as_str(),
        };
        lines.push(format!("\nWhy {} was taken for {found}:", wrong.truth));
        lines.extend(wrong.log().iter().map(|line| format!("  {line}")));
    }
    let largest = |of: fn(&Exploration) -> f64| results.verdicts().map(of).fold(0.0, f64::max);
    lines.push(format!(
        "\n{} of {} right, {} at the median. Off at most: force {:.1} %, speed {:.2} %, slots {:.2} us; PC: features \
         {:.1e}, posterior {:.1e}.",
        results.right(),
        results.explorations.len(),
        count(results.median_slides().unwrap_or_default(), "slide"),
        largest(|e| e.force_error().1) * 100.0,
        largest(|e| e.speed_error()) * 100.0,
        largest(|e| e.jitter_us()),
        largest(|e| e.features_difference().into()),
        largest(|e| e.agreement.posterior.into()),
    ));
    if results.name == "recordings" {
        let clipped: u32 = results.verdicts().map(|e| e.played.clipped).sum();
        let clipped = count(clipped, "sample");
        lines.push(format!("{RECORDED_LIMITS} Clipped: {clipped}."));
    }
    let missed = results.missed(bars);
    lines.extend(missed.iter().map(|missed| format!("MISSED: {missed}")));
}

fn row(e: &Exploration) -> String {
    let short = |name: &str| name.chars().take(22).collect::<String>();
    let (newtons, share) = e.force_error();
    format!(
        "{:22} {:22} {:5} {:6.4} {:6} {:5.1} s {:4.1} mN {:3.1} % {:5.2} % {:3.1} us {:>14} {:>9}",
        short(&e.truth),
        if e.found.unknown {
            "(unknown)".into()
        } else {
            short(&e.found.name)
        },
        if e.right() { "yes" } else { "NO" },
        e.found.probability,
        e.found.slides,
        e.virtual_s,
        newtons * 1e3,
        share * 100.0,
        e.speed_error() * 100.0,
        e.jitter_us(),
        format!(
            "{}/{}/{}",
            e.counts.lost_samples, e.counts.late_slots, e.counts.parity_errors
        ),
        if e.follows() { "agrees" } else { "DIFFERS" }
    )
}
