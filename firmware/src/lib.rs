//! Tactus on a NUCLEO-F429ZI: pins, timing and messages round the core. Everything that decides is in `tactus-core`.
//!
//! On a PC this crate is empty: there is nothing to drive.
#![cfg_attr(target_os = "none", no_std)]
#![cfg(target_os = "none")]

mod arm;
mod bench;
mod board;
mod boot;
mod checks;
mod chip;
mod handheld;
mod rig;
mod selftest;
mod tasks;
pub mod workload;

pub use arm::arm;
pub use bench::silicon;
pub use handheld::handheld;
pub use rig::rig;
pub use selftest::selftest;

use defmt_rtt as _;

defmt::timestamp!("{=u64:us}", embassy_time::Instant::now().as_micros());
