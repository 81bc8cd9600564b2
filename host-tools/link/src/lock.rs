//! Locks of ports: one command at a time has a port, by a locked file. The system unlocks it when the process ends,
//! however it ends.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{Read as _, Seek as _, Write as _};
use std::net::ToSocketAddrs as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// The port is this process's for as long as this lives.
#[derive(Debug)]
pub struct PortLock(#[expect(dead_code, reason = "its lock ends with it")] Option<File>);

/// Another command has the port.
#[derive(PartialEq, Debug, thiserror::Error)]
#[error(
    "{port} is used by `{command}` (process {process}) since {}: wait for it or end it, it cannot be watched from a \
         second \
     command",
    ago(*.for_)
)]
pub struct PortInUse {
    port: String,
    command: String,
    process: u32,
    for_: Duration,
}

fn ago(time: Duration) -> String {
    match time.as_secs() {
        s @ 0..60 => format!("{s} s"),
        s @ 60..3600 => format!("{} min", s / 60),
        s => format!("{} h {} min", s / 3600, s / 60 % 60),
    }
}

/// The folder of the locks: only this user can write there.
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
    /// Takes the port. Where there is no place for the file, nobody is told, and nobody is kept out.
    ///
    /// # Errors
    /// Another command of this user has it.
    pub fn take(port: &str) -> Result<Self, PortInUse> {
        match folder() {
            Some(folder) => Self::take_in(&folder, port),
            None => Ok(Self(None)),
        }
    }

    fn take_in(folder: &Path, port: &str) -> Result<Self, PortInUse> {
        let path = folder.join(file_name(port));
        let mut options = OpenOptions::new();
        // what another one wrote stays until the lock is ours
        let opened = options
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path);
        let Ok(mut file) = opened else {
            return Ok(Self(None));
        };
        let now = || {
            SystemTime::now()
                .duration_since(SystemTime::UNIX_EPOCH)
                .unwrap_or_default()
        };
        match file.try_lock() {
            Ok(()) => {
                let arguments: Vec<String> = std::env::args().skip(1).collect();
                let text = format!(
                    "{}\n{}\ntactus {}\n",
                    std::process::id(),
                    now().as_secs(),
                    arguments.join(" ")
                );
                // the lock counts; without the text, nobody is named
                let _ = file
                    .set_len(0)
                    .and_then(|()| file.rewind())
                    .and_then(|()| file.write_all(text.as_bytes()));
                Ok(Self(Some(file)))
            }
            Err(TryLockError::WouldBlock) => {
                let mut text = String::new();
                let _ = file.read_to_string(&mut text);
                let mut lines = text.lines();
                let mut number = || lines.next().and_then(|line| line.parse::<u64>().ok());
                let (process, since) = (number().unwrap_or(0), number());
                Err(PortInUse {
                    port: port.to_owned(),
                    command: lines.next().unwrap_or("another tactus").to_owned(),
                    process: process as u32,
                    for_: since.map_or(Duration::ZERO, |since| {
                        now().saturating_sub(Duration::from_secs(since))
                    }),
                })
            }
            // a file system without locks
            Err(TryLockError::Error(_)) => Ok(Self(None)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_port_has_one_owner_who_is_named_and_is_free_when_that_ends() {
        let folder = tempfile::tempdir().unwrap();
        let first = PortLock::take_in(folder.path(), "tcp:127.0.0.1:7429").unwrap();
        let owned = PortLock::take_in(folder.path(), "tcp:localhost:7429").map(|_| ());
        // localhost may be ::1 here first: then it is another port
        if let Err(owned) = owned {
            assert_eq!(owned.process, std::process::id());
        }
        let said = PortLock::take_in(folder.path(), "tcp:127.0.0.1:7429")
            .unwrap_err()
            .to_string();
        assert!(
            said.contains("used by `tactus") && said.contains("since 0 s"),
            "{said}"
        );
        assert!(PortLock::take_in(folder.path(), "tcp:127.0.0.1:7430").is_ok());
        drop(first);
        assert!(PortLock::take_in(folder.path(), "tcp:127.0.0.1:7429").is_ok());
    }

    #[test]
    fn times_are_said_for_people() {
        let said = [5, 65, 7300].map(|s| ago(Duration::from_secs(s)));
        assert_eq!(said, ["5 s", "1 min", "2 h 1 min"]);
    }
}
