//! The mount of the fingertip: stiff, or a spring or a weight that yields before the finger is hurt.

use crate::conditions::TICK_S;

/// Stiffness above that of a finger on its core, N/mm: sets the speed at which the spring finds its place.
const SETTLES_N_PER_MM: f64 = 20.0;
/// m/s^2.
const STANDARD_GRAVITY: f64 = 9.806_65;

/// A spring between lever and finger, preloaded against a stop: stiff up to its preload, soft beyond.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Mount {
    preload_n: f64,
    n_per_mm: f64,
    /// Yield of the spring, mm.
    pub(super) pushed_mm: f64,
}

impl Mount {
    /// No spring.
    pub const STIFF: Self = Self {
        preload_n: f64::INFINITY,
        n_per_mm: 0.0,
        pushed_mm: 0.0,
    };
    /// The one that the book's list of parts names. It lies still at the probe's forces, 1.26 N and what a slide adds;
    /// and the lever's whole travel of 16 mm makes no more of it than 2.1 N.
    pub const SPRUNG: Self = Self {
        preload_n: 1.45,
        n_per_mm: 0.04,
        pushed_mm: 0.0,
    };

    /// The one of a rig that is to press 2 N: it lies still at that, and the lever's whole travel makes no more of it
    /// than 2.2 N.
    pub const FOR_2_N: Self = Self {
        preload_n: 2.05,
        n_per_mm: 0.009,
        pushed_mm: 0.0,
    };

    /// A tick with this force on the finger, N.
    pub(super) fn tick(&mut self, force_n: f64) {
        let over_n = force_n - self.preload_n - self.n_per_mm * self.pushed_mm;
        self.pushed_mm = (self.pushed_mm + over_n / SETTLES_N_PER_MM).max(0.0);
    }
}

/// A carriage that lies on its stop by its weight, rubs on its slide, and has inertia.
#[derive(Clone, Copy, Debug)]
pub(super) struct Weight {
    weight_n: f64,
    rubs_n: f64,
    speed_mm_s: f64,
    /// Height of its stop, and its own over that, mm.
    carrier_mm: f64,
    pub(super) pushed_mm: f64,
}

impl Weight {
    /// A carriage of this weight and friction, N, on its stop.
    pub(super) fn new(weight_n: f64, rubs_n: f64) -> Self {
        Self {
            weight_n,
            rubs_n,
            speed_mm_s: 0.0,
            carrier_mm: 0.0,
            pushed_mm: 0.0,
        }
    }

    /// A tick with this force on the finger, N, after which the stop is at this height, mm.
    pub(super) fn tick(&mut self, force_n: f64, carrier_mm: f64) {
        let before_mm = std::mem::replace(&mut self.carrier_mm, carrier_mm);
        let carrier_mm_s = (carrier_mm - before_mm) / TICK_S;
        // mm/s of a tick by a newton
        let step = 1e3 * TICK_S * STANDARD_GRAVITY / self.weight_n;
        let slides = self.speed_mm_s - carrier_mm_s + (force_n - self.weight_n) * step;
        let rubs = self.rubs_n * step;
        // friction stops it before it turns it round
        self.speed_mm_s = carrier_mm_s + slides - slides.clamp(-rubs, rubs);
        self.pushed_mm += (self.speed_mm_s - carrier_mm_s) * TICK_S;
        if self.pushed_mm <= 0.0 {
            (self.pushed_mm, self.speed_mm_s) = (0.0, carrier_mm_s);
        }
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

    /// A push accelerates it by F / m; its weight and its friction slow it down again.
    #[test]
    fn a_weight_has_inertia_and_friction() {
        let mut weight = Weight::new(1.45, 0.2);
        (0..1000).for_each(|_| weight.tick(1.64, 0.0));
        assert_eq!(weight.pushed_mm, 0.0);
        // 0.1 N more than both for 50 ms: a = 0.1 N / 0.148 kg
        (0..660).for_each(|_| weight.tick(1.75, 0.0));
        let (a, t) = (0.1 / (1.45 / STANDARD_GRAVITY), 0.05);
        assert!(
            (weight.pushed_mm / (500.0 * a * t * t) - 1.0).abs() < 0.01,
            "{weight:?}"
        );
        // slowed down by its weight and its friction from v = a t
        let mut highest = weight.pushed_mm;
        for _ in 0..13_200 {
            weight.tick(0.0, 0.0);
            highest = highest.max(weight.pushed_mm);
        }
        let slows = (1.45 + 0.2) / (1.45 / STANDARD_GRAVITY);
        let most = 500.0 * a * t * t + 500.0 * (a * t).powi(2) / slows;
        assert!(
            (highest / most - 1.0).abs() < 0.01 && weight.pushed_mm == 0.0,
            "{highest} {most}"
        );
    }
}
