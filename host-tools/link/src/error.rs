//! Errors of lines and operations.

use std::io;
use std::time::Duration;

use tactus_core::table::TableError;

use super::lifting::Stopped;
use super::session::LinkError;

/// An error of a line.
#[derive(Debug, thiserror::Error)]
pub enum PortError {
    /// The port cannot be read or written.
    #[error("the port failed; check the cable, then open it again")]
    Io(#[from] io::Error),
    /// The other end has closed the port.
    #[error("the other end closed the port; open it again")]
    Closed,
    /// The probe says nothing.
    #[error("the probe said nothing for {0:?}: check that it has power and that this is its port")]
    Silent(Duration),
    /// Bytes come, and none of them is a report.
    #[error(
        "{0} bytes came and not one report: this is not the probe's port, or not its baud rate, or another firmware \
             runs there"
    )]
    Garbage(u64),
    /// Reports come, and the request does not end.
    #[error(
        "the probe has not ended the request {request} within {longest:?} or the bytes of that time, the most that it \
         can take: switch it off and on, then ask again"
    )]
    Endless {
        /// The request.
        request: String,
        /// Longest time that it takes.
        longest: Duration,
    },
    /// See [`LinkError`].
    #[error(transparent)]
    Link(#[from] LinkError),
}

impl PortError {
    pub(crate) fn is_restart(&self) -> bool {
        matches!(self, Self::Link(LinkError::Rebooted { .. }))
    }
}

/// The cause of a failed operation, and what to do.
#[derive(Debug, thiserror::Error)]
pub enum OperationError {
    /// The line failed, or the probe refused.
    #[error("{name}: {why}{}", after(.why, *.moving))]
    Port {
        /// Name of the line.
        name: String,
        /// The cause.
        why: PortError,
        /// Something that moves was asked for and not over.
        moving: bool,
    },
    /// The user stopped it.
    #[error(transparent)]
    Stopped(#[from] Stopped),
    /// The probe's table is damaged.
    #[error("the probe's table cannot be read: {0}")]
    Table(#[from] TableError),
    /// A file does not hold a table for the probe.
    #[error("{file}")]
    File {
        /// Name of the file.
        file: String,
        /// The cause.
        source: LinkError,
    },
    /// The host has nothing that the probe could take.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Something cannot be written.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// A sentence.
    #[error("{0}")]
    Said(String),
}

impl OperationError {
    /// An error with the sentence of another one.
    pub fn said(why: impl ToString) -> Self {
        Self::Said(why.to_string())
    }

    /// The probe's reason, where it refused.
    pub fn refusal(&self) -> Option<String> {
        match self {
            Self::Port {
                why: PortError::Link(LinkError::Refused(why)),
                ..
            } => Some(why.to_string()),
            _ => None,
        }
    }
}

/// The sentence after a failure of the line while something moved.
fn after(why: &PortError, moving: bool) -> &'static str {
    if moving && !matches!(why, PortError::Link(_)) {
        ".\nThe rig was moving: the probe goes on and lifts the finger at the end. To stop it now, press its \
             emergency stop"
    } else {
        ""
    }
}
