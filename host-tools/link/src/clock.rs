//! Time of this PC, or that of the emulated board.

use std::path::PathBuf;
use std::time::{Duration, Instant};

/// A clock that began with a line. Where `TACTUS_CLOCK` names a file, its eight bytes are the ns of an emulated board:
/// a PC that is too slow for the board shall not see it late.
#[derive(Debug)]
pub(crate) struct Clock {
    began: Instant,
    board: Option<PathBuf>,
}

impl Clock {
    pub(crate) fn start() -> Self {
        Self {
            began: Instant::now(),
            board: std::env::var_os("TACTUS_CLOCK").map(PathBuf::from),
        }
    }

    /// Time since its begin, or since that of the board.
    pub(crate) fn elapsed(&self) -> Duration {
        let Some(file) = &self.board else {
            return self.began.elapsed();
        };
        let bytes = std::fs::read(file).unwrap_or_default();
        Duration::from_nanos(u64::from_le_bytes(bytes.try_into().unwrap_or_default()))
    }
}
