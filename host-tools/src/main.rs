//! The command `tactus`.

mod cli;
mod commands;
mod device;
mod identify;
mod manual;
mod study_command;

use std::process::ExitCode;

/// As a shell has it for Ctrl-C: 128 and the number of SIGINT.
const INTERRUPTED: u8 = 130;

fn main() -> ExitCode {
    match commands::run() {
        Ok(()) => ExitCode::SUCCESS,
        // `tactus features | head` is no failure
        Err(why) if is_broken_pipe(&why) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("error: {why:#}");
            match why.downcast_ref::<device::BenchError>() {
                Some(why) if why.is_interrupt() => ExitCode::from(INTERRUPTED),
                _ => ExitCode::FAILURE,
            }
        }
    }
}

fn is_broken_pipe(why: &anyhow::Error) -> bool {
    why.chain()
        .filter_map(|cause| cause.downcast_ref::<std::io::Error>())
        .any(|io| io.kind() == std::io::ErrorKind::BrokenPipe)
}
