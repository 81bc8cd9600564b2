//! The pictures that commands draw with `--plot`: their contents, and their counting.

pub mod control;
pub mod evaluation;
pub mod exploration;
