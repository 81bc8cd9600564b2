//! Why a run did not come to its end.

use crate::board;
use crate::host::args::WriteError;
use crate::host::exploration::ExploreError;
use crate::host::talk::TalkError;
use crate::host::under_finger::KnownError;

use super::bench::error::BenchError;
use super::cuts::tear::CutError;
use super::soak::day::DayError;
use super::soak::hour_report::HourError;

/// Why a run did not come to its end.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The board.
    #[error(transparent)]
    Board(#[from] board::Error),
    /// What lies under the finger.
    #[error(transparent)]
    Known(#[from] KnownError),
    /// The firmware.
    #[error(transparent)]
    Talk(#[from] TalkError),
    /// The exploration.
    #[error(transparent)]
    Explore(#[from] ExploreError),
    /// Bars that an exploration misses.
    #[error("not as it must be: {}", .0.join("; "))]
    Missed(Vec<String>),
    /// The terminal, or whoever reads what is printed.
    #[error("cannot print the result: {0}")]
    Print(#[from] std::io::Error),
    /// The file for the result.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The TCP port.
    #[error("cannot listen on port {port}: {source}. Is it in use? 0 takes any free one")]
    Listen {
        /// Which.
        port: u16,
        /// Why.
        source: std::io::Error,
    },
    /// The power cuts.
    #[error("power cuts: {0}")]
    Cut(#[from] CutError),
    /// The day of the soak.
    #[error("the simulated rig of the PC: {0}")]
    Day(#[from] DayError),
    /// The hour of the soak.
    #[error("the emulated board: {0}")]
    Hour(#[from] HourError),
    /// The bench.
    #[error(transparent)]
    Bench(#[from] BenchError),
    /// The stack was not measured while the firmware slid.
    #[error("the exploration had no slide: the stack that was measured says nothing")]
    NoSlide,
}
