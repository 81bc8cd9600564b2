//! The table that comes with the firmware, made anew from the simulated world.
use std::path::Path;

use anyhow::{Context as _, Result, ensure};

use crate::firmware::hash;
use crate::{cargo, root, run, target};

/// The world, and the trials of each texture and movement, that the firmware's table is learned from.
const SEED: &str = "1";
const TRIALS: &str = "5";

/// Makes the table and writes it, or compares it with the one that is committed.
pub(crate) fn factory(check: bool) -> Result<()> {
    let work = target().join(format!("factory-{}", std::process::id()));
    let made = make(&work);
    // half a gigabyte of recordings
    let _ = std::fs::remove_dir_all(&work);
    let made = made?;
    let file = root().join("firmware/factory.tact");
    if check {
        let committed =
            std::fs::read(&file).with_context(|| format!("cannot read {}", file.display()))?;
        same(&committed, &made)?;
        println!("firmware/factory.tact is what world {SEED} gives");
    } else {
        std::fs::write(&file, &made).with_context(|| format!("cannot write {}", file.display()))?;
        println!("firmware/factory.tact is written");
    }
    println!("bytes    {}\nSHA-256  {}", made.len(), hash(&made));
    Ok(())
}

fn make(work: &Path) -> Result<Vec<u8>> {
    std::fs::create_dir_all(work).with_context(|| format!("cannot make {}", work.display()))?;
    let (recordings, table) = (work.join("recordings"), work.join("factory.tact"));
    let tactus = || {
        let mut cargo = cargo();
        cargo.args(["run", "--quiet", "--release", "--package", "tactus", "--"]);
        cargo
    };
    let mut simulate = tactus();
    simulate.args(["simulate", "--seed", SEED, "--trials", TRIALS, "--out"]);
    run(simulate.arg(&recordings)).context("the simulation failed")?;
    let mut learn = tactus();
    learn.args(["learn", "--train-slides", TRIALS, "--recordings"]);
    learn.arg(&recordings).arg("--out").arg(&table);
    run(&mut learn).context("the learning failed")?;
    std::fs::read(&table).with_context(|| format!("cannot read {}", table.display()))
}

fn same(committed: &[u8], made: &[u8]) -> Result<()> {
    let at = committed.iter().zip(made).position(|(a, b)| a != b);
    ensure!(
        at.is_none() && committed.len() == made.len(),
        "firmware/factory.tact is not what world {SEED} gives: {} bytes there, {} made, first difference at byte {}.\n\
         If simulator, features or table were changed on purpose: cargo xtask factory, and commit the file",
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
        assert!(same(b"TACT1", b"TACT1").is_ok());
        let error = |made| same(b"TACT1", made).unwrap_err().to_string();
        assert!(error(b"TACT2").contains("first difference at byte 4"));
        assert!(error(b"TACT").contains("5 bytes there, 4 made, first difference at byte 4"));
    }
}
