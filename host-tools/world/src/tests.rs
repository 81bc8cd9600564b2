//! The simulated world against what the paper and the makers observed.

pub(crate) mod bench;
mod finger;
mod fingers;
mod paper;
mod protocol;
mod surface;

use std::fs;
use std::path::{Path, PathBuf};

fn sources() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let (mut files, mut folders) = (Vec::new(), vec![root]);
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                files.push(path);
            }
        }
    }
    files
}

/// Neither features nor tables nor decisions of the core are named anywhere.
#[test]
fn the_world_knows_nothing_of_features_tables_and_decisions() {
    // not written out, or this file would name it
    let core = concat!("tactus", "_core");
    let sources = sources();
    assert!(sources.len() > 20, "{}", sources.len());
    for path in sources {
        let source = fs::read_to_string(&path).unwrap();
        for use_of in source.split(core).skip(1) {
            let named = use_of.split(';').next().unwrap_or_default();
            let mut words = named.split(|c: char| !c.is_alphanumeric() && c != '_');
            let decides = words.any(|word| ["features", "table", "explorer"].contains(&word));
            assert!(
                !decides && !named.contains("::*") && !named.starts_with(" as"),
                "{}: {named}",
                path.display()
            );
        }
    }
}
