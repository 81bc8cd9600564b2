//! `--plot`: the pictures are well-formed, change nothing else, and say the numbers that the commands print.

use std::collections::BTreeMap;
use std::fs;

use serde_json::Value;

use super::book::{run, tactus};

const RECORDINGS: &str = "--recordings host-tools/recordings/simulated --train-slides 2";

/// Commands that draw.
fn commands() -> [String; 4] {
    [
        format!("evaluate {RECORDINGS} --runs 300 --method paper --threshold 0.97"),
        format!("identify {RECORDINGS} --material 91 --method random --format json"),
        "identify --simulated --among 4 --seed 3".to_owned(),
        "table tests/golden/paper.tact".to_owned(),
    ]
}

/// A picture has titles, and no number that is none.
fn look(name: &str, svg: &str) {
    let picture = roxmltree::Document::parse(svg).unwrap_or_else(|why| panic!("{name}: {why}"));
    let has = |n: roxmltree::Node<'_, '_>, tag| n.tag_name().name() == tag;
    for drawing in picture.descendants().filter(|n| has(*n, "svg")) {
        let title = drawing.first_element_child().unwrap();
        assert!(
            has(title, "title") && title.text().is_some(),
            "{name} has no title"
        );
    }
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{name}");
}

#[test]
fn pictures_can_be_read_and_change_nothing_else() {
    let temp = tempfile::tempdir().unwrap();
    for (number, command) in commands().iter().enumerate() {
        let folder = temp.path().join(number.to_string());
        let plain = tactus(command);
        assert_eq!(
            tactus(&format!("{command} --plot {}", folder.display())),
            plain,
            "{command}"
        );
        let mut drawn = 0;
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            look(
                &format!("{command}, {path:?}"),
                &fs::read_to_string(&path).unwrap(),
            );
            drawn += 1;
        }
        assert!(drawn > 0, "{command}");
    }
}

#[test]
fn the_matrix_counts_what_the_verdicts_say() {
    let folder = tempfile::tempdir().unwrap();
    let options = format!(
        "--runs 600 --method fused --threshold 0.9 --format json --plot {}",
        folder.path().display()
    );
    let json: Value =
        serde_json::from_str(&tactus(&format!("evaluate {RECORDINGS} {options}"))).unwrap();
    let svg = fs::read_to_string(folder.path().join("confusion.svg")).unwrap();
    let picture = roxmltree::Document::parse(&svg).unwrap();
    let titles = picture
        .descendants()
        .filter(|n| n.tag_name().name() == "title");
    let said = titles
        .filter_map(|n| n.text())
        .filter(|said| said.contains(": told "));
    let mut rows: BTreeMap<String, (u64, u64)> = BTreeMap::new();
    let mut kinds: BTreeMap<&str, u64> = BTreeMap::new();
    for said in said {
        let (name, rest) = said.split_once(": ").unwrap();
        let (told, counts) = rest.rsplit_once(", ").unwrap();
        let (count, all) = counts.split_once(" of ").unwrap();
        let count: u64 = count.parse().unwrap();
        let all: u64 = all.split_once(' ').unwrap().0.parse().unwrap();
        let row = rows.entry(name.to_owned()).or_insert((0, all));
        assert_eq!(row.1, all);
        row.0 += count;
        let kind = match told {
            "told as sure, right" => "right",
            "told to be none of those known" => "new",
            "told as not sure" => "undecided",
            _ => "wrong",
        };
        *kinds.entry(kind).or_default() += count;
    }
    assert_eq!(rows.len(), 6);
    assert!(rows.values().all(|(sum, all)| sum == all), "{rows:?}");
    assert_eq!(rows.values().map(|row| row.1).sum::<u64>(), 600);
    for kind in ["right", "new", "wrong", "undecided"] {
        let counted = kinds.get(kind).copied().unwrap_or(0) as f64 / 600.0;
        let told = json["verdicts"][kind].as_f64().unwrap();
        assert!(
            (counted - told).abs() < 1e-9,
            "{kind}: {counted} for {told}"
        );
    }
}

#[test]
fn a_place_that_cannot_be_drawn_to_is_told_before_the_work() {
    let temp = tempfile::tempdir().unwrap();
    let mine = temp.path().join("mine");
    fs::write(&mine, "mine").unwrap();
    for target in [mine.clone(), mine.join("pictures")] {
        let out = run(&format!("identify --simulated --plot {}", target.display()));
        let said = String::from_utf8(out.stderr).unwrap();
        assert_eq!(out.status.code(), Some(1), "{said}");
        assert!(said.contains("cannot be written"), "{said}");
        assert!(out.stdout.is_empty());
    }
    assert_eq!(fs::read_to_string(mine).unwrap(), "mine");
}
