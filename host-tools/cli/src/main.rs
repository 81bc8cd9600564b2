//! The command `tactus`.

// they panic where nobody reads
#![deny(clippy::print_stderr, clippy::print_stdout)]

mod cmd;

use std::process::ExitCode;

fn main() -> ExitCode {
    match cmd::run() {
        Ok(cmd::Done::Fully) => ExitCode::SUCCESS,
        Ok(cmd::Done::Different) => ExitCode::from(3),
        Ok(cmd::Done::Unsure) => ExitCode::from(4),
        Err(why) => {
            cmd::say_error(&format!("error: {why:#}"));
            match why.downcast_ref::<cmd::BenchError>() {
                // as a shell has it: 128 and the number of SIGINT
                Some(why) if why.is_interrupt() => ExitCode::from(130),
                _ if why.is::<cmd::UsageError>() => ExitCode::from(2),
                _ => ExitCode::FAILURE,
            }
        }
    }
}
