//! Places of a table's textures in a plane: their distances, as well as a plane can show them.

use tactus_core::features::{Observation, Property};
use tactus_core::table::{Action, Contents, Table, white};

use super::show::apart;

/// Distance of each two textures, in standard deviations within a texture: at one movement, or root mean square over
/// the movements at which both are known.
pub fn distances(table: Table<'_>, at: Option<u8>) -> Vec<Vec<f64>> {
    let apart = |movement, textures: [u16; 2]| match table.contents() {
        Contents::Fused(..) => apart(table, movement, textures).map(f64::from),
        Contents::Gaussians(_) => apart_by_properties(table, movement, textures),
    };
    let distance = |a: u16, b: u16| {
        let movements = (0..).zip(table.movements()).map(|(movement, _)| movement);
        let wanted = movements.filter(|movement| at.is_none_or(|at| at == *movement));
        let all: Vec<f64> = wanted.filter_map(|m| apart(m, [a, b])).collect();
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

/// Distance of a slide of a movement from each texture of a fused table, in standard deviations within a texture;
/// `None` if it lacks features.
pub fn slide_distances(table: Table<'_>, movement: u8, slide: &Observation) -> Option<Vec<f64>> {
    let all = |one: &dyn Fn(u16) -> f64| (0..table.textures()).map(one).collect();
    match table.contents() {
        Contents::Fused(set, features) => {
            let slide = slide.vector(set, features.into())?;
            let slide = table.whiten(movement, &slide)?;
            Some(all(&|texture| {
                let means = table.white_mean(texture, movement);
                let apart = slide.iter().zip(means);
                let squares = apart.map(|(z, mean)| f64::from(white(*z) - white(mean)).powi(2));
                squares.sum::<f64>().sqrt()
            }))
        }
        Contents::Gaussians(measured) => {
            let values = measured.iter().map(|property| {
                let value = slide.properties.get(property)?;
                Some((property, value))
            });
            let values = values.collect::<Option<Vec<_>>>()?;
            Some(all(&|texture| {
                let squares = values.iter().filter_map(|(property, value)| {
                    let known = table.gaussian(texture, Action::of(movement, *property))?;
                    Some(f64::from((value - known.mean) / known.sd).powi(2))
                });
                squares.sum::<f64>().sqrt()
            }))
        }
    }
}

/// Distance of two textures by the three properties, for which each texture has its own standard deviations.
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

/// Places in a plane whose distances are as near to these as a linear map makes them (classical scaling, Torgerson
/// 1952).
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Plane {
    /// A place for each.
    pub places: Vec<(f64, f64)>,
    means: Vec<f64>,
    axes: [Vec<f64>; 2],
}

impl Plane {
    /// The plane of these distances, a row for each.
    pub fn of(distances: &[Vec<f64>]) -> Self {
        let n = distances.len();
        let mean = |row: &[f64]| row.iter().map(|d| d * d).sum::<f64>() / n.max(1) as f64;
        let means: Vec<f64> = distances.iter().map(|row| mean(row)).collect();
        let all = means.iter().sum::<f64>() / n.max(1) as f64;
        let mut products: Vec<Vec<f64>> = (0..n)
            .map(|a| {
                let product =
                    |b: usize| (means[a] + means[b] - all - distances[a][b].powi(2)) / 2.0;
                (0..n).map(product).collect()
            })
            .collect();
        let axes = [0, 1].map(|axis| {
            let (value, vector) = greatest(&products, axis);
            for (a, row) in products.iter_mut().enumerate() {
                for (b, product) in row.iter_mut().enumerate() {
                    *product -= value * vector[a] * vector[b];
                }
            }
            (value.sqrt(), vector)
        });
        let [x, y] = [0, 1].map(|axis: usize| {
            let (scale, vector) = &axes[axis];
            vector.iter().map(|v| scale * v).collect::<Vec<f64>>()
        });
        let axes = axes.map(|(scale, vector)| {
            let share = if scale > 0.0 { 0.5 / scale } else { 0.0 };
            vector.into_iter().map(|v| share * v).collect()
        });
        Self {
            places: x.into_iter().zip(y).collect(),
            means,
            axes,
        }
    }

    /// Place of another one that has these distances from all (Gower 1968).
    pub fn place(&self, distances: &[f64]) -> (f64, f64) {
        let nearer = || {
            self.means
                .iter()
                .zip(distances)
                .map(|(mean, d)| mean - d * d)
        };
        let [x, y] = [0, 1].map(|axis: usize| {
            let parts = self.axes[axis].iter().zip(nearer());
            parts.map(|(share, nearer)| share * nearer).sum::<f64>()
        });
        (x, y)
    }

    /// The same plane, turned and mirrored to lie as near as possible to another one of the same.
    #[must_use]
    pub(crate) fn turned_to(mut self, other: &Self) -> Self {
        let pairs = || self.places.iter().zip(&other.places);
        // of turns and of turns of the mirror image, the better one has the longer sum
        let sum = |mirror: f64| {
            pairs().fold((0.0, 0.0), |(re, im), (a, b)| {
                let (x, y) = (a.0, mirror * a.1);
                (re + x * b.0 + y * b.1, im + x * b.1 - y * b.0)
            })
        };
        let (straight, mirrored) = (sum(1.0), sum(-1.0));
        let length = |of: (f64, f64)| of.0 * of.0 + of.1 * of.1;
        let (mirror, (re, im)) = if length(mirrored) > length(straight) {
            (-1.0, mirrored)
        } else {
            (1.0, straight)
        };
        let size = length((re, im)).sqrt();
        if size < 1e-12 {
            return self;
        }
        let (cos, sin) = (re / size, im / size);
        let turn = |x: f64, y: f64| (cos * x - sin * mirror * y, sin * x + cos * mirror * y);
        for place in &mut self.places {
            *place = turn(place.0, place.1);
        }
        let [xs, ys] = &mut self.axes;
        for (x, y) in xs.iter_mut().zip(ys) {
            (*x, *y) = turn(*x, *y);
        }
        self
    }
}

/// Error of the distances between places, as part of the distances (root mean square).
pub fn off(distances: &[Vec<f64>], places: &[(f64, f64)]) -> f64 {
    let (mut apart, mut all) = (0.0, 0.0);
    for (row, a) in distances.iter().zip(places) {
        for (d, b) in row.iter().zip(places) {
            apart += (d - (a.0 - b.0).hypot(a.1 - b.1)).powi(2);
            all += d * d;
        }
    }
    if all > 0.0 { (apart / all).sqrt() } else { 0.0 }
}

const ROUNDS: usize = 300;

/// The greatest eigenvalue of a symmetric matrix, at least 0, and its vector, by the power method.
fn greatest(of: &[Vec<f64>], begin: usize) -> (f64, Vec<f64>) {
    let n = of.len();
    // no vector that happens to be orthogonal to the one that is wanted
    let mut vector: Vec<f64> = (0..n)
        .map(|k| libm::sin((k + begin) as f64 * 0.7) + 0.1)
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
            let places = Plane::of(&wanted).places;
            assert!(off(&wanted, &places) < 0.01, "seed {seed}");
            for (a, b) in between(&places)
                .iter()
                .flatten()
                .zip(wanted.iter().flatten())
            {
                assert!((a - b).abs() < 0.2, "seed {seed}: {a} for {b}");
            }
        }
        assert_eq!(Plane::of(&[vec![0.0]]).places, [(0.0, 0.0)]);
    }

    #[test]
    fn another_one_is_placed_by_its_distances_and_maps_are_turned_onto_each_other() {
        for seed in 0..50 {
            let mut random = ChaCha8Rng::seed_from_u64(seed);
            let mut at = || random.random_range(-20.0..20.0);
            let points: Vec<_> = (0..30).map(|_| (at(), 0.5 * at())).collect();
            let (cos, sin): (f64, f64) = (0.6, 0.8);
            let elsewhere = |p: &(f64, f64)| (cos * p.0 + sin * p.1, sin * p.0 - cos * p.1);
            let others: Vec<_> = points.iter().map(elsewhere).collect();
            let plane = Plane::of(&between(&points));
            let turned = Plane::of(&between(&others)).turned_to(&plane);
            for (place, wanted) in turned.places.iter().zip(&plane.places) {
                let apart = (place.0 - wanted.0).hypot(place.1 - wanted.1);
                assert!(apart < 0.3, "seed {seed}: {place:?} for {wanted:?}");
            }
            for (n, row) in between(&points).iter().enumerate() {
                for plane in [&plane, &turned] {
                    let (place, wanted) = (plane.place(row), plane.places[n]);
                    let apart = (place.0 - wanted.0).hypot(place.1 - wanted.1);
                    assert!(apart < 0.05, "seed {seed}: {place:?} for {wanted:?}");
                }
            }
        }
    }
}
