//! The core of Tactus: it turns the samples of a slide into properties, keeps what every texture feels like, and
//! chooses each next movement (Bayesian exploration, Fishel & Loeb 2012). Equation and table numbers in these pages are
//! that paper's.
//!
//! The crate has no std, no allocation, no unsafe code, no clock and no statics: the same functions run on the chip and
//! on a PC, and give the same bits.
#![no_std]
#![forbid(unsafe_code)]
// Nothing panics on the chip: what these do not see, `cargo xtask size` finds in the images.
#![cfg_attr(
    not(test),
    deny(
        clippy::expect_used,
        clippy::indexing_slicing,
        clippy::panic,
        clippy::unwrap_used
    )
)]

#[cfg(test)]
extern crate std;

pub mod dsp;
pub mod explorer;
pub mod features;
pub mod handheld;
pub mod probe;
pub mod rig;
pub mod sensor;
pub mod store;
pub mod table;
pub mod wire;

/// CRC-32 without a table: that would take 1 KB of the chip's flash.
const CRC32: crc::Crc<u32, crc::NoTable> =
    crc::Crc::<u32, crc::NoTable>::new(&crc::CRC_32_ISO_HDLC);

/// Adds as many items as the buffer has space for; `extend` would panic at one more.
fn fill<T, const N: usize>(buffer: &mut heapless::Vec<T, N>, items: impl Iterator<Item = T>) {
    for item in items {
        if buffer.push(item).is_err() {
            break;
        }
    }
}

/// Collects as many items as a buffer of `N` has space for; `collect` would panic at one more.
fn up_to<T, const N: usize>(items: impl Iterator<Item = T>) -> heapless::Vec<T, N> {
    let mut buffer = heapless::Vec::new();
    fill(&mut buffer, items);
    buffer
}
