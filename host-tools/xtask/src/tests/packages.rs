//! What is published: cargo packs it, and the packages have all that they name.
use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};

use crate::shell::{cargo, root};

/// What goes to the registry: folders and packages.
const PUBLISHED: [(&str, &str); 2] = [("shared", "tactus-core"), ("host-tools", "tactus-probe")];
/// Of the workspace only: the picture that this test draws is in the book, which is in no package.
const OF_THE_BOOK: &str = "src/sim/tests/fingers.rs";

/// What cargo said, on standard output and error.
fn cargo_package(arguments: &[&str]) -> (String, String) {
    let mut package = cargo();
    // the index as it was when the workspace was built: no network
    package.args(["package", "--allow-dirty", "--offline", "--locked"]);
    let out = package.args(arguments).output().unwrap();
    let [told, said] = [out.stdout, out.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    assert!(out.status.success(), "{arguments:?}: {said}");
    (told, said)
}

/// What a file of a package names, as paths from the package's top; one that begins with ".." is outside.
fn named(file: &Path, text: &str) -> BTreeSet<PathBuf> {
    let beside = file.parent().unwrap();
    let places = [
        ("include_str!", beside),
        ("include_bytes!", beside),
        ("#[path", beside),
        ("CARGO_MANIFEST_DIR\"", Path::new("")),
    ];
    let mut all = BTreeSet::new();
    for (mark, folder) in places {
        for (at, _) in text.match_indices(mark) {
            // the next literal of the same statement
            let rest = &text[at + mark.len()..];
            let statement = rest.split([';', '\n', ']']).next().unwrap();
            let next_line = rest.split(';').next().unwrap();
            let literal = |text: &str| text.split('"').nth(1).map(str::to_owned);
            if let Some(name) = literal(statement).or_else(|| literal(next_line)) {
                all.insert(flat(&folder.join(name.trim_start_matches('/'))));
            }
        }
    }
    all
}

/// A path without ".." behind another part.
fn flat(path: &Path) -> PathBuf {
    let mut flat = PathBuf::new();
    for part in path.components() {
        let inside = matches!(flat.components().next_back(), Some(Component::Normal(_)));
        match part {
            Component::ParentDir if inside => {
                flat.pop();
            }
            part => flat.push(part),
        }
    }
    flat
}

/// What the files of a package name that is not in it, a line each.
fn missing(folder: &Path, files: &BTreeSet<PathBuf>) -> Vec<String> {
    let mut lines = Vec::new();
    let sources = files
        .iter()
        .filter(|file| file.extension() == Some("rs".as_ref()));
    for file in sources.filter(|file| **file != Path::new(OF_THE_BOOK)) {
        let text = std::fs::read_to_string(folder.join(file)).unwrap();
        for name in named(file, &text) {
            // a folder is there if a file of it is
            if !files.iter().any(|file| file.starts_with(&name)) {
                lines.push(format!("{} names {}", file.display(), name.display()));
            }
        }
    }
    lines
}

#[test]
fn cargo_packs_what_is_published_and_nothing_is_missing() {
    let target = tempfile::tempdir().unwrap();
    let mut pack = vec![
        "--no-verify",
        "--target-dir",
        target.path().to_str().unwrap(),
    ];
    for (folder, package) in PUBLISHED {
        pack.extend(["--package", package]);
        let (list, _) = cargo_package(&["--list", "--package", package]);
        let files: BTreeSet<PathBuf> = list.lines().map(PathBuf::from).collect();
        for needed in ["README.md", "LICENSE-MIT", "LICENSE-APACHE", "src/lib.rs"] {
            assert!(files.contains(Path::new(needed)), "{package}: {needed}");
        }
        let missing = missing(&root().join(folder), &files);
        assert!(missing.is_empty(), "{package}\n{}", missing.join("\n"));
    }
    // as of the other workspace members nothing is published, cargo takes these two together only
    let (_, said) = cargo_package(&pack);
    // the tests across the crates are not in the package, and need not be
    let warnings = said.lines().filter(|line| line.starts_with("warning"));
    let others: Vec<&str> = warnings
        .filter(|line| !line.contains("ignoring test `"))
        .collect();
    assert!(others.is_empty(), "{said}");
    let crates = std::fs::read_dir(target.path().join("package")).unwrap();
    let crates = crates.map(|entry| entry.unwrap().path());
    let crates = crates.filter(|file| file.extension() == Some("crate".as_ref()));
    assert_eq!(crates.count(), PUBLISHED.len());
}

#[test]
fn what_is_outside_of_a_package_is_seen() {
    let text = r#"
        include_str!("../beside.css"); include_bytes!(concat!("../../outside/", $file));
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/recordings/small");
        let path = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../docs");
        Path::new(env!("CARGO_MANIFEST_DIR"));
        let other = "../not/a/file";
    "#;
    let found = named(Path::new("src/cmd.rs"), text);
    let all = ["../docs", "../outside", "beside.css", "recordings/small"];
    assert!(found.iter().eq(all.map(Path::new).iter()), "{found:?}");
}

#[test]
fn the_version_is_the_same_everywhere() {
    let version = env!("CARGO_PKG_VERSION");
    let has = |file: &str, line: &str| {
        let text = std::fs::read_to_string(root().join(file)).unwrap();
        assert!(text.contains(line), "{file} does not say {line}");
    };
    let line = format!("\nversion = \"{version}\"\n");
    for folder in [
        "host-tools/emulator",
        "host-tools/page",
        "host-tools/python",
        "tests/fuzz",
    ] {
        has(&format!("{folder}/Cargo.toml"), &line);
    }
    has("host-tools/python/pyproject.toml", &line);
    has("CITATION.cff", &format!("\nversion: {version}\n"));
    has("CHANGELOG.md", &format!("\n## {version}"));
    for (folder, _) in PUBLISHED {
        let dependency = format!("path = \"{folder}\", version = \"{version}\"");
        has("Cargo.toml", &dependency);
    }
}
