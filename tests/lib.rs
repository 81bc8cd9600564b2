//! Parts that the tests share: recordings, skipped tests, seeds, a table of properties.
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The folder of test data `name` ("biotac", "worlds"): below `TACTUS_DATA`, else below `../shared/data`.
///
/// Where it is missing the test is to return: the skip is written to the file that `TACTUS_SKIP_LOG` names (xtask lists
/// it), and under `TACTUS_REQUIRE_DATA=1` this panics instead.
pub fn data(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("TACTUS_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data"),
        PathBuf::from,
    );
    let folder = root.join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(
        std::env::var("TACTUS_REQUIRE_DATA").as_deref() != Ok("1"),
        "TACTUS_REQUIRE_DATA=1, but there is no folder {}",
        folder.display()
    );
    skipped(&format!("no folder {}", folder.display()));
    None
}

/// Says that this test is skipped, and why: where it is run, and in the file that `TACTUS_SKIP_LOG` names.
pub fn skipped(why: &str) {
    let test = std::thread::current()
        .name()
        .unwrap_or("unnamed test")
        .to_owned();
    eprintln!("SKIPPED {test}: {why}");
    if let Some(log) = std::env::var_os("TACTUS_SKIP_LOG") {
        let line = format!("{test}: {why}\n");
        // one write per line, so that parallel tests do not mix
        std::fs::OpenOptions::new()
            .create(true)
            .append(true)
            .open(log)
            .and_then(|mut f| f.write_all(line.as_bytes()))
            .expect("the file named by TACTUS_SKIP_LOG can be written");
    }
}

/// All of a test's draws in the campaign (`TACTUS_ALL_SEEDS=1`, as `cargo xtask campaign tests` sets it), a few in the
/// test command.
pub fn count(all: u64, few: u64) -> u64 {
    match std::env::var("TACTUS_ALL_SEEDS").as_deref() {
        Ok("1") => all,
        _ => few.min(all),
    }
}

/// The seeds of a test that draws from so many: five of them in the test command.
pub fn seeds(all: u64) -> std::ops::RangeInclusive<u64> {
    1..=count(all, 5)
}

/// A table of properties for `tactus evaluate --properties`. Each set, "train" and "validate", has `trials` of a
/// texture, a movement and a set. Textures lie 1 apart in each property, their trials up to a hundredth of their
/// squares.
pub fn properties_csv(
    textures: i32,
    movements: i32,
    trials: impl Fn(i32, i32, &str) -> i32,
) -> String {
    let mut csv = "texture,movement,trial,set,traction,roughness,fineness\n".to_owned();
    for texture in 1..=textures {
        for movement in 1..=movements {
            for set in ["train", "validate"] {
                for trial in 1..=trials(texture, movement, set) {
                    let x = f64::from(texture) + 0.01 * f64::from(trial * trial);
                    csv += &format!("{texture},{movement},{trial},{set},{x},{x},{x}\n");
                }
            }
        }
    }
    csv
}
