//! `tactus device`: the probe at the other end of the serial link, and everything that is done with it at the bench.

mod bench;
mod bringup;
mod calibrate;
mod doctor;
mod flash;
mod identify;
mod line;
mod log;
mod monitor;
mod printer;
mod record;
mod rename;
mod status;
mod table;
mod train;
mod verify;

use std::io::Write;

use clap::Subcommand;

use crate::cmd::output::Done;

pub(crate) use bench::BenchError;

/// Work with a probe at its serial port, or with an emulated board at a TCP port
#[derive(Subcommand)]
#[command(after_help = "\
Try first:
  tactus device monitor                        what it measures, live
  tactus device status                         the state of the probe that is plugged in
  tactus device doctor                         whether all is well with it, and what to do if not
  tactus device identify --log session.jsonl   what lies under its finger
  tactus device log session.jsonl              the same decisions, computed again on this PC

Ctrl-C stops the rig and waits until the finger is lifted; the exit code is 130 then.
After `identify` and `verify` it is 3 for new, changed or different, and 4 for not sure.")]
pub(crate) enum Command {
    Status(status::Args),
    Doctor(doctor::Args),
    /// Watch the probe live, and have it identify, home or stop by a key
    #[command(after_help = "\
Examples:
  tactus device monitor
  tactus device monitor --port localhost:7429    the emulated board of `cargo xtask emulate --port 7429`")]
    Monitor(identify::Args),
    Identify(identify::Run),
    Verify(verify::Args),
    Train(train::Train),
    Teach(train::Teach),
    Rename(rename::Rename),
    Forget(rename::Forget),
    Refresh(rename::Refresh),
    Record(record::Args),
    #[command(subcommand)]
    Table(table::Command),
    Calibrate(calibrate::Args),
    Settings(rename::Settings),
    /// End a fault and find the limit switches
    #[command(after_help = "\
Examples:
  tactus device home    once the cause of the fault is removed")]
    Home(line::Where),
    /// Stop the rig and lift the finger
    #[command(after_help = "\
Examples:
  tactus device stop")]
    Stop(line::Where),
    Flash(flash::Args),
    Bringup(bringup::Args),
    #[command(subcommand)]
    Printer(printer::Command),
    Log(log::Args),
}

pub(crate) fn run(command: &Command, out: &mut impl Write) -> anyhow::Result<Done> {
    let done = perform(command, out)?;
    bench::logs_kept()?;
    Ok(done)
}

fn perform(command: &Command, out: &mut impl Write) -> anyhow::Result<Done> {
    let done = match command {
        Command::Status(args) => status::run(args, out),
        Command::Doctor(args) => doctor::run(args, out),
        Command::Monitor(args) => monitor::run(args),
        Command::Identify(args) => return identify::run(args, out),
        Command::Verify(args) => return verify::run(args, out),
        Command::Train(args) => train::train(args, out),
        Command::Teach(args) => train::teach(args, out),
        Command::Rename(args) => rename::rename(args, out),
        Command::Forget(args) => rename::forget(args, out),
        Command::Refresh(args) => rename::refresh(args, out),
        Command::Record(args) => record::run(args, out),
        Command::Table(command) => table::run(command, out),
        Command::Calibrate(args) => calibrate::run(args, out),
        Command::Settings(args) => rename::settings(args, out),
        Command::Home(at) => calibrate::home(at, out),
        Command::Stop(at) => calibrate::stop(at, out),
        Command::Flash(args) => flash::run(args, out),
        Command::Bringup(args) => bringup::run(args, out),
        Command::Printer(command) => printer::run(command, out),
        Command::Log(args) => log::run(args, out),
    };
    done.map(|()| Done::Fully)
}
