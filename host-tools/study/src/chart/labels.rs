//! Layout of words in a drawing: their width, their lines, and their places beside points.

/// Width of a letter as part of its height: that of wide ones in the usual fonts, so that words fit in all of them.
const WIDE: f64 = 0.6;

/// Estimated width of words of this height, px.
pub(crate) fn width(words: &str, em: f64) -> i32 {
    (words.chars().count() as f64 * em * WIDE).ceil() as i32
}

/// Words in lines of at most so many px; a word that is longer has a line of its own. Words that a space without a
/// break joins count as one.
pub(crate) fn lines(words: &str, em: f64, most: i32) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in words.split(' ').filter(|word| !word.is_empty()) {
        let last = lines.last().map_or("", String::as_str);
        let longer = format!("{last} {word}");
        if last.is_empty() || width(&longer, em) <= most {
            lines.pop();
            lines.push(longer.trim_start().to_owned());
        } else {
            lines.push(word.to_owned());
        }
    }
    lines
}

/// Left, top, right and bottom, px.
pub(crate) type Area = [i32; 4];

fn overlap(a: Area, b: Area) -> bool {
    a[0] < b[2] && b[0] < a[2] && a[1] < b[3] && b[1] < a[3]
}

/// A point's mark reaches so far, px.
const MARK: i32 = 5;
/// Rings round a point on which its label may stand.
const RINGS: i32 = 14;

/// The middle of a label beside each point, so that labels cover neither each other nor a point, and stay in
/// `inside`; `None` if there is no place. The first ones have the choice.
pub(crate) fn place(
    points: &[(i32, i32)],
    labels: &[String],
    em: f64,
    inside: Area,
) -> Vec<Option<(i32, i32)>> {
    let marks = points
        .iter()
        .map(|&(x, y)| [x - MARK, y - MARK, x + MARK, y + MARK]);
    let mut taken: Vec<Area> = marks.collect();
    let mut placed = Vec::new();
    for (&(x, y), label) in points.iter().zip(labels) {
        let (half, tall) = (width(label, em) / 2, (em / 2.0).ceil() as i32);
        let free = (0..RINGS).find_map(|ring| {
            let (far, up) = (half + MARK + 2 + 7 * ring, tall + MARK + 1 + 6 * ring);
            let places = [
                (far, 0),
                (-far, 0),
                (0, -up),
                (0, up),
                (far, -up),
                (far, up),
                (-far, -up),
                (-far, up),
            ];
            places.into_iter().find_map(|(dx, dy)| {
                let (x, y) = (x + dx, y + dy);
                let area = [x - half, y - tall, x + half, y + tall];
                let fits = area[0] >= inside[0]
                    && area[1] >= inside[1]
                    && area[2] <= inside[2]
                    && area[3] <= inside[3];
                (fits && !taken.iter().any(|&other| overlap(area, other))).then_some(((x, y), area))
            })
        });
        if let Some((_, area)) = free {
            taken.push(area);
        }
        placed.push(free.map(|(middle, _)| middle));
    }
    placed
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    #[test]
    fn words_are_broken_where_a_line_ends() {
        assert_eq!(lines("one two three", 10.0, 60), ["one two", "three"]);
        assert_eq!(lines("unbreakable", 10.0, 12), ["unbreakable"]);
        assert_eq!(lines("", 10.0, 12), [""]);
    }

    #[test]
    fn labels_cover_nothing_and_stay_inside() {
        for seed in 0..50 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let inside = [60, 20, 470, 420];
            let mut at = |range: std::ops::Range<i32>| random.random_range(range);
            let points: Vec<_> = (0..40).map(|_| (at(60..470), at(20..420))).collect();
            let labels: Vec<String> = (0..40).map(|n| "m".repeat(3 + n % 12)).collect();
            let placed = place(&points, &labels, 13.0, inside);
            let areas: Vec<Area> = placed
                .iter()
                .zip(&labels)
                .filter_map(|(middle, label)| {
                    let (half, (x, y)) = (width(label, 13.0) / 2, (*middle)?);
                    Some([x - half, y - 7, x + half, y + 7])
                })
                .collect();
            assert!(areas.len() >= 30, "seed {seed}: {} of 40", areas.len());
            for (n, a) in areas.iter().enumerate() {
                assert!(a[0] >= inside[0] && a[2] <= inside[2], "seed {seed}: {a:?}");
                assert!(a[1] >= inside[1] && a[3] <= inside[3], "seed {seed}: {a:?}");
                assert!(!areas[..n].iter().any(|b| overlap(*a, *b)), "seed {seed}");
                let covers = |&(x, y): &(i32, i32)| overlap(*a, [x - 4, y - 4, x + 4, y + 4]);
                assert!(!points.iter().any(covers), "seed {seed}: {a:?}");
            }
        }
    }
}
