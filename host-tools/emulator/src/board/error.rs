//! Reasons why there is no run, or why it is over.

use std::path::PathBuf;

/// Reasons why there is no run, or why it is over.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The ELF cannot be read.
    #[error("cannot read {}: {source}. Build the firmware with `cargo xtask size`", path.display())]
    Read {
        /// Its path.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// It is no ELF.
    #[error("{} is no ELF: {source}", path.display())]
    Elf {
        /// Its path.
        path: PathBuf,
        /// The reason.
        source: object::Error,
    },
    /// It does not fit into the chip, or is not for it.
    #[error(transparent)]
    Image(#[from] rigless::image::Error),
    /// The emulator has failed.
    #[error(transparent)]
    Emulator(#[from] rigless::emulator::Error),
    /// rigless' description of the chip is wrong.
    #[error(transparent)]
    Chip(#[from] rigless::soc::Error),
    /// The run is over.
    #[error("the run has ended")]
    Ended,
    /// No symbol, or several, of that name.
    #[error(
        "{name}: {count} symbols of the ELF have that in their name, it takes exactly one: {examples}"
    )]
    Symbol {
        /// The name that was looked for.
        name: String,
        /// Number of matches.
        count: usize,
        /// Some of them.
        examples: String,
    },
    /// A function is too short for the code that is to take its place.
    #[error("{name} has {size} bytes, {needed} are needed")]
    NoSpace {
        /// The function.
        name: &'static str,
        /// Its size, bytes.
        size: u64,
        /// The size of the new code, bytes.
        needed: u64,
    },
    /// No memory there.
    #[error("no memory at {address:#010x}")]
    Memory {
        /// The address.
        address: u64,
    },
}
