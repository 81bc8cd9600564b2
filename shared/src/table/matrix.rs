//! Small square matrices in f64, for what is learned once: Cholesky, eigenvectors, products.

use crate::features::MAX_FEATURES;

const SWEEPS: usize = 12;
/// Least part of a feature's variance that the features before it may leave unexplained.
const LEAST_PIVOT: f64 = 1e-6;

pub(super) type Square = [[f64; MAX_FEATURES]; MAX_FEATURES];

pub(super) fn add(sum: &mut Square, more: &Square, weight: f64) {
    for (row, more) in sum.iter_mut().zip(more) {
        for (sum, more) in row.iter_mut().zip(more) {
            *sum += weight * more;
        }
    }
}

/// Inverse of the lower Cholesky factor of a correlation matrix.
pub(super) fn inverse_cholesky(matrix: &Square, features: usize) -> Square {
    let mut lower = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    let mut inverse = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    // indices, as in every book; all are below `features`, which is at most the matrices' size
    #[allow(clippy::indexing_slicing, clippy::needless_range_loop)]
    for i in 0..features.min(MAX_FEATURES) {
        for j in 0..=i {
            let dot: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
            let rest = matrix[i][j] - dot;
            lower[i][j] = if i == j {
                libm::sqrt(rest.max(LEAST_PIVOT))
            } else {
                rest / lower[j][j]
            };
        }
        for j in 0..i {
            let dot: f64 = (j..i).map(|k| lower[i][k] * inverse[k][j]).sum();
            inverse[i][j] = -dot / lower[i][i];
        }
        inverse[i][i] = 1.0 / lower[i][i];
    }
    inverse
}

pub(super) fn transposed(matrix: &Square) -> Square {
    let mut other = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    for (row, at) in matrix.iter().zip(0..) {
        for (c, other) in row.iter().zip(&mut other) {
            if let Some(other) = other.get_mut::<usize>(at) {
                *other = *c;
            }
        }
    }
    other
}

pub(super) fn product(left: &Square, right: &Square) -> Square {
    left.map(|row| {
        let mut sum = [0.0; MAX_FEATURES];
        for (weight, other) in row.iter().zip(right) {
            sum.iter_mut()
                .zip(other)
                .for_each(|(sum, c)| *sum += weight * c);
        }
        sum
    })
}

/// The eigenvectors of a symmetric matrix as rows, that of the largest eigenvalue first (Jacobi's rotations; Golub and
/// Van Loan, Matrix Computations, 8.5). Of the two directions of each, that in which its largest element is positive.
pub(super) fn principal_axes(matrix: &Square, features: usize) -> Square {
    let features = features.min(MAX_FEATURES);
    let mut rest = *matrix;
    let mut axes = [[0.0; MAX_FEATURES]; MAX_FEATURES];
    // indices, as in every book; all are below `features`, which is at most the matrices' size
    #[allow(clippy::indexing_slicing, clippy::needless_range_loop)]
    {
        for i in 0..features {
            axes[i][i] = 1.0;
        }
        // each sweep squares what is left beside the diagonal: a few do
        for _ in 0..SWEEPS {
            for p in 0..features {
                for q in p + 1..features {
                    if rest[p][q] == 0.0 {
                        continue;
                    }
                    let tau = (rest[q][q] - rest[p][p]) / (2.0 * rest[p][q]);
                    let t = 1.0 / (libm::fabs(tau) + libm::sqrt(1.0 + tau * tau));
                    let t = if tau < 0.0 { -t } else { t };
                    let c = 1.0 / libm::sqrt(1.0 + t * t);
                    let s = t * c;
                    for k in 0..features {
                        let (a, b) = (rest[k][p], rest[k][q]);
                        (rest[k][p], rest[k][q]) = (c * a - s * b, s * a + c * b);
                    }
                    for k in 0..features {
                        let (a, b) = (rest[p][k], rest[q][k]);
                        (rest[p][k], rest[q][k]) = (c * a - s * b, s * a + c * b);
                        let (a, b) = (axes[p][k], axes[q][k]);
                        (axes[p][k], axes[q][k]) = (c * a - s * b, s * a + c * b);
                    }
                }
            }
        }
        // the rows beyond the features stay last, and 0
        let mut order: [usize; MAX_FEATURES] = core::array::from_fn(|i| i);
        order[..features]
            .sort_unstable_by(|&i, &j| rest[j][j].total_cmp(&rest[i][i]).then(i.cmp(&j)));
        order.map(|i| {
            let axis = axes[i];
            let largest = axis.iter().fold(0.0, |most: f64, &c| {
                if libm::fabs(c) > libm::fabs(most) {
                    c
                } else {
                    most
                }
            });
            if largest < 0.0 {
                axis.map(|c| -c)
            } else {
                axis
            }
        })
    }
}

/// Variance along each row of `axes` of what has this covariance.
pub(super) fn variances(axes: &Square, covariance: &Square) -> [f64; MAX_FEATURES] {
    let along = product(axes, covariance);
    let mut variances = [0.0; MAX_FEATURES];
    for ((variance, row), axis) in variances.iter_mut().zip(&along).zip(axes) {
        *variance = row.iter().zip(axis).map(|(c, a)| c * a).sum();
    }
    variances
}
