//! Tests of the command `tactus` as a person or a script uses it, and of the examples.

mod by_hand;
mod convert;
mod device;
mod endings;
mod import;
mod kills;
mod offline;
mod outputs;
mod protocols;
mod refusals;
mod schema;
mod strangers;
mod study;
mod verdicts;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// The recordings that come with the command.
const SIMULATED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");

/// A folder of its own in which commands run, a line of words each; some words stand for paths and addresses.
struct Scratch {
    folder: TempDir,
    names: Vec<(&'static str, String)>,
}

/// The end of a command.
struct Ran {
    code: Option<i32>,
    out: String,
    said: String,
}

impl Scratch {
    fn new() -> Self {
        Self {
            folder: TempDir::new().unwrap(),
            names: vec![("SIMULATED", SIMULATED.to_owned())],
        }
    }

    fn with(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.names.push((name, value.into()));
        self
    }

    /// Splits a line at spaces outside of single quotes.
    fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tactus"));
        for (at, part) in line.split('\'').enumerate() {
            let words: Vec<&str> = match at % 2 {
                0 => part.split_whitespace().collect(),
                _ => vec![part],
            };
            for word in words {
                let stands = self.names.iter().find(|(name, _)| *name == word);
                command.arg(stands.map_or(word, |(_, value)| value));
            }
        }
        // its locks, and the tables that it keeps
        for folder in ["XDG_RUNTIME_DIR", "XDG_DATA_HOME"] {
            command.env(folder, env!("CARGO_TARGET_TMPDIR"));
        }
        for variable in ["TACTUS_RECORDINGS", "TACTUS_PORT"] {
            command.env_remove(variable);
        }
        command.current_dir(self.folder.path()).stdin(Stdio::null());
        command
    }

    fn run(&self, line: &str) -> Ran {
        ran(&mut self.command(line))
    }

    /// Prints of a command that succeeds, or explores and ends without a sure name (3, 4).
    fn printed(&self, line: &str) -> String {
        let Ran { code, out, said } = self.run(line);
        assert!(matches!(code, Some(0 | 3 | 4)), "{line}: {said}");
        out
    }

    /// The object that a command prints which ends with this code.
    fn json(&self, line: &str, wanted: i32) -> Value {
        let Ran { code, out, said } = self.run(&format!("{line} --format json"));
        assert_eq!(code, Some(wanted), "{line}: {said}");
        serde_json::from_str(&out).unwrap()
    }

    /// The error of a command that ends with this code.
    fn error(&self, line: &str, wanted: i32) -> String {
        let Ran { code, said, .. } = self.run(line);
        assert_eq!(code, Some(wanted), "{line}: {said}");
        assert!(!said.contains("panicked"), "{line}: {said}");
        said
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn read(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap_or_else(|why| panic!("{name}: {why}"))
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) {
        let path = self.path(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }

    /// Copies the recordings that come with the command to a folder, with other lines of the manifest.
    fn recordings(&self, to: &str, line: impl Fn(&str) -> Option<String>) {
        fs::create_dir_all(self.path(to)).unwrap();
        for entry in fs::read_dir(SIMULATED).unwrap() {
            let entry = entry.unwrap();
            fs::copy(entry.path(), self.path(to).join(entry.file_name())).unwrap();
        }
        let manifest = fs::read_to_string(Path::new(SIMULATED).join("manifest.csv")).unwrap();
        let lines: Vec<String> = manifest.lines().filter_map(line).collect();
        self.write(&format!("{to}/manifest.csv"), lines.join("\n") + "\n");
    }

    /// Unpacks the golden log of a session.
    fn log(&self, name: &str) -> String {
        let packed = format!(
            "{}/../../tests/golden/{name}.jsonl.gz",
            env!("CARGO_MANIFEST_DIR")
        );
        let mut packed = flate2::read::GzDecoder::new(fs::File::open(packed).unwrap());
        let log = std::io::read_to_string(&mut packed).unwrap();
        self.write(&format!("{name}.jsonl"), &log);
        log
    }
}

fn ran(command: &mut Command) -> Ran {
    let out = command.output().unwrap();
    Ran {
        code: out.status.code(),
        out: String::from_utf8(out.stdout).unwrap(),
        said: String::from_utf8(out.stderr).unwrap(),
    }
}

fn assert_says(said: &str, parts: &[&str]) {
    for part in parts {
        assert!(said.contains(part), "{part}: {said}");
    }
}

fn array(of: &Value) -> &Vec<Value> {
    of.as_array().unwrap_or_else(|| panic!("{of}"))
}
