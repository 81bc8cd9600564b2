//! The tables that come with the firmware, made anew from the simulated world.
use std::path::Path;

use anyhow::{Context as _, Result, ensure};

use crate::firmware::hash;
use crate::shell::{root, run, tactus, target};

/// The world, and the trials of each texture and movement, that the firmware's table is learned from.
const SEED: &str = "1";
const TRIALS: &str = "5";
/// The lengths at which the rig's slides may end, s at constant speed: of the image that ends slides early.
const LENGTHS: &str = "0.5,1,2";
/// Slides of each texture that the handheld's table is learned from: a hand scatters more than a rig.
const SLIDES_BY_HAND: &str = "15";

/// Where they are kept: in the core, which has them as constants.
pub(crate) const FOLDER: &str = "shared/tables";
/// The rig's table and the handheld's of each finger, with the finger's name; then that of a probe on an arm, for the
/// only finger that has an image for it.
pub(crate) const TABLES: [(&str, &[&str]); 3] = [
    ("biotac", &["factory.tact", "handheld.tact", "arm.tact"]),
    ("analog", &["factory-analog.tact", "handheld-analog.tact"]),
    ("mems", &["factory-mems.tact", "handheld-mems.tact"]),
];

/// Makes the tables, and compares them with those that are committed or writes them.
pub(super) fn factory(write: bool) -> Result<String> {
    for (finger, names) in TABLES {
        let work = target().join(format!("factory-{}", std::process::id()));
        let made = make(&work, finger, names);
        // half a gigabyte of recordings
        let _ = std::fs::remove_dir_all(&work);
        for (name, made) in names.iter().zip(made?) {
            let file = root().join(FOLDER).join(name);
            if write {
                std::fs::write(&file, &made).with_context(|| file.display().to_string())?;
            }
            let committed = std::fs::read(&file).with_context(|| file.display().to_string())?;
            same(name, &committed, &made)?;
            println!("{}  {FOLDER}/{name}, {} bytes", hash(&made), made.len());
        }
    }
    Ok(format!("The tables are those of world {SEED}."))
}

fn make(work: &Path, finger: &str, names: &[&str]) -> Result<Vec<Vec<u8>>> {
    std::fs::create_dir_all(work).with_context(|| format!("cannot make {}", work.display()))?;
    let recordings = work.join("recordings");
    let files: Vec<_> = names.iter().map(|name| work.join(name)).collect();
    let mut simulate = tactus();
    let world = ["--seed", SEED, "--finger", finger];
    simulate.arg("simulate").args(world);
    simulate.args(["--trials", TRIALS, "--out"]);
    run(simulate.arg(&recordings)).context("the simulation failed")?;
    for (file, name) in files.iter().zip(names) {
        let mut learn = tactus();
        if name.starts_with("handheld") {
            learn.arg("learn-by-hand").args(world);
            learn.args(["--trials", SLIDES_BY_HAND]);
        } else {
            learn.args(["learn", "--plain", "--train-slides", TRIALS]);
            learn.arg("--recordings");
            learn.arg(&recordings);
        }
        if name.starts_with("arm") {
            // whoever moves the finger may know the shear, the probe does not
            learn.args(["--features", "bands"]);
        }
        if *name == "factory.tact" {
            learn.args(["--lengths", LENGTHS]);
        }
        run(learn.arg("--out").arg(file)).context("the learning failed")?;
    }
    let read = |file: &std::path::PathBuf| {
        std::fs::read(file).with_context(|| format!("cannot read {}", file.display()))
    };
    files.iter().map(read).collect()
}

fn same(name: &str, committed: &[u8], made: &[u8]) -> Result<()> {
    let at = committed.iter().zip(made).position(|(a, b)| a != b);
    ensure!(
        at.is_none() && committed.len() == made.len(),
        "{FOLDER}/{name} is not what world {SEED} gives: {} bytes there, {} made, first difference at byte {}.\n\
         If simulator, features or table were changed on purpose: cargo xtask campaign factory -- --write",
        committed.len(),
        made.len(),
        at.unwrap_or(committed.len().min(made.len()))
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_that_differs_says_where() {
        assert!(same("x", b"TACT1", b"TACT1").is_ok());
        let error = |made| same("x", b"TACT1", made).unwrap_err().to_string();
        assert!(error(b"TACT2").contains("first difference at byte 4"));
        assert!(error(b"TACT").contains("5 bytes there, 4 made, first difference at byte 4"));
    }
}
