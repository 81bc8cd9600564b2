//! Commands that write folders are killed at random moments, or run out of space: what they leave never looks whole,
//! and the same command goes on and ends with the bytes of one that nobody disturbed.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_lab::data::recordings::RecordingSet;
use tactus_tests::count;

use crate::SIMULATED;

/// All files below a folder, by their paths in it.
pub(crate) fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.insert(path.clone(), fs::read(path).unwrap());
        }
    }
    let below = |(path, bytes): (PathBuf, _)| match path.strip_prefix(folder) {
        Ok(below) => (below.to_owned(), bytes),
        Err(_) => (path, bytes),
    };
    found.into_iter().map(below).collect()
}

/// A command that writes the folder `out`, its last argument, where it stands: a report names it.
struct Writes<'a> {
    arguments: &'a [&'a str],
    /// whether a folder looks whole
    is_whole: fn(&Path) -> bool,
}

impl Writes<'_> {
    fn command(&self, place: &Path) -> Command {
        fs::create_dir_all(place).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
        command.current_dir(place).args(self.arguments).arg("out");
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        command
    }

    /// Runs it to its end: what it wrote, and how long that took.
    fn run(&self, place: &Path) -> (BTreeMap<PathBuf, Vec<u8>>, Duration) {
        let begun = Instant::now();
        let out = self.command(place).output().unwrap();
        let said = String::from_utf8_lossy(&out.stderr);
        assert!(out.status.success(), "{:?}: {said}", self.arguments);
        (files(&place.join("out")), begun.elapsed())
    }

    /// Runs it and kills it after a while, again and again, until it comes to its end or so many were killed; then the
    /// next folder. How many left something to go on with.
    fn kill(&self, kills: u32, share: f64) -> u32 {
        let home = tempfile::tempdir().unwrap();
        let (whole, took) = self.run(&home.path().join("undisturbed"));
        let random = &mut ChaCha8Rng::seed_from_u64(u64::from(kills));
        let (mut killed, mut gone_on, mut folders) = (0, 0, 0);
        while killed < kills {
            folders += 1;
            let place = home.path().join(format!("{folders}"));
            let folder = place.join("out");
            loop {
                let mut child = self.command(&place).spawn().unwrap();
                thread::sleep(took.mul_f64(random.random::<f64>() * share));
                let ended = child.try_wait().unwrap();
                child.kill().unwrap();
                let out = child.wait_with_output().unwrap();
                let said = String::from_utf8_lossy(&out.stderr);
                if let Some(status) = ended {
                    // or the last one was killed when all was done
                    let is_there =
                        said.contains("already holds recordings") || said.contains("is not empty");
                    assert!(status.success() || is_there, "{said}");
                    break;
                }
                killed += 1;
                if (self.is_whole)(&folder) {
                    break;
                }
                gone_on += u32::from(place.read_dir().unwrap().next().is_some());
                if killed == kills {
                    break;
                }
            }
            // what it says when all is there does not count, what is there does
            let _ = self.command(&place).output().unwrap();
            assert!((self.is_whole)(&folder), "{folders}");
            assert!(files(&folder) == whole, "{folders}: other bytes");
            let beside = folder.with_extension("part");
            assert!(!beside.exists(), "{} is left", beside.display());
        }
        println!("{:?}: {killed} kills, {folders} folders", self.arguments);
        gone_on
    }
}

fn holds_recordings(folder: &Path) -> bool {
    RecordingSet::open(folder).is_ok()
}

const SIMULATE: Writes<'_> = Writes {
    arguments: &["simulate", "--textures", "1,9,21", "--trials", "1", "--out"],
    is_whole: holds_recordings,
};

#[test]
fn a_simulation_that_is_killed_goes_on() {
    let kills = count(30, 6) as u32;
    assert!(SIMULATE.kill(kills, 0.7) > kills / 3);
}

#[test]
fn an_import_that_is_killed_goes_on() {
    let import = Writes {
        arguments: &["import", SIMULATED],
        is_whole: holds_recordings,
    };
    let kills = count(30, 10) as u32;
    assert!(import.kill(kills, 0.9) > kills / 6);
}

/// A shell's limit of a file's size stands for a full disk: writing fails in the middle of a file.
#[cfg(unix)]
#[test]
fn a_full_disk_is_an_error_that_leaves_nothing() {
    let home = tempfile::tempdir().unwrap();
    let import = ["import", SIMULATED];
    let unpack = ["unpack"];
    for arguments in [SIMULATE.arguments, &import, &unpack] {
        let writes = Writes {
            arguments,
            is_whole: holds_recordings,
        };
        let (whole, _) = writes.run(&home.path().join(format!("{}-undisturbed", arguments[0])));
        let largest = whole.values().map(Vec::len).max().unwrap();
        // blocks of 512 bytes: the first file of samples, some of them, the rows
        for blocks in [0, 1, 8, 20, 22, 24, 26, 48]
            .iter()
            .filter(|blocks| *blocks * 512 < largest)
        {
            let place = home.path().join(format!("{}-{blocks}", arguments[0]));
            fs::create_dir(&place).unwrap();
            let mut shell = Command::new("sh");
            shell.args(["-c", "ulimit -f $1; trap '' XFSZ; shift; exec \"$@\"", "sh"]);
            shell.args([&blocks.to_string(), env!("CARGO_BIN_EXE_tactus")]);
            let out = shell
                .args(arguments)
                .arg("new/out")
                .current_dir(&place)
                .output()
                .unwrap();
            let said = String::from_utf8_lossy(&out.stderr);
            assert_eq!(
                out.status.code(),
                Some(1),
                "{arguments:?}, {blocks}: {said}"
            );
            assert!(said.contains("arge"), "{blocks}: {said}");
            assert!(!place.join("new").exists(), "{arguments:?}, {blocks}");
            assert!(writes.run(&place).0 == whole, "{blocks}: other bytes");
        }
    }
}
