//! README, book and the recordings of the repository: generated parts are as the code has them, links lead somewhere,
//! the commands in them exist.
//!
//! `TACTUS_BOOK=write` (`cargo xtask docs --write`) writes the generated parts, the recordings and the pictures.

#[path = "book/holder.rs"]
mod holder;
#[path = "book/parts.rs"]
mod parts;
#[path = "book/schema.rs"]
mod schema;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

/// Where the simulated recordings are, and the options of the command that makes them.
const RECORDINGS: &str = "host-tools/recordings/simulated";
const SIMULATE: &str = "--trials 3 --seed 1 --textures \"Computer paper,Coarse suede,Burlap,Denim \
 twill,Corduroy,Terry cloth\"";
const MAX_RECORDINGS: usize = 2_000_000;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

fn read(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|why| panic!("{}: {why}", path.display()))
}

fn writes() -> bool {
    std::env::var("TACTUS_BOOK").as_deref() == Ok("write")
}

/// Starts `tactus` with these words at the top of the repository.
pub(crate) fn run(line: &str) -> Output {
    let mut tactus = Command::new(env!("CARGO_BIN_EXE_tactus"));
    tactus
        .args(words(line))
        .current_dir(root())
        .stdin(Stdio::null());
    tactus.output().unwrap()
}

/// The output of a command that succeeds.
pub(crate) fn tactus(line: &str) -> String {
    let out = run(line);
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "tactus {line}: {said}");
    String::from_utf8(out.stdout).unwrap()
}

/// The files of a folder that end with `suffix`, as paths from the top of the repository, sorted.
fn files(folder: &str, suffix: &str) -> Vec<String> {
    let mut found = Vec::new();
    for entry in fs::read_dir(root().join(folder)).unwrap() {
        let entry = entry.unwrap();
        let path = format!("{folder}/{}", entry.file_name().to_str().unwrap());
        if entry.file_type().unwrap().is_dir() {
            found.extend(files(&path, suffix));
        } else if path.ends_with(suffix) {
            found.push(path);
        }
    }
    found.sort();
    found
}

/// Everything that a reader may read.
fn pages() -> Vec<String> {
    let mut pages = files("docs/src", ".md");
    let others = "README ARCHITECTURE CHANGELOG CONTRIBUTING DATA SECURITY".split(' ');
    pages.extend(others.map(|page| format!("{page}.md")));
    pages
}

/// Compares a file with what it should be, or writes it.
fn compare(path: &str, wanted: &[u8]) -> Result<(), String> {
    let there = fs::read(root().join(path)).unwrap_or_default();
    if there == wanted {
        return Ok(());
    }
    if writes() {
        fs::write(root().join(path), wanted).unwrap();
        return Ok(());
    }
    let at = there.iter().zip(wanted).take_while(|(a, b)| a == b).count();
    let line = there[..at].iter().filter(|&&byte| byte == b'\n').count() + 1;
    Err(format!(
        "{path}, line {line}: not as the code has it; `cargo xtask docs --write` writes it again"
    ))
}

/// Puts `content` between the lines `<!-- begin -->` and `<!-- /end -->`.
fn filled(page: &str, begin: &str, end: &str, content: &str) -> Option<String> {
    let (from, to) = (format!("<!-- {begin} -->\n"), format!("<!-- /{end} -->"));
    let (before, rest) = page.split_once(&from)?;
    let (_, after) = rest.split_once(&to)?;
    Some(format!("{before}{from}{content}{to}{after}"))
}

#[test]
fn generated_parts_are_as_the_code_has_them() {
    let mut wrong = Vec::new();
    for (path, name, content) in parts::from_sources() {
        let begin = format!("{name}: generated, cargo xtask docs --write");
        let page = filled(&read(path), &begin, name, &format!("\n{content}\n"));
        let page = page.unwrap_or_else(|| panic!("{path} has no place for {name}"));
        wrong.extend(compare(path, page.as_bytes()).err());
    }
    let screens = fs::read(root().join("shared/src/handheld/golden/screens.svg")).unwrap();
    wrong.extend(compare("docs/src/screens.svg", &screens).err());
    wrong.extend(compare("docs/src/wire.json", schema::schema().as_bytes()).err());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn printed_outputs_are_what_the_commands_print() {
    let mut wrong = Vec::new();
    let mut runs = 0;
    for path in pages() {
        let mut page = read(&path);
        let lines = page.clone();
        for run in lines
            .lines()
            .filter_map(|line| line.strip_prefix("<!-- run: tactus"))
        {
            let command = run.trim_end_matches("-->").trim();
            let printed = tactus(command);
            let begin = format!("run: tactus {command}");
            let begin = begin.trim_end();
            let content = format!("```text\n{}\n```\n", printed.trim_end());
            page = filled(&page, begin, "run", &content)
                .unwrap_or_else(|| panic!("{path} has no place for {command}"));
            runs += 1;
        }
        wrong.extend(compare(&path, page.as_bytes()).err());
    }
    assert!(runs > 0);
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_recordings_are_what_their_command_makes() {
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("simulated");
    let simulate = |out: &str| format!("tactus simulate --out {out} {SIMULATE}");
    tactus(&simulate(made.to_str().unwrap())["tactus ".len()..]);
    let mut names = BTreeSet::new();
    let mut bytes = 0;
    let mut wrong = Vec::new();
    fs::create_dir_all(root().join(RECORDINGS)).unwrap();
    for entry in fs::read_dir(&made).unwrap() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        let file = fs::read(made.join(&name)).unwrap();
        bytes += file.len();
        wrong.extend(compare(&format!("{RECORDINGS}/{name}"), &file).err());
        names.insert(format!("{RECORDINGS}/{name}"));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!(files(RECORDINGS, ""), Vec::from_iter(names));
    assert!(bytes <= MAX_RECORDINGS, "{bytes} bytes of recordings");
    let page = read("docs/src/recordings.md").replace("\\\n    ", "");
    let told = simulate(RECORDINGS);
    assert!(page.contains(&told), "recordings.md does not say {told}");
}

#[test]
fn links_lead_somewhere() {
    let mut wrong = Vec::new();
    for path in pages() {
        let page = read(&path);
        let folder = Path::new(&path).parent().unwrap();
        for target in links(&page) {
            if target.contains("://") || target.starts_with("mailto:") {
                continue;
            }
            let (file, anchor) = target.split_once('#').unwrap_or((target, ""));
            let to = if file.is_empty() {
                PathBuf::from(&path)
            } else {
                folder.join(file)
            };
            let outside =
                path.starts_with("docs/src") && (file.contains('/') || file.contains(".."));
            let there = root().join(&to).exists() && !outside;
            if !there || !anchor.is_empty() && !anchors(&read(&to)).contains(anchor) {
                wrong.push(format!("{path}: {target}"));
            }
        }
        // a file that is named exists, too
        for name in page.split('`').skip(1).step_by(2) {
            let tops = ["docs/", "firmware/", "host-tools/", "shared/", "tests/"];
            let is_path = tops.iter().any(|top| name.starts_with(top));
            if is_path && !name.contains([' ', '*', '\n']) && !root().join(name).exists() {
                wrong.push(format!("{path}: `{name}`"));
            }
        }
    }
    assert!(
        wrong.is_empty(),
        "these lead nowhere:\n{}",
        wrong.join("\n")
    );
}

/// Where the links and pictures of a page lead; not those inside code.
fn links(page: &str) -> Vec<&str> {
    let text = page.split("```").step_by(2);
    text.flat_map(|text| text.split("](").skip(1))
        .filter_map(|rest| rest.split_once(')'))
        .map(|(target, _)| target)
        .collect()
}

/// The anchors that GitHub and mdBook make of headings.
fn anchors(page: &str) -> BTreeSet<String> {
    let headings = page.lines().filter(|line| line.starts_with('#'));
    headings
        .map(|line| {
            let text = line.trim_start_matches('#').trim().to_lowercase();
            let kept = text
                .chars()
                .filter(|c| c.is_alphanumeric() || " -_".contains(*c));
            kept.collect::<String>().replace(' ', "-")
        })
        .collect()
}

#[test]
fn the_summary_lists_every_page_once() {
    let summary = read("docs/src/SUMMARY.md");
    let mut listed: Vec<_> = links(&summary)
        .into_iter()
        .map(|l| format!("docs/src/{l}"))
        .collect();
    listed.push("docs/src/SUMMARY.md".to_owned());
    listed.sort();
    assert_eq!(listed, files("docs/src", ".md"));
}

/// Every command that a page shows in a block of the shell exists, with these options.
#[test]
fn commands_exist() {
    let known = subcommands(&[]);
    let xtask = parts::xtask_commands();
    let mut wrong = Vec::new();
    let mut seen = 0;
    for path in pages() {
        let page = read(&path).replace("\\\n", "");
        let blocks = page
            .split("```sh\n")
            .skip(1)
            .filter_map(|rest| rest.split("```").next());
        for line in blocks.flat_map(str::lines) {
            let words = words(line);
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let rest = match &words[..] {
                ["tactus", rest @ ..] | ["cargo", "run", "--release", "--", rest @ ..] => rest,
                ["cargo", "xtask", name, ..] => {
                    seen += 1;
                    if !xtask.iter().any(|(command, _)| command == name) {
                        wrong.push(format!("{path}: {line}"));
                    }
                    continue;
                }
                _ => continue,
            };
            seen += 1;
            let mut command = Vec::new();
            for word in rest {
                let longer = [&command[..], &[*word]].concat();
                if !known.iter().any(|path| *path == longer) {
                    break;
                }
                command = longer;
            }
            let help = if command.is_empty() && !rest.is_empty() {
                String::new()
            } else {
                help(&command)
            };
            let options = rest.iter().filter(|word| word.starts_with("--"));
            let mut unknown = options.filter(|option| !help.contains(*option));
            if help.is_empty() || unknown.next().is_some() {
                wrong.push(format!("{path}: {line}"));
            }
        }
    }
    assert!(seen > 30, "{seen} commands");
    assert!(
        wrong.is_empty(),
        "these do not exist:\n{}",
        wrong.join("\n")
    );
}

/// The words of a line as a shell splits them, up to a comment.
fn words(line: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word: Option<String> = None;
    let mut quoted = false;
    for c in line.chars() {
        match c {
            '#' if !quoted && word.is_none() => break,
            '"' => {
                quoted = !quoted;
                word.get_or_insert_default();
            }
            ' ' if !quoted => words.extend(word.take()),
            _ => word.get_or_insert_default().push(c),
        }
    }
    words.extend(word);
    words
}

fn help(command: &[&str]) -> String {
    tactus(&format!("{} --help", command.join(" ")))
}

/// The commands below `command`.
fn subcommands(command: &[&str]) -> Vec<Vec<String>> {
    let help = help(command);
    let Some((_, list)) = help.split_once("\nCommands:\n") else {
        return Vec::new();
    };
    let mut all = Vec::new();
    let names = list.lines().take_while(|line| !line.is_empty());
    // further lines of a command's description are indented more
    for line in names.filter(|line| !line.starts_with("   ")) {
        let name = line.split_whitespace().next().unwrap_or_default();
        if name != "help" {
            let path = [command, &[name]].concat();
            let below = subcommands(&path);
            all.push(path.iter().map(|&word| word.to_owned()).collect());
            all.extend(below);
        }
    }
    all
}

/// Whoever wires a probe by the book connects the pins that the firmware has.
#[test]
fn pins_in_the_book_are_the_firmwares() {
    let board = read("firmware/src/board.rs");
    let pin = |part: &str, signal: &str| {
        let (_, lines) = board.split_once(&format!("{part} {{\n")).unwrap();
        let mut pins = lines.lines().filter_map(|line| {
            let (name, pin) = line.trim().strip_suffix(',')?.split_once(": ")?;
            (name == signal).then(|| pin.split(' ').next().unwrap_or(pin).to_owned())
        });
        pins.next()
            .unwrap_or_else(|| panic!("{part} has no {signal}"))
    };
    for row in include_str!("book/pins.txt").lines() {
        // page: row of a table = part's signal
        let (page, row) = row.split_once(": ").unwrap();
        let (row, of) = row.rsplit_once(" = ").unwrap();
        let (part, signal) = of.split_once('.').unwrap();
        let row = format!("{row} {}", pin(part, signal));
        let text = read(format!("docs/src/{page}"));
        assert!(text.contains(&row), "{page} lacks {row}");
    }
}

/// A region of the chip's memories, (address, bytes).
fn region(name: &str) -> (u64, u64) {
    let memory = read("memory.x");
    let line = memory.lines().find_map(|line| {
        let rest = line.trim().strip_prefix(name)?;
        rest.strip_prefix(" : ORIGIN = 0x")?
            .split_once("K")?
            .0
            .split_once(", LENGTH = ")
    });
    let (at, kb) = line.unwrap_or_else(|| panic!("memory.x has no {name}"));
    let at = u64::from_str_radix(at, 16).unwrap();
    (at, kb.parse::<u64>().unwrap() << 10)
}

#[test]
fn the_store_is_where_the_firmware_has_it() {
    let place = read("firmware/src/chip/store_place.rs");
    let (at, bytes) = region("STORE");
    let high_low = format!("0x{:04x}_{:04x}", at >> 16, at & 0xffff);
    for line in [
        format!("STORE_AT: usize = {high_low};"),
        format!("STORE_LENGTH: usize = {} * 1024;", bytes >> 10),
    ] {
        assert!(place.contains(&line), "store_place.rs lacks {line}");
    }
}
