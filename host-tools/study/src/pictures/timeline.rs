//! One slide over time: force, speed, P_AC, and the part of it that the features are made of.

use tactus_core::features::{Block, Movement};
use tactus_core::sensor::pressure::RATE_HZ;
use tactus_core::wire::{Event, Live, Phase};

use crate::chart::{Chart, DrawError, Figure, Mark, Series, WIDTH, buffer};
use tactus_lab::data::recording::Recording;

/// Points across the picture: more than these are drawn as their least and their greatest.
const COLUMNS: usize = 380;
/// What is shown before and after the slide, s.
const AROUND_S: f64 = 0.5;

/// A slide over time.
#[derive(Clone, PartialEq, Debug)]
pub struct Timeline {
    title: String,
    /// What each shows, with its unit, and its values by the time in s from the slide's begin.
    traces: Vec<(&'static str, Vec<(f64, f64)>)>,
    /// The part at constant speed, s.
    window: (f64, f64),
    /// What is not shown, and why.
    missing: &'static str,
}

impl Timeline {
    /// Of a recorded slide: recordings hold the force and the speed that were asked for, not those that were.
    pub fn of_recording(recording: &Recording) -> Self {
        let over = |samples: &[i16], rate_hz: u32, unit: f64| {
            let seconds = (0..samples.len()).map(|n| n as f64 / f64::from(rate_hz));
            let values = samples.iter().map(|&s| f64::from(s) * unit);
            seconds.zip(values).collect::<Vec<_>>()
        };
        let mut traces = vec![(
            "P_DC (counts)",
            over(&recording.pdc, recording.pdc_rate_hz, 1.0),
        )];
        if let Some(shear) = recording.shear_mn() {
            let shear = over(&shear, recording.shear_rate_hz, 1e-3);
            traces.push(("traction (N)", shear));
        }
        traces.push(("P_AC (counts)", over(&recording.pac(), RATE_HZ, 1.0)));
        Self {
            title: title(recording.movement),
            traces,
            window: (recording.window.0.into(), recording.window.1.into()),
            missing: "Recordings hold neither the force nor the speed over time; P_DC grows with the force.",
        }
    }

    /// The picture: a panel for each.
    ///
    /// # Errors
    /// See [`DrawError`].
    pub fn figure(&self) -> Result<Figure, DrawError> {
        let times = self
            .traces
            .iter()
            .flat_map(|(_, points)| points)
            .map(|p| p.0);
        let x_range = buffer(times.chain([self.window.0, self.window.1]));
        let last = self.traces.len().saturating_sub(1);
        let mut panels = Vec::new();
        for (n, (what, points)) in self.traces.iter().enumerate() {
            let series = vec![Series::curve(0, Mark::None, "", drawn(points))];
            let window = "the features are made of this part";
            let is_last = n == last;
            let (from, to) = self.window;
            let (title, about) = match n {
                0 => (
                    self.title.as_str(),
                    format!("The features are made of {from:.2} to {to:.2} s."),
                ),
                _ => (*what, String::new()),
            };
            let panel = Chart {
                titled: n == 0,
                about,
                span: Some((self.window, if n == 0 { window } else { "" })),
                y_marks: 4,
                below: if is_last { self.missing } else { "" },
                size: (
                    WIDTH,
                    if n == 0 {
                        200
                    } else if is_last {
                        230
                    } else {
                        150
                    },
                ),
                ..Chart::new(
                    title,
                    if is_last {
                        "time from the slide's begin (s)"
                    } else {
                        ""
                    },
                    what,
                    x_range,
                    series,
                )
            };
            panels.push(panel.figure("")?);
        }
        Ok(Figure::stacked("timeline", &self.title, &panels))
    }
}

fn title(movement: Movement) -> String {
    format!("The last slide that counted: {movement}")
}

/// At most two points for each column of the picture.
pub(super) fn drawn(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= 2 * COLUMNS {
        return points.to_vec();
    }
    let columns = points.chunks(points.len().div_ceil(COLUMNS));
    let ends = columns.flat_map(|column| {
        let least = column.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1));
        let most = column.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1));
        [least, most].into_iter().flatten()
    });
    ends.collect()
}

/// Keeps what a probe reports of the slide it makes.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    movement: Option<Movement>,
    /// When the stage began the slide, ms.
    began_ms: Option<u32>,
    live: Vec<(u32, Live)>,
    blocks: Vec<Block>,
    last: Option<Timeline>,
}

impl Watch {
    /// Takes a report of this time.
    pub fn report(&mut self, at_ms: u32, event: &Event) {
        match event {
            Event::Chosen { movement, .. } => self.begin(*movement),
            Event::Phase(Phase::Sliding) => self.began_ms = Some(at_ms),
            Event::Live(live) => self.live.push((at_ms, *live)),
            Event::Block(block) => self.blocks.push(block.clone()),
            Event::SlideReport { .. } => self.counted(),
            _ => {}
        }
    }

    /// A movement begins: what was kept of the one before is no part of it.
    pub fn begin(&mut self, movement: Movement) {
        *self = Self {
            movement: Some(movement),
            last: self.last.take(),
            ..Self::default()
        };
    }

    /// The slide counts.
    pub fn counted(&mut self) {
        self.last = self.timeline().or(self.last.take());
    }

    /// The last slide that counted, as far as its samples were reported.
    pub fn last(&self) -> Option<&Timeline> {
        self.last.as_ref()
    }

    fn timeline(&self) -> Option<Timeline> {
        let slide = || self.blocks.iter().filter(|block| !block.still);
        let (from, to) = slide().find_map(|block| block.steady)?;
        let rate = f64::from(RATE_HZ);
        let pac = slide().flat_map(|block| &block.pac).map(|&s| f64::from(s));
        let pac: Vec<(f64, f64)> = (0..).map(|n| f64::from(n) / rate).zip(pac).collect();
        let end = pac.last().map_or(0.0, |p| p.0) + AROUND_S;
        let mut traces = Vec::new();
        let mut missing = "Force, speed and traction were not reported.";
        if let Some(began_ms) = self.began_ms
            && !self.live.is_empty()
        {
            let over = |value: fn(&Live) -> f64| {
                let all = self.live.iter();
                let all = all.map(|(at, live)| {
                    let after_ms = i64::from(*at) - i64::from(began_ms);
                    (after_ms as f64 * 1e-3, value(live))
                });
                all.filter(|(s, _)| (-AROUND_S..end).contains(s))
                    .collect::<Vec<_>>()
            };
            traces.push(("force (N)", over(|live| f64::from(live.force_mn) * 1e-3)));
            traces.push((
                "speed (mm/s)",
                over(|live| f64::from(live.speed_um_s).abs() * 1e-3),
            ));
            missing = "";
        }
        traces.push(("P_AC (counts)", pac));
        Some(Timeline {
            title: title(self.movement?),
            traces,
            window: (f64::from(from) / rate, f64::from(to) / rate),
            missing,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_keeps_its_least_and_its_greatest() {
        let points: Vec<_> = (0..10_000)
            .map(|n| (f64::from(n), f64::from((n * 7919) % 1000)))
            .collect();
        let drawn = drawn(&points);
        assert!(drawn.len() <= 2 * COLUMNS && drawn.len() > COLUMNS);
        let ends = |points: &[(f64, f64)]| {
            let values = points.iter().map(|p| p.1);
            (
                values.clone().fold(f64::MAX, f64::min),
                values.fold(0.0, f64::max),
            )
        };
        assert_eq!(ends(&drawn), ends(&points));
    }
}
