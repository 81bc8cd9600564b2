//! The host's end of the link to the probe; without the feature `serial` without IO of its own: bytes come in, bytes go
//! out.
//!
//! [`Session`] makes requests and understands reports. A [`Transaction`] is one request ([`Request`]) or a sequence of
//! them ([`PushTable`], [`ReadTable`]); [`Job`] runs it to its end, whatever is damaged or lost on the way. [`Probe`]
//! runs jobs over bytes that somebody else carries, for [`operations`] that follow each other; [`Port`] carries its
//! bytes over anything that reads and writes: a serial line, a TCP connection.

pub mod bringup;
mod clock;
mod error;
pub mod follow;
pub mod lifting;
mod limits;
#[cfg(feature = "serial")]
pub mod line;
#[cfg(feature = "serial")]
pub mod lock;
pub mod log;
pub mod operations;
pub mod person;
mod port;
pub mod printer;
pub mod probe;
mod request;
pub mod samples;
pub mod say;
mod session;
mod sound;
mod table;
mod transaction;
pub mod whole;

pub use error::{OperationError, PortError};
pub use port::Port;
pub use probe::Probe;
pub use request::{Identified, Request};
pub use session::{LinkError, MAX_TRIES, Session};
pub use sound::foreign;
pub use table::{PushTable, ReadTable, checksum, for_probe};
pub use transaction::{Job, Transaction};

#[cfg(test)]
mod tests;
