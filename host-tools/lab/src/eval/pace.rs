//! Features as functions of the speed of a slide: a line over ln(speed) for every texture, from slides whose speed was
//! measured.

use tactus_core::features::{FEATURE_STEPS, MAX_FEATURES, Observation, Vector};
use tactus_core::table::{Pace, Slope, Slopes, Whitening};

/// Weight of the slope of all textures together in that of one, in slides: a few slides at about one speed show little
/// of it.
const POOLED_SLIDES: f64 = 10.0;
/// Least standard deviation of ln(speed) within a texture that slopes can be learned from: a rig holds its speed.
const LEAST_SPREAD: f64 = 0.02;

type Numbers = [f64; MAX_FEATURES];

struct Movement {
    /// Mean and variance of ln(speed), and the slope of all textures together, per unit of ln(speed).
    mean: f64,
    variance: f64,
    pooled: Numbers,
    own: Vec<Numbers>,
}

pub(super) struct Lines {
    movements: Vec<Movement>,
    /// Per texture and movement, ln(speed) of the slides.
    paces: Vec<Vec<Vec<Option<f64>>>>,
}

/// Learns them; `None` where the speed of no slide is known, or all are alike. A slide of unknown speed counts as one
/// of the usual speed.
pub(super) fn lines(
    slides: &[Vec<Vec<Observation>>],
    vectors: &[Vec<Vec<Vector>>],
    features: usize,
) -> Option<Lines> {
    let pace = |slide: &Observation| Some(f64::from(slide.pace?) / f64::from(FEATURE_STEPS));
    let of_row = |row: &Vec<Vec<Observation>>| -> Vec<Vec<Option<f64>>> {
        let cells = row.iter();
        cells.map(|cell| cell.iter().map(pace).collect()).collect()
    };
    let paces: Vec<Vec<Vec<Option<f64>>>> = slides.iter().map(of_row).collect();
    let count = paces.first()?.len();
    let movements = (0..count).map(|at| {
        let cells = vectors.iter().zip(&paces);
        let cells = cells.map(|(vectors, paces)| Cell::new(&vectors[at], &paces[at], features));
        Movement::new(&cells.collect::<Vec<_>>())
    });
    Some(Lines {
        movements: movements.collect::<Option<_>>()?,
        paces,
    })
}

struct Cell {
    slides: f64,
    /// Of ln(speed).
    pace: f64,
    /// Of its squared deviations from the texture's mean.
    squares: f64,
    products: Numbers,
}

impl Cell {
    fn new(vectors: &[Vector], paces: &[Option<f64>], features: usize) -> Self {
        let known = vectors.iter().zip(paces.iter());
        let known = known.filter_map(|(vector, pace)| Some((vector, (*pace)?)));
        let slides = known.clone().count() as f64;
        let pace: f64 = known.clone().map(|(_, u)| u).sum();
        let mean = pace / slides.max(1.0);
        let mut products = Numbers::default();
        for (vector, pace) in known.clone() {
            for (product, x) in products.iter_mut().zip(vector).take(features) {
                *product += (pace - mean) * f64::from(*x);
            }
        }
        Self {
            slides,
            pace,
            squares: known.map(|(_, u)| (u - mean).powi(2)).sum(),
            products,
        }
    }
}

impl Movement {
    fn new(cells: &[Cell]) -> Option<Self> {
        let sum = |of: fn(&Cell) -> f64| cells.iter().map(of).sum::<f64>();
        let freedom = sum(|cell| (cell.slides - 1.0).max(0.0));
        let squares = sum(|cell| cell.squares);
        let variance = squares / freedom.max(1.0);
        if variance < LEAST_SPREAD * LEAST_SPREAD {
            return None;
        }
        let mut pooled = Numbers::default();
        for cell in cells {
            for (pooled, product) in pooled.iter_mut().zip(cell.products) {
                *pooled += product / squares;
            }
        }
        let weight = POOLED_SLIDES * variance;
        let own = |cell: &Cell| {
            let mut own = pooled;
            for (own, product) in own.iter_mut().zip(cell.products) {
                *own = (product + weight * *own) / (cell.squares + weight);
            }
            own
        };
        Some(Self {
            mean: sum(|cell| cell.pace) / sum(|cell| cell.slides).max(1.0),
            variance,
            own: cells.iter().map(own).collect(),
            pooled,
        })
    }
}

impl Lines {
    /// The features of all slides as they would have been at the movement's speed.
    pub(super) fn at_movement_speed(&self, vectors: &[Vec<Vec<Vector>>]) -> Vec<Vec<Vec<Vector>>> {
        let slowed = |vector: &Vector, slope: &Numbers, pace: f64| -> Vector {
            let each = vector.iter().zip(slope);
            // `as` saturates, as features do
            each.map(|(x, b)| (f64::from(*x) - b * pace).round() as i16)
                .collect()
        };
        let textures = vectors.iter().zip(&self.paces).enumerate();
        textures
            .map(|(texture, (row, paces))| {
                let cells = row.iter().zip(paces).zip(&self.movements);
                cells
                    .map(|((slides, paces), movement)| {
                        let slope = &movement.own[texture];
                        let slides = slides.iter().zip(paces);
                        slides
                            .map(|(x, u)| slowed(x, slope, u.unwrap_or(movement.mean)))
                            .collect()
                    })
                    .collect()
            })
            .collect()
    }

    pub(super) fn whitened(self, whitenings: &[Whitening]) -> Whitened {
        let of = self.movements.iter().zip(whitenings);
        let paces = of.clone().map(|(movement, whitening)| Pace {
            mean: (movement.mean * f64::from(FEATURE_STEPS)).round() as i16,
            variance: movement.variance as f32,
            pooled: whitening.change(&movement.pooled),
        });
        let textures = 0..self.paces.len();
        let slopes = textures.flat_map(|texture| {
            let cells = of.clone();
            cells.map(move |(movement, whitening)| whitening.change(&movement.own[texture]))
        });
        Whitened {
            paces: paces.collect(),
            slopes: slopes.collect(),
        }
    }
}

/// The lines as a table has them.
pub(super) struct Whitened {
    paces: Vec<Pace>,
    slopes: Vec<Slope>,
}

impl Whitened {
    pub(super) fn slopes(&self) -> Slopes<'_> {
        Slopes {
            paces: &self.paces,
            slopes: &self.slopes,
        }
    }
}
