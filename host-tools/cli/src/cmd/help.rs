//! Help that fits terminals of any width, and the command that was meant by a wrong one.

use clap::error::{ContextKind, ContextValue};
use clap::{ArgMatches, Command};

use super::names::nearest;
use super::printed::say;

/// Columns of a narrow terminal.
const NARROW: usize = 80;

/// The words of the command line; ends the program where they are wrong, or ask for help.
pub(crate) fn parse(tactus: Command) -> ArgMatches {
    let tactus = flowing_help(tactus);
    tactus.clone().try_get_matches().unwrap_or_else(|mut why| {
        let is_near = why.get(ContextKind::SuggestedSubcommand).is_some();
        if let Some(ContextValue::String(wanted)) = why.get(ContextKind::InvalidSubcommand)
            && let Some(meant) = meant(wanted, &tactus).filter(|_| !is_near)
        {
            let meant = ContextValue::Strings(vec![meant]);
            why.insert(ContextKind::SuggestedSubcommand, meant);
        }
        if why.use_stderr() {
            // what was typed may be a name of others
            say(why.render().to_string().trim_end());
            std::process::exit(why.exit_code());
        }
        why.exit()
    })
}

/// The command of another group, such as `tactus device train` for `tactus train`.
fn meant(wanted: &str, tactus: &Command) -> Option<String> {
    let mut known = vec![(tactus.get_name().to_owned(), tactus)];
    let mut at = 0;
    while let Some((path, command)) = known.get(at).cloned() {
        let below = command.get_subcommands();
        known.extend(below.map(|command| (format!("{path} {}", command.get_name()), command)));
        at += 1;
    }
    let names: Vec<&str> = known
        .iter()
        .map(|(_, command)| command.get_name())
        .collect();
    let name = nearest(wanted, &names)?;
    let at = names.iter().position(|known| *known == name)?;
    Some(known.swap_remove(at).0)
}

/// A command and all below it, with texts that clap can wrap.
pub(crate) fn flowing_help(command: Command) -> Command {
    let about = command
        .get_long_about()
        .map(|text| flowing(&text.to_string()));
    let after = command
        .get_after_help()
        .map(|text| flowing(&text.to_string()));
    let command = command.mut_subcommands(flowing_help);
    let command = match about {
        Some(about) => command.long_about(about),
        None => command,
    };
    match after {
        Some(after) => command.after_help(after),
        None => command,
    }
}

/// A text with a line for each paragraph. Lines of examples stay; where one of a block is too wide, what they do stands
/// below them.
pub(crate) fn flowing(text: &str) -> String {
    let is_example = |line: &str| line.starts_with(' ');
    let is_prose = |line: &str| !line.is_empty() && !is_example(line);
    let lines: Vec<&str> = text.lines().collect();
    let blocks = lines.chunk_by(|a, b| {
        is_example(a) && is_example(b) || is_prose(a) && is_prose(b) && !a.ends_with(':')
    });
    let blocks = blocks.map(|block| {
        if !is_example(block[0]) {
            return block.join(" ");
        }
        let is_wide = block.iter().any(|line| line.chars().count() > NARROW);
        let lines =
            block.iter().map(
                |line| match line.trim_start().split_once("  ").filter(|_| is_wide) {
                    Some((command, does)) => format!("  {command}\n      {}", does.trim_start()),
                    None => (*line).to_owned(),
                },
            );
        lines.collect::<Vec<_>>().join("\n")
    });
    blocks.collect::<Vec<_>>().join("\n")
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory as _;

    use super::*;
    use crate::cmd::Tactus;

    #[test]
    fn no_help_breaks_a_sentence_where_its_next_word_fits() {
        fn check(command: &mut Command, seen: &mut usize) {
            for width in [NARROW, 100, 120] {
                let help = command
                    .clone()
                    .term_width(width)
                    .render_long_help()
                    .to_string();
                let lines: Vec<&str> = help.lines().collect();
                for line in lines.windows(2) {
                    let indented = |line: &str| line.len() - line.trim_start().len();
                    let word = line[1].split_whitespace().next().unwrap_or_default();
                    let goes_on = word.starts_with(char::is_lowercase) && word != "tactus";
                    let is_text = !line[0].trim().is_empty() && !line[0].ends_with([':', '.']);
                    let fits = line[0].chars().count() + 1 + word.chars().count() <= width;
                    let same = indented(line[0]) == indented(line[1]) && indented(line[0]) != 2;
                    let name = command.get_name();
                    assert!(
                        !(goes_on && is_text && fits && same),
                        "{name}, {width}: {line:?}"
                    );
                    let is_wide = line[0].chars().count() > width;
                    // which clap never breaks
                    let is_usage = line[0].starts_with("Usage");
                    assert!(!is_wide || is_usage, "{name}, {width}: {line:?}");
                    *seen += 1;
                }
            }
            command
                .get_subcommands_mut()
                .for_each(|command| check(command, seen));
        }
        let (mut tactus, mut seen) = (flowing_help(Tactus::command()), 0);
        tactus.build();
        check(&mut tactus, &mut seen);
        assert!(seen > 1000, "{seen} lines");
    }

    #[test]
    fn a_command_of_another_group_is_found() {
        for (wanted, found) in [
            ("train", Some("tactus device train")),
            ("moniter", Some("tactus device monitor")),
            ("push", Some("tactus device table push")),
            ("identfy", Some("tactus identify")),
            ("cheese", None),
        ] {
            assert_eq!(
                meant(wanted, &Tactus::command()).as_deref(),
                found,
                "{wanted}"
            );
        }
    }
}
