//! Arguments that several runs take, and their values.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use sha2::{Digest as _, Sha256};
use tactus_core::sensor::FingerName;
use tactus_lab::eval::evaluate::Method;

use crate::board::Error;

/// The firmware that runs.
#[derive(Args)]
pub struct Firmware {
    /// The firmware: what `cargo xtask size` names
    #[arg(long, value_name = "PATH")]
    pub elf: PathBuf,
}

impl Firmware {
    /// Shows its SHA-256 before anything is drawn or learned: this proves that the firmware was not made for the
    /// texture. On stdout it is for people; programs want nothing there but the result.
    pub fn show(&self, on_stdout: bool) -> Result<String, Error> {
        let elf = std::fs::read(&self.elf).map_err(|source| Error::Read {
            path: self.elf.clone(),
            source,
        })?;
        let digest = Sha256::digest(elf);
        let sha256: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        let named = format!("ELF {}\nSHA-256 {sha256}", self.elf.display());
        if on_stdout {
            println!("{named}");
        } else {
            eprintln!("{named}");
        }
        Ok(sha256)
    }
}

/// The reader of a result.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// For people.
    Text,
    /// For programs.
    Json,
}

/// The board, and the texture under its finger.
#[derive(Args)]
pub struct World {
    /// The firmware.
    #[command(flatten)]
    pub firmware: Firmware,
    /// The texture under the finger: its name in Table 1 or its number; drawn by the seed unless given
    #[arg(long, value_name = "NAME")]
    pub texture: Option<String>,
    /// Let the finger feel recordings of this material of data/biotac instead: its name or its number. The firmware
    /// knows all 20, from other slides
    #[arg(long, value_name = "MATERIAL", conflicts_with_all = ["texture", "among", "finger"])]
    pub recording: Option<String>,
    /// The finger that the firmware is for: biotac, analog (piezo disc and load cell) or mems (accelerometer and load
    /// cell)
    #[arg(long, value_name = "NAME", default_value_t = FingerName::Biotac)]
    pub finger: FingerName,
    /// Number of textures that the firmware is to know; the unknown one is among them
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u8).range(2..=117))]
    pub among: u8,
    /// Another seed is another world, another trial, and another texture unless one is given
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Method by which the firmware decides and its table is learned
    #[arg(long, value_enum, default_value_t = Method::Fused)]
    pub method: Method,
    /// Print the firmware's log to stderr
    #[arg(long)]
    pub log: bool,
}
