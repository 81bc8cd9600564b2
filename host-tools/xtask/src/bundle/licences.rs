//! The licences of the crates that a release is linked with, in their authors' words.
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, ensure};

use crate::shell::{cargo, root};
use crate::toolchain;

const NAMES: [&str; 5] = ["LICEN", "COPYING", "COPYRIGHT", "NOTICE", "UNLICENSE"];

/// One text for all parts, each a manifest, a package and a platform: a list of crates, then each licence once.
pub(super) fn of(parts: &[(&str, &str, Option<&str>)]) -> Result<String> {
    let (mut crates, mut host) = (BTreeSet::new(), String::new());
    if parts.iter().any(|(.., triple)| triple.is_none()) {
        host = toolchain::host()?;
    }
    for (manifest, package, triple) in parts {
        let mut tree = cargo();
        // what only runs in the compiler is not linked
        tree.args([
            "tree",
            "--locked",
            "--edges",
            "normal,no-proc-macro",
            "--prefix",
            "none",
        ]);
        tree.args([
            "--format",
            "{p}|{l}",
            "--package",
            package,
            "--target",
            triple.unwrap_or(&host),
        ]);
        let out = tree
            .arg("--manifest-path")
            .arg(root().join(manifest))
            .output()?;
        ensure!(
            out.status.success(),
            "cargo tree: {}",
            String::from_utf8_lossy(&out.stderr)
        );
        let text = String::from_utf8(out.stdout)?;
        // ours have a folder behind their version
        let others = text.lines().filter(|line| !line.contains(" ("));
        crates.extend(others.map(str::to_owned));
    }
    let mut found = Vec::new();
    for line in &crates {
        let (name, licence) = line.split_once('|').unwrap_or((line, "not said"));
        let name = name.replacen(" v", "-", 1);
        let texts = licences_in(&folder(&name).with_context(|| format!("{name} is nowhere"))?)?;
        found.push((name, licence.to_owned(), texts));
    }
    Ok(listed(&found))
}

fn folder(name: &str) -> Option<PathBuf> {
    let home = std::env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| Some(Path::new(&std::env::var_os("HOME")?).join(".cargo")))?;
    let mut registries = std::fs::read_dir(home.join("registry/src")).ok()?.flatten();
    registries.find_map(|registry| Some(registry.path().join(name)).filter(|path| path.is_dir()))
}

/// The text about these crates, each with its licence and the files of its licences.
fn listed(crates: &[(String, String, Vec<String>)]) -> String {
    let mut all = String::from(
        "The crates that the files of this release are linked with, and their licences.\n\
         Rust's standard library, MIT OR Apache-2.0, is in each of them. Where a crate has no text,\n\
         MIT and Apache-2.0 read as in LICENSE-MIT and LICENSE-APACHE, with its authors in place of ours.\n\n",
    );
    let mut texts: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (name, licence, files) in crates {
        let without = if files.is_empty() {
            ", no text in its crate"
        } else {
            ""
        };
        // writing to a String cannot fail
        let _ = writeln!(all, "{name}: {licence}{without}");
        for text in files {
            texts.entry(text).or_default().push(name);
        }
    }
    for (text, names) in texts {
        let line = "-".repeat(80);
        let _ = write!(
            all,
            "\n{line}\n{}\n{line}\n\n{}\n",
            names.join(", "),
            text.trim_end()
        );
    }
    all
}

fn licences_in(folder: &Path) -> Result<Vec<String>> {
    let mut texts = BTreeSet::new();
    for entry in std::fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let file = entry?.path();
        let name = file
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .to_uppercase();
        if NAMES.iter().any(|begin| name.starts_with(begin)) && file.is_file() {
            let bytes = std::fs::read(&file).with_context(|| file.display().to_string())?;
            texts.insert(String::from_utf8_lossy(&bytes).replace("\r\n", "\n"));
        }
    }
    Ok(texts.into_iter().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_licence_is_there_once_with_those_who_have_it() {
        let folder = tempfile::tempdir().unwrap();
        for (file, text) in [
            ("LICENSE-MIT", "may\r\nbe used"),
            ("license.txt", "may\nbe used"),
            ("README", "x"),
            ("NOTICE", "by me"),
        ] {
            std::fs::write(folder.path().join(file), text).unwrap();
        }
        let texts = licences_in(folder.path()).unwrap();
        assert_eq!(texts, ["by me", "may\nbe used"]);
        let of = |name: &str, texts: &[String]| (name.to_owned(), "MIT".to_owned(), texts.to_vec());
        let text = listed(&[
            of("one-1.0.0", &texts[1..]),
            of("two-1.0.0", &texts),
            of("three-1.0.0", &[]),
        ]);
        assert_eq!(text.matches("may\nbe used").count(), 1, "{text}");
        for part in [
            "\none-1.0.0, two-1.0.0\n---",
            "\ntwo-1.0.0\n---",
            "three-1.0.0: MIT, no text in its crate\n",
        ] {
            assert!(text.contains(part), "{text}");
        }
    }

    #[test]
    fn the_images_are_linked_with_embassy_and_no_macro() {
        let text = of(&[super::super::FIRMWARE]).unwrap();
        assert!(
            text.contains("\nembassy-stm32-") && !text.contains("\nsyn-"),
            "{}",
            &text[..2000]
        );
    }
}
