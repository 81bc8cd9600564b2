//! Which program makes something that takes long: what it left unfinished is only gone on with by the same.

use std::time::UNIX_EPOCH;

/// Version of this program, and when it was built.
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
