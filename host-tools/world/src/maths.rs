//! Functions of real numbers that IEEE 754 leaves to a library, from `libm`: a platform's own differ in the last bit,
//! and a world would be another one there. Clippy forbids std's in this crate (`disallowed-methods`).

pub use libm::{cbrt, cos, exp, log as ln, pow, sin, sincos as sin_cos, tan};

/// x^2: the precision of std's `powi` is unspecified.
pub fn square(x: f64) -> f64 {
    x * x
}
