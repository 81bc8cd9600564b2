//! Pictures of `tactus evaluate`: the verdicts on each texture, and the reliability of the probabilities.

use tactus_core::explorer::VerdictKind;

use crate::chart::grid::{AVOIDED, Grid, Tile};
use crate::chart::{COLOURS, Chart, DrawError, Figure, MARKS, Series};
use tactus_lab::eval::courses::Course;
use tactus_lab::eval::reliability::{Statements, statements, verdicts};

/// The two pictures of these explorations, among textures of these names, at this threshold.
///
/// # Errors
/// See [`DrawError`].
pub fn figures(
    courses: &[Course],
    names: &[String],
    threshold: f32,
) -> Result<Vec<Figure>, DrawError> {
    Ok(vec![
        confusion(courses, names, threshold)?,
        reliability(courses, threshold)?,
    ])
}

/// More names than this are written as numbers below the columns, and no share is written into a cell.
const FEW: usize = 12;

/// Verdicts, row by row: presented textures, and columns of verdicts.
fn confusion(courses: &[Course], names: &[String], threshold: f32) -> Result<Figure, DrawError> {
    let known = names.len();
    let mut counts = vec![vec![0_u64; known + 3]; known];
    for course in courses {
        let (told, _, texture) = course.told(threshold);
        let column = match told {
            VerdictKind::Sure => texture,
            VerdictKind::Changed => known,
            VerdictKind::New => known + 1,
            VerdictKind::Undecided => known + 2,
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
        "Of {} explorations {:.1} % ended with the right name, {:.1} % with a wrong one, {:.1} % with a changed one, \
         {:.1} % with none of those known and {:.1} % undecided.",
        courses.len(),
        100.0 * verdicts.right,
        100.0 * verdicts.wrong,
        100.0 * verdicts.changed,
        100.0 * verdicts.new,
        100.0 * verdicts.undecided
    );
    let below = if known > FEW {
        "Darker is more often. Blue: the right name, told as sure. Orange: a wrong one. Grey: changed (C), none of \
         those known (N), not sure (?)."
    } else {
        "In % of the row. Blue: the right name, told as sure. Orange: a wrong one. Grey: changed (C), none of those \
         known (N), not sure (?)."
    };
    Grid {
        id: "confusion".to_owned(),
        title: format!("Verdicts on each texture, at {} %", percent(threshold)),
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

/// Confidence interval of 95 % for the true share, if `right` of `count` were found (Wilson 1927).
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
    let mut said = Series::dashed("as stated (mean)", Vec::new());
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
