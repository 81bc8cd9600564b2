//! The mount of the fingertip: stiff, or a spring that yields before the finger is hurt.

/// Stiffness above that of a finger on its core, N/mm: sets the speed at which the spring finds its place.
const SETTLES_N_PER_MM: f64 = 20.0;

/// A spring between lever and finger, preloaded against a stop: stiff up to its preload, soft beyond.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Mount {
    preload_n: f64,
    n_per_mm: f64,
    /// Friction of its slide, N.
    rubs_n: f64,
    /// Yield of the spring, mm.
    pub(super) pushed_mm: f64,
}

impl Mount {
    /// No spring.
    pub const STIFF: Self = Self {
        preload_n: f64::INFINITY,
        n_per_mm: 0.0,
        rubs_n: 0.0,
        pushed_mm: 0.0,
    };
    /// The one that the book's list of parts names. It lies still at the probe's forces, 1.26 N and what a slide adds;
    /// and the lever's whole travel of 16 mm makes no more of it than 2.1 N.
    pub const SPRUNG: Self = Self {
        preload_n: 1.45,
        n_per_mm: 0.04,
        rubs_n: 0.0,
        pushed_mm: 0.0,
    };

    /// The one of a rig that is to press 2 N: it lies still at that, and the lever's whole travel makes no more of it
    /// than 2.2 N.
    pub const FOR_2_N: Self = Self {
        preload_n: 2.05,
        n_per_mm: 0.009,
        rubs_n: 0.0,
        pushed_mm: 0.0,
    };

    /// A carriage that lies on its stop by a weight, N, and rubs on its slide, N.
    pub(super) const fn weighted(weight_n: f64, rubs_n: f64) -> Self {
        Self {
            preload_n: weight_n,
            n_per_mm: 0.0,
            rubs_n,
            pushed_mm: 0.0,
        }
    }

    /// A tick with this force on the finger, N.
    pub(super) fn tick(&mut self, force_n: f64) {
        let over_n = force_n - self.preload_n - self.n_per_mm * self.pushed_mm;
        let over_n = over_n - over_n.clamp(-self.rubs_n, self.rubs_n);
        self.pushed_mm = (self.pushed_mm + over_n / SETTLES_N_PER_MM).max(0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_spring_lies_at_its_stop_until_its_preload_and_comes_back() {
        let mut mount = Mount::SPRUNG;
        let after = |mount: &mut Mount, force_n: f64| {
            (0..20_000).for_each(|_| mount.tick(force_n));
            mount.pushed_mm
        };
        assert_eq!(after(&mut mount, 1.44), 0.0);
        assert!((after(&mut mount, 1.65) - 5.0).abs() < 0.1);
        assert_eq!(after(&mut mount, 1.4), 0.0);
        let mut stronger = Mount::FOR_2_N;
        assert_eq!(after(&mut stronger, 2.04), 0.0);
        assert!((after(&mut stronger, 2.2) - 16.7).abs() < 0.1);
        let mut stiff = Mount::STIFF;
        assert_eq!(after(&mut stiff, 12.0), 0.0);
    }
}
