//! Why nothing is counted.

use tactus::data::recordings::RecordingError;
use tactus::eval::learn::TableError as LearnError;

use crate::board;
use crate::host::talk::TalkError;

/// Why nothing is counted.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// The board.
    #[error(transparent)]
    Board(#[from] board::Error),
    /// The rig's firmware.
    #[error("the rig's image: {0}")]
    Talk(#[from] TalkError),
    /// The slide of a real finger.
    #[error(transparent)]
    Recordings(#[from] RecordingError),
    /// The table of made-up textures.
    #[error("the made-up table: {0}")]
    Learn(#[from] LearnError),
    /// The table that comes with the firmware.
    #[error("cannot read {}: {source}", path.display())]
    Factory {
        /// Its path.
        path: std::path::PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Bench image and workload do not fit together.
    #[error("{kernel}: {what}")]
    Unsuitable {
        /// What was to be counted.
        kernel: String,
        /// What is wrong.
        what: &'static str,
    },
    /// The chip's result is another one.
    #[error("not what the plain kernels give: {}", .0.join("; "))]
    Different(Vec<String>),
    /// The rig's image did not do what is measured.
    #[error("the rig's image: {0}")]
    Rig(&'static str),
    /// The curves.
    #[cfg(feature = "plot")]
    #[error(transparent)]
    Draw(#[from] tactus::eval::chart::DrawError),
    /// Their file.
    #[error(transparent)]
    Write(#[from] crate::host::args::WriteError),
    /// What draws is not in this program.
    #[error(
        "built without the feature `plot`: `cargo xtask bench --growth --plot FILE` builds with it"
    )]
    NoPlot,
}
