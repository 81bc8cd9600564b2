//! Reasons why a report cannot be written.

use std::io;
use std::path::PathBuf;

use crate::chart::DrawError;

/// Reasons why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder has something in it.
    #[error("{}: is not empty; give --out a new folder, so that no study is mixed with another", .0.display())]
    Taken(PathBuf),
    /// Another study is being written there.
    #[error("{}: another study is being made for this folder; wait for it, or give --out another one", .0.display())]
    Busy(PathBuf),
    /// The system could not write.
    #[error("{} cannot be written; give --out a folder that can be written", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A figure failed.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// The study does not become JSON.
    #[error("the study cannot be written as JSON; please report this")]
    Json(#[source] serde_json::Error),
    /// The page's template fails.
    #[error("the template of the report's page fails; please report this")]
    Page(#[source] minijinja::Error),
}
