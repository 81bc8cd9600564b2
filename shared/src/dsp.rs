//! From samples to power and spectrum: the band-pass, frames and transforms, and arithmetic in fixed point.
//!
//! The inner loops stand behind [`Kernels`]. Of the sensor this module knows the sample rate only.

mod fir;
pub mod fixed;
mod kernels;
mod plan;
mod spectrum;

pub use fir::BandPower;
pub use kernels::{Kernels, Reals};
pub use microfft::Complex32;
pub use plan::{Angles, BAND_PASS, FRAME, Folded, HALVES, HalfFilters, Plan, TAPS, Taps};
pub use spectrum::{BIN_HZ, BINS, FUSED_BANDS, FUSED_EDGES, HOP, Spectrum, SpectrumSum};
