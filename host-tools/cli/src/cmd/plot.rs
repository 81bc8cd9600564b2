//! `--plot`: pictures as SVG in a folder.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use tactus_lab::data::whole::{Lock, NewOutputs, write_whole};
use tactus_study::chart::Figure;

use super::progress::notice;

#[derive(clap::Args, Clone)]
pub(crate) struct Plot {
    /// Draw pictures too, into this folder; what is there of their names is replaced
    #[arg(long, value_name = "DIR")]
    pub(crate) plot: Option<PathBuf>,
}

impl Plot {
    /// The folder, if pictures are wanted; that it can be written shows before the work, not after it.
    pub(crate) fn open(&self) -> anyhow::Result<Option<Canvas>> {
        let Some(path) = self.plot.clone() else {
            return Ok(None);
        };
        let (mut made, part) = (NewOutputs::default(), path.join(".tactus-plot.part"));
        made.folder(&path)
            .and_then(|()| Lock::take(&part).map(drop))
            .with_context(|| cannot(&path))?;
        Ok(Some(Canvas(path, made)))
    }
}

fn cannot(path: &Path) -> String {
    format!("--plot {}: cannot be written", path.display())
}

/// A folder for pictures, which can be written, and what is made in it.
pub(crate) struct Canvas(PathBuf, NewOutputs);

impl Canvas {
    /// Writes them, whole or not at all, and says so on stderr after what was printed.
    pub(crate) fn write(mut self, figures: &[Figure], out: &mut impl Write) -> anyhow::Result<()> {
        out.flush()?;
        for figure in figures {
            let path = self.0.join(format!("{}.svg", figure.id));
            self.1.file(path.clone());
            write_whole(&path, &figure.svg).with_context(|| cannot(&path))?;
        }
        if !figures.is_empty() {
            self.1.keep();
        }
        let ids: Vec<&str> = figures.iter().map(|figure| figure.id.as_str()).collect();
        let name = self.0.display();
        notice(&match ids.as_slice() {
            [] => format!("{name}: not written, there is nothing to draw"),
            ids => format!("wrote {name}: {}", ids.join(", ")),
        });
        Ok(())
    }
}
