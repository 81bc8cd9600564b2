//! Picture of `tactus evaluate --verify`: false rejects against false accepts, limit by limit.

use crate::chart::{Chart, Figure, MARKS, Mark, Series, WIDTH};
use tactus_lab::eval::show::count;
use tactus_lab::eval::verify::After;

/// Height of the chart without its words, px.
const TALL: u32 = 380;

/// The curves after one slide, two, three.
pub fn figure(after: &[After]) -> anyhow::Result<Figure> {
    let percent = |share: f64| 100.0 * share;
    let worst = after.iter().map(|a| percent(a.equal_error));
    let end = (4.0 * worst.fold(0.5, f64::max)).ceil();
    let mut series = vec![Series::dashed("both alike", vec![(0.0, 0.0), (end, end)])];
    for (n, a) in after.iter().enumerate() {
        let name = count(a.slides as u64, "slide");
        let points = a
            .curve
            .iter()
            .map(|[reject, accept]| (percent(*accept), percent(*reject)));
        let inside = points.filter(|(x, y)| *x <= end && *y <= end).collect();
        series.push(Series::curve(n, Mark::None, name, inside));
        let equal = percent(a.equal_error);
        series.push(Series {
            says: vec![format!("{equal:.2} % of both")],
            ..Series::points(n, MARKS[n % MARKS.len()], "", vec![(equal, equal)])
        });
    }
    let below = "Each curve is of all limits; the mark is where both errors are equal. Nearer to the corner is better.";
    Chart {
        y_range: (0.0, end),
        size: (WIDTH, TALL + Chart::height_of(below)),
        below,
        ..Chart::new(
            "The same as this one?",
            "others taken for it (%)",
            "its own slides rejected (%)",
            (0.0, end),
            series,
        )
    }
    .figure("trade-off")
}
