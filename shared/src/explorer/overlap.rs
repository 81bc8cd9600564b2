//! The overlap of two densities of the same width over their distance, for the paper's confusion (eq. 7): a table and
//! three operations in place of an exponential.

/// Steps of [`OVERLAP`] up to 25 octaves.
const STEPS: usize = 31;

/// Coefficients, from the constant one on, of a 32nd of 2 to the power of -(5 z / 31)^2 around each whole z from 0 to
/// 31, then from -32 to -1, and towards the next one away from 0: the overlap of two densities of the same width, at
/// most 5e-5 off. From 31 on, beyond 25 octaves, it is half of the last place of a number near 1: 0. The fourth number
/// is nothing: 16 bytes are easily found.
pub(super) const OVERLAP: [[f32; 4]; 64] = overlap();

#[expect(
    clippy::indexing_slicing,
    reason = "the compiler runs it, and has no iterators"
)]
const fn overlap() -> [[f32; 4]; 64] {
    let mut table = [[0.0; 4]; 64];
    // around 0 even, from both sides
    let (near, far) = (0.5 - 0.353_553_390_593_273_8, 0.5 + 0.353_553_390_593_273_8);
    let (at_near, at_far) = (overlap_at(near), overlap_at(far));
    let curve = (at_far - at_near) / (far - near);
    table[0] = coefficients([at_near - curve * near, 0.0, curve]);
    let mut n = 1;
    while n < STEPS {
        // through three points, where Chebyshev has them
        let middle = n as f64 + 0.5;
        let reach = 0.433_012_701_892_219_3;
        let [low, centre, high] = [
            overlap_at((middle - reach) * (middle - reach)),
            overlap_at(middle * middle),
            overlap_at((middle + reach) * (middle + reach)),
        ];
        let slope = (high - low) / (2.0 * reach);
        let curve = (high - 2.0 * centre + low) / (2.0 * reach * reach);
        let [constant, linear, square] = [
            centre - slope * middle + curve * middle * middle,
            slope - 2.0 * curve * middle,
            curve,
        ];
        table[n] = coefficients([constant, linear, square]);
        table[64 - n] = coefficients([constant, -linear, square]);
        n += 1;
    }
    table
}

const fn coefficients([constant, linear, square]: [f64; 3]) -> [f32; 4] {
    [
        constant as f32 / 32.0,
        linear as f32 / 32.0,
        square as f32 / 32.0,
        0.0,
    ]
}

/// 2 to the power of -25 z^2 / 31^2, of the square of z.
const fn overlap_at(square: f64) -> f64 {
    // e^x by a short way, and that 32 times
    let steps = (STEPS * STEPS) as f64;
    let x = -25.0 * core::f64::consts::LN_2 / steps * square / 32.0;
    let (mut sum, mut term, mut k) = (0.0, 1.0, 1.0);
    while k < 20.0 {
        sum += term;
        term *= x / k;
        k += 1.0;
    }
    let mut squared = 0;
    while squared < 5 {
        sum *= sum;
        squared += 1;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_overlap_is_that_of_the_densities() {
        for n in 0..40_000 {
            let z = f64::from(n) * 1e-3;
            let exact = (-25.0 / 961.0 * z * z).exp2();
            for z in [z as f32, -z as f32] {
                let [constant, linear, square, _] =
                    OVERLAP[(z as i32).clamp(-32, 31) as usize & 63];
                let overlap = 32.0 * f64::from(constant + (linear + square * z) * z);
                assert!((overlap - exact).abs() < 5e-5, "{z}: {overlap} {exact}");
            }
        }
    }
}
