//! The board: chip, flash, pins, display and the rig on its pins, and what is measured of the code that runs on it.

mod chip;
pub mod cycles;
mod display;
mod driver;
mod emulator;
mod error;
mod exti;
mod flash;
mod halt;
mod handler_profile;
mod handlers;
mod log;
mod options;
mod peers;
pub mod pins;
mod record;
pub mod referee;
mod registers;
mod rig;
mod stack;
mod symbols;
mod taps;
mod upset;
mod wave;

pub use display::Display;
pub use emulator::{Emulator, Reset};
pub use error::Error;
pub use flash::{FLASH, FlashWrite, STORE, places};
pub use handler_profile::HandlerProfile;
pub use options::Options;
pub use record::Slide;
pub use rig::{Output, Rig};
pub use rigless::device::ResetCause;
pub use stack::{StackLayout, StackLevel, StackUse};
pub use upset::Switch;
