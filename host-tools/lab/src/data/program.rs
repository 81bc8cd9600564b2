//! The program that makes something that takes long: only the same program continues an unfinished one.

use std::time::UNIX_EPOCH;

/// Version of this program, and its build time.
pub fn program() -> String {
    let modified = || {
        std::env::current_exe()
            .ok()?
            .metadata()
            .ok()?
            .modified()
            .ok()
    };
    let built = modified().and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    let version = env!("CARGO_PKG_VERSION");
    format!(
        "tactus {version}, built {}",
        built.map_or(0, |built| built.as_secs())
    )
}
