//! Logarithm and exponential of fixed-point numbers, for the fused way of deciding: integers only, so that chip and PC
//! agree to the bit by construction.

/// Parts that an octave is divided into; straight lines in between.
const PARTS: usize = 32;
/// ln 2 in Q32.
pub(crate) const LN_2: u32 = 2_977_044_472;
/// 1 / ln 2 in Q30.
pub(crate) const LOG2_E: u32 = 1_549_082_005;

/// ln(1 + n/32) in Q32, and how much more the next one is, a multiple of 256.
#[allow(clippy::indexing_slicing)] // while compiling
const LN: [[u32; 2]; PARTS] = {
    let mut table = [[0; 2]; PARTS];
    let mut n = 0;
    while n < PARTS {
        let (low, high) = (ln_of_part(n), ln_of_part(n + 1));
        table[n] = [low, (high - low) & !0xff];
        n += 1;
    }
    table
};

const fn ln_of_part(n: usize) -> u32 {
    // ln x = 2 artanh((x - 1)/(x + 1)); the ratio is at most a third
    let r = n as f64 / (2 * PARTS + n) as f64;
    let (mut sum, mut power, mut k) = (0.0, r, 1.0);
    while k < 40.0 {
        sum += power / k;
        power *= r * r;
        k += 2.0;
    }
    (2.0 * sum * 4_294_967_296.0 + 0.5) as u32
}

/// 2^(-n/32) in Q30, and how much less the next one is.
#[allow(clippy::indexing_slicing)] // while compiling
const EXP2: [[u32; 2]; PARTS] = {
    let mut table = [[0; 2]; PARTS];
    let mut n = 0;
    while n < PARTS {
        let (high, low) = (exp2_of_part(n), exp2_of_part(n + 1));
        table[n] = [high, high - low];
        n += 1;
    }
    table
};

const fn exp2_of_part(n: usize) -> u32 {
    let x = -(n as f64) / PARTS as f64 * core::f64::consts::LN_2;
    let (mut sum, mut term, mut k) = (0.0, 1.0, 1.0);
    while k < 25.0 {
        sum += term;
        term *= x / k;
        k += 1.0;
    }
    (sum * 1_073_741_824.0 + 0.5) as u32
}

/// Natural logarithm of `x / 65536`, in Q16; 0 is taken as the smallest number. At most 1.5e-4 below the true value,
/// never more than a step of Q16 above it.
pub(crate) const fn ln_q16(x: u64) -> i32 {
    let x = if x == 0 { 1 } else { x };
    // a shift of 64 bits takes the chip several
    if x >> 32 == 0 {
        let zeros = (x as u32).leading_zeros();
        return ln((x as u32) << zeros, 15 - zeros as i64);
    }
    let zeros = x.leading_zeros();
    ln(((x << zeros) >> 32) as u32, 47 - zeros as i64)
}

/// From a number of 1 to 2 in Q31 times so many octaves.
#[allow(clippy::indexing_slicing)] // masked
const fn ln(mantissa: u32, octaves: i64) -> i32 {
    // the first bit is the one
    let [low, more] = LN[(mantissa >> 26) as usize & (PARTS - 1)];
    let between = (mantissa << 6) & !0xff;
    let step = ((more as u64 * between as u64) >> 32) as u32;
    let ln = (low + step) as i64 + octaves * LN_2 as i64;
    ((ln + (1 << 15)) >> 16) as i32
}

/// e^(-x) in Q30 of an `x` in Q16; relative error at most 7e-5, and 0 beyond 2^-30.
#[inline(always)]
pub(crate) const fn exp_neg_q30(x: u32) -> u32 {
    let octaves = x as u64 * LOG2_E as u64; // Q46
    let whole = (octaves >> 46) as u32;
    if whole > 30 {
        return 0;
    }
    let part = (octaves >> 41) as usize;
    power(whole, part, (octaves >> 9) as u32 & 0xffff_0000)
}

/// 2^(-x) in Q30 of an `x` below 32 in Q18; relative error at most 7e-5.
#[inline(always)]
pub(crate) const fn exp2_neg_q30(x: u32) -> u32 {
    power(x >> 18, (x >> 13) as usize, x << 19)
}

/// 2 to the power of less these whole octaves and this part, of which the last five bits count; `between` that and the
/// next one, Q32.
#[inline(always)]
#[allow(clippy::indexing_slicing)] // masked
const fn power(whole: u32, part: usize, between: u32) -> u32 {
    let [high, less] = EXP2[part & (PARTS - 1)];
    (high - ((less as u64 * between as u64) >> 32) as u32) >> (whole & 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn exact_where_the_tables_are() {
        assert_eq!(ln_q16(1 << 16), 0);
        assert_eq!(ln_q16(2 << 16), 45_426); // 0.693147 * 65536 = 45426.1
        assert_eq!(ln_q16(0), ln_q16(1));
        assert_eq!(exp_neg_q30(0), 1 << 30);
        assert_eq!(exp_neg_q30(45_426) >> 10, (1 << 29) >> 10);
        assert_eq!(exp_neg_q30(u32::MAX), 0);
    }

    /// Just below and above the numbers that 32 bits hold, and in the range of each: one logarithm.
    #[test]
    fn both_lengths_are_one_logarithm() {
        for x in (1..=u64::from(u32::MAX)).step_by(9_999_991).chain(1..2000) {
            // the same mantissa, 32 octaves higher
            let octaves = f64::from(ln_q16(x << 32) - ln_q16(x)) - 32.0 * LN_2 as f64 / 65536.0;
            assert!(octaves.abs() <= 1.0, "{x}: {octaves}");
        }
    }

    proptest! {
        #[test]
        fn ln_is_the_logarithm(x in 1u64.., shift in 0u32..63) {
            let x = (x >> shift).max(1);
            let exact = (x as f64 / 65536.0).ln();
            let error = f64::from(ln_q16(x)) / 65536.0 - exact;
            prop_assert!((-1.5e-4..=1.6e-5).contains(&error), "{x}: {error}");
        }

        #[test]
        fn exp_is_the_exponential(x in 0u32..(20 << 16)) {
            let exact = (-f64::from(x) / 65536.0).exp();
            let error = f64::from(exp_neg_q30(x)) / 1_073_741_824.0 - exact;
            prop_assert!(error.abs() <= 7e-5 * exact + 1.0 / 1_073_741_824.0, "{x}: {error}");
        }

        #[test]
        fn exp2_is_the_power_of_2(x in 0u32..(30 << 18)) {
            let exact = (-f64::from(x) / 262_144.0).exp2();
            let error = f64::from(exp2_neg_q30(x)) / 1_073_741_824.0 - exact;
            prop_assert!(error.abs() <= 7e-5 * exact + 1.0 / 1_073_741_824.0, "{x}: {error}");
        }

        #[test]
        fn both_are_monotonic(x in 1u64..u64::MAX, y in 0u32..u32::MAX) {
            prop_assert!(ln_q16(x) <= ln_q16(x + 1));
            prop_assert!(exp_neg_q30(y) >= exp_neg_q30(y + 1));
        }
    }
}
