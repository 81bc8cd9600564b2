//! What `tactus evaluate --novelty --plot` draws: what is told of known textures and of those that were left out of the table.

use crate::chart::{Chart, DrawError, Figure, MARKS, Series};
use tactus_lab::eval::novelty::{After, Novelty};

/// What a curve is called, its colour, and its share after so many slides.
type Curve = (&'static str, usize, fn(&After) -> f64);

const KNOWN: [Curve; 4] = [
    ("told the right name as sure", 0, |after| after.known.right),
    ("told a wrong name as sure", 1, |after| after.known.wrong),
    ("told to be none of those known", 2, |after| after.known.new),
    ("told to have changed", 3, |after| after.known.changed),
];
const NEW: [Curve; 4] = [
    ("noticed: told as new or as changed", 0, |after| {
        after.unknown.noticed()
    }),
    ("told a name as sure: wrong", 1, |after| after.unknown.wrong),
    ("told to be none of those known", 2, |after| {
        after.unknown.new
    }),
    ("told to be one that has changed", 3, |after| {
        after.unknown.changed
    }),
];

/// A picture of known textures, and one of new ones.
///
/// # Errors
/// See [`DrawError`].
pub fn figures(novelty: &Novelty) -> Result<Vec<Figure>, DrawError> {
    let draw = |title: &str, curves: [Curve; 4], file: &str| {
        let series = curves.map(|(name, colour, share)| {
            let mut series = Series::curve(colour, MARKS[colour], name, Vec::new());
            for after in &novelty.novelty {
                let share = 100.0 * share(after);
                series.points.push((after.slides as f64, share));
                let slides = after.slides;
                series
                    .says
                    .push(format!("after {slides}: {share:.1} % {name}"));
            }
            series
        });
        Chart {
            y_range: (0.0, 100.0),
            x_marks: novelty.novelty.len(),
            x_text: &|x: f64| format!("{x:.0}"),
            ..Chart::new(
                title,
                "slides",
                "episodes (%)",
                (0.5, novelty.novelty.len() as f64 + 0.5),
                series.into(),
            )
        }
        .figure(file)
    };
    Ok(vec![
        draw("What is told of known textures", KNOWN, "known-by-slides")?,
        draw("What is told of new textures", NEW, "new-by-slides")?,
    ])
}
