//! Why there is no picture.

use crate::board::Error;
use crate::host::talk::TalkError;

/// The picture cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum ScopeError {
    /// The emulator's.
    #[error(transparent)]
    Emulator(#[from] Error),
    /// The link's.
    #[error(transparent)]
    Talk(#[from] TalkError),
    /// The firmware does not do what is to be seen.
    #[error("the pins do not show {0}")]
    NotSeen(&'static str),
}
