//! Files that commands write, whole or not at all, and table files, checked when read.

use std::io::{self, ErrorKind, Read, Write};
use std::path::Path;

use anyhow::anyhow;
use tactus_core::table::Table;
use tactus_lab::data::printable::Printable;
use tactus_lab::data::recordings::files::open;
use tactus_lab::data::table_file::{self, TableFileError};
use tactus_lab::data::whole::{WholeFile, write_new, write_whole};

use super::printed::{Beside, Printed};
use super::progress::is_quiet;

/// The consent to lose a file.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub(crate) struct Force {
    /// Replace the file that is to be written, if there is one
    #[arg(long)]
    pub(crate) force: bool,
}

/// Writes a file whole or not at all; "-" is standard output. Another file of that name is replaced by force only.
pub(crate) fn write_file(file: &Path, bytes: &[u8], Force { force }: Force) -> anyhow::Result<()> {
    let written = match (is_pipe(file), force) {
        (true, _) => {
            let mut to = Printed(io::stdout());
            to.write_all(bytes).and_then(|()| to.flush())
        }
        (false, true) => write_whole(file, bytes),
        (false, false) => write_new(file, bytes),
    };
    written.map_err(|why| unwritten(file, why))
}

/// Files of recordings, by how their names end.
const OF_RECORDINGS: [&str; 5] = [
    "manifest.csv",
    "manifest.json",
    "import.toml",
    ".npy",
    ".gz",
];

/// Refuses to write over what is read, with force as well: a file itself, or one of a folder of recordings.
pub(crate) fn spare_input(file: &Path, input: &Path) -> anyhow::Result<()> {
    // the file may not be there, or be a pipe
    let (Ok(target), Ok(read)) = (file.canonicalize(), input.canonicalize()) else {
        return Ok(());
    };
    let name = target.to_string_lossy();
    let of_folder = OF_RECORDINGS.iter().any(|end| name.ends_with(end));
    anyhow::ensure!(
        target != read && !(of_folder && target.starts_with(&read)),
        "{}: is read by this command, and not replaced: give another name",
        file.display()
    );
    Ok(())
}

fn unwritten(file: &Path, why: io::Error) -> anyhow::Error {
    let name = file.display();
    match why.kind() {
        ErrorKind::AlreadyExists => {
            anyhow!("{name}: is there already: give another name, or replace it with --force")
        }
        _ => anyhow!("{name}: {why}"),
    }
}

/// A file that is written bit by bit, and gets its name at the end; or standard output.
pub(crate) enum Output {
    File(WholeFile),
    Printed(Printed),
}

impl Output {
    pub(crate) fn create(file: &Path, Force { force }: Force) -> anyhow::Result<Self> {
        if is_pipe(file) {
            return Ok(Self::Printed(Printed(io::stdout())));
        }
        let created = WholeFile::create(file, force).map(Self::File);
        created.map_err(|why| unwritten(file, why))
    }

    pub(crate) fn finish(self) -> io::Result<()> {
        match self {
            Self::File(file) => file.finish(),
            Self::Printed(mut to) => to.flush(),
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(file) => file.write(bytes),
            Self::Printed(to) => to.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(file) => file.flush(),
            Self::Printed(to) => to.flush(),
        }
    }
}

pub(crate) fn is_pipe(file: &Path) -> bool {
    file == Path::new("-")
}

/// Where to say what was written: not into the file, where that is standard output.
pub(crate) fn beside<'o>(file: &Path, out: &'o mut impl Write) -> Box<dyn Write + 'o> {
    match (is_pipe(file), is_quiet()) {
        (false, _) => Box::new(out),
        (true, false) => Box::new(Printable::new(Beside)),
        (true, true) => Box::new(io::sink()),
    }
}

/// A file to read; "-" is standard input.
pub(crate) fn opened(file: &Path) -> io::Result<Box<dyn Read>> {
    Ok(if is_pipe(file) {
        Box::new(io::stdin().lock())
    } else {
        Box::new(open(file)?)
    })
}

pub(crate) fn read_table<'b>(
    file: &Path,
    bytes: &'b mut Vec<u8>,
) -> Result<Table<'b>, TableFileError> {
    table_file::read_table(file, opened(file), bytes)
}
