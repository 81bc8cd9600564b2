//! The parts that are printed, from their OpenSCAD sources.

use std::path::Path;
use std::process::Command;

use anyhow::{Context as _, Result, ensure};

use super::Files;
use crate::shell::{root, run};

/// The files of `hardware/`, and their parts.
const PARTS: [(&str, &[&str]); 3] = [
    ("case", &["body", "lid"]),
    ("finger", &["carrier", "mould", "core"]),
    (
        "printer",
        &["back", "carriage", "corner", "saddle", "clamp", "tray"],
    ),
];

pub(crate) fn lacks() -> Result<()> {
    let asked = Command::new("openscad").arg("--version").output();
    ensure!(
        asked.is_ok(),
        "openscad is not installed (Debian: the package openscad)"
    );
    Ok(())
}

/// Every part as STL, by the names `case-lid.stl` and so on.
pub(crate) fn all(folder: &Path) -> Result<Files> {
    let mut files = Files::new();
    for (source, parts) in PARTS {
        for part in parts {
            let name = format!("{source}-{part}.stl");
            let out = folder.join(&name);
            let mut openscad = Command::new("openscad");
            openscad.args(["-q", "-D", &format!("part=\"{part}\""), "-o"]);
            openscad
                .arg(&out)
                .arg(root().join(format!("hardware/{source}.scad")));
            run(&mut openscad)?;
            let made = std::fs::read(&out).with_context(|| out.display().to_string())?;
            files.insert(name, made);
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_of_the_sources_is_made() {
        for (source, parts) in PARTS {
            let text = root().join(format!("hardware/{source}.scad"));
            let text = std::fs::read_to_string(text).unwrap();
            let named = text.lines().filter_map(|line| {
                let name = line.strip_prefix("if (part == \"")?.split('"').next()?;
                (!name.starts_with("assembly")).then_some(name)
            });
            assert_eq!(named.collect::<Vec<_>>(), parts, "{source}");
        }
    }
}
