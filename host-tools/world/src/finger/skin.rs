//! The skin as a spring: force for indentation.

use crate::conditions::TICK_S;

/// Contact force for each count of P_DC, N (PAPER fig. 3).
pub(crate) const N_PER_COUNT: f64 = 0.0115;

/// Stiffness on the fluid, N/mm^1.5: a Hertz contact. Chosen: 0.2 N at 0.34 mm and 2 N at 1.6 mm.
const FLUID_N: f64 = 1.0;
/// Indentation at which the skin touches the core, mm: that of 2 N (PAPER fig. 3).
const CORE_MM: f64 = 1.587;
/// Stiffness on the core, N/mm^1.5. Chosen: the slope of P_DC over force falls to a third within a newton.
const CORE_N: f64 = 4.0;
/// Part of the elastic force that the silicone adds when pressed fast and that relaxes (chosen; without fluid pressure,
/// so that loading and unloading differ in fig. 3).
const RELAXING: f64 = 0.03;
/// Time of that, s (chosen).
const RELAX_S: f64 = 1.5;

#[derive(Clone, Copy, Default, Debug)]
pub(super) struct Skin {
    /// indentation of the skin alone, mm
    mm: f64,
    /// force that the fluid carries, N
    fluid_n: f64,
    /// elastic force, N
    elastic_n: f64,
    /// elastic force as the silicone remembers it, N
    remembered_n: f64,
}

impl Skin {
    /// A tick of being pressed by `mm`, which skin and surface share.
    pub(super) fn press(&mut self, mm: f64, compliance_mm_per_n: f64, landed: bool) {
        // Newton; the indentation changes little from tick to tick, so one step is enough but at the landing
        for _ in 0..if landed { 12 } else { 1 } {
            let (force, slope) = self.elastic();
            let error = self.mm + compliance_mm_per_n * force - mm;
            self.mm = (self.mm - error / (1.0 + compliance_mm_per_n * slope)).max(0.0);
        }
        self.elastic_n = self.elastic().0;
        self.fluid_n = FLUID_N * self.mm * self.mm.sqrt();
        self.remember();
    }

    pub(super) fn lift(&mut self) {
        (self.mm, self.fluid_n, self.elastic_n) = (0.0, 0.0, 0.0);
        self.remember();
    }

    fn remember(&mut self) {
        self.remembered_n += (self.elastic_n - self.remembered_n) * TICK_S / RELAX_S;
    }

    /// Force, N, and stiffness, N/mm, at equilibrium.
    fn elastic(&self) -> (f64, f64) {
        let root = self.mm.sqrt();
        let (mut force, mut slope) = (FLUID_N * self.mm * root, 1.5 * FLUID_N * root);
        if self.mm > CORE_MM {
            let core = self.mm - CORE_MM;
            let root = core.sqrt();
            force += CORE_N * core * root;
            slope += 1.5 * CORE_N * root;
        }
        (force, slope)
    }

    /// Contact force, N.
    pub(super) fn force_n(&self) -> f64 {
        (self.elastic_n + RELAXING * (self.elastic_n - self.remembered_n)).max(0.0)
    }

    /// The part of it that makes pressure in the fluid, N.
    pub(super) fn fluid_n(&self) -> f64 {
        self.fluid_n
    }
}
