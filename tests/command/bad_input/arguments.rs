//! Arguments of the command line.

use std::process::{Command, Stdio};

use super::{of_table, root};

/// A kind of damage, the command, and how it ends.
const ARGUMENTS: [(&str, &[&str], i32); 16] = [
    (
        "missing: a value",
        &["identify", "--simulated", "--threshold"],
        2,
    ),
    ("missing: an option", &["evaluate"], 2),
    ("missing: a command", &["device"], 2),
    (
        "empty: a number",
        &["identify", "--simulated", "--threshold", ""],
        2,
    ),
    (
        "empty: a name",
        &["identify", "--simulated", "--texture", ""],
        1,
    ),
    (
        "cut short: an option",
        &["identify", "--simulated", "--thresh", "0.9"],
        2,
    ),
    (
        "cut short: a range",
        &["study", "identify", "--out", "OUT", "--seeds", "11-"],
        2,
    ),
    (
        "a flipped bit: in a number",
        &["identify", "--simulated", "--threshold", "0.9q"],
        2,
    ),
    (
        "a flipped bit: in a name",
        &["identify", "--simulated", "--texture", "Burlaq"],
        1,
    ),
    (
        "a flipped bit: in a command",
        &["idendify", "--simulated"],
        2,
    ),
    (
        "wrong type",
        &["identify", "--simulated", "--threshold", "green"],
        2,
    ),
    (
        "wrong type: not a choice",
        &["identify", "--simulated", "--method", "magic"],
        2,
    ),
    (
        "huge: a number",
        &[
            "identify",
            "--simulated",
            "--seed",
            "99999999999999999999999",
        ],
        2,
    ),
    (
        "huge: a share",
        &["identify", "--simulated", "--threshold", "1e999"],
        2,
    ),
    (
        "another version: an option that there never was",
        &["identify", "--simulated", "--turbo"],
        2,
    ),
    (
        "no permission",
        &[
            "simulate",
            "--out",
            "/proc/tactus",
            "--textures",
            "Burlap",
            "--trials",
            "1",
        ],
        1,
    ),
];

pub(super) fn section() -> String {
    let mut text = String::from(
        "## Arguments\n\nThe exit code is in brackets: 2 is wrong usage. What an older version called otherwise is still taken (`device forget --self-taught`).\n\n\
         | damage | command | answer |\n|---|---|---|\n",
    );
    for (damage, arguments, code) in ARGUMENTS {
        let out = Command::new(env!("CARGO_BIN_EXE_tactus"))
            .args(arguments)
            .env_remove("TACTUS_RECORDINGS")
            .env_remove("TACTUS_PORT")
            .current_dir(root())
            .stdin(Stdio::null())
            .output()
            .unwrap();
        let said = String::from_utf8(out.stderr).unwrap();
        assert_eq!(out.status.code(), Some(code), "{arguments:?}: {said}");
        assert!(out.stdout.is_empty(), "{arguments:?}");
        assert!(!said.contains("panicked"), "{arguments:?}: {said}");
        assert!(!root().join("OUT").exists(), "{arguments:?}");
        // clap's usage of a group has no line of its own
        let line = said.lines().next().unwrap_or_default();
        let line = line.strip_prefix("error: ").unwrap_or("its help");
        let line = match line {
            "the following required arguments were not provided:" => {
                let what = said.lines().nth(1).unwrap_or_default().trim();
                format!("{line} {what}")
            }
            other => other.to_owned(),
        };
        let shown: Vec<String> = arguments
            .iter()
            .map(|argument| match *argument {
                "" => "\"\"".to_owned(),
                other => other.to_owned(),
            })
            .collect();
        text += &format!(
            "| {damage} | `tactus {}` | {} ({code}) |\n",
            shown.join(" "),
            of_table(&line)
        );
    }
    text
}
