//! Why nothing is counted.

use tactus_lab::data::recordings::RecordingError;
use tactus_lab::eval::learn::TableError as LearnError;

use crate::board;
use crate::host::talk::TalkError;

#[derive(Debug, thiserror::Error)]
pub(crate) enum BenchError {
    #[error(transparent)]
    Board(#[from] board::Error),
    #[error("the rig's image: {0}")]
    Talk(#[from] TalkError),
    #[error(transparent)]
    Recordings(#[from] RecordingError),
    #[error("the made-up table: {0}")]
    Learn(#[from] LearnError),
    #[error("{kernel}: {what}")]
    Unsuitable { kernel: String, what: &'static str },
    #[error("not what the plain kernels give: {}", .0.join("; "))]
    Different(Vec<String>),
    #[error("the rig's image: {0}")]
    Rig(&'static str),
}
