//! What the program does: a sub-command each.

pub mod bench;
pub mod campaign;
pub mod cuts;
pub mod error;
pub mod identify;
pub mod serve;
pub mod soak;
pub mod stack_depth;
