//! What belongs to no single command: the command line, who asks for it, and what is published.
mod packages;

use super::*;
use clap::CommandFactory as _;

#[test]
fn the_command_line_is_consistent() {
    Cli::command().debug_assert();
}

#[test]
fn workflows_and_instructions_ask_for_commands_that_there_are() {
    let mut asked = 0;
    let files = [
        ".github/workflows/ci.yml",
        ".github/workflows/page.yml",
        ".github/workflows/release.yml",
        ".ci/run",
        "docs/src/release.md",
    ];
    for file in files {
        let text = std::fs::read_to_string(shell::root().join(file)).unwrap();
        for line in text.lines() {
            let Some((_, command)) = line.split_once("cargo xtask ") else {
                continue;
            };
            let end = command
                .find(['#', '`', '&', '|', ';'])
                .unwrap_or(command.len());
            let words = command[..end].split_whitespace();
            let parsed = Cli::try_parse_from(["xtask"].into_iter().chain(words));
            assert!(parsed.is_ok(), "{file}: {line}: {}", parsed.err().unwrap());
            asked += 1;
        }
    }
    assert!(asked >= 5, "{asked}");
}

#[test]
fn a_workflow_is_steps_of_one_job() {
    // no YAML here: what a misplaced indentation or a tab would break
    for name in ["ci", "page", "release"] {
        let file = shell::root().join(format!(".github/workflows/{name}.yml"));
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(!text.contains('\t'), "{name}: a tab");
        let steps = text.split_once("\n    steps:\n").expect("steps").1;
        for line in steps.lines() {
            let indent = line.len() - line.trim_start().len();
            let item = line.trim_start().starts_with("- ");
            let comment = line.trim_start().starts_with('#');
            assert!(
                comment || (item && indent == 6) || (!item && [8, 10].contains(&indent)),
                "{name}: {line}"
            );
        }
    }
}

#[test]
fn options_behind_mutants_go_through() {
    let Cli::Mutants { options } = Cli::parse_from(["xtask", "mutants", "--jobs", "2"]) else {
        panic!("not mutants");
    };
    assert_eq!(options, ["--jobs", "2"]);
}
