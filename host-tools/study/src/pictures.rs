//! The pictures that commands draw with `--plot`: their contents, and their counting.

pub mod control;
pub mod evaluation;
pub mod exploration;
pub mod map;
pub mod novelty;
pub mod session;
mod spectrum;
pub mod timeline;
pub mod trade_off;
