//! What a step gives: its finding, and points that can be drawn.

use serde::{Deserialize, Serialize};

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
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Series {
    /// What they show.
    pub title: String,
    /// Of the first coordinate and of the second.
    pub axes: [String; 2],
    /// The points.
    pub points: Vec<[f64; 2]>,
}

impl StepResult {
    /// A finding, and points that can be drawn.
    pub(super) fn drawn(
        finding: Finding,
        title: &str,
        axes: [&str; 2],
        points: Vec<[f64; 2]>,
    ) -> Self {
        let (title, axes) = (title.to_owned(), axes.map(str::to_owned));
        let series = Some(Series {
            title,
            axes,
            points,
        });
        Self { finding, series }
    }
}

impl From<Finding> for StepResult {
    fn from(finding: Finding) -> Self {
        Self {
            finding,
            series: None,
        }
    }
}
