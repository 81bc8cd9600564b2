//! Known, changed or new, in f64 and straight from the recipe, for one movement: what the fixed-point form is held
//! against.
//!
//! V = (1/k + 1/n) I + D is left as it is, a full matrix in the space of the whitener of `oracle`.
#![allow(unreachable_pub)]

use super::Random;
use super::oracle::{
    DEGREES_OF_FREEDOM as NU, Matrix, SURE, Trained, cholesky, inverse_lower, oas,
};

/// Draws for every training slide.
const DRAWS: usize = 8;
/// Slides of an episode that have limits of their own.
pub const SLIDES: usize = 3;
/// Shares of drawn slides: see [`Judge::tell`].
const FAR: f64 = 0.00025;
const POOR_FIT: f64 = 0.05;

/// Standard deviations of the drift: of the bands, ln, and of traction as a share of its mean.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Drift {
    pub bands: f64,
    pub traction: f64,
}

impl Drift {
    pub const USUAL: Self = Self {
        bands: 0.1,
        traction: 0.04,
    };
}

/// One of what people are told.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum VerdictKind {
    New,
    Changed,
    Sure,
    Undecided,
}

/// For every number of slides k the inverse of V's Cholesky factor and ln |V|.
type Spreads = Vec<(Matrix, f64)>;

pub struct Judge {
    table: Trained,
    /// With drift and without.
    spreads: [Spreads; 2],
    /// Axes of the population, its mean and its variances along them.
    axes: Matrix,
    centre: Vec<f64>,
    spread: Vec<f64>,
    /// u and beta of both scores, after one slide, two, three.
    pub limits: [[[f64; 2]; SLIDES]; 2],
}

fn times(matrix: &Matrix, x: &[f64]) -> Vec<f64> {
    matrix
        .iter()
        .map(|row| row.iter().zip(x).map(|(a, b)| a * b).sum())
        .collect()
}

/// Eigenvalues and eigenvectors, as rows, of a symmetric matrix (Jacobi).
fn eigen(matrix: &Matrix) -> (Vec<f64>, Matrix) {
    let d = matrix.len();
    let mut a = matrix.clone();
    let mut axes: Matrix = (0..d)
        .map(|i| (0..d).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    for _ in 0..30 {
        for p in 0..d {
            for q in p + 1..d {
                // the angle that makes a[p][q] vanish
                let angle = 0.5 * (2.0 * a[p][q]).atan2(a[p][p] - a[q][q]);
                let (s, c) = angle.sin_cos();
                for row in &mut a {
                    let (x, y) = (row[p], row[q]);
                    (row[p], row[q]) = (c * x + s * y, c * y - s * x);
                }
                for k in 0..d {
                    let (x, y) = (a[p][k], a[q][k]);
                    (a[p][k], a[q][k]) = (c * x + s * y, c * y - s * x);
                    let (x, y) = (axes[p][k], axes[q][k]);
                    (axes[p][k], axes[q][k]) = (c * x + s * y, c * y - s * x);
                }
            }
        }
    }
    ((0..d).map(|i| a[i][i]).collect(), axes)
}

/// ln of the gamma function for 4, 4.5, 5...
fn ln_gamma(x: f64) -> f64 {
    let mut x = x;
    let mut sum = 0.0;
    while x > 1.5 {
        x -= 1.0;
        sum += x.ln();
    }
    // G(1) = 1, G(3/2) = sqrt(pi)/2
    sum + if x == 1.5 {
        (std::f64::consts::PI.sqrt() / 2.0).ln()
    } else {
        0.0
    }
}

impl Judge {
    /// Of slides as `[texture][slide][feature]`, traction first; each texture has as many.
    pub fn learn(slides: &[Vec<Vec<f64>>], drift: Drift) -> Self {
        let training = slides.iter().map(|texture| vec![texture.clone()]).collect();
        let table = Trained::train(&training);
        let n = slides[0].len() as f64;
        let whitener = &table.movements[0];
        let d = whitener.g.len();
        let raw = |i: usize, j: usize| match (i, j) {
            (0, 0) => (drift.traction * whitener.g[0]).powi(2),
            (0, _) | (_, 0) => 0.0,
            // two low bands by themselves
            (1 | 2, _) | (_, 1 | 2) if i != j => 0.0,
            (1 | 2, _) => (0.6 * drift.bands).powi(2),
            _ if d > 15 => drift.bands.powi(2) * (-0.25 * i.abs_diff(j) as f64).exp(),
            _ => drift.bands.powi(2) * (-0.5 * i.abs_diff(j) as f64).exp(),
        };
        let raw: Matrix = (0..d)
            .map(|i| (0..d).map(|j| raw(i, j)).collect())
            .collect();
        let half: Matrix = whitener.w.iter().map(|row| times(&raw, row)).collect();
        let drifted: Matrix = half.iter().map(|row| times(&whitener.w, row)).collect();
        let spreads = [1.0, 0.0].map(|drifts| {
            let spread = |k: usize| {
                let mut v = drifted.clone();
                for (i, row) in v.iter_mut().enumerate() {
                    row.iter_mut().for_each(|v| *v *= drifts);
                    row[i] += 1.0 / k as f64 + 1.0 / n;
                }
                let l = cholesky(&v);
                let volume = (0..d).map(|i| 2.0 * l[i][i].ln()).sum();
                (inverse_lower(&l), volume)
            };
            (1..=SLIDES).map(spread).collect()
        });
        let textures = table.textures() as f64;
        let mean = |i: usize| table.means.iter().map(|m| m[0][i]).sum::<f64>() / textures;
        let mean: Vec<f64> = (0..d).map(mean).collect();
        let mut c = vec![vec![0.0; d]; d];
        for m in &table.means {
            for (i, row) in c.iter_mut().enumerate() {
                for (j, c) in row.iter_mut().enumerate() {
                    *c += (m[0][i] - mean[i]) * (m[0][j] - mean[j]) / (textures - 1.0);
                }
            }
        }
        let rho = oas(&c, textures - 1.0);
        let trace: f64 = (0..d).map(|i| c[i][i]).sum();
        let (values, axes) = eigen(&c);
        let spread = values.iter().map(|v| {
            let shrunk = (1.0 - rho) * v + rho * trace / d as f64;
            (shrunk - 1.0 / n).max(0.02)
        });
        let mut judge = Self {
            spread: spread.collect(),
            centre: times(&axes, &mean),
            axes,
            spreads,
            limits: [[[0.0; 2]; SLIDES]; 2],
            table,
        };
        // a draw of N(0, D) is a factor of D times a standard normal vector
        let (values, axes) = eigen(&drifted);
        let drifting = |random: &mut Random| {
            let mut x = vec![0.0; d];
            for (value, axis) in values.iter().zip(&axes) {
                let along = value.max(0.0).sqrt() * normal(random);
                x.iter_mut().zip(axis).for_each(|(x, a)| *x += along * a);
            }
            x
        };
        judge.limits = [0, 1].map(|which| judge.calibrate(slides, which, &drifting));
        judge
    }

    /// A_j of every texture after k slides of this mean.
    fn surprises(&self, z: &[f64], k: usize, which: usize) -> Vec<f64> {
        let (inverse, volume) = &self.spreads[which][k - 1];
        let d = z.len() as f64;
        let half = (NU + d) / 2.0;
        let of = |m: &Vec<Vec<f64>>| {
            let apart: Vec<f64> = z.iter().zip(&m[0]).map(|(z, m)| z - m).collect();
            let t: f64 = times(inverse, &apart).iter().map(|x| x * x).sum();
            half * (1.0 + t / NU).ln() + 0.5 * volume - ln_gamma(half)
                + ln_gamma(NU / 2.0)
                + d / 2.0 * (NU / 2.0).ln()
        };
        self.table.means.iter().map(of).collect()
    }

    /// S, with drift (0) or without (1).
    pub fn score(&self, z: &[f64], k: usize, which: usize) -> f64 {
        let least = self
            .surprises(z, k, which)
            .into_iter()
            .fold(f64::INFINITY, f64::min);
        let turned = times(&self.axes, z);
        let each = turned.iter().zip(&self.centre).zip(&self.spread);
        let [volume, distance] = each.fold([0.0; 2], |[volume, distance], ((z, b), lambda)| {
            let v = lambda + 1.0 / k as f64;
            [volume + v.ln(), distance + (z - b).powi(2) / v]
        });
        // what is unlike everything is no likelier for it
        let d = z.len() as f64;
        least - 0.5 * (volume + distance.min(d + 2.0 * (2.0 * d).sqrt()))
    }

    fn calibrate(
        &self,
        slides: &[Vec<Vec<f64>>],
        which: usize,
        drifting: &dyn Fn(&mut Random) -> Vec<f64>,
    ) -> [[f64; 2]; SLIDES] {
        let mut random = Random::new(3, which as u64);
        let n = slides[0].len() as f64;
        let freedom = slides.len() as f64 * (n - 1.0);
        let weight = freedom / (freedom + 10.0);
        std::array::from_fn(|more| {
            let k = more + 1;
            let mut scores = Vec::new();
            for (slides, m) in slides.iter().zip(&self.table.means) {
                for slide in slides {
                    let z = self.table.movements[0].z(slide);
                    let r: Vec<f64> = z.iter().zip(&m[0]).map(|(z, m)| z - m).collect();
                    let rho = r.iter().map(|r| r * r).sum::<f64>() * n / (n - 1.0);
                    let f = match rho < freedom {
                        true => f64::min((freedom - 1.0) / (freedom - rho), 5.0),
                        false => 5.0,
                    };
                    let by = (f * (1.0 / k as f64 + 1.0 / n) / (1.0 - 1.0 / n)).sqrt();
                    for _ in 0..DRAWS {
                        let drifted = match which {
                            0 => drifting(&mut random),
                            _ => vec![0.0; r.len()],
                        };
                        let each = m[0].iter().zip(&r).zip(drifted);
                        let z: Vec<f64> = each.map(|((m, r), x)| m + r * by + x).collect();
                        scores.push(self.score(&z, k, which));
                    }
                }
            }
            scores.sort_by(f64::total_cmp);
            let at = 0.9 * (scores.len() - 1) as f64;
            let low = scores[at as usize];
            let u = low + (scores[at as usize + 1] - low) * at.fract();
            let above: Vec<f64> = scores.iter().map(|s| s - u).filter(|s| *s > 0.0).collect();
            let beta = above.iter().sum::<f64>() / above.len() as f64;
            // -1 - 2.5 ln(alpha/0.01), drawn to this
            let prior = -1.0 - 2.5 * 10f64.ln();
            [
                weight * u + (1.0 - weight) * prior,
                weight * beta + (1.0 - weight) * 2.5,
            ]
        })
    }

    /// The verdict after slides of this mean, and the most probable texture.
    pub fn tell(&self, z: &[f64], k: usize, alpha: f64) -> (VerdictKind, usize) {
        let surprises = self.surprises(z, k, 0);
        let least = surprises.iter().copied().fold(f64::INFINITY, f64::min);
        let sum: f64 = surprises.iter().map(|a| (least - a).exp()).sum();
        let best = surprises.iter().position(|a| *a == least).unwrap();
        let over = |which: usize, alpha: f64| {
            let limits = self.limits[which].iter().take(k);
            let limits = limits.map(|[u, beta]| u + beta * (0.1 / alpha).ln());
            self.score(z, k, which) > limits.fold(f64::INFINITY, f64::min)
        };
        // one slide makes only what is far new; in the first four slides a name must fit better than 19 of 20 slides
        let new = over(0, if k == 1 { FAR } else { alpha });
        let fits = !over(0, if k <= 4 { POOR_FIT } else { alpha });
        let told = match 1.0 / sum > SURE && fits {
            _ if new => VerdictKind::New,
            true if over(1, alpha) => VerdictKind::Changed,
            true => VerdictKind::Sure,
            false => VerdictKind::Undecided,
        };
        (told, best)
    }

    pub fn z(&self, slide: &[f64]) -> Vec<f64> {
        self.table.movements[0].z(slide)
    }
}

/// A standard normal number (Box and Muller).
pub fn normal(random: &mut Random) -> f64 {
    let mut uniform = || ((random.next() >> 11) as f64 + 0.5) / (1u64 << 53) as f64;
    let radius = (-2.0 * uniform().ln()).sqrt();
    radius * (std::f64::consts::TAU * uniform()).cos()
}
