//! Locks of ports: one command at a time has a port, by a locked file. The system unlocks it when the process ends,
//! however it ends.

use std::fs::{File, OpenOptions, TryLockError};
use std::net::ToSocketAddrs as _;
use std::path::{Path, PathBuf};

/// The port is this process's for as long as this lives.
#[derive(Debug)]
pub struct PortLock(#[expect(dead_code, reason = "its lock ends with it")] Option<File>);

fn folder() -> Option<PathBuf> {
    let given = |variable| std::env::var_os(variable).map(PathBuf::from);
    given("XDG_RUNTIME_DIR")
        .map(|folder| folder.join("tactus"))
        .or_else(|| given("HOME").map(|home| home.join(".cache/tactus")))
        .filter(|folder| std::fs::create_dir_all(folder).is_ok())
}

/// A name for the port, the same however it is written, that a file can have.
fn file_name(port: &str) -> String {
    let same = match port.strip_prefix("tcp:") {
        Some(address) => {
            let first = address
                .to_socket_addrs()
                .ok()
                .and_then(|mut all| all.next());
            first.map_or_else(|| address.to_owned(), |first| first.to_string())
        }
        None => std::fs::canonicalize(port)
            .map_or_else(|_| port.to_owned(), |path| path.display().to_string()),
    };
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
    same.chars().map(plain).collect::<String>() + ".lock"
}

impl PortLock {
    /// Takes the port; `None`: another command of this user has it. Where there is no place for the file, nobody is
    /// kept out.
    pub fn take(port: &str) -> Option<Self> {
        match folder() {
            Some(folder) => Self::take_in(&folder, port),
            None => Some(Self(None)),
        }
    }

    fn take_in(folder: &Path, port: &str) -> Option<Self> {
        let mut options = OpenOptions::new();
        let options = options.write(true).create(true).truncate(false);
        let Ok(file) = options.open(folder.join(file_name(port))) else {
            return Some(Self(None));
        };
        match file.try_lock() {
            Ok(()) => Some(Self(Some(file))),
            Err(TryLockError::WouldBlock) => None,
            // a file system without locks
            Err(TryLockError::Error(_)) => Some(Self(None)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_has_one_owner_and_is_free_when_that_ends() {
        let folder = tempfile::tempdir().unwrap();
        let take = |port| PortLock::take_in(folder.path(), port);
        let first = take("tcp:127.0.0.1:7429");
        assert!(first.is_some() && take("tcp:127.0.0.1:7429").is_none());
        assert!(take("tcp:127.0.0.1:7430").is_some());
        drop(first);
        assert!(take("tcp:127.0.0.1:7429").is_some());
    }
}
