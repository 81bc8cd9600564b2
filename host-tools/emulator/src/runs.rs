//! What the program does: a sub-command each.

pub mod bench;
pub mod faults;
mod handheld;
mod identify;
mod printer;
mod serve;
mod stack_depth;

use std::process::ExitCode;

use anyhow::Result;
use clap::Parser;

/// Runs the firmware's ELF, unmodified, on a NUCLEO-F429ZI in software with the simulated rig on its pins.
#[derive(Parser)]
#[command(version)]
enum Cli {
    /// Have the firmware identify a texture
    ///
    /// Learns some textures of a simulated world, gives their table to the firmware, puts one of them under its finger
    /// and has it find out which.
    #[command(after_help = "Examples:
  tactus-emulator identify --elf tactus-rig                       a texture drawn by the seed
  tactus-emulator identify --elf tactus-rig --texture 10 --log    with the firmware's own log
  tactus-emulator identify --elf tactus-rig --recording 3         slides of a real BioTac
`cargo xtask emulate` builds both and does this. With --port N it serves the board's serial port there instead.")]
    Identify(identify::Args),
    /// Have a simulated hand find out with the handheld's firmware what a texture is
    ///
    /// What the display says in the end is the answer.
    #[command(after_help = "Example:
  tactus-emulator handheld --elf tactus-handheld --seed 7         a texture drawn by the seed")]
    Handheld(handheld::Args),
    /// Have the command `tactus device identify` find out what lies under a finger that hangs on a simulated 3D printer
    ///
    /// Board and printer are served at two TCP ports; the command is the one that a person uses.
    #[command(after_help = "Example:
  tactus-emulator printer --elf tactus-arm --tactus target/debug/tactus --finger mems --among 6")]
    Printer(printer::Args),
    /// Serve the board's serial port on a TCP port of this PC
    ///
    /// Virtual time then goes no faster than real time.
    #[command(after_help = "Example:
  tactus-emulator serve --elf tactus-rig --port 7429              talk to it yourself")]
    Serve(serve::Args),
    /// Break the rig in many ways, at any moment of whatever its probe does
    Faults(faults::Args),
    /// Count the instructions of the core's kernels
    Bench(bench::Args),
    /// Measure how deep its stack gets
    Stack(stack_depth::Args),
}

/// Runs it; false if a limit is missed.
fn run(cli: &Cli) -> Result<bool> {
    match cli {
        Cli::Identify(args) => identify::run(args)?,
        Cli::Handheld(args) => handheld::run(args)?,
        Cli::Printer(args) => return printer::run(args),
        Cli::Serve(args) => serve::run(args)?,
        Cli::Faults(args) => return faults::run(args),
        Cli::Bench(args) => return bench::run(args),
        Cli::Stack(args) => stack_depth::run(args)?,
    }
    Ok(true)
}

/// The program, from its arguments to its exit code.
pub fn main() -> ExitCode {
    match run(&Cli::parse()) {
        Ok(true) => return ExitCode::SUCCESS,
        Ok(false) => {}
        Err(why) => eprintln!("error: {why}"),
    }
    ExitCode::FAILURE
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
