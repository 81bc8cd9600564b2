//! The fused way to decide, in f64 and straight from the recipe: what the fixed-point one is held against.
//!
//! Written without a look at any other implementation. K textures, M movements, d features: any number of each. Where
//! the recipe leaves something open, the reading taken here is marked "reading:".
#![allow(unreachable_pub)]
#![allow(clippy::needless_range_loop)] // indices as in the formulas

/// Degrees of freedom of the Student-t that a slide is judged by, and of the background class.
pub const DEGREES_OF_FREEDOM: f64 = 8.0;
/// A posterior above this ends an episode.
pub const SURE: f64 = 0.99;
/// Slides of trust that the average over movements has against one movement's own covariance.
pub const BLEND: f64 = 15.0;
/// Novelty log-odds that flag an unknown texture after one slide, and after more.
pub const NOVEL_AT_ONCE: f64 = 2.0;
pub const NOVEL_LATER: f64 = 1.5;
/// A square matrix as rows.
pub type Matrix = Vec<Vec<f64>>;

/// Slides to train from, as `[texture][movement][slide][feature]`.
pub type Training = Vec<Vec<Vec<Vec<f64>>>>;

/// The share of a sphere that OAS mixes into a covariance estimated with `freedom` degrees of freedom.
pub fn oas(covariance: &Matrix, freedom: f64) -> f64 {
    let d = covariance.len() as f64;
    let of_square: f64 = covariance.iter().flatten().map(|c| c * c).sum();
    let trace: f64 = covariance.iter().enumerate().map(|(i, row)| row[i]).sum();
    let apart = of_square - trace * trace / d;
    // a sphere already: any share gives the same (and one feature is always that)
    if apart <= 0.0 {
        return 1.0;
    }
    let above = (1.0 - 2.0 / d) * of_square + trace * trace;
    (above / ((freedom + 1.0 - 2.0 / d) * apart)).min(1.0)
}

/// Lower triangular L with L L' = `s`.
///
/// # Panics
/// `s` is not positive definite.
pub fn cholesky(s: &Matrix) -> Matrix {
    let d = s.len();
    let mut l = vec![vec![0.0; d]; d];
    for i in 0..d {
        for j in 0..=i {
            let rest = s[i][j] - (0..j).map(|k| l[i][k] * l[j][k]).sum::<f64>();
            l[i][j] = if i == j {
                assert!(rest > 0.0, "not positive definite: {s:?}");
                rest.sqrt()
            } else {
                rest / l[j][j]
            };
        }
    }
    l
}

/// Inverse of a lower triangular matrix, by forward substitution.
pub fn inverse_lower(l: &Matrix) -> Matrix {
    let d = l.len();
    let mut w = vec![vec![0.0; d]; d];
    for j in 0..d {
        for i in j..d {
            let unit = f64::from(u8::from(i == j));
            w[i][j] = (unit - (j..i).map(|k| l[i][k] * w[k][j]).sum::<f64>()) / l[i][i];
        }
    }
    w
}

/// Frozen after training: what makes the features of one movement comparable, z = W (x - g).
#[derive(Clone, Debug)]
pub struct Whitener {
    /// Inverse of the Cholesky factor of the covariance: lower triangular.
    pub w: Matrix,
    /// Grand mean of the features.
    pub g: Vec<f64>,
}

impl Whitener {
    /// The whitened features.
    pub fn z(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len(), self.g.len());
        let about: Vec<f64> = x.iter().zip(&self.g).map(|(x, g)| x - g).collect();
        let dot = |row: &Vec<f64>| row.iter().zip(&about).map(|(w, x)| w * x).sum();
        self.w.iter().map(dot).collect()
    }
}

/// A whole table: whiteners, and each texture's mean and count by movement.
#[derive(Clone, Debug)]
pub struct Trained {
    /// One for each movement.
    pub movements: Vec<Whitener>,
    /// Whitened means as `[texture][movement][feature]`.
    pub means: Vec<Vec<Vec<f64>>>,
    /// Number of slides behind each mean, as `[texture][movement]`.
    pub counts: Vec<Vec<f64>>,
}

fn mean_of<'a>(rows: impl IntoIterator<Item = &'a Vec<f64>>) -> Vec<f64> {
    let mut n = 0.0;
    let mut sum = Vec::new();
    for row in rows {
        if sum.is_empty() {
            sum = vec![0.0; row.len()];
        }
        for (s, x) in sum.iter_mut().zip(row) {
            *s += x;
        }
        n += 1.0;
    }
    assert!(n > 0.0, "the mean of nothing");
    sum.iter().map(|s| s / n).collect()
}

fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

impl Trained {
    /// Steps 2 and 3. Every texture has slides of every movement.
    ///
    /// # Panics
    /// No degree of freedom is left, or a feature never varies.
    pub fn train(slides: &Training) -> Self {
        let movements = slides[0].len();
        let dimensions = slides[0][0][0].len();
        // pooled within-texture covariance and its degrees of freedom, by movement
        let pooled: Vec<(Matrix, f64)> = (0..movements)
            .map(|m| {
                let mut s = vec![vec![0.0; dimensions]; dimensions];
                let mut freedom = 0.0;
                for texture in slides {
                    let mean = mean_of(&texture[m]);
                    for x in &texture[m] {
                        for (i, row) in s.iter_mut().enumerate() {
                            for (j, sum) in row.iter_mut().enumerate() {
                                *sum += (x[i] - mean[i]) * (x[j] - mean[j]);
                            }
                        }
                    }
                    freedom += texture[m].len() as f64 - 1.0;
                }
                assert!(freedom > 0.0, "one slide of each texture");
                s.iter_mut().flatten().for_each(|s| *s /= freedom);
                (s, freedom)
            })
            .collect();
        let whiteners: Vec<Whitener> = (0..movements)
            .map(|m| {
                let (own, freedom) = &pooled[m];
                let weight = BLEND / (BLEND + freedom);
                let mut s = own.clone();
                for (i, row) in s.iter_mut().enumerate() {
                    for (j, s) in row.iter_mut().enumerate() {
                        let average =
                            pooled.iter().map(|(s, _)| s[i][j]).sum::<f64>() / movements as f64;
                        *s += weight * (average - *s);
                    }
                }
                Whitener {
                    w: inverse_lower(&cholesky(&shrunk(&s, *freedom))),
                    // reading: the mean over textures of their means, so that none weighs more for having more slides
                    g: mean_of(&slides.iter().map(|t| mean_of(&t[m])).collect::<Vec<_>>()),
                }
            })
            .collect();
        let mut table = Self {
            movements: whiteners,
            means: Vec::new(),
            counts: Vec::new(),
        };
        for texture in slides {
            table.teach(texture);
        }
        table
    }

    /// Number of textures.
    pub fn textures(&self) -> usize {
        self.means.len()
    }

    /// A new texture from its slides, as `[movement][slide][feature]`; its index.
    pub fn teach(&mut self, slides: &[Vec<Vec<f64>>]) -> usize {
        let z = |(whitener, slides): (&Whitener, &Vec<Vec<f64>>)| whitener.z(&mean_of(slides));
        self.means
            .push(self.movements.iter().zip(slides).map(z).collect());
        self.counts
            .push(slides.iter().map(|s| s.len() as f64).collect());
        self.means.len() - 1
    }

    /// Step 6: how far two textures are confused by one slide of a movement. Symmetric, 1 on the diagonal.
    pub fn confusion(&self, movement: usize) -> Matrix {
        let row = |i: usize| {
            let cell = |j: usize| {
                let n = self.counts[i][movement].min(self.counts[j][movement]);
                let apart = squared_distance(&self.means[i][movement], &self.means[j][movement]);
                (-apart / (8.0 * (1.0 + 1.0 / n))).exp()
            };
            (0..self.textures()).map(cell).collect()
        };
        (0..self.textures()).map(row).collect()
    }
}

/// The covariance `s` with its correlations shrunk towards none: S = D C D, C <- (1 - lambda) C + lambda I.
pub fn shrunk(s: &Matrix, freedom: f64) -> Matrix {
    let d = s.len();
    let sd: Vec<f64> = (0..d).map(|i| s[i][i].sqrt()).collect();
    let c: Matrix = (0..d)
        .map(|i| (0..d).map(|j| s[i][j] / (sd[i] * sd[j])).collect())
        .collect();
    let lambda = oas(&c, freedom);
    let mixed = |i: usize, j: usize| {
        let unit = f64::from(u8::from(i == j));
        ((1.0 - lambda) * c[i][j] + lambda * unit) * sd[i] * sd[j]
    };
    (0..d)
        .map(|i| (0..d).map(|j| mixed(i, j)).collect())
        .collect()
}

/// Eq. 11: the uncertainty expected to remain, 1 - sum p_i^2 / (sum_j C_ij p_j); never below 0.
pub fn uncertainty(posterior: &[f64], confusion: &Matrix) -> f64 {
    let rest = posterior.iter().zip(confusion).map(|(p, row)| {
        let confused: f64 = row.iter().zip(posterior).map(|(c, p)| c * p).sum();
        // a texture that is ruled out adds nothing, and 0 / 0 where it underflowed
        if *p > 0.0 { p * p / confused } else { 0.0 }
    });
    (1.0 - rest.sum::<f64>()).max(0.0)
}

/// The slides of one movement, within one episode.
#[derive(Clone, Debug, Default)]
pub struct Made {
    /// Their number: k.
    pub slides: u32,
    /// Their whitened mean; empty while there is none.
    pub mean: Vec<f64>,
}

/// One episode on one texture: slides of any movements.
#[derive(Clone, Debug)]
pub struct Episode {
    /// By movement.
    pub made: Vec<Made>,
}

impl Episode {
    /// An episode before its first slide.
    pub fn new(movements: usize) -> Self {
        Self {
            made: vec![Made::default(); movements],
        }
    }

    /// All slides so far.
    pub fn slides(&self) -> u32 {
        self.made.iter().map(|m| m.slides).sum()
    }

    /// One more slide, by its features.
    pub fn slide(&mut self, table: &Trained, movement: usize, x: &[f64]) {
        self.slide_z(movement, &table.movements[movement].z(x));
    }

    /// One more slide, whitened already.
    pub fn slide_z(&mut self, movement: usize, z: &[f64]) {
        let made = &mut self.made[movement];
        made.mean.resize(z.len(), 0.0);
        made.slides += 1;
        for (mean, z) in made.mean.iter_mut().zip(z) {
            *mean += (z - *mean) / f64::from(made.slides);
        }
    }

    fn movements_made(&self) -> impl Iterator<Item = (usize, f64, &[f64])> {
        let made = self.made.iter().enumerate().filter(|(_, m)| m.slides > 0);
        made.map(|(movement, m)| (movement, f64::from(m.slides), m.mean.as_slice()))
    }

    /// Step 4: the log-likelihood of each texture. A slide replaces what its movement said before.
    pub fn log_likelihoods(&self, table: &Trained) -> Vec<f64> {
        let of = |j: usize| {
            let by_movement = self.movements_made().map(|(movement, k, mean)| {
                let d = mean.len() as f64;
                let v = 1.0 / k + 1.0 / table.counts[j][movement];
                let q = squared_distance(mean, &table.means[j][movement]);
                -d / 2.0 * v.ln()
                    - (DEGREES_OF_FREEDOM + d) / 2.0 * (q / (DEGREES_OF_FREEDOM * v)).ln_1p()
            });
            by_movement.sum()
        };
        (0..table.textures()).map(of).collect()
    }

    /// The posterior of each texture, all equally probable before.
    pub fn posterior(&self, table: &Trained) -> Vec<f64> {
        let l = self.log_likelihoods(table);
        let sum = ln_sum_exp(&l);
        l.iter().map(|l| (l - sum).exp()).collect()
    }

    /// The most probable texture (the first of equals) and its posterior.
    pub fn best(&self, table: &Trained) -> (usize, f64) {
        let posterior = self.posterior(table);
        let mut best = 0;
        for (j, p) in posterior.iter().enumerate() {
            if *p > posterior[best] {
                best = j;
            }
        }
        (best, posterior[best])
    }

    /// Step 6: the benefit of each movement (eq. 12), with alpha = 1 / (slides made of it + 1).
    pub fn benefits(&self, table: &Trained) -> Vec<f64> {
        let posterior = self.posterior(table);
        let benefit = |movement: usize| {
            let alpha = 1.0 / f64::from(self.made[movement].slides + 1);
            1.0 - uncertainty(&posterior, &table.confusion(movement)).powf(alpha)
        };
        (0..table.movements.len()).map(benefit).collect()
    }

    /// Step 7: log-odds of an unknown texture against the average known one.
    pub fn novelty(&self, table: &Trained) -> f64 {
        let textures = table.textures() as f64;
        let background = self.movements_made().map(|(movement, k, mean)| {
            let centre = mean_of(table.means.iter().map(|m| &m[movement]));
            // all of the covariance of means, drawn towards a sphere (OAS, Chen et al. 2010, eq. 23)
            let d = mean.len();
            let about: Vec<Vec<f64>> = table
                .means
                .iter()
                .map(|m| {
                    m[movement]
                        .iter()
                        .zip(&centre)
                        .map(|(m, c)| m - c)
                        .collect()
                })
                .collect();
            let mut s: Matrix = vec![vec![0.0; d]; d];
            for about in &about {
                for (row, x) in s.iter_mut().zip(about) {
                    for (s, y) in row.iter_mut().zip(about) {
                        *s += x * y / textures;
                    }
                }
            }
            let trace: f64 = (0..d).map(|i| s[i][i]).sum();
            let df = d as f64;
            let rho = oas(&s, textures);
            for (i, row) in s.iter_mut().enumerate() {
                row.iter_mut().for_each(|s| *s *= 1.0 - rho);
                row[i] += rho * trace / df + 1.0 / k;
            }
            // its inverse Cholesky factor gives distance and determinant
            let w = inverse_lower(&cholesky(&s));
            let z: Vec<f64> = mean.iter().zip(&centre).map(|(z, c)| z - c).collect();
            let row = |row: &Vec<f64>| row.iter().zip(&z).map(|(w, z)| w * z).sum::<f64>();
            let q: f64 = w.iter().map(row).map(|x| x * x).sum();
            let ln: f64 = (0..d).map(|i| -2.0 * w[i][i].ln()).sum();
            -ln / 2.0 - (DEGREES_OF_FREEDOM + df) / 2.0 * (q / DEGREES_OF_FREEDOM).ln_1p()
        });
        background.sum::<f64>() - (ln_sum_exp(&self.log_likelihoods(table)) - textures.ln())
    }

    /// Step 7: is the texture flagged as unknown?
    pub fn novel(&self, table: &Trained) -> bool {
        let bar = if self.slides() <= 1 {
            NOVEL_AT_ONCE
        } else {
            NOVEL_LATER
        };
        self.novelty(table) > bar
    }
}

/// ln of the sum of exponentials.
pub fn ln_sum_exp(l: &[f64]) -> f64 {
    let top = l.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    top + l.iter().map(|l| (l - top).exp()).sum::<f64>().ln()
}
