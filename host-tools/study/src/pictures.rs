//! The pictures that commands draw with `--plot`: what each shows, and how it is counted.

pub mod control;
pub mod evaluation;
pub mod exploration;
pub mod map;
mod spectrum;
pub mod trade_off;
