//! Why a run did not come to its end.

use tactus_lab::sim::rig::SimError;

use crate::board;
use crate::host::exploration::ExploreError;
use crate::host::talk::TalkError;
use crate::host::under_finger::UnderFingerError;

use super::bench::error::BenchError;

#[derive(Debug, thiserror::Error)]
pub(crate) enum RunError {
    #[error(transparent)]
    Board(#[from] board::Error),
    #[error(transparent)]
    Learn(#[from] UnderFingerError),
    #[error(transparent)]
    Talk(#[from] TalkError),
    #[error(transparent)]
    Explore(#[from] ExploreError),
    #[error("not as it must be: {}", .0.join("; "))]
    Missed(Vec<String>),
    #[error("cannot print the result: {0}")]
    Print(#[from] std::io::Error),
    #[error("cannot listen on port {port}: {source}. Is it in use? 0 takes any free one")]
    Listen { port: u16, source: std::io::Error },
    #[error("the simulated rig of the PC: {0}")]
    Rig(#[from] SimError),
    #[error(transparent)]
    Bench(#[from] BenchError),
    #[error("the exploration had no slide: the stack that was measured says nothing")]
    NoSlide,
    #[error("the display shows no verdict")]
    NoVerdict,
}
