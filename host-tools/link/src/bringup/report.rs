//! The report to send to somebody: text and JSON.

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use serde::Serialize;

use super::journal::{Entry, Journal};
use super::steps::Product;
use crate::whole::write_whole;

/// The knowledge of a rig.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Version of this program.
    version: &'static str,
    /// True if all steps have passed.
    passed: bool,
    steps: Vec<ReportStep>,
}

#[derive(Debug, Serialize)]
struct ReportStep {
    step: &'static str,
    checks: &'static str,
    limit: String,
    /// `null`: not yet.
    found: Option<Entry>,
}

impl Report {
    /// That of a journal.
    pub fn new(product: Product, journal: &Journal) -> Self {
        let steps = product.steps();
        let passed = steps.iter().all(|step| journal.has_passed(step.key));
        let steps = steps.iter().map(|step| ReportStep {
            step: step.key,
            checks: step.checks,
            limit: (step.limit)(),
            found: journal.last(step.key).cloned(),
        });
        Self {
            version: env!("CARGO_PKG_VERSION"),
            passed,
            steps: steps.collect(),
        }
    }

    /// In words.
    pub fn text(&self) -> String {
        let mut text = format!("tactus {} device bringup\n\n", self.version);
        for step in &self.steps {
            let (verdict, saw) = match &step.found {
                None => ("to do ", format!("right is: {}", step.limit)),
                Some(entry) if entry.passed => ("passed", entry.saw.clone()),
                Some(entry) => (
                    "FAILED",
                    format!("{} (right is: {})", entry.saw, step.limit),
                ),
            };
            // writing to a string does not fail
            let _ = writeln!(text, "{verdict}  {:<13} {}: {saw}", step.step, step.checks);
            for mistake in step.found.iter().flat_map(|entry| &entry.mistakes) {
                let _ = writeln!(text, "        {}: {}", mistake.key, mistake.what);
                let _ = writeln!(text, "        what to do: {}", mistake.remedy);
            }
        }
        text
    }

    /// Writes `report.txt` and, with the points of the curves, `report.json` into a folder.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        write_whole(&folder.join("report.txt"), self.text())?;
        let mut json = serde_json::to_string_pretty(self)?;
        json.push('\n');
        write_whole(&folder.join("report.json"), json)
    }
}
