//! A probe at a line that somebody else carries, a page for example: [`Remote`] is asked in JSON, gets the bytes that
//! came and the time, and gives back bytes to send and what has happened. It does and says what `tactus device` does
//! and says.

mod heard;
mod message;
pub mod operations;
pub mod say;
mod session;
mod verifying;
mod work;

pub use session::Remote;
