//! What `tactus evaluate` draws: what was told of each texture, how often it was right when it said so, and what another
//! threshold would change.

use tactus_core::explorer::Told;

use crate::chart::grid::{AVOIDED, Grid, Tile};
use crate::chart::{COLOURS, Chart, DrawError, Figure, MARKS, Series};
use tactus_lab::eval::courses::Course;
use tactus_lab::eval::reliability::{self, Statements, statements, verdicts};

/// The three pictures of explorations that went like this, among textures of these names, at this threshold.
///
/// # Errors
/// See [`DrawError`].
pub fn figures(
    courses: &[Course],
    names: &[String],
    threshold: f32,
) -> Result<Vec<Figure>, DrawError> {
    let mut figures = vec![
        confusion(courses, names, threshold)?,
        reliability(courses, threshold)?,
    ];
    figures.extend(by_threshold(courses, threshold)?);
    Ok(figures)
}

/// More names than this are written as numbers below the columns, and no share is written into a cell.
const FEW: usize = 12;

/// What was told, row by row: textures presented, and columns of what was told.
fn confusion(courses: &[Course], names: &[String], threshold: f32) -> Result<Figure, DrawError> {
    let known = names.len();
    let mut counts = vec![vec![0_u64; known + 3]; known];
    for course in courses {
        let (told, _, texture) = course.told(threshold);
        let column = match told {
            Told::Sure => texture,
            Told::Changed => known,
            Told::New => known + 1,
            Told::Undecided => known + 2,
        };
        counts[course.presented][column] += 1;
    }
    let presented: Vec<usize> = (0..known)
        .filter(|&t| counts[t].iter().sum::<u64>() > 0)
        .collect();
    let tiles = presented.iter().map(|&texture| {
        let all: u64 = counts[texture].iter().sum();
        let tile = |(column, &count): (usize, &u64)| {
            let share = count as f64 / all as f64;
            let name = &names[texture];
            let (told, colour) = match column {
                c if c == texture => ("told as sure, right".to_owned(), COLOURS[0]),
                c if c == known => ("told to have changed".to_owned(), AVOIDED),
                c if c == known + 1 => ("told to be none of those known".to_owned(), AVOIDED),
                c if c > known => ("told as not sure".to_owned(), AVOIDED),
                c => (format!("told as sure to be {}", names[c]), COLOURS[1]),
            };
            Tile {
                text: if count == 0 || known > FEW {
                    String::new()
                } else {
                    format!("{:.0}", 100.0 * share)
                },
                // the least is to be seen, too
                shade: if count == 0 { 0.0 } else { 0.15 + 0.85 * share },
                colour,
                framed: false,
                says: if count == 0 {
                    String::new()
                } else {
                    format!("{name}: {told}, {count} of {all} ({:.1} %)", 100.0 * share)
                },
            }
        };
        counts[texture].iter().enumerate().map(tile).collect()
    });
    let tiles = tiles.collect();
    let rows = presented
        .iter()
        .map(|&t| format!("{}: {}", t + 1, names[t]));
    let numbers = (1..=known).map(|number| number.to_string());
    let columns = numbers.chain(["C", "N", "?"].map(str::to_owned));
    let verdicts = verdicts(courses, threshold);
    let about = format!(
        "Of {} explorations {:.1} % ended with the right name, {:.1} % with a wrong one, {:.1} % with a changed one, {:.1} % with none of those known and {:.1} % undecided.",
        courses.len(),
        100.0 * verdicts.right,
        100.0 * verdicts.wrong,
        100.0 * verdicts.changed,
        100.0 * verdicts.new,
        100.0 * verdicts.undecided
    );
    let below = if known > FEW {
        "Darker is more often. Blue: the right name, told as sure. Orange: a wrong one. Grey: changed (C), none of those known (N), not sure (?)."
    } else {
        "In % of the row. Blue: the right name, told as sure. Orange: a wrong one. Grey: changed (C), none of those known (N), not sure (?)."
    };
    Grid {
        id: "confusion".to_owned(),
        title: format!("What is told of each texture, at {} %", percent(threshold)),
        about: &about,
        x: ("told: the texture of this number", columns.collect()),
        y: ("presented", rows.collect()),
        tiles,
        below,
    }
    .figure()
}

/// A share in %, without the digits of its binary form.
fn percent(share: f32) -> f64 {
    (f64::from(share) * 1e6).round() / 1e4
}

/// Between which shares the true one is, 95 times of 100, if `right` of `count` were found (Wilson 1927).
fn wilson(right: u64, count: u64) -> (f64, f64) {
    const Z: f64 = 1.96;
    let (n, p) = (count as f64, right as f64 / count as f64);
    let middle = (p + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
    let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt() / (1.0 + Z * Z / n);
    ((middle - half).max(0.0), (middle + half).min(1.0))
}

fn reliability(courses: &[Course], threshold: f32) -> Result<Figure, DrawError> {
    let bins = statements(courses, threshold);
    let mut right = Series::points(
        0,
        MARKS[0],
        "was right (bar: 95 % of such counts)",
        Vec::new(),
    );
    let mut said = Series::dashed("what it said (mean)", Vec::new());
    for (bin, x) in bins.iter().zip(1..).filter(|(bin, _)| bin.count > 0) {
        let (x, of) = (f64::from(x), bin.count as f64);
        let mean = 100.0 * bin.said.unwrap_or_default();
        let share = 100.0 * bin.right as f64 / of;
        let (low, high) = wilson(bin.right, bin.count);
        right.points.push((x, share));
        right.bars.push((100.0 * low, 100.0 * high));
        right.labels.push(format!("{share:.1}"));
        right.says.push(format!(
            "said {}: right {} of {} times ({share:.1} %, from {:.1} to {:.1} %); said {mean:.2} % on average",
            range(bin),
            bin.right,
            bin.count,
            100.0 * low,
            100.0 * high,
        ));
        said.points.push((x, mean));
    }
    let text = |x: f64| {
        let bin = bins.get((x.round() as usize).wrapping_sub(1));
        bin.map_or_else(String::new, range)
    };
    let about = "Counted after every slide until the exploration ended; slides of one exploration are not independent, \
                 so the bars are rather too short.";
    Chart {
        about: about.to_owned(),
        y_range: (0.0, 108.0),
        x_marks: bins.len(),
        x_text: &text,
        below: "Points below the dashed line: it said more than was so.",
        ..Chart::new(
            "How often it is right when it says so",
            "probability that was said of the most probable (%)",
            "how often that was right (%)",
            (0.5, bins.len() as f64 + 0.5),
            vec![said, right],
        )
    }
    .figure("reliability")
}

/// The probabilities that are counted together, in %.
fn range(bin: &Statements) -> String {
    match (percent(bin.from), percent(bin.to)) {
        (0.0, high) => format!("<{high}"),
        (low, 100.0) => format!("\u{2265}{low}"),
        (low, high) => format!("{low}\u{2013}{high}"),
    }
}

/// Slides, and what is told, by the threshold.
fn by_threshold(courses: &[Course], threshold: f32) -> Result<Vec<Figure>, DrawError> {
    let by_threshold = reliability::by_threshold(courses, threshold);
    let thresholds: Vec<f32> = by_threshold.iter().map(|at| at.threshold).collect();
    let at = thresholds.iter().position(|&t| t == threshold);
    let at = at.unwrap_or(0) as f64 + 1.0;
    let text = |x: f64| {
        let at = (x.round() as usize).wrapping_sub(1);
        thresholds
            .get(at)
            .map_or_else(String::new, |&t| percent(t).to_string())
    };
    let x_range = (0.5, thresholds.len() as f64 + 0.5);
    let x = "threshold: sure above this probability (%)";
    let mut slides = Series::curve(0, MARKS[0], "", Vec::new());
    let mut told = [
        ("told a wrong name as sure", 1),
        ("told none of those known", 2),
        ("told a changed one", 3),
        ("undecided", 0),
    ]
    .map(|(name, colour)| Series::curve(colour, MARKS[colour], name, Vec::new()));
    for (at, n) in by_threshold.iter().zip(1..) {
        let n = f64::from(n);
        let (mean, v) = (at.mean_slides, at.verdicts);
        slides.points.push((n, mean));
        let shown = percent(at.threshold);
        slides.says.push(format!("at {shown} %: {mean:.2} slides"));
        for (series, share) in told
            .iter_mut()
            .zip([v.wrong, v.new, v.changed, v.undecided])
        {
            let share = 100.0 * share;
            series.points.push((n, share));
            let name = &series.name;
            series
                .says
                .push(format!("at {shown} %: {share:.2} % {name}"));
        }
    }
    let used = |top: f64| Series::dashed("the threshold in use", vec![(at, 0.0), (at, top)]);
    let most = |series: &[Series]| {
        let points = series.iter().flat_map(|s| &s.points);
        1.1 * points.map(|p| p.1).fold(0.1, f64::max)
    };
    let top = most(std::slice::from_ref(&slides));
    let slides = Chart {
        y_range: (0.0, top),
        x_marks: thresholds.len(),
        x_text: &text,
        ..Chart::new(
            "Slides by threshold",
            x,
            "slides until the answer (mean)",
            x_range,
            vec![used(top), slides],
        )
    }
    .figure("slides-by-threshold")?;
    let top = most(&told);
    let [wrong, new, changed, undecided] = told;
    let errors = Chart {
        y_range: (0.0, top),
        x_marks: thresholds.len(),
        x_text: &text,
        ..Chart::new(
            "Errors by threshold",
            x,
            "explorations (%)",
            x_range,
            vec![used(top), wrong, new, changed, undecided],
        )
    }
    .figure("errors-by-threshold")?;
    Ok(vec![slides, errors])
}
