//! What explorations and trainings have in common.

pub use crate::explorer::Visited;
pub use crate::features::Blocks;
pub use crate::probe::explore::Random;
pub use crate::probe::{identify, train};

pub use crate::wire::text;
