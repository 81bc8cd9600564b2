//! What runs on the board, one file a task, and what they hand each other.
pub(crate) mod acquire;
pub(crate) mod display;
pub(crate) mod hand;
mod level;
pub(crate) mod link;
pub(crate) mod outbox;
pub(crate) mod probe;
mod rig_handle;
pub(crate) mod servo;
pub(crate) mod watch;
