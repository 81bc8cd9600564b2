//! Reasons why a folder of fabrics cannot be read.

use std::path::PathBuf;

use tactus_lab::data::recordings::files::RecordingError;

/// Name of the manifest.
pub const MANIFEST: &str = "manifest.json";

/// Reasons why fabrics cannot be read. Every message names the file, the cause and a remedy.
#[derive(thiserror::Error, Debug)]
#[non_exhaustive]
pub enum FabricError {
    /// The folder does not exist.
    #[error("{}: no such folder; give one in the layout of data/fabricslide", .0.display())]
    NoFolder(PathBuf),
    /// The folder has no manifest.
    #[error(
        "{}: no {MANIFEST} in this folder, so it holds no fabrics; give one in the layout of \
         data/fabricslide", .0.display()
    )]
    NoManifest(PathBuf),
    /// The fabrics cannot be compared.
    #[error(
        "{}: no movement that all {fabrics} fabrics have with both repetitions (rep 0 and 1) in one direction; take \
         out the fabric that lacks them or record it again", manifest.display()
    )]
    NothingShared {
        /// The manifest.
        manifest: PathBuf,
        /// Number of fabrics that it lists.
        fabrics: usize,
    },
    /// A slide from which nothing can be measured.
    #[error("{}: {movement}, direction {direction}, rep {repetition}: {cause}", path.display())]
    Slide {
        /// The file of samples.
        path: PathBuf,
        /// Set-point and speed.
        movement: Box<str>,
        /// As in the manifest.
        direction: i8,
        /// As in the manifest.
        repetition: u8,
        /// The fault, and its remedy.
        cause: String,
    },
    /// A file cannot be read or differs from its manifest.
    #[error(transparent)]
    Recording(#[from] RecordingError),
}
