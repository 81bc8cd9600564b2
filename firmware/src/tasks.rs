//! What runs on the board, one file a task, and what they hand each other.
use embassy_executor::{SpawnError, SpawnToken};

use crate::chip::rescue;

pub(crate) mod acquire;
pub(crate) mod arm;
pub(crate) mod display;
pub(crate) mod drive;
pub(crate) mod hand;
mod level;
pub(crate) mod link;
pub(crate) mod outbox;
pub(crate) mod probe;
pub(crate) mod servo;
pub(crate) mod watch;

/// A task of which there is only one; without it the image does not start.
pub(crate) fn only<S>(task: Result<SpawnToken<S>, SpawnError>) -> SpawnToken<S> {
    match task {
        Ok(task) => task,
        Err(_) => rescue::refuse("a task runs already"),
    }
}
