//! Channels of a session over its time, one panel below the other, as viewers of logs show them.

use super::timeline::drawn;
use crate::chart::{Chart, DrawError, Figure, Mark, Series, WIDTH, buffer};

/// Height of a panel, px.
const HEIGHT: u32 = 220;

/// Numbers over time.
#[derive(Clone, PartialEq, Debug)]
pub struct Trace {
    /// Its channel and field.
    pub name: String,
    /// Time in s, and the value.
    pub points: Vec<(f64, f64)>,
}

/// The picture: a panel for each group of traces, all over the same time; those without a value are left out.
///
/// # Errors
/// See [`DrawError`].
pub fn figure(title: &str, panels: &[(&str, Vec<Trace>)]) -> Result<Figure, DrawError> {
    let traces = panels.iter().flat_map(|(_, traces)| traces);
    let x_range = buffer(traces.flat_map(|trace| &trace.points).map(|point| point.0));
    let last = panels.len().saturating_sub(1);
    let mut figures = Vec::new();
    for (n, (what, traces)) in panels.iter().enumerate() {
        let shown = traces.iter().filter(|trace| !trace.points.is_empty());
        let series = shown.enumerate().map(|(colour, trace)| {
            // what is told once a slide has a mark
            let mark = match trace.points.len() {
                0..=60 => Mark::Circle,
                _ => Mark::None,
            };
            Series::curve(colour, mark, &trace.name, drawn(&trace.points))
        });
        let x = if n == last {
            "time since the probe booted (s)"
        } else {
            ""
        };
        let chart = Chart {
            y_marks: 4,
            size: (WIDTH, HEIGHT),
            titled: n == 0,
            ..Chart::new(title, x, what, x_range, series.collect())
        };
        figures.push(chart.figure("")?);
    }
    Ok(Figure::stacked("channels", title, &figures))
}
