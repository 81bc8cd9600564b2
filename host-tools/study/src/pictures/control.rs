//! A control chart: the distance of each reading from the mean of its part and operator, in the order of time.

use crate::chart::{COLOURS, Chart, Figure, MARKS, Mark, Series, WIDTH};
use tactus_lab::eval::gauge::{Reading, Study, distinct};

/// Height of the chart without its words, px.
const TALL: u32 = 320;

/// Runs of slides of one part whose names have room, most.
const RUNS: usize = 16;

/// The chart of one property, with the `study` of its `readings`; `unit` follows the name of the axis.
pub fn figure(
    id: &str,
    title: &str,
    unit: &str,
    readings: &[Reading],
    study: &Study,
) -> anyhow::Result<Figure> {
    let places = || (1..).map(f64::from).zip(study.away.iter().copied());
    let operators = distinct(readings.iter().map(|r| r.operator.as_str()));
    let end = readings.len() as f64 + 1.0;
    let level = |name: &str, y: f64| Series::dashed(name, vec![(0.0, y), (end, y)]);
    let limit = study.control_limit;
    let mut series = vec![
        level("limits", limit),
        level("", -limit),
        Series {
            width: 1,
            ..level("", 0.0)
        },
    ];
    let most = study
        .away
        .iter()
        .fold(limit, |most, away| most.max(away.abs()));
    series.extend(parts(readings, most));
    for (n, operator) in operators.iter().enumerate() {
        let of = readings.iter().zip(places());
        let of: Vec<_> = of.filter(|(r, _)| r.operator == *operator).collect();
        let says = of.iter().map(|(r, (_, away))| {
            let by = match r.operator.as_str() {
                "" => String::new(),
                name => format!(", {name}"),
            };
            format!("{}{by}, slide {}: {away:+.3}", r.part, r.slide)
        });
        let name = if operators.len() > 1 && operator.is_empty() {
            "nobody named"
        } else {
            operator
        };
        series.push(Series {
            says: says.collect(),
            ..Series::points(
                n,
                MARKS[n % 3],
                name,
                of.iter().map(|(_, place)| *place).collect(),
            )
        });
    }
    if !study.outside.is_empty() {
        let outside = places()
            .zip(0..)
            .filter(|(_, n)| study.outside.contains(n))
            .map(|(place, _)| place);
        series.push(Series {
            colour: COLOURS[1],
            ..Series::points(1, Mark::Cross, "outside the limits", outside.collect())
        });
    }
    let below = "Each slide, as far as it is from the mean of its part and operator. Dashed across: three standard \
         deviations, by the mean moving range. A slide outside is worth a look at the sample, the finger and the rig.";
    let y = format!("away from the mean{unit}");
    Chart {
        size: (WIDTH, TALL + Chart::height_of(below)),
        below,
        ..Chart::new(title, "slide, in the order of time", &y, (0.0, end), series)
    }
    .figure(id)
}

/// The name of each run of a part at the top, and a line before it; nothing where parts take turns. `most` is the
/// largest distance that is shown.
fn parts(readings: &[Reading], most: f64) -> Vec<Series> {
    let runs: Vec<&[Reading]> = readings.chunk_by(|a, b| a.part == b.part).collect();
    if runs.len() > RUNS {
        return Vec::new();
    }
    let mut tops = Series::points(0, Mark::None, "", Vec::new());
    let mut series = Vec::new();
    let mut first = 0.5;
    for run in runs {
        series.push(Series {
            width: 1,
            ..Series::dashed("", vec![(first, -most), (first, 1.7 * most)])
        });
        let next = first + run.len() as f64;
        tops.points.push((f64::midpoint(first, next), 1.65 * most));
        tops.labels.push(run[0].part.clone());
        first = next;
    }
    series.push(tops);
    series
}
