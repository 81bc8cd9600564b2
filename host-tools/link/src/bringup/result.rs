//! What a step gives: its finding, and points that can be drawn.

use super::judge::Finding;

/// What a step has found, and what can be drawn of it.
#[derive(Debug)]
pub struct StepResult {
    /// The finding.
    pub finding: Finding,
    /// Axes, and points.
    pub series: Option<Series>,
}

/// Points that belong together.
#[derive(Clone, Debug)]
pub struct Series {
    /// What they show.
    pub title: &'static str,
    /// Of the first coordinate and of the second.
    pub axes: [&'static str; 2],
    /// The points.
    pub points: Vec<[f64; 2]>,
}

impl From<Finding> for StepResult {
    fn from(finding: Finding) -> Self {
        Self {
            finding,
            series: None,
        }
    }
}
