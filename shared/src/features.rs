//! From the samples of a slide to what it says about a texture.

mod block;
mod movement;
mod observation;
mod property;
mod signal;
mod slide;

pub use crate::dsp::{FUSED_BANDS, FUSED_EDGES};
pub use block::{BLOCK, Block, Blocks, SamplePhase};
pub use movement::{Movement, MovementError};
pub(crate) use observation::LOW_BANDS;
pub use observation::{
    COARSE_BANDS, FEATURE_STEPS, FeatureSet, MAX_FEATURES, Observation, PDC_UNIT, Vector,
    WHITE_STEPS, fixed,
};
pub use property::{Properties, Property, PropertySet};
pub(crate) use signal::FROZEN;
pub use signal::Signal;
pub use slide::{BAND_EDGES, Measurement, Slide, SlideError, roughness};
