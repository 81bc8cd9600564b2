//! Recordings of slides, tables of properties, and what is read from other formats.

pub mod content;
pub mod import;
pub mod program;
pub mod properties;
pub mod recorder;
pub mod recording;
pub mod recordings;
pub mod replay;
pub mod rows;
pub mod table_file;
pub mod whole;
