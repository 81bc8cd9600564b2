//! Whether the same sources give the same bytes in another folder.
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context as _, Result, bail, ensure};

use super::{Files, SUMS, files, names};
use crate::firmware::hash;
use crate::shell::{cargo, root, run, target};

/// Builds the release, or what of it is named, here and in a copy of the sources in another folder, and compares each file.
pub(crate) fn reproduce(only: &[String]) -> Result<()> {
    if let Some(unknown) = only.iter().find(|one| !names().contains(&one.as_str())) {
        bail!(
            "{unknown} is no part of a release: there are {}",
            names().join(", ")
        );
    }
    let here = files(only)?;
    let copy = target().join("reproduce").join("in another folder");
    copy_sources(&copy)?;
    let out = copy.join("target/bundle");
    let mut bundle = cargo();
    bundle.current_dir(&copy).env_remove("CARGO_TARGET_DIR");
    bundle.args([
        "run",
        "--quiet",
        "--package",
        "xtask",
        "--",
        "bundle",
        "--out",
    ]);
    bundle.arg(&out);
    if !only.is_empty() {
        bundle.arg("--only").arg(only.join(","));
    }
    run(&mut bundle).context("the release is not built in the other folder")?;
    let there = read_all(&out)?;
    let lines = compare(&here, &there);
    for (name, bytes) in &here {
        println!("{}  {name}", hash(bytes));
    }
    ensure!(
        lines.is_empty(),
        "the same sources give other bytes in {}:\n{}",
        copy.display(),
        lines.join("\n")
    );
    println!("{}: the same files, {} of them", copy.display(), here.len());
    Ok(())
}

/// What differs, a line each.
fn compare(here: &Files, there: &Files) -> Vec<String> {
    let mut names: Vec<&String> = here.keys().chain(there.keys()).collect();
    names.sort();
    names.dedup();
    // the sums differ where a file does
    let names = names.into_iter().filter(|name| *name != SUMS);
    let line = |name: &String| match (here.get(name), there.get(name)) {
        (Some(a), Some(b)) => {
            let at = a.iter().zip(b).position(|(a, b)| a != b);
            let at = at.or((a.len() != b.len()).then_some(a.len().min(b.len())))?;
            Some(format!(
                "{name}: from byte {at} of {} and {}",
                a.len(),
                b.len()
            ))
        }
        (Some(_), None) => Some(format!("{name}: not built there")),
        (None, Some(_)) => Some(format!("{name}: not built here")),
        (None, None) => None,
    };
    names.filter_map(line).collect()
}

/// Copies the files that git knows, as they are now; what was built there is kept, but for a release.
fn copy_sources(to: &Path) -> Result<()> {
    let listed = Command::new("git")
        .current_dir(root())
        .args(["ls-files", "-z"])
        .output()
        .context("cannot start git")?;
    ensure!(listed.status.success(), "git does not list the sources");
    let _ = std::fs::remove_dir_all(to.join("target/bundle"));
    for name in String::from_utf8(listed.stdout)?.split_terminator('\0') {
        let (from, to) = (root().join(name), to.join(name));
        let folder = to.parent().context("a file is in no folder")?;
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        let bytes = std::fs::read(&from).with_context(|| from.display().to_string())?;
        // what is as it was keeps its time: it is not built again
        if std::fs::read(&to).ok().as_deref() != Some(&bytes) {
            std::fs::write(&to, bytes).with_context(|| to.display().to_string())?;
        }
    }
    Ok(())
}

fn read_all(folder: &Path) -> Result<Files> {
    let mut files = Files::new();
    for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let file: PathBuf = entry?.path();
        let Some(name) = file.file_name().and_then(|name| name.to_str()) else {
            bail!("{} has no name", file.display());
        };
        files.insert(name.to_owned(), std::fs::read(&file)?);
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_file_that_differs_is_named() {
        let files = |all: &[(&str, &[u8])]| -> Files {
            let own = |(name, bytes): &(&str, &[u8])| ((*name).to_owned(), bytes.to_vec());
            all.iter().map(own).collect()
        };
        let here = files(&[("a", b"12"), ("b", b"12"), ("c", b"1"), (SUMS, b"x")]);
        assert!(compare(&here, &here).is_empty());
        let there = files(&[("a", b"12"), ("b", b"13"), ("d", b"1"), (SUMS, b"y")]);
        assert_eq!(
            compare(&here, &there),
            [
                "b: from byte 1 of 2 and 2",
                "c: not built there",
                "d: not built here"
            ]
        );
        let longer = files(&[("a", b"123"), ("b", b"12"), ("c", b"1")]);
        assert_eq!(compare(&here, &longer), ["a: from byte 2 of 2 and 3"]);
    }

    #[test]
    fn the_copy_is_what_git_knows() {
        let folder = tempfile::tempdir().unwrap();
        copy_sources(folder.path()).unwrap();
        let manifest = std::fs::read(root().join("Cargo.toml")).unwrap();
        assert_eq!(
            std::fs::read(folder.path().join("Cargo.toml")).unwrap(),
            manifest
        );
        assert!(!folder.path().join("target").exists());
    }
}
