//! The pictures that commands draw with `--plot`: what each shows, and how it is counted.

pub mod channels;
pub mod control;
pub mod evaluation;
pub mod exploration;
pub mod map;
pub mod novelty;
pub mod session;
mod spectrum;
pub mod timeline;
pub mod trade_off;
