//! The pictures that commands draw with `--plot`: their contents, and their counting.

pub mod control;
pub mod evaluation;
pub mod exploration;
pub mod map;
pub mod trade_off;
