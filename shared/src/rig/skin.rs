//! Wear of the skin: sliding rubs the fingerprints off, and roughness changes when they go.

use crate::features::Movement;

/// Wear after which the skin should be looked at, J of sliding weighted by the wear that a power makes.
///
/// The paper changed the skin twice during 117 textures x 3 movements x 5 trials, every time there were visible signs
/// of wear: about 585 slides a skin, of about 30 mm at 0.6 N of shear, 18 mJ each at 8 mW. Half of that, so that the
/// warning comes first.
pub const WARN_J: f32 = 8.0;

/// Factor of wear per joule at this sliding power: the paper found that movements of high power wear the fingerprints
/// off, which slow or light ones of the same energy do not. Chosen: twice as bad at the limit of
/// [`Movement::is_high_wear`], and in proportion above.
pub(crate) fn wearing(power_mw: f32) -> f32 {
    1.0 + power_mw / Movement::WEAR_LIMIT_MW
}

/// A sum of millions of small parts: the rounding error of each addition is added with the next part (Kahan's method),
/// since the chip adds f64 in a hundred instructions.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
struct Sum {
    sum: f32,
    /// Excess of the sum over the true value.
    excess: f32,
}

impl Sum {
    const fn of(sum: f32) -> Self {
        Self { sum, excess: 0.0 }
    }

    fn add(&mut self, part: f32) {
        let part = part - self.excess;
        let sum = self.sum + part;
        self.excess = (sum - self.sum) - part;
        self.sum = sum;
    }
}

/// Sliding since the skin was replaced.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct SkinCare {
    energy_j: Sum,
    wear_j: Sum,
}

impl SkinCare {
    /// A new skin.
    pub const NEW: Self = Self::after(0.0, 0.0);

    /// A skin that has done `energy_j` joules, which wore it like `wear_j`.
    pub const fn after(energy_j: f32, wear_j: f32) -> Self {
        Self {
            energy_j: Sum::of(energy_j),
            wear_j: Sum::of(wear_j),
        }
    }

    /// One millisecond of sliding. Where the shear is not measured the contact force stands in for it, with a
    /// coefficient of friction of 1: a skin is then replaced too early rather than too late.
    pub(crate) fn slid(&mut self, shear_n: f32, force_n: f32, speed_mm_s: f32) {
        let friction = if shear_n > 0.0 {
            shear_n
        } else {
            force_n.max(0.0)
        };
        let power_mw = friction * libm::fabsf(speed_mm_s);
        let energy_j = power_mw * 1e-6;
        self.energy_j.add(energy_j);
        self.wear_j.add(energy_j * wearing(power_mw));
    }

    /// Sliding energy since the last replacement, J.
    pub fn energy_j(&self) -> f32 {
        self.energy_j.sum
    }

    /// The same, weighted by how much it wears, J.
    pub fn wear_j(&self) -> f32 {
        self.wear_j.sum
    }

    /// Returns true if the skin should be looked at before the next training.
    pub fn is_worn(&self) -> bool {
        self.wear_j() > WARN_J
    }

    /// The skin was replaced.
    pub fn replaced(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn energy_is_shear_times_way_and_high_power_wears_more() {
        let slide = |shear_n: f32, speed: f32, ms: u32| {
            let mut skin = SkinCare::default();
            (0..ms).for_each(|_| skin.slid(shear_n, 1.0, speed));
            skin
        };
        // 0.5 N over 30 mm
        let slow = slide(0.5, 10.0, 3000);
        let fast = slide(0.5, 100.0, 300);
        assert!((slow.energy_j() - 0.015).abs() < 1e-6 && (fast.energy_j() - 0.015).abs() < 1e-6);
        assert!((slow.wear_j() / slow.energy_j() - (1.0 + 5.0 / 15.887)).abs() < 1e-3);
        assert!((fast.wear_j() / fast.energy_j() - (1.0 + 50.0 / 15.887)).abs() < 1e-3);
        // without a shear the force counts
        assert!((slide(0.0, 10.0, 3000).energy_j() - 0.03).abs() < 1e-6);
    }

    /// The parts of a worn skin are 1e-6 of its sum: f32 alone would be off by some of them each.
    #[test]
    fn hours_of_sliding_are_summed_as_in_f64() {
        let mut skin = SkinCare::after(3.0, 7.0);
        let (mut energy_j, mut wear_j) = (3.0, 7.0);
        for ms in 0..2_000_000 {
            let shear_n = 0.1 + (ms % 977) as f32 * 1e-3;
            skin.slid(shear_n, 1.0, 3.0);
            let power_mw = f64::from(shear_n) * 3.0;
            energy_j += power_mw * 1e-6;
            wear_j += power_mw * 1e-6 * (1.0 + power_mw / f64::from(Movement::WEAR_LIMIT_MW));
        }
        for (sum, exact) in [(skin.energy_j(), energy_j), (skin.wear_j(), wear_j)] {
            let off = (f64::from(sum) / exact - 1.0).abs();
            assert!(off < 3e-7, "{sum} for {exact}: {off}");
        }
    }

    #[test]
    fn a_worn_skin_is_reported_until_it_is_replaced() {
        assert!(!SkinCare::after(7.0, 7.99).is_worn());
        let mut worn = SkinCare::after(5.0, 8.01);
        assert!(worn.is_worn());
        worn.replaced();
        assert_eq!(worn, SkinCare::default());
    }
}
