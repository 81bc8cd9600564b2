//! `--plot`: pictures as SVG, all in one file or one by one in a folder.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tactus_lab::data::whole::write_whole;
use tactus_study::chart::Figure;

use super::progress::notice;

/// Where pictures go.
#[derive(clap::Args, Clone)]
pub(crate) struct Plot {
    /// Draw pictures too: FILE.svg has all of them, a folder one file each; what is there of these names is replaced
    #[arg(long, value_name = "FILE.svg|DIR", value_parser = target)]
    plot: Option<PathBuf>,
}

#[derive(Debug, thiserror::Error)]
pub(crate) enum PlotError {
    /// A folder has the name of the file.
    #[error(
        "--plot {0}: is a folder; give it another name, or one without .svg for a folder of pictures"
    )]
    IsFolder(String),
    /// A file has the name of the folder.
    #[error("--plot {0}: is a file and no folder; give the name of a file that ends with .svg")]
    IsFile(String),
    /// The system could not write.
    #[error("--plot {path}: cannot be written")]
    Write { path: String, source: io::Error },
}

fn target(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension() {
        _ if text.is_empty() => Err("a file FILE.svg, or a folder".to_owned()),
        Some(ending) if !is_svg(&path) && !path.is_dir() => Err(format!(
            "pictures are SVG, and this ends with .{}: give FILE.svg, or a folder",
            ending.display()
        )),
        _ => Ok(path),
    }
}

fn is_svg(path: &Path) -> bool {
    path.extension()
        .is_some_and(|ending| ending.eq_ignore_ascii_case("svg"))
}

impl Plot {
    pub(crate) fn is_asked(&self) -> bool {
        self.plot.is_some()
    }

    /// Where pictures are to go, if any are wanted: found out before the work, not after it.
    pub(crate) fn open(&self) -> Result<Option<Canvas>, PlotError> {
        let Some(path) = self.plot.clone() else {
            return Ok(None);
        };
        let name = path.display().to_string();
        let is_file = is_svg(&path);
        if is_file && path.is_dir() {
            return Err(PlotError::IsFolder(name));
        }
        if !is_file && path.is_file() {
            return Err(PlotError::IsFile(name));
        }
        let canvas = Canvas { path, is_file };
        // whether it can be written shows only when it is
        let try_it = || {
            let folder = match is_file {
                true => canvas.path.parent(),
                false => canvas.path.ancestors().find(|folder| folder.exists()),
            };
            // the folder of a bare name has no name
            let folder = folder.filter(|folder| !folder.as_os_str().is_empty());
            let part = folder.unwrap_or(Path::new(".")).join(".tactus-plot.part");
            fs::write(&part, b"").and_then(|()| fs::remove_file(&part))
        };
        match try_it() {
            Ok(()) => Ok(Some(canvas)),
            Err(source) => Err(PlotError::Write { path: name, source }),
        }
    }
}

pub(crate) struct Canvas {
    path: PathBuf,
    is_file: bool,
}

impl Canvas {
    /// Writes them, whole or not at all, and says so on stderr after what was printed.
    pub(crate) fn write(
        self,
        title: &str,
        figures: &[Figure],
        out: &mut impl Write,
    ) -> anyhow::Result<()> {
        out.flush()?;
        let name = self.path.display();
        if figures.is_empty() {
            notice(&format!("{name}: not written, there is nothing to draw"));
            return Ok(());
        }
        if self.is_file {
            draw(&self.path, &Figure::stacked("", title, figures).svg)?;
        } else {
            fs::create_dir_all(&self.path).map_err(|source| failed(&self.path, source))?;
            for figure in figures {
                draw(&self.path.join(format!("{}.svg", figure.id)), &figure.svg)?;
            }
        }
        let ids: Vec<&str> = figures.iter().map(|figure| figure.id.as_str()).collect();
        notice(&format!("wrote {name}: {}", ids.join(", ")));
        Ok(())
    }
}

fn failed(path: &Path, source: io::Error) -> PlotError {
    let path = path.display().to_string();
    PlotError::Write { path, source }
}

fn draw(path: &Path, svg: &str) -> Result<(), PlotError> {
    write_whole(path, svg).map_err(|source| failed(path, source))
}
