//! Where what is converted goes.
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use anyhow::Context as _;

use crate::cmd::table_file::is_pipe;

/// Where a file goes.
pub(super) type To = BufWriter<Box<dyn Write + Send>>;

/// A new file, or standard output.
pub(super) fn create(path: &Path) -> anyhow::Result<To> {
    tracing::info!(file = %path.display(), "writes");
    // whoever has it locked is this thread
    Ok(BufWriter::new(if is_pipe(path) {
        Box::new(io::stdout())
    } else {
        let file = File::create_new(path);
        Box::new(file.with_context(|| path.display().to_string())?)
    }))
}
