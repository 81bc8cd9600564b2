//! The report to send to somebody: text, JSON and curves.

use std::fmt::Write as _;
use std::io;
use std::path::Path;

use serde::Serialize;

use super::journal::{Entry, EntrySeries, Journal};
use super::steps::STEPS;

/// What is known of a rig.
#[derive(Debug, Serialize)]
pub struct Report {
    /// Version of this program.
    version: &'static str,
    /// Whether all steps have passed.
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
    pub fn new(journal: &Journal) -> Self {
        let steps = STEPS.iter().map(|step| ReportStep {
            step: step.key,
            checks: step.checks,
            limit: (step.limit)(),
            found: journal.last(step.key).cloned(),
        });
        Self {
            version: env!("CARGO_PKG_VERSION"),
            passed: STEPS.iter().all(|step| journal.has_passed(step.key)),
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

    /// Writes `report.txt`, `report.json` and a curve for each step that has one into a folder.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn write(&self, folder: &Path) -> io::Result<()> {
        std::fs::write(folder.join("report.txt"), self.text())?;
        let mut json = serde_json::to_string_pretty(self)?;
        json.push('\n');
        std::fs::write(folder.join("report.json"), json)?;
        for step in &self.steps {
            let series = step.found.as_ref().and_then(|entry| entry.series.as_ref());
            if let Some(series) = series.filter(|series| !series.points.is_empty()) {
                std::fs::write(folder.join(format!("{}.svg", step.step)), plot(series))?;
            }
        }
        Ok(())
    }
}

/// Size of a curve, and its margins left, top, right, bottom, px.
const SIZE: (f64, f64) = (480.0, 240.0);
const MARGINS: [f64; 4] = [56.0, 28.0, 12.0, 36.0];

/// A curve as SVG.
pub fn plot(series: &EntrySeries) -> String {
    let range = |of: usize| {
        let values = series.points.iter().map(|point| point[of]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        match high > low {
            true => (low, high),
            false => (low - 1.0, low + 1.0),
        }
    };
    let [(left, right), (low, high)] = [range(0), range(1)];
    let [margin_left, margin_top, margin_right, margin_bottom] = MARGINS;
    let x = |value: f64| {
        margin_left + (value - left) / (right - left) * (SIZE.0 - margin_left - margin_right)
    };
    let y = |value: f64| {
        SIZE.1
            - margin_bottom
            - (value - low) / (high - low) * (SIZE.1 - margin_top - margin_bottom)
    };
    let points = series
        .points
        .iter()
        .map(|[a, b]| format!("{:.1},{:.1}", x(*a), y(*b)));
    let points: Vec<String> = points.collect();
    let (width, height) = SIZE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\" \
             font-size=\"12\">\n\
         <title>{}</title>\n<rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n\
         <text x=\"{margin_left}\" y=\"18\">{}</text>\n",
        escaped(&series.title),
        escaped(&series.title)
    );
    for share in [0.0, 0.5, 1.0] {
        let (at_x, at_y) = (left + share * (right - left), low + share * (high - low));
        let _ = write!(
            svg,
            "<line x1=\"{margin_left}\" x2=\"{:.1}\" y1=\"{1:.1}\" y2=\"{1:.1}\" stroke=\"#ccc\"/>\n\
             <text x=\"{2:.1}\" y=\"{3:.1}\" text-anchor=\"end\">{4}</text>\n\
             <text x=\"{5:.1}\" y=\"{6:.1}\" text-anchor=\"middle\">{7}</text>\n",
            width - margin_right,
            y(at_y),
            margin_left - 6.0,
            y(at_y) + 4.0,
            short(at_y),
            x(at_x).min(width - 30.0),
            height - margin_bottom + 16.0,
            short(at_x)
        );
    }
    let [name_x, name_y] = &series.axes;
    let _ = write!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>\n<text x=\"4\" y=\"18\">{}</text>\n\
         <polyline fill=\"none\" stroke=\"#0072B2\" stroke-width=\"1.2\" points=\"{}\"/>\n</svg>\n",
        width - margin_right,
        height - 4.0,
        escaped(name_x),
        escaped(name_y),
        points.join(" ")
    );
    svg
}

/// A number with about three digits.
fn short(value: f64) -> String {
    let digits = match value.abs() {
        size if size >= 100.0 => 0,
        size if size >= 10.0 => 1,
        _ => 2,
    };
    format!("{value:.digits$}")
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}
