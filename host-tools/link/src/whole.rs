//! Files that are there whole or not at all: written beside their place, kept by the disk, then renamed. Each has one
//! writer at a time.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

/// Replaces the file of a path by these bytes, or leaves it as it is.
pub fn write_whole(path: &Path, bytes: impl AsRef<[u8]>) -> io::Result<()> {
    let mut file = WholeFile::create(path, true)?;
    file.write_all(bytes.as_ref())?;
    file.finish()
}

/// Writes these bytes into a new file. One that holds them already is left as it is.
/// Errors: [`ErrorKind::AlreadyExists`] if it holds others.
pub fn write_new(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let is_file = fs::metadata(path).is_ok_and(|there| there.is_file());
    if is_file && fs::read(path)? == bytes {
        return Ok(());
    }
    let mut file = WholeFile::create(path, false)?;
    file.write_all(bytes)?;
    file.finish()
}

/// A file that gets its name when it is [finished](Self::finish), and else leaves nothing behind. A pipe or a device is
/// written as it is.
#[derive(Debug)]
pub struct WholeFile {
    path: PathBuf,
    replaces: bool,
    file: BufWriter<File>,
    part: Option<Lock>,
}

impl WholeFile {
    /// Begins the file of this path, in the place of one that is there only if it `replaces` that.
    pub fn create(path: &Path, replaces: bool) -> io::Result<Self> {
        let there = fs::metadata(path);
        if there.as_ref().is_ok_and(fs::Metadata::is_dir) {
            let why = "is a folder: name a file";
            return Err(io::Error::new(ErrorKind::IsADirectory, why));
        }
        let (file, part) = if there.as_ref().is_ok_and(|there| !there.is_file()) {
            if is_named_pipe(path) {
                let why =
                    "is a pipe that perhaps nobody reads: name a file, or - for standard output";
                return Err(io::Error::new(ErrorKind::InvalidInput, why));
            }
            (OpenOptions::new().write(true).open(path)?, None)
        } else {
            is_free(path, replaces)?;
            let part = Lock::take(&beside(path)?).map_err(explained)?;
            part.file.set_len(0)?;
            if let Ok(there) = there {
                part.file.set_permissions(there.permissions())?;
            }
            (part.file.try_clone()?, Some(part))
        };
        Ok(Self {
            // where a link leads to
            path: fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()),
            replaces,
            file: BufWriter::new(file),
            part,
        })
    }

    /// Has the disk keep it, and gives it its name.
    pub fn finish(mut self) -> io::Result<()> {
        self.file.flush()?;
        let Some(part) = &mut self.part else {
            return Ok(());
        };
        part.file.sync_all()?;
        is_free(&self.path, self.replaces)?;
        fs::rename(&part.path, &self.path)?;
        part.is_renamed = true;
        sync_folder(&self.path);
        Ok(())
    }
}

impl Write for WholeFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// True of a pipe with a place of its own in a folder: to open it would wait for a reader. That of a shell's `>(...)`
/// has one.
fn is_named_pipe(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt as _;
        let there = fs::canonicalize(path).and_then(fs::symlink_metadata);
        there.is_ok_and(|there| there.file_type().is_fifo())
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        false
    }
}

/// What to do where a file cannot be made.
fn explained(why: io::Error) -> io::Error {
    let kind = why.kind();
    match kind {
        ErrorKind::NotFound | ErrorKind::NotADirectory => io::Error::new(
            kind,
            "there is no such folder: make it first, or give another name",
        ),
        ErrorKind::InvalidFilename => io::Error::new(kind, "the name is too long: give another"),
        ErrorKind::PermissionDenied => {
            io::Error::new(kind, "nothing may be written there: give another folder")
        }
        _ => why,
    }
}

fn is_free(path: &Path, replaces: bool) -> io::Result<()> {
    match fs::symlink_metadata(path) {
        Ok(_) if !replaces => {
            let why = "is there already: give another name";
            Err(io::Error::new(ErrorKind::AlreadyExists, why))
        }
        _ => Ok(()),
    }
}

/// The place of a file that is not whole: in the same folder, with a name that no user gives.
fn beside(path: &Path) -> io::Result<PathBuf> {
    let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let mut name = std::ffi::OsString::from(".");
    name.push(path.file_name().ok_or(ErrorKind::InvalidFilename)?);
    name.push(".tactus-part");
    Ok(path.with_file_name(name))
}

/// Has the disk keep a name. A system that cannot do so does it by itself.
pub fn sync_folder(path: &Path) {
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    let _ = File::open(folder.unwrap_or(Path::new("."))).and_then(|folder| folder.sync_all());
}

/// Files and folders that a command has made, removed in the end unless it [keeps](Self::keep) them: an output of many
/// files is whole or absent, too.
#[derive(Debug, Default)]
pub struct NewOutputs {
    files: Vec<PathBuf>,
    folders: Vec<PathBuf>,
}

impl NewOutputs {
    /// Makes a folder, and those above it that are missing.
    pub fn folder(&mut self, path: &Path) -> io::Result<()> {
        if !path.is_dir() && fs::symlink_metadata(path).is_ok() {
            let why = "is no folder: give another name, or move it away";
            return Err(io::Error::new(ErrorKind::NotADirectory, why));
        }
        let missing = path.ancestors().filter(|path| *path != Path::new(""));
        let missing = missing.take_while(|path| fs::symlink_metadata(path).is_err());
        self.folders.extend(missing.map(Path::to_owned));
        fs::create_dir_all(path).map_err(explained)
    }

    /// Notes a file that is made next, unless it is there already: that one is somebody's.
    pub fn file(&mut self, path: PathBuf) {
        if fs::symlink_metadata(&path).is_err() {
            self.files.push(path);
        }
    }

    /// Leaves everything where it is.
    pub fn keep(&mut self) {
        self.files.clear();
        self.folders.clear();
    }
}

impl Drop for NewOutputs {
    fn drop(&mut self) {
        // what was not made after all, or has something of others in it, stays as it is
        for file in &self.files {
            let _ = fs::remove_file(file);
        }
        for folder in &self.folders {
            let _ = fs::remove_dir(folder);
        }
    }
}

/// A file that has one owner at a time, and is removed with it.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    file: File,
    is_renamed: bool,
}

impl Lock {
    /// Takes the file of this path, which a command that was killed may have left.
    /// Errors: [`ErrorKind::ResourceBusy`] while another command has it.
    pub fn take(path: &Path) -> io::Result<Self> {
        let mut options = OpenOptions::new();
        let options = options.write(true).create(true).truncate(false);
        for _ in 0..10 {
            let file = options.open(path)?;
            if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
                break;
            }
            // its last owner may have ended in between
            if is_at(&file, path) {
                let (path, is_renamed) = (path.to_owned(), false);
                return Ok(Self {
                    path,
                    file,
                    is_renamed,
                });
            }
        }
        let why = "another command writes it now: wait for that one, or give another name";
        Err(io::Error::new(ErrorKind::ResourceBusy, why))
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        if !self.is_renamed {
            // it may be gone already
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Returns true while the path still names this file.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt as _;
    let of = |found: io::Result<fs::Metadata>| found.map(|found| (found.dev(), found.ino())).ok();
    let there = of(fs::symlink_metadata(path));
    there.is_some() && there == of(file.metadata())
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let name = |entry: io::Result<fs::DirEntry>| entry.unwrap().file_name().into_string();
        let mut names: Vec<String> = entries.map(|entry| name(entry).unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_whole_or_absent_and_replaced_only_where_that_is_wanted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        let mut unfinished = WholeFile::create(&path, false).unwrap();
        unfinished.write_all(b"half").unwrap();
        unfinished.flush().unwrap();
        let why = WholeFile::create(&path, true).unwrap_err();
        assert_eq!(why.kind(), ErrorKind::ResourceBusy);
        assert!(!path.exists());
        drop(unfinished);
        assert!(names(folder.path()).is_empty());
        write_new(&path, b"one").unwrap();
        write_new(&path, b"one").unwrap();
        let why = write_new(&path, b"other").unwrap_err();
        assert_eq!(why.kind(), ErrorKind::AlreadyExists);
        write_whole(&path, "another").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"another");
        // one that came while it was written
        let later = folder.path().join("later");
        let file = WholeFile::create(&later, false).unwrap();
        fs::write(&later, "mine").unwrap();
        assert!(file.finish().is_err());
        assert_eq!(fs::read(&later).unwrap(), b"mine");
        assert_eq!(names(folder.path()), ["later", "table"]);
        assert!(write_whole(folder.path(), "x").is_err());
    }

    #[test]
    fn what_a_failing_command_made_goes_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        for keeps in [false, true] {
            let mut made = NewOutputs::default();
            made.folder(&path("a/b/c")).unwrap();
            fs::write(path("mine"), "mine").unwrap();
            for name in ["mine", "a/b/c/one", "never"] {
                made.file(path(name));
            }
            fs::write(path("a/b/c/one"), "one").unwrap();
            fs::write(path("a/two"), "of another").unwrap();
            if keeps {
                made.keep();
            }
            drop(made);
            assert_eq!(
                [path("a/b"), path("a/b/c/one")].map(|path| path.exists()),
                [keeps; 2]
            );
            assert_eq!(names(folder.path()), ["a", "mine"]);
        }
    }

    /// A command that was killed leaves a part, which the next one takes, however long it is.
    #[test]
    fn a_part_that_was_left_is_taken_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table");
        fs::write(folder.path().join(".table.tactus-part"), [7; 900]).unwrap();
        write_new(&path, b"whole").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"whole");
        assert_eq!(names(folder.path()), ["table"]);
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_links_and_devices_are_written_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let [link, to] = ["link", "to"].map(|name| folder.path().join(name));
        std::os::unix::fs::symlink(&to, &link).unwrap();
        // it leads nowhere, and is somebody's
        assert!(write_new(&link, b"x").is_err());
        fs::write(&to, "old").unwrap();
        write_whole(&link, "new").unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&to).unwrap(), b"new");
        write_whole(Path::new("/dev/null"), "gone").unwrap();
        assert!(write_whole(Path::new("/dev/full"), [0; 9000]).is_err());
        assert_eq!(names(folder.path()), ["link", "to"]);
    }
}
