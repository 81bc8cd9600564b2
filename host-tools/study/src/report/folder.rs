//! The folder of a study: under another name until it is whole, with the finished stages, so that an interrupted study
//! can continue.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;

use super::error::ReportError;
use tactus_lab::data::program::program;
use tactus_lab::data::whole::write_whole;

/// Name of the mark in a folder that is not whole: it names the study.
const INCOMPLETE: &str = "INCOMPLETE";
/// The stages that are done.
const STAGES: &str = "stages";
/// Name of the part that gets the folder's name.
const WHOLE: &str = "whole";

/// A folder that a report is written into: below `DIR.part`, until it is whole. The stages of a study that was
/// interrupted are kept there for the next one, if that is the same; any other study replaces them.
#[derive(Debug)]
pub struct Folder {
    whole: PathBuf,
    part: PathBuf,
    /// its lock ends with it, however the process ends
    _note: File,
}

impl Folder {
    /// Makes the folder of the report of a study, which is to be `whole`; that must be empty or new. `study`
    /// distinguishes it from every other study of this program. Called before the work, not after it: a study takes
    /// minutes.
    ///
    /// # Errors
    /// See [`ReportError`].
    pub fn prepare(whole: &Path, study: &str) -> Result<Self, ReportError> {
        let taken = match fs::read_dir(whole).map(|mut there| there.next().is_some()) {
            Err(why) if why.kind() != io::ErrorKind::NotFound => return Err(error(whole, why)),
            there => there.unwrap_or(false),
        };
        // `.` and the like have a name, too
        let whole = fs::canonicalize(whole).unwrap_or_else(|_| whole.components().collect());
        let mut part = whole.clone().into_os_string();
        part.push(".part");
        let part = PathBuf::from(part);
        let note = part.join(INCOMPLETE);
        if part.exists() && !note.is_file() {
            return Err(ReportError::Taken(part));
        }
        if taken && !note.is_file() {
            return Err(ReportError::Taken(whole));
        }
        // whether it can be written shows only when it is
        fs::create_dir_all(&part).map_err(|source| error(&part, source))?;
        let open = File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&note);
        let file = open.map_err(|source| error(&note, source))?;
        if matches!(file.try_lock(), Err(fs::TryLockError::WouldBlock)) {
            return Err(ReportError::Busy(whole));
        }
        let folder = Self {
            whole,
            part,
            _note: file,
        };
        if taken {
            // the last moment of a study that was whole
            folder.remove(&folder.part)?;
            return Err(ReportError::Taken(folder.whole.clone()));
        }
        let says = format!(
            "{study}\nThe same command continues this study; another one with this --out replaces it.\n({})\n",
            program()
        );
        if fs::read_to_string(&note).is_ok_and(|there| there != says) {
            folder.remove(&folder.part.join(STAGES))?;
            fs::write(&note, says).map_err(|source| error(&note, source))?;
        }
        Ok(folder)
    }

    /// Path of a stage's file.
    fn stage(&self, name: &str) -> PathBuf {
        self.part.join(STAGES).join(name).with_extension("json")
    }

    /// The result of a stage of an interrupted study.
    pub fn kept<T: DeserializeOwned>(&self, stage: &str) -> Option<T> {
        // an unreadable stage is made again
        serde_json::from_slice(&fs::read(self.stage(stage)).ok()?).ok()
    }

    /// Keeps the result of a stage, whole or not at all.
    ///
    /// # Errors
    /// See [`ReportError`].
    pub fn keep(&self, stage: &str, result: &impl Serialize) -> Result<(), ReportError> {
        let path = self.stage(stage);
        let json = serde_json::to_vec(result).map_err(ReportError::Json)?;
        fs::create_dir_all(self.part.join(STAGES))
            .and_then(|()| write_whole(&path, json))
            .map_err(|source| error(&path, source))
    }

    /// Removes the output of a study that was interrupted while writing.
    pub(super) fn clear(&self) -> Result<(), ReportError> {
        self.remove(&self.part.join(WHOLE))
    }

    pub(super) fn put(&self, name: &str, bytes: &[u8]) -> Result<(), ReportError> {
        let path = self.part.join(WHOLE).join(name);
        path.parent()
            .map_or(Ok(()), fs::create_dir_all)
            .and_then(|()| fs::write(&path, bytes))
            .map_err(|source| error(&path, source))
    }

    /// Gives the folder its name. An empty folder of that name may be there.
    pub(super) fn finish(self) -> Result<(), ReportError> {
        match fs::remove_dir(&self.whole) {
            Err(why) if why.kind() != io::ErrorKind::NotFound => Err(why),
            _ => fs::rename(self.part.join(WHOLE), &self.whole),
        }
        .map_err(|source| error(&self.whole, source))?;
        self.remove(&self.part)
    }

    fn remove(&self, folder: &Path) -> Result<(), ReportError> {
        match fs::remove_dir_all(folder) {
            Err(why) if why.kind() != io::ErrorKind::NotFound => Err(error(folder, why)),
            _ => Ok(()),
        }
    }
}

impl Drop for Folder {
    /// A study that failed before its first stage was done leaves no files; those of another one stay.
    fn drop(&mut self) {
        if !self.part.join(STAGES).exists() {
            // one that is whole has its name
            let _ = fs::remove_dir_all(&self.part);
        }
    }
}

fn error(path: &Path, source: io::Error) -> ReportError {
    ReportError::Io {
        path: path.to_owned(),
        source,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_its_name_only_when_it_is_whole() {
        let here = tempfile::tempdir().unwrap();
        let (whole, part) = (here.path().join("study"), here.path().join("study.part"));
        let prepare = |study: &str| Folder::prepare(&whole, study);
        let folder = prepare("one").unwrap();
        folder.put("tables/a.csv", b"a").unwrap();
        assert!(matches!(prepare("one"), Err(ReportError::Busy(_))));
        // one that fails before its first stage leaves no files
        drop(folder);
        assert!(!whole.exists() && !part.exists());
        // the same study continues
        let third = 1.0 / 3.0;
        let folder = prepare("one").unwrap();
        folder.put("tables/a.csv", b"a").unwrap();
        folder.keep("pilot", &vec![third, 1e300 * third]).unwrap();
        drop(folder);
        let folder = prepare("one").unwrap();
        assert!(!whole.exists());
        assert_eq!(folder.kept("pilot"), Some(vec![third, 1e300 * third]));
        assert_eq!(folder.kept::<f64>("training"), None);
        // a damaged stage is not used
        fs::write(folder.stage("pilot"), b"[0.33").unwrap();
        assert_eq!(folder.kept::<Vec<f64>>("pilot"), None);
        folder.keep("pilot", &third).unwrap();
        drop(folder);
        // another study does not, and an empty folder of its name may be there
        fs::create_dir(&whole).unwrap();
        let folder = prepare("two").unwrap();
        assert_eq!(folder.kept::<f64>("pilot"), None);
        folder.clear().unwrap();
        folder.put("tables/b.csv", b"b").unwrap();
        folder.finish().unwrap();
        assert_eq!(fs::read(whole.join("tables/b.csv")).unwrap(), b"b");
        assert!(!whole.join("tables/a.csv").exists() && !part.exists());
        // existing files are never touched
        assert!(matches!(prepare("two"), Err(ReportError::Taken(path)) if path == whole));
        // it was killed when it was whole: the rest goes
        fs::create_dir(&part).unwrap();
        fs::write(part.join(INCOMPLETE), b"two").unwrap();
        assert!(matches!(prepare("two"), Err(ReportError::Taken(path)) if path == whole));
        assert!(whole.join("tables/b.csv").exists() && !part.exists());
        let other = here.path().join("other");
        fs::create_dir_all(here.path().join("other.part/mine")).unwrap();
        assert!(matches!(
            Folder::prepare(&other, "one"),
            Err(ReportError::Taken(_))
        ));
    }
}
