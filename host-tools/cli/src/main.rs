//! The command `tactus`.

mod cmd;

use std::process::ExitCode;

/// What the command came to, for scripts; `tactus --help` lists them.
mod code {
    /// Arguments that make no sense, as clap has it.
    pub(super) const USAGE: u8 = 2;
    /// An exploration ended without a name that is sure.
    pub(super) const NOT_IDENTIFIED: u8 = 3;
    /// As a shell has it for Ctrl-C: 128 and the number of SIGINT.
    pub(super) const INTERRUPTED: u8 = 130;
}

fn main() -> ExitCode {
    match cmd::run() {
        Ok(cmd::Done::Fully) => ExitCode::SUCCESS,
        Ok(cmd::Done::NotIdentified) => ExitCode::from(code::NOT_IDENTIFIED),
        // `tactus features | head` is no failure
        Err(why) if is_broken_pipe(&why) => ExitCode::SUCCESS,
        Err(why) => {
            eprintln!("error: {why:#}");
            match why.downcast_ref::<cmd::BenchError>() {
                Some(why) if why.is_interrupt() => ExitCode::from(code::INTERRUPTED),
                _ if why.is::<cmd::UsageError>() => ExitCode::from(code::USAGE),
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
