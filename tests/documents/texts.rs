//! What programs say, as far as the sources show it: "1 movement", never "1 movements".

use std::fs;
use std::path::{Path, PathBuf};

/// Things of which there may be one. Of bytes, steps and instructions there are always many.
const THINGS: [&str; 34] = [
    "bands",
    "boards",
    "cuts",
    "episodes",
    "errors",
    "explorations",
    "failures",
    "faults",
    "features",
    "files",
    "folders",
    "frames",
    "images",
    "lines",
    "materials",
    "movements",
    "names",
    "operators",
    "presses",
    "properties",
    "recordings",
    "reports",
    "requests",
    "rows",
    "runs",
    "samples",
    "seeds",
    "sessions",
    "slides",
    "slots",
    "textures",
    "trials",
    "words",
    "worlds",
];

/// What the sources of a file's programs say of a number of things, whatever the number: the line and the words.
fn fixed_plurals(source: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    for (line, number) in source.lines().zip(1..) {
        if line.starts_with("#[cfg(test)]") {
            break;
        }
        if line.trim_start().starts_with("//") {
            continue;
        }
        for (at, _) in line.match_indices("} ") {
            let word: String = line[at + 2..]
                .chars()
                .take_while(|c| c.is_alphabetic())
                .collect();
            let Some(from) = line[..at].rfind('{') else {
                continue;
            };
            let value = &line[from + 1..at];
            // code, a mean, a constant, the name of a set
            let is_other =
                value.contains([' ', ';', '}', '.']) || value == "set" || is_constant(value);
            // "3 of 1 runs" is none either, but of several there is more than one
            let of = line[..from].to_lowercase().ends_with("of ");
            if !is_other && !of && THINGS.contains(&word.as_str()) {
                found.push((number, line.trim().to_owned()));
            }
        }
    }
    found
}

fn is_constant(value: &str) -> bool {
    !value.is_empty() && value.chars().all(|c| c.is_uppercase() || c == '_')
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if path.is_dir() {
            if name != "tests" && name != "target" {
                sources(&path, found);
            }
        } else if name.ends_with(".rs") && name != "tests.rs" {
            found.push(path);
        }
    }
}

#[test]
fn a_number_of_things_is_counted_by_one_function() {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let mut files = Vec::new();
    for part in [
        "shared/src",
        "host-tools/link/src",
        "host-tools/world/src",
        "host-tools/lab/src",
        "host-tools/study/src",
        "host-tools/cli/src",
        "host-tools/emulator/src",
        "host-tools/xtask/src",
        "firmware/src",
    ] {
        sources(&root.join(part), &mut files);
    }
    assert!(files.len() > 250, "{}", files.len());
    let mut faults = Vec::new();
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        let shown = file.strip_prefix(root).unwrap().display().to_string();
        for (line, said) in fixed_plurals(&text) {
            faults.push(format!("{shown}:{line}: {said}"));
        }
    }
    assert!(
        faults.is_empty(),
        "\"1 things\" may come of these; see tactus_lab::eval::show::count, or say it otherwise\n{}",
        faults.join("\n")
    );
}

#[test]
fn a_fixed_plural_is_found() {
    let bad = r#"
    writeln!(out, "{slides} slides")?;
    #[error("{} has {count} textures, no more", folder.display())]
        "{:.1} of them, {} runs",
    // {n} slides
    let text = if x { 1 } else { 2 }; } slides
    "{bytes} bytes, {slides_made}, {:.2} slides, {MOST} slides, 1 of {n} slides"
#[cfg(test)]
    "{n} slides"
"#;
    let lines: Vec<usize> = fixed_plurals(bad)
        .into_iter()
        .map(|(line, _)| line)
        .collect();
    assert_eq!(lines, [2, 3, 4]);
}
