//! What a count of P_DC is worth, by known weights on the finger.

use tactus_core::rig::calibration::{LineFit, RigCalibrationError};

/// Weights make no force scale.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum WeightError {
    /// They are on no line.
    #[error(transparent)]
    Line(#[from] RigCalibrationError),
    /// P_DC falls.
    #[error(
        "P_DC falls under a weight: the load cell is wired the wrong way round. Swap its two signal wires"
    )]
    Falls,
}

/// The line through counts and weights in mN, and through 0 and 0, where the finger is in the air: mN a count, and how
/// far each weight is off it, mN.
pub fn line(points: &[(f32, f32)]) -> Result<(f32, Vec<f32>), WeightError> {
    let mut line = LineFit::default();
    line.push(0.0, 0.0);
    for &(counts, mn) in points {
        line.push(counts, mn);
    }
    let (at_0, mn_per_count) = line.line()?;
    if mn_per_count <= 0.0 {
        return Err(WeightError::Falls);
    }
    let off = |&(counts, mn): &(f32, f32)| mn - (at_0 + mn_per_count * counts);
    Ok((mn_per_count, points.iter().map(off).collect()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_residuals_and_a_reversed_cell_is_found() {
        // 10 mN a count, and the third weight 20 mN too light
        let points = [(29.4, 294.0), (58.8, 588.0), (90.3, 883.0), (117.7, 1177.0)];
        let (scale, residuals) = line(&points).unwrap();
        assert!((scale - 10.0).abs() < 0.1, "{scale}");
        let worst = residuals
            .iter()
            .copied()
            .fold(0.0, |a: f32, b| if b.abs() > a.abs() { b } else { a });
        assert!(
            (-20.0..-10.0).contains(&worst) && worst == residuals[2],
            "{residuals:?}"
        );
        let reversed = points.map(|(counts, mn)| (-counts, mn));
        assert_eq!(line(&reversed), Err(WeightError::Falls));
        // one weight laid on twice is no line
        assert!(line(&[(29.4, 294.0), (58.8, 588.0), (58.8, 1200.0)]).is_err());
    }
}
