//! What explorations and trainings have in common.

use heapless::Vec;

use crate::fused::Vector;
use crate::table::MAX_MOVEMENTS;

pub use crate::features::Blocks;
pub use crate::probe::explore::Random;
pub use crate::probe::{identify, train};

pub use crate::wire::text;

/// What an exploration can teach, until the next one begins.
#[derive(Clone, Debug)]
pub struct Visited {
    /// Checksum of the table that was explored with.
    pub table: u32,
    /// The most probable texture.
    pub texture: u16,
    /// Whether the probe may learn from it by itself.
    pub certain: bool,
    /// The movements made, with the number of slides and their whitened mean; none with a table of Gaussians.
    pub felt: Vec<(u8, u8, Vector), MAX_MOVEMENTS>,
}
