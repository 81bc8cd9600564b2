//! Fingers of parts, and weights on them, on the simulated rig.

mod fingers;
mod weights;
