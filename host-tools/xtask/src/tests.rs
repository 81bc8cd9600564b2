//! Tests of the command line, of those who ask for its commands, and of versions.
use super::*;
use clap::CommandFactory as _;

fn text(file: &str) -> String {
    std::fs::read_to_string(shell::root().join(file)).unwrap()
}

#[test]
fn the_command_line_is_consistent() {
    Cli::command().debug_assert();
}

#[test]
fn workflows_and_pages_ask_for_commands_that_there_are() {
    let book = std::fs::read_dir(shell::root().join("docs/src")).unwrap();
    let book = book.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let book = book.filter(|name| name.ends_with(".md"));
    let mut files: Vec<String> = book.map(|name| format!("docs/src/{name}")).collect();
    files.extend(["ci", "page", "release"].map(|name| format!(".github/workflows/{name}.yml")));
    files.extend([".ci/run", "README.md", "CONTRIBUTING.md"].map(str::to_owned));
    let mut asked = 0;
    for file in files {
        for asks in text(&file)
            .replace("-->", "\n")
            .split("cargo xtask ")
            .skip(1)
        {
            // a command of an earlier commit, which the page names
            let soon: String = asks.chars().take(60).collect();
            if soon.contains("commit ") {
                continue;
            }
            let end = asks.find(['#', '`', '&', '|', ';', '\n', '(', ')']);
            let words = asks[..end.unwrap_or(asks.len())].split_whitespace();
            let words = words.map(|word| word.trim_matches([',', '.', ':']));
            let parsed = Cli::try_parse_from(["xtask"].into_iter().chain(words));
            // "--help" ends it, too
            let is_wrong = parsed.as_ref().is_err_and(clap::Error::use_stderr);
            assert!(!is_wrong, "{file}: {soon}: {}", parsed.err().unwrap());
            asked += 1;
        }
    }
    assert!(asked >= 20, "{asked}");
}

#[test]
fn a_workflow_is_steps_of_one_job() {
    // no YAML here: what a misplaced indentation or a tab would break
    for name in ["ci", "page", "release"] {
        let text = text(&format!(".github/workflows/{name}.yml"));
        assert!(!text.contains('\t'), "{name}: a tab");
        for line in text.split_once("\n    steps:\n").expect("steps").1.lines() {
            let start = line.trim_start();
            let indent = line.len() - start.len();
            let is_right = match start.starts_with("- ") {
                true => indent == 6,
                false => start.starts_with('#') || [8, 10].contains(&indent),
            };
            assert!(is_right, "{name}: {line}");
        }
    }
}

#[test]
fn every_workspace_is_linted_and_licensed() {
    let mut git = std::process::Command::new("git");
    git.args(["ls-files", "*Cargo.lock"])
        .current_dir(shell::root());
    let listed = String::from_utf8(git.output().unwrap().stdout).unwrap();
    let others = listed
        .lines()
        .filter_map(|lock| lock.strip_suffix("/Cargo.lock"));
    assert_eq!(others.collect::<Vec<_>>(), test::OTHERS);
}

#[test]
fn the_security_page_names_every_file_with_unsafe_code() {
    let mut git = std::process::Command::new("git");
    let code = "^[^/\"]*(unsafe (\\{|fn |impl |extern )|#\\[unsafe\\()";
    git.args(["grep", "-lE", code, "--", "*.rs"])
        .current_dir(shell::root());
    let listed = String::from_utf8(git.output().unwrap().stdout).unwrap();
    let page = text("SECURITY.md");
    let files: Vec<&str> = listed.lines().collect();
    for file in &files {
        assert!(page.contains(&format!("`{file}`")), "{file}");
    }
    let named = page.split('`').filter(|word| word.ends_with(".rs"));
    for file in named {
        assert!(files.contains(&file), "{file} has none");
    }
}

#[test]
fn every_test_of_the_proof_is_there() {
    let page = text("SECURITY.md");
    let (_, proof) = page.split_once("\n## Proof\n").unwrap();
    let (proof, _) = proof.split_once("\n## ").unwrap();
    let (_, rows) = proof.split_once("|---|---|---|---|\n").unwrap();
    for name in rows
        .lines()
        .flat_map(|row| row.split('`').skip(1).step_by(2))
    {
        let mut git = std::process::Command::new("git");
        git.args(["grep", "-qF", "-e", name, "--", "*.rs", "*.py", "*.mjs"]);
        let found = git.current_dir(shell::root()).status().unwrap();
        assert!(found.success(), "{name}");
    }
    assert!(rows.lines().count() > 20);
}

#[test]
fn the_version_is_the_same_everywhere() {
    let version = env!("CARGO_PKG_VERSION");
    let has = |file: &str, line: &str| assert!(text(file).contains(line), "{file}: {line}");
    for folder in test::OTHERS {
        has(
            &format!("{folder}/Cargo.toml"),
            &format!("\nversion = \"{version}\"\n"),
        );
    }
    has(
        "host-tools/python/pyproject.toml",
        &format!("\nversion = \"{version}\"\n"),
    );
    has("CITATION.cff", &format!("\nversion: {version}\n"));
    has("CHANGELOG.md", &format!("\n## {version}"));
    let manifest = text("Cargo.toml");
    let own = manifest
        .lines()
        .filter(|line| line.starts_with("tactus") && line.contains("version"));
    for line in own {
        assert!(line.contains(&format!("version = \"{version}\"")), "{line}");
    }
}
