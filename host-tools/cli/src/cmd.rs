//! The command `tactus`: a file for each of its commands, with the arguments, what is done and what is said.

mod args;
mod completions;
mod convert;
mod device;
mod evaluate;
mod features;
mod help;
mod identify;
mod import;
mod learn;
mod names;
mod output;
mod plot;
mod printed;
mod progress;
mod report;
mod simulate;
mod study;
mod table;
mod table_file;
mod textures;
mod unpack;
mod verify;

use std::io::{self, Write as _};

use clap::{CommandFactory as _, FromArgMatches as _, Parser, Subcommand};
use tactus_lab::data::printable::Printable;

pub(crate) use device::BenchError;
pub(crate) use output::{Done, UsageError};
pub(crate) use printed::{say, say_error};

/// Tactus tells what a surface is by touching it.
#[derive(Parser)]
#[command(
    name = "tactus",
    version,
    about = "Tactus tells what a surface is by touching it",
    long_about = LONG_ABOUT,
    after_help = after_help()
)]
struct Tactus {
    /// Show no progress and no notices on the terminal, only results and errors
    #[arg(long, short, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Option<Command>,
}

// what --help says of each is beside its arguments
#[derive(Subcommand)]
enum Command {
    Features(features::Args),
    Learn(learn::Args),
    Table(table::Args),
    Report(report::Args),
    Identify(identify::Args),
    Evaluate(evaluate::Args),
    Verify(verify::Args),
    Simulate(simulate::Args),
    LearnByHand(learn::ByHand),
    Study(study::Args),
    #[command(subcommand)]
    Device(device::Command),
    Completions(completions::Args),
    Import(import::Args),
    Convert(convert::Args),
    Unpack(unpack::Args),
}

const LONG_ABOUT: &str = "\
Tactus tells what a surface is by touching it: it slides a BioTac fingertip, measures traction, roughness and fineness,
and chooses each next movement so as to tell the remaining candidates apart (Bayesian exploration, Fishel & Loeb 2012).

This command runs the core of the firmware, the same code, on recordings and on a simulated rig.";

/// The first commands to try, and notes for scripts.
fn after_help() -> String {
    format!("{}\n\n{CONVENTIONS}", identify::FIRST_STEPS)
}

const CONVENTIONS: &str = "\
Environment:
  TACTUS_RECORDINGS   the folder, where --recordings is not given
  TACTUS_PORT         the probe's port, where --port is not given

Exit codes:
  0     done; of `identify` a sure name, of `verify` the same
  1     an error
  2     wrong usage
  3     new or changed; of `verify` different
  4     not sure yet
  130   ended by Ctrl-C";

pub(crate) fn run() -> anyhow::Result<Done> {
    // what others wrote, names and words of a probe, goes out as text
    let out = &mut Printable::new(io::BufWriter::new(printed::Printed(io::stdout())));
    let mut done = Done::Fully;
    let matches = help::parse(Tactus::command());
    let Tactus { quiet, command } =
        Tactus::from_arg_matches(&matches).unwrap_or_else(|why| why.exit());
    if quiet {
        progress::be_quiet();
    }
    match command {
        None => identify::demonstrate(out)?,
        Some(Command::Features(args)) => features::run(&args, out)?,
        Some(Command::Learn(args)) => learn::run(&args, out)?,
        Some(Command::Table(args)) => table::run(&args, out)?,
        Some(Command::Report(args)) => report::run(&args, out)?,
        Some(Command::Identify(args)) => done = identify::run(&args, out)?,
        Some(Command::Evaluate(args)) => evaluate::run(&args, out)?,
        Some(Command::Verify(args)) => done = verify::run(&args, out)?,
        Some(Command::Simulate(args)) => simulate::run(&args, out)?,
        Some(Command::LearnByHand(args)) => learn::by_hand(&args, out)?,
        Some(Command::Study(args)) => study::run(&args, out)?,
        Some(Command::Device(command)) => done = device::run(&command, out)?,
        Some(Command::Completions(args)) => completions::run(&args, Tactus::command(), out)?,
        Some(Command::Import(args)) => import::run(&args, out)?,
        Some(Command::Convert(args)) => convert::run(&args, out)?,
        Some(Command::Unpack(args)) => unpack::run(&args, out)?,
    }
    out.flush()?;
    Ok(done)
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    #[test]
    fn the_command_line_is_consistent() {
        super::Tactus::command().debug_assert();
    }

    #[test]
    fn every_command_or_its_group_has_examples() {
        fn check(command: &clap::Command, group: bool) {
            let help = command.get_after_help().map(ToString::to_string);
            let has = help.is_some_and(|help| help.contains("\n  tactus ")) || group;
            let mut commands = command.get_subcommands().peekable();
            assert!(has || commands.peek().is_some(), "{}", command.get_name());
            commands.for_each(|command| check(command, has));
        }
        let command = super::Tactus::command();
        command.get_subcommands().for_each(|c| check(c, false));
    }
}
