//! A map of the textures of a table: how far they are apart, as well as a plane can show it.

use tactus_core::features::Property;
use tactus_core::table::{Action, Contents, Table};

use crate::eval::chart::{Chart, DrawError, Figure, MARKS, Series, WIDTH, buffer};
use crate::eval::show::apart;

/// More textures than this have numbers in the map and a list of names below it.
const NAMED: usize = 40;

/// The map of a table's textures.
///
/// # Errors
/// See [`DrawError`].
pub fn figure(table: Table<'_>) -> Result<Figure, DrawError> {
    let distances = distances(table);
    let names: Vec<&str> = table.names().collect();
    let places = plane(&distances);
    let many = names.len() > NAMED;
    let nearest = distances.iter().enumerate().map(|(n, row)| {
        let others = row.iter().enumerate().filter(|&(other, _)| other != n);
        others.min_by(|a, b| a.1.total_cmp(b.1))
    });
    let nearest: Vec<Option<(usize, f64)>> = nearest
        .map(|found| found.map(|(other, d)| (other, *d)))
        .collect();
    let mut textures = Series::points(0, MARKS[0], "", places.clone());
    let mut series = Vec::new();
    for (n, name) in names.iter().enumerate() {
        textures.labels.push(if many {
            (n + 1).to_string()
        } else {
            (*name).to_owned()
        });
        let near = nearest[n].map_or_else(String::new, |(other, sd)| {
            format!("; nearest {}, {sd:.1} standard deviations", names[other])
        });
        textures.says.push(format!("{name}{near}"));
        // a pair that is nearest to each other has one line
        if let Some((other, _)) = nearest[n]
            && (other > n || nearest[other].is_none_or(|(back, _)| back != n))
        {
            series.push(Series {
                width: 1,
                ..Series::dashed("", vec![places[n], places[other]])
            });
        }
    }
    series.push(textures);
    let below = format!(
        "Distance: in standard deviations between slides of one texture. In a plane distances are not quite right: here \
         they are off by {:.0} % (root mean square). Dashed: to the texture that is nearest in truth.",
        100.0 * off(&distances, &places)
    );
    let list: Vec<String> = names
        .iter()
        .zip(1..)
        .map(|(name, n)| format!("{n}\u{a0}{}", name.replace(' ', "\u{a0}")))
        .collect();
    let below = if many {
        format!("{below} {}", list.join(", "))
    } else {
        below
    };
    let (x_range, y_range, tall) = ranges(&places);
    let axis = "distance (standard deviations)";
    Chart {
        y_range,
        // what stands above and below the axes, and as many lines as the chart makes of the words
        size: (WIDTH, tall + 88 + Chart::height_of(&below)),
        below: &below,
        ..Chart::new("Map of the table's textures", axis, axis, x_range, series)
    }
    .figure("map")
}

/// Width of the area between the axes, and its least and greatest height, px.
const INSIDE: (f64, f64, f64) = (388.0, 360.0, 460.0);

/// Ranges of the axes with all places and some room for names, and the height between the axes at which both have the
/// same scale.
fn ranges(places: &[(f64, f64)]) -> ((f64, f64), (f64, f64), u32) {
    let ends = |of: fn(&(f64, f64)) -> f64| {
        let (low, high) = buffer(places.iter().map(of));
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        (middle, 1.15 * half.max(0.5))
    };
    let ((x, wide), (y, high)) = (ends(|p| p.0), ends(|p| p.1));
    let (width, least, most) = INSIDE;
    let tall = (width * high / wide).clamp(least, most);
    // the wider of the two in its own direction says the scale
    let scale = (wide / width).max(high / tall);
    let (wide, high) = (scale * width, scale * tall);
    ((x - wide, x + wide), (y - high, y + high), tall as u32)
}

/// How far distances between places are off, as part of the distances (root mean square).
fn off(distances: &[Vec<f64>], places: &[(f64, f64)]) -> f64 {
    let (mut apart, mut all) = (0.0, 0.0);
    for (row, a) in distances.iter().zip(places) {
        for (d, b) in row.iter().zip(places) {
            apart += (d - (a.0 - b.0).hypot(a.1 - b.1)).powi(2);
            all += d * d;
        }
    }
    if all > 0.0 { (apart / all).sqrt() } else { 0.0 }
}

/// How far each two textures are apart, in standard deviations within a texture: root mean square over the movements at
/// which both are known.
fn distances(table: Table<'_>) -> Vec<Vec<f64>> {
    let apart = |movement, textures: [u16; 2]| match table.contents() {
        Contents::Fused(..) => apart(table, movement, textures).map(f64::from),
        Contents::Gaussians(_) => apart_by_properties(table, movement, textures),
    };
    let distance = |a: u16, b: u16| {
        let at = (0..).zip(table.movements());
        let all: Vec<f64> = at.filter_map(|(m, _)| apart(m, [a, b])).collect();
        let squares: f64 = all.iter().map(|d| d * d).sum();
        (squares / all.len().max(1) as f64).sqrt()
    };
    let textures = table.textures();
    let mut all = vec![vec![0.0; textures.into()]; textures.into()];
    for a in 0..textures {
        for b in 0..a {
            let d = distance(a, b);
            all[usize::from(a)][usize::from(b)] = d;
            all[usize::from(b)][usize::from(a)] = d;
        }
    }
    all
}

/// The same by the three properties, whose standard deviations each texture has its own of.
fn apart_by_properties(table: Table<'_>, movement: u8, textures: [u16; 2]) -> Option<f64> {
    let mut squares = None;
    for property in Property::ALL {
        let action = Action::of(movement, property);
        let [a, b] = textures.map(|texture| table.gaussian(texture, action));
        if let (Some(a), Some(b)) = (a, b) {
            let variance = f64::from((a.sd * a.sd + b.sd * b.sd) / 2.0);
            let d = f64::from(a.mean - b.mean);
            *squares.get_or_insert(0.0) += d * d / variance;
        }
    }
    squares.map(f64::sqrt)
}

/// Places in a plane whose distances are as near to these as a linear map makes them (classical scaling, Torgerson 1952).
fn plane(distances: &[Vec<f64>]) -> Vec<(f64, f64)> {
    let n = distances.len();
    let mean = |row: &[f64]| row.iter().map(|d| d * d).sum::<f64>() / n.max(1) as f64;
    let means: Vec<f64> = distances.iter().map(|row| mean(row)).collect();
    let all = means.iter().sum::<f64>() / n.max(1) as f64;
    let mut products: Vec<Vec<f64>> = (0..n)
        .map(|a| {
            let product = |b: usize| (means[a] + means[b] - all - distances[a][b].powi(2)) / 2.0;
            (0..n).map(product).collect()
        })
        .collect();
    let [x, y] = [0, 1].map(|axis| {
        let (value, vector) = greatest(&products, axis);
        for (a, row) in products.iter_mut().enumerate() {
            for (b, product) in row.iter_mut().enumerate() {
                *product -= value * vector[a] * vector[b];
            }
        }
        let scale = value.sqrt();
        vector.into_iter().map(|v| scale * v).collect::<Vec<f64>>()
    });
    x.into_iter().zip(y).collect()
}

/// Rounds of the power method: the nearest of two axes is off by less than can be seen.
const ROUNDS: usize = 300;

/// The greatest eigenvalue of a symmetric matrix, at least 0, and its vector, by the power method.
fn greatest(of: &[Vec<f64>], begin: usize) -> (f64, Vec<f64>) {
    let n = of.len();
    // no vector that happens to be orthogonal to the one that is wanted
    let mut vector: Vec<f64> = (0..n)
        .map(|k| ((k + begin) as f64 * 0.7).sin() + 0.1)
        .collect();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let mut value = 0.0;
    for _ in 0..ROUNDS {
        let next: Vec<f64> = of.iter().map(|row| dot(row, &vector)).collect();
        value = dot(&next, &vector) / dot(&vector, &vector);
        let length = dot(&next, &next).sqrt();
        if length < 1e-12 {
            return (0.0, vec![0.0; n]);
        }
        vector = next.into_iter().map(|v| v / length).collect();
    }
    (value.max(0.0), vector)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn between(points: &[(f64, f64)]) -> Vec<Vec<f64>> {
        let row = |a: &(f64, f64)| {
            points
                .iter()
                .map(|b| (a.0 - b.0).hypot(a.1 - b.1))
                .collect()
        };
        points.iter().map(row).collect()
    }

    #[test]
    fn what_lies_in_a_plane_keeps_its_distances() {
        for seed in 0..50 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut at = || random.random_range(-20.0..20.0);
            let points: Vec<_> = (0..30).map(|_| (at(), 0.5 * at())).collect();
            let wanted = between(&points);
            let places = plane(&wanted);
            assert!(off(&wanted, &places) < 0.01, "seed {seed}");
            for (a, b) in between(&places)
                .iter()
                .flatten()
                .zip(wanted.iter().flatten())
            {
                assert!((a - b).abs() < 0.2, "seed {seed}: {a} for {b}");
            }
        }
        assert_eq!(plane(&[vec![0.0]]), [(0.0, 0.0)]);
    }
}
