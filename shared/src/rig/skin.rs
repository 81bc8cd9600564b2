//! Wear of the skin: sliding rubs the fingerprints off, and roughness changes when they go.

/// Sliding energy after which the skin should be looked at, J.
///
/// The paper changed the skin twice during 117 textures x 3 movements x 5 trials, every time there were visible signs of
/// wear: about 585 slides a skin, of about 30 mm at 0.6 N of shear, 18 mJ each. Half of that, so that the warning comes
/// first.
pub const WARN_J: f32 = 5.0;

/// Sliding energy since the skin was replaced.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct SkinCare {
    /// In mJ, as f64: millions of small additions.
    energy_mj: f64,
}

impl SkinCare {
    /// A skin that has done `energy_j` joules.
    pub fn after(energy_j: f32) -> Self {
        Self {
            energy_mj: f64::from(energy_j) * 1e3,
        }
    }

    /// One millisecond of sliding. Where the shear is not measured the contact force stands in for it, with a coefficient
    /// of friction of 1: a skin is then replaced too early rather than too late.
    pub(crate) fn slid(&mut self, shear_n: f32, force_n: f32, speed_mm_s: f32) {
        let friction = if shear_n > 0.0 {
            shear_n
        } else {
            force_n.max(0.0)
        };
        // N times mm/s is mW; over a ms that is uJ
        self.energy_mj += f64::from(friction * libm::fabsf(speed_mm_s)) * 1e-3;
    }

    /// Sliding energy since the last replacement, J.
    pub fn energy_j(&self) -> f32 {
        (self.energy_mj * 1e-3) as f32
    }

    /// Whether the skin should be looked at before the next training.
    pub fn is_worn(&self) -> bool {
        self.energy_j() > WARN_J
    }

    /// The skin was replaced.
    pub fn replaced(&mut self) {
        *self = Self::default();
    }
}
