//! The port and the recordings that the environment names, where no option does.

use std::env;
use std::ffi::OsString;
use std::path::PathBuf;

fn named(variable: &str) -> Option<OsString> {
    env::var_os(variable).filter(|value| !value.is_empty())
}

/// Returns the port that `TACTUS_PORT` names.
pub(crate) fn port() -> Option<String> {
    named("TACTUS_PORT").and_then(|port| port.into_string().ok())
}

/// Returns the folder of recordings that `TACTUS_RECORDINGS` names.
pub(crate) fn recordings() -> Option<PathBuf> {
    named("TACTUS_RECORDINGS").map(PathBuf::from)
}
