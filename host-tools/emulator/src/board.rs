//! The board: chip, flash, pins, display and the rig on its pins.

mod chip;
mod display;
mod driver;
mod emulator;
mod error;
mod exti;
mod flash;
mod halt;
mod handler_profile;
mod log;
mod motion;
mod options;
mod peers;
pub mod pins;
mod record;
pub mod referee;
mod registers;
mod rig;
mod symbols;
mod taps;
mod upset;
mod wave;

pub use display::Display;
pub use emulator::{Emulator, Reset};
pub use error::Error;
pub use flash::{FLASH, FlashWrite, STORE, places};
pub use motion::MotionPeer;
pub use options::Options;
pub use record::{Slide, Touch};
pub use rig::{Output, Rig};
pub use rigless::device::ResetCause;
pub use upset::Switch;
