//! The command `tactus`.

mod cmd;

use std::process::ExitCode;

fn main() -> ExitCode {
    match cmd::run() {
        Ok(cmd::Done::Fully) => ExitCode::SUCCESS,
        Ok(cmd::Done::NotIdentified) => ExitCode::from(3),
        // `tactus features | head` is no failure
        Err(why) if is_broken_pipe(&why) => ExitCode::SUCCESS,
        Err(why) => {
            cmd::tell(&format!("error: {why:#}"));
            match why.downcast_ref::<cmd::BenchError>() {
                // as a shell has it: 128 and the number of SIGINT
                Some(why) if why.is_interrupt() => ExitCode::from(130),
                _ if why.is::<cmd::UsageError>() => ExitCode::from(2),
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
