//! The NUCLEO-F429ZI in software, with the simulated rig on its pins: runs the firmware's ELF, unmodified.
//!
//! Chip and core are rigless' (STM32F427, Cortex-M4F); the rig is [`tactus::sim`]. Everything goes by virtual time and by
//! seeds: the same ELF, [`Setup`] and calls give the same run.
//!
//! What passes here says much for logic and use of the drivers and nothing for silicon: instructions take 1/168 us each,
//! whatever they are, and no wire has a length.

mod board;
pub mod campaign;
pub mod cuts;
pub mod cycles;
mod display;
mod driver;
pub mod exploration;
mod flash;
pub mod lessons;
mod log;
mod part;
pub mod pins;
mod record;
mod rig;
pub mod scenario;
mod serial;
pub mod soak;
mod spent;
mod stack;
pub mod talk;

pub use board::{Emulator, Error, Options};
pub use display::Display;
pub use flash::{FLASH, FlashWrite, STORE};
pub use record::Slide;
pub use rig::{Output, Rig};
pub use rigless::device::ResetCause;
pub use spent::Spent;
pub use stack::{StackLayout, StackLevel, StackUse};
pub use tactus::sim::faults::Fault;
pub use tactus::sim::world::Setup;
