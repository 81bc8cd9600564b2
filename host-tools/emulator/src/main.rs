//! `tactus-emulator`: the firmware's ELF on the emulated board, identifying a texture of the simulated rig.

mod explore;
mod learned;
mod serve;

use std::path::PathBuf;
use std::process::ExitCode;

use anyhow::Context as _;
use clap::{Parser, ValueEnum};
use tactus::evaluate::Method;

/// Runs the firmware's ELF, unmodified, on a NUCLEO-F429ZI in software with the simulated rig on its pins.
///
/// Learns some textures of a simulated world, gives their table to the firmware, puts one of them under its finger and has
/// it find out which.
#[derive(Parser)]
#[command(
    version,
    after_help = "Examples:
  tactus-emulator --elf tactus-rig                       a texture drawn by the seed
  tactus-emulator --elf tactus-rig --texture 10 --log    with the firmware's own log
  tactus-emulator --elf tactus-rig --recording 3         slides of a real BioTac
  tactus-emulator --elf tactus-rig --port 7429           talk to it yourself"
)]
struct Cli {
    /// The firmware: what `cargo xtask build` names
    #[arg(long, value_name = "PATH")]
    elf: PathBuf,
    /// The texture under the finger: its name in Table 1 or its number; drawn by the seed unless given
    #[arg(long, value_name = "NAME")]
    texture: Option<String>,
    /// Let the finger feel recordings of this material of data/biotac instead: its name or its number. The firmware knows
    /// all 20, from other slides
    #[arg(long, value_name = "MATERIAL", conflicts_with_all = ["texture", "among"])]
    recording: Option<String>,
    /// How many textures the firmware is to know; the unknown one is among them
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u8).range(2..=117))]
    among: u8,
    /// Another seed is another world, another trial, and another texture unless one is given
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// How the firmware decides, and what its table is learned for
    #[arg(long, value_enum, default_value_t = Method::Fused)]
    method: Method,
    /// Table to give to the firmware instead of one learned for this world
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
    /// Stop when a texture is more probable than this
    #[arg(long, value_name = "P", default_value_t = 0.99)]
    threshold: f32,
    /// Stop after so many slides
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u8).range(1..))]
    max_slides: u8,
    /// For people, or a line of JSON at the end for programs
    #[arg(long, value_enum, default_value_t = Format::Text)]
    format: Format,
    /// Serve the board's serial port on this TCP port of this PC (0 is any free one) instead of exploring; virtual time
    /// then goes no faster than real time
    #[arg(long, value_name = "N")]
    port: Option<u16>,
    /// Print the firmware's log to stderr
    #[arg(long)]
    log: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    Text,
    Json,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("error: {why:#}");
            ExitCode::FAILURE
        }
    }
}

fn run(cli: &Cli) -> anyhow::Result<()> {
    // first of all, so that nobody can say the firmware was made for the texture
    let elf = std::fs::read(&cli.elf).with_context(|| {
        format!(
            "cannot read {}: build the firmware with `cargo xtask build`",
            cli.elf.display()
        )
    })?;
    let sha256 = learned::hex_sha256(&elf);
    let named = format!("ELF {}\nSHA-256 {sha256}", cli.elf.display());
    match cli.format {
        Format::Text => println!("{named}"),
        Format::Json => eprintln!("{named}"),
    }
    let chosen = learned::Chosen::new(cli)?;
    match cli.port {
        Some(port) => serve::serve(cli, &chosen, port),
        None => explore::explore(cli, &chosen, &sha256),
    }
}
