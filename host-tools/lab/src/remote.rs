//! A probe at a line that somebody else carries, a page for example: [`Remote`] is asked in JSON, gets the bytes that
//! came and the time, and gives back bytes to be sent and what has happened. What it does and says is what `tactus
//! device` does and says.

mod message;
mod open;
pub mod operations;
mod recorded;
mod replay;
pub mod say;
mod session;
pub mod verifying;
mod work;

pub use message::{File, Folder, Frame, Question, Reply, Request, Streams, Work};
pub use open::OpenError;
pub use session::Remote;
