//! README, book and the recordings of the repository: generated parts are as the code has them, links lead somewhere, the
//! commands in them exist.
//!
//! `TACTUS_BOOK=write` (`cargo xtask docs --write`) writes the generated parts, the recordings and the pictures.

#[path = "book/parts.rs"]
mod parts;
#[path = "book/picture.rs"]
mod picture;
#[path = "book/schema.rs"]
mod schema;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Where the simulated recordings are, and the command that makes them: [`simulate`].
const RECORDINGS: &str = "host-tools/recordings/simulated";
const TEXTURES: &str = "Computer paper,Coarse suede,Burlap,Denim twill,Corduroy,Terry cloth";
/// The exploration of the moving picture.
const PICTURE: &str = "docs/src/identify.svg";
const EXPLORATION: &[&str] = &[
    "identify",
    "--simulated",
    "--method",
    "paper",
    "--among",
    "60",
    "--seed",
    "2",
];
/// Most bytes of the moving picture, and of all recordings.
const MAX_PICTURE: usize = 500_000;
const MAX_RECORDINGS: usize = 2_000_000;
const MAX_README_LINES: usize = 180;

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

/// What `tactus` prints, started at the top of the repository.
fn tactus(arguments: &[&str]) -> String {
    let out = Command::new(env!("CARGO_BIN_EXE_tactus"))
        .args(arguments)
        .current_dir(root())
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success(), "tactus {arguments:?}: {said}");
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
    for page in [
        "README",
        "ARCHITECTURE",
        "CHANGELOG",
        "CONTRIBUTING",
        "DATA",
        "SECURITY",
    ] {
        pages.push(format!("{page}.md"));
    }
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
    let mut parts = parts::from_sources();
    parts.push(("docs/src/commands.md", "commands", commands()));
    let mut wrong = Vec::new();
    for (path, name, content) in parts {
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
            let arguments = words(command);
            let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
            let printed = tactus(&arguments);
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
    let out = made.to_str().unwrap();
    let command = simulate(out);
    tactus(&command);
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
    let page = read("docs/src/recordings.md");
    let [_, _, _, rest @ .., last] = &simulate(RECORDINGS)[..] else {
        panic!("another command");
    };
    let told = format!(
        "tactus simulate --out {RECORDINGS} {} {last:?}",
        rest.join(" ")
    );
    assert!(page.contains(&told), "recordings.md does not say {told}");
}

fn simulate(out: &str) -> [&str; 9] {
    [
        "simulate",
        "--out",
        out,
        "--trials",
        "3",
        "--seed",
        "1",
        "--textures",
        TEXTURES,
    ]
}

/// It is made from an exploration among 60 textures, which takes a minute where nothing is optimised: only when written.
#[test]
fn the_moving_picture_is_small_and_moves() {
    if writes() {
        let svg = picture::moving(&tactus(EXPLORATION), &EXPLORATION.join(" "));
        fs::write(root().join(PICTURE), svg).unwrap();
    }
    let svg = read(PICTURE);
    roxmltree::Document::parse(&svg).unwrap();
    assert!(svg.len() <= MAX_PICTURE, "{} bytes", svg.len());
    assert!(svg.contains("@keyframes") && svg.contains(&EXPLORATION.join(" ")));
}

/// The monitor in the book: a session of the simulated rig, filmed.
#[test]
fn the_film_is_what_its_command_makes() {
    let temp = tempfile::tempdir().unwrap();
    let [log, film] = ["session.jsonl", "film.svg"].map(|name| temp.path().join(name));
    let packed = fs::File::open(root().join("tests/golden/identify.jsonl.gz")).unwrap();
    let mut unpacked = fs::File::create(&log).unwrap();
    std::io::copy(&mut flate2::read::GzDecoder::new(packed), &mut unpacked).unwrap();
    let [log, film] = [&log, &film].map(|path| path.to_str().unwrap());
    tactus(&["device", "log", "film", log, "--out", film]);
    let svg = fs::read(film).unwrap();
    assert!(svg.len() <= MAX_PICTURE, "{} bytes", svg.len());
    assert!(read("docs/src/bench.md").contains("](monitor.svg)"));
    compare("docs/src/monitor.svg", &svg).unwrap();
}

/// What the viewers show of a session, drawn from the MCAP file.
#[test]
fn the_channels_are_what_their_command_draws() {
    let temp = tempfile::tempdir().unwrap();
    let names = ["session.jsonl", "session.mcap", "channels.svg"];
    let [log, mcap, drawn] = names.map(|name| temp.path().join(name));
    let packed = fs::File::open(root().join("tests/golden/identify.jsonl.gz")).unwrap();
    let mut unpacked = fs::File::create(&log).unwrap();
    std::io::copy(&mut flate2::read::GzDecoder::new(packed), &mut unpacked).unwrap();
    let [log, mcap, drawn] = [&log, &mcap, &drawn].map(|path| path.to_str().unwrap());
    tactus(&["convert", log, "--mcap", mcap, "--plot", drawn]);
    let page = read("docs/src/convert.md");
    assert!(page.contains("tactus convert session.jsonl --mcap session.mcap --plot channels.svg"));
    assert!(page.contains("](plot-channels.svg)"));
    let svg = fs::read(drawn).unwrap();
    assert!(svg.len() < 100_000, "{} bytes", svg.len());
    compare("docs/src/plot-channels.svg", &svg).unwrap();
}

/// Pictures of recordings that are not in the repository: made again where they are, when the book is written.
const OF_OTHERS: (&str, [&str; 2]) = (
    "evaluate --recordings biotac --lifelong --runs 20",
    ["drift", "told-without-learning"],
);

#[test]
fn pictures_of_others_recordings_stand_beside_their_command() {
    let temp = tempfile::tempdir().unwrap();
    let drawn = temp.path().to_str().unwrap();
    let page = read("docs/src/evidence.md");
    let (command, pictures) = OF_OTHERS;
    assert!(page.contains(&format!("`tactus {command}`")));
    let data = writes().then(|| tactus_tests::data("biotac")).flatten();
    if let Some(folder) = &data {
        let folder = folder.to_str().unwrap();
        let arguments = words(&command.replace("biotac", folder));
        let mut arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        arguments.extend(["--plot", drawn]);
        tactus(&arguments);
    }
    for picture in pictures {
        let name = format!("plot-{picture}.svg");
        if data.is_some() {
            let svg = fs::read(temp.path().join(format!("{picture}.svg"))).unwrap();
            fs::write(root().join("docs/src").join(&name), svg).unwrap();
        }
        assert!(page.contains(&format!("]({name})")), "{name}");
        roxmltree::Document::parse(&read(format!("docs/src/{name}"))).unwrap();
    }
}

/// The pictures of the page about pictures, the command of each, and what comes before it.
const PLOTS: [(&str, &[&str]); 4] = [
    (
        "evaluate --recordings host-tools/recordings/simulated --train-slides 2 --method paper --runs 2000 --seed 1",
        &["confusion", "reliability"],
    ),
    (
        "identify --simulated --texture burlap --among 20 --seed 2",
        &["spectrum", "timeline"],
    ),
    ("table show TABLE", &["map"]),
    (
        "gauge --recordings host-tools/recordings/simulated",
        &["control-roughness-1"],
    ),
];

#[test]
fn plots_are_what_their_commands_draw() {
    let temp = tempfile::tempdir().unwrap();
    let [table, drawn] = ["table", "drawn"].map(|name| temp.path().join(name));
    let [table, drawn] = [&table, &drawn].map(|path| path.to_str().unwrap());
    let learn = "learn --recordings host-tools/recordings/simulated --train-slides 3 --out TABLE";
    let page = read("docs/src/pictures.md");
    let mut wrong = Vec::new();
    for (command, pictures) in [(learn, &[][..])].into_iter().chain(PLOTS) {
        assert!(page.contains(&format!("\ntactus {command}")), "{command}");
        let mut arguments = words(command);
        for argument in &mut arguments {
            if argument == "TABLE" {
                table.clone_into(argument);
            }
        }
        let mut arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        if !pictures.is_empty() {
            arguments.extend(["--plot", drawn]);
        }
        tactus(&arguments);
        for picture in pictures {
            let svg = fs::read(Path::new(drawn).join(format!("{picture}.svg"))).unwrap();
            assert!(svg.len() < 60_000, "{picture}: {} bytes", svg.len());
            let path = format!("docs/src/plot-{picture}.svg");
            assert!(
                page.contains(&format!("](plot-{picture}.svg)")),
                "{picture}"
            );
            wrong.extend(compare(&path, &svg).err());
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn the_readme_is_short() {
    let lines = read("README.md").lines().count();
    assert!(lines <= MAX_README_LINES, "{lines} lines");
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
        let page = read(&path);
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
                if !known.iter().any(|(path, _)| *path == longer) {
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
    tactus(&[command, &["--help"]].concat())
}

/// All commands below `command`, with what they do.
fn subcommands(command: &[&str]) -> Vec<(Vec<String>, String)> {
    let help = help(command);
    let Some((_, list)) = help.split_once("\nCommands:\n") else {
        return Vec::new();
    };
    let mut found: Vec<(Vec<String>, String)> = Vec::new();
    for line in list.lines().take_while(|line| !line.is_empty()) {
        let more = line.trim();
        if line.starts_with("   ") {
            if let Some((_, about)) = found.last_mut() {
                *about = format!("{about} {more}");
            }
            continue;
        }
        let (name, about) = more.split_once("  ").unwrap_or((more, ""));
        let path = command.iter().copied().chain([name]).map(str::to_owned);
        found.push((path.collect(), about.trim().to_owned()));
    }
    found.retain(|(path, _)| path.last().is_some_and(|name| name != "help"));
    let mut all = Vec::new();
    for (path, about) in found {
        let names: Vec<&str> = path.iter().map(String::as_str).collect();
        let below = subcommands(&names);
        all.push((path, about));
        all.extend(below);
    }
    all
}

/// The list of all commands, and the help of each.
fn commands() -> String {
    let known = subcommands(&[]);
    let mut text = String::from("| command | what it does |\n|---|---|\n");
    for (path, about) in &known {
        text += &format!("| `tactus {}` | {about} |\n", path.join(" "));
    }
    for (path, _) in &known {
        let names: Vec<&str> = path.iter().map(String::as_str).collect();
        let help = help(&names);
        // a group of commands is in the list above, unless it does something itself
        let itself = ["\nArguments:\n", "\n       tactus "];
        if !help.contains("\nCommands:\n") || itself.iter().any(|part| help.contains(part)) {
            text += &format!(
                "\n## tactus {}\n\n```text\n{}\n```\n",
                path.join(" "),
                help.trim_end()
            );
        }
    }
    text
}

/// The number that a name has in an OpenSCAD file.
fn drawn(file: &str, name: &str) -> f64 {
    let value = read(file).lines().find_map(|line| {
        let value = line.strip_prefix(name)?.strip_prefix(" = ")?;
        value.split_once(';')?.0.parse().ok()
    });
    value.unwrap_or_else(|| panic!("{file} has no number {name}"))
}

#[test]
fn the_finger_is_built_as_it_is_drawn_and_wired() {
    let page = read("docs/src/build-finger.md");
    let finger = |name| drawn("hardware/finger.scad", name);
    let [end, below_flange] = [finger("end_radius"), finger("skirt")];
    for sentence in [
        format!(
            "| tip | {} mm wide; its end is part of a sphere of {end} mm |",
            finger("diameter")
        ),
        format!("| skin | {} mm thick |", finger("skin")),
        format!(
            "| {} mm high, {} mm apart, across the slide |",
            finger("ridge_height"),
            finger("ridge_spacing")
        ),
    ] {
        assert!(page.contains(&sentence), "the page lacks: {sentence}");
    }
    let rise = end - (end.powi(2) - (finger("diameter") / 2.0).powi(2)).sqrt();
    let tip = drawn("hardware/case.scad", "tip_below");
    let below = finger("flange") + below_flange + rise;
    assert!(
        (tip - below).abs() < 0.1,
        "the case has a tip of {tip} mm, the finger {below:.2}"
    );
    // the bus, as the firmware has it
    let board = read("firmware/src/board.rs");
    for (signal, in_code, pins) in [
        (
            "clock",
            "sck",
            [
                "IIS3DWB | SCL, as SPC",
                "ADS1220 | SCLK",
                "MCP3202 | CLK (7)",
            ],
        ),
        (
            "data in",
            "miso",
            ["IIS3DWB | SDO", "ADS1220 | DOUT", "MCP3202 | DOUT (6)"],
        ),
        (
            "data out",
            "mosi",
            [
                "IIS3DWB | SDA, as SDI",
                "ADS1220 | DIN",
                "MCP3202 | DIN (5)",
            ],
        ),
        (
            "select",
            "select",
            ["IIS3DWB | CS", "MCP3202 | CS (1)", "MCP3202 | CS (1)"],
        ),
        (
            "second select",
            "select_2",
            ["ADS1220 | CS", "ADS1220 | CS", "ADS1220 | CS"],
        ),
    ] {
        let pin = board.lines().find_map(|line| {
            line.trim()
                .strip_prefix(in_code)?
                .strip_prefix(": ")?
                .strip_suffix(',')
        });
        let pin = pin.unwrap_or_else(|| panic!("board.rs names no {in_code}"));
        for part in pins {
            let row = format!("| {part} | {pin} (");
            assert!(page.contains(&row), "{signal}: the page lacks {row}");
        }
    }
}

/// A region of a board's memories, (address, bytes).
fn region(board: &str, name: &str) -> (u64, u64) {
    let memory = read(format!("firmware/boards/{board}/board.x"));
    let line = memory.lines().find_map(|line| {
        let rest = line.trim().strip_prefix(name)?;
        rest.strip_prefix(" : ORIGIN = 0x")?
            .split_once("K")?
            .0
            .split_once(", LENGTH = ")
    });
    let (at, kb) = line.unwrap_or_else(|| panic!("board.x of {board} has no {name}"));
    let at = u64::from_str_radix(at, 16).unwrap();
    (at, kb.parse::<u64>().unwrap() << 10)
}

#[test]
fn the_boards_have_their_memories_where_the_firmware_and_the_page_say() {
    let place = read("firmware/src/chip/store_place.rs");
    let (at, bytes) = region("nucleo-f429zi", "STORE");
    let high_low = format!("0x{:04x}_{:04x}", at >> 16, at & 0xffff);
    for line in [
        format!("STORE_AT: usize = {high_low};"),
        format!("STORE_LENGTH: usize = {} * 1024;", bytes >> 10),
    ] {
        assert!(place.contains(&line), "store_place.rs lacks {line}");
    }
    for name in ["FLASH", "STORE"] {
        let [reference, other] =
            ["nucleo-f429zi", "nucleo-f767zi"].map(|board| region(board, name));
        assert_eq!(reference, other, "{name}");
    }
    let page = read("docs/src/another-board.md");
    let kb = |board, name| region(board, name).1 >> 10;
    for words in [
        format!("| {} KB, buffer", kb("nucleo-f429zi", "RAM")),
        format!("SRAM1 ({} KB)", kb("nucleo-f767zi", "RAM")),
        format!("DTCM ({} KB)", kb("nucleo-f767zi", "DTCM")),
        format!("stack's {} KB", kb("nucleo-f767zi", "DTCM") - 16),
    ] {
        assert!(page.contains(&words), "the page lacks {words}");
    }
    // what the firmware tells to do is on the page
    let board = read("firmware/src/board/nucleo_f767zi.rs");
    let (_, command) = board.split_once("nothing is stored: ").unwrap();
    let (command, _) = command.split_once('"').unwrap();
    assert!(page.contains(command), "the page lacks {command}");
}

#[test]
fn the_motion_sensor_is_wired_as_the_firmware_has_it() {
    let board = read("firmware/src/board.rs");
    let page = read("docs/src/handheld.md");
    let (_, pins) = board.split_once("motion: Motion {").unwrap();
    for (signal, in_code) in [
        ("SCK", "sck"),
        ("MISO", "miso"),
        ("MOSI", "mosi"),
        ("CS", "select"),
    ] {
        let line = pins.lines().find_map(|line| {
            let pin = line.trim().strip_prefix(in_code)?;
            pin.strip_prefix(": ")?.strip_suffix(',')
        });
        let pin = line.unwrap();
        let row = format!("| {signal} | {pin}");
        assert!(page.contains(&row), "the page lacks {row}");
    }
}
