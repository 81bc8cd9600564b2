//! The licences of what a release is linked with, in their authors' words.
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result};
use serde_json::Value;

/// What the names of files begin with that are licences.
const NAMES: [&str; 6] = [
    "LICENSE",
    "LICENCE",
    "COPYING",
    "COPYRIGHT",
    "NOTICE",
    "UNLICENSE",
];

/// One text for all packages, as cargo's metadata has them: who allows what, then each licence once.
pub(super) fn of<'m>(packages: impl Iterator<Item = &'m Value>) -> Result<String> {
    let mut list = String::new();
    let mut texts: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for package in packages {
        let said = |key: &str| package[key].as_str().unwrap_or("not said");
        let name = format!("{} {}", said("name"), said("version"));
        let manifest = package["manifest_path"].as_str().map(Path::new);
        let folder = manifest.and_then(Path::parent);
        let files = licences_in(folder.with_context(|| format!("{name} is nowhere"))?)?;
        let without = if files.is_empty() {
            ", no text in its package"
        } else {
            ""
        };
        writeln!(list, "{name}: {}{without}", said("license"))?;
        for text in files {
            let of_it = texts.entry(text).or_default();
            // a package may have one text under two names
            if of_it.last() != Some(&name) {
                of_it.push(name.clone());
            }
        }
    }
    let mut all = format!(
        "What the files of this release are linked with, and on which terms; Rust's standard library, MIT OR Apache-2.0, is in each of them.\n\
         Where a package has no text, MIT and Apache-2.0 read as in LICENSE-MIT and LICENSE-APACHE, with its authors in place of ours.\n\n{list}"
    );
    for (text, names) in texts {
        let line = "-".repeat(80);
        write!(
            all,
            "\n{line}\n{}\n{line}\n\n{}\n",
            names.join(", "),
            text.trim_end()
        )?;
    }
    Ok(all)
}

/// The texts of the licences in a package, in the order of their files' names.
fn licences_in(folder: &Path) -> Result<Vec<String>> {
    let entries = std::fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut files = Vec::new();
    for entry in entries {
        let file = entry?.path();
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let name = name.to_uppercase();
        if NAMES.iter().any(|begin| name.starts_with(begin)) && file.is_file() {
            files.push(file);
        }
    }
    files.sort();
    let read = |file: &std::path::PathBuf| {
        let bytes = std::fs::read(file).with_context(|| file.display().to_string())?;
        Ok(String::from_utf8_lossy(&bytes).replace("\r\n", "\n"))
    };
    files.iter().map(read).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn each_licence_is_there_once_with_those_who_have_it() {
        let folder = tempfile::tempdir().unwrap();
        let package = |name: &str, files: &[(&str, &str)]| {
            let at = folder.path().join(name);
            std::fs::create_dir(&at).unwrap();
            for (file, text) in files {
                std::fs::write(at.join(file), text).unwrap();
            }
            json!({"name": name, "version": "1.0.0", "license": "MIT", "manifest_path": at.join("Cargo.toml")})
        };
        let packages = [
            package("one", &[("LICENSE-MIT", "may\r\nbe used"), ("README", "x")]),
            package(
                "two",
                &[("license.txt", "may\nbe used"), ("NOTICE", "by two")],
            ),
            package("three", &[]),
        ];
        let text = of(packages.iter()).unwrap();
        assert_eq!(text.matches("may\nbe used").count(), 1, "{text}");
        assert!(text.contains("one 1.0.0, two 1.0.0\n"), "{text}");
        assert!(text.contains("\ntwo 1.0.0\n----"), "{text}");
        assert!(
            text.contains("three 1.0.0: MIT, no text in its package\n"),
            "{text}"
        );
    }
}
