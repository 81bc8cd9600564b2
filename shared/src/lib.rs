//! The core of Tactus: it turns the samples of a slide into properties, keeps what every texture feels like, and chooses
//! each next movement (Bayesian exploration, Fishel & Loeb 2012). Equation and table numbers in these pages are that
//! paper's.
//!
//! The crate has no std, no allocation, no unsafe code, no clock and no statics: the same functions run on the chip and on
//! a PC, and give the same bits.
//!
//! For the chip it is compiled for speed, and what is generic or `#[inline]` with the firmware, for size (`Cargo.toml`):
//! large functions that nobody waits for are `#[inline]`.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod dsp;
pub mod explorer;
pub mod features;
pub mod handheld;
pub mod probe;
pub mod rig;
pub mod sensor;
pub mod session;
pub mod store;
pub mod table;
pub mod wire;

/// Former path.
pub mod teaching {
    pub use crate::probe::teach::*;
}

/// Former path.
pub mod training {
    pub use crate::probe::training::*;
}

pub use dsp::fixed;
pub use sensor::{biotac, mcp3202, pressure};

/// See [`dsp`].
pub mod fir {
    pub use crate::dsp::{BandPower, PAIRS, PASS_BAND_HZ, TAPS, Taps};
}

/// See [`dsp`].
pub mod spectrum {
    pub use crate::dsp::{
        Angles, BIN_HZ, BINS, Complex32, FRAME, Folded, FrameSum, HOP, Spectrum, SpectrumSum,
        angles,
    };
}

/// See [`dsp`] and [`explorer::kernels`].
pub mod kernels {
    pub use crate::dsp::Plain;
    pub use crate::explorer::kernels::{Candidate, EXP2, FAR, Live, ROUND, Spread, exp_neg};

    /// What costs the time of a slide and of a decision.
    pub trait Kernels: crate::dsp::Kernels + crate::explorer::Kernels {}

    impl<K: crate::dsp::Kernels + crate::explorer::Kernels> Kernels for K {}
}

/// See [`features`] and [`rig::slide_path`].
pub mod movement {
    pub use crate::features::{Movement, MovementError};
    pub use crate::rig::slide_path::SlidePath;
}

/// See [`features`] and [`table`].
pub mod fused {
    pub use crate::features::{
        FEATURE_STEPS, FeatureSet, MAX_FEATURES, Observation, Vector, WHITE_STEPS, fixed,
    };
    pub use crate::table::{Scatter, WhitenError, Whitened, Whitening, white, whiten};
}

/// Adds as many of them as there is room for: `extend` would panic at more.
fn fill<T, const N: usize>(room: &mut heapless::Vec<T, N>, items: impl Iterator<Item = T>) {
    for item in items {
        if room.push(item).is_err() {
            break;
        }
    }
}

/// As many of them as there is room for: `collect` would panic at more.
fn up_to<T, const N: usize>(items: impl Iterator<Item = T>) -> heapless::Vec<T, N> {
    let mut room = heapless::Vec::new();
    fill(&mut room, items);
    room
}
