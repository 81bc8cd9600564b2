//! Why there is no run, or no more of it.

use std::path::PathBuf;

/// Why there is no run, or no more of it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The ELF cannot be read.
    #[error("cannot read {}: {source}. Build the firmware with `cargo xtask size`", path.display())]
    Read {
        /// Its path.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no ELF.
    #[error("{} is no ELF: {source}", path.display())]
    Elf {
        /// Its path.
        path: PathBuf,
        /// Why.
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
        /// What was looked for.
        name: String,
        /// How many.
        count: usize,
        /// Some of them.
        examples: String,
    },
    /// A function is too short for the code that is to take its place.
    #[error("{name} has {size} bytes, {needed} are needed")]
    NoSpace {
        /// The function.
        name: &'static str,
        /// What it has, bytes.
        size: u64,
        /// What it takes, bytes.
        needed: u64,
    },
    /// No memory there.
    #[error("no memory at {address:#010x}")]
    Memory {
        /// Where.
        address: u64,
    },
}
