//! Picture of `tactus evaluate`: the verdicts on each texture.

use tactus_core::explorer::VerdictKind;

use crate::chart::grid::{AVOIDED, Grid, Tile};
use crate::chart::{COLOURS, Figure};
use tactus_lab::eval::courses::Course;
use tactus_lab::eval::reliability::verdicts;

/// More names than this are written as numbers below the columns, and no share is written into a cell.
const FEW: usize = 12;

/// Verdicts of these explorations at this threshold, row by row: presented textures, and columns of verdicts.
pub fn confusion(courses: &[Course], names: &[String], threshold: f32) -> anyhow::Result<Figure> {
    let known = names.len();
    let mut counts = vec![vec![0_u64; known + 2]; known];
    for course in courses {
        let (told, _, texture) = course.told(threshold);
        let column = match told {
            VerdictKind::Sure | VerdictKind::Changed => texture,
            VerdictKind::New => known,
            VerdictKind::MostLike | VerdictKind::Undecided => known + 1,
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
            let (told, colour) = match column {
                c if c == texture => ("told as sure, right".to_owned(), COLOURS[0]),
                c if c == known => ("told to be none of those known".to_owned(), AVOIDED),
                c if c > known => ("told as not sure".to_owned(), AVOIDED),
                c => (format!("told as sure to be {}", names[c]), COLOURS[1]),
            };
            Tile {
                text: match count == 0 || known > FEW {
                    true => String::new(),
                    false => format!("{:.0}", 100.0 * share),
                },
                // the least is to be seen, too
                shade: if count == 0 { 0.0 } else { 0.15 + 0.85 * share },
                colour,
                framed: false,
                says: if count == 0 {
                    String::new()
                } else {
                    let (name, percent) = (&names[texture], 100.0 * share);
                    format!("{name}: {told}, {count} of {all} ({percent:.1} %)")
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
    let columns = numbers.chain(["N", "?"].map(str::to_owned));
    let verdicts = verdicts(courses, threshold);
    let about = format!(
        "Of {} explorations {:.1} % ended with the right name, {:.1} % with a wrong one, {:.1} % with none of those \
         known and {:.1} % undecided or with the one most like it.",
        courses.len(),
        100.0 * verdicts.right,
        100.0 * verdicts.wrong,
        100.0 * verdicts.new,
        100.0 * (verdicts.undecided + verdicts.most_like)
    );
    let below = if known > FEW {
        "Darker is more often. Blue: the right name, told as sure. Orange: a wrong one. Grey: none of those known (N), \
         not sure (?)."
    } else {
        "In % of the row. Blue: the right name, told as sure. Orange: a wrong one. Grey: none of those known (N), \
         not sure (?)."
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
