//! Shell completions and manual pages, made from the arguments themselves.

use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::Context as _;
use clap::Command;
use clap::builder::PossibleValuesParser;
use clap_complete::Shell;
use tactus::sim::collection::plain_name;
use tactus::sim::textures::TEXTURES;

/// Print completions for a shell: commands, options, and the textures of the simulated world
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus completions bash > ~/.local/share/bash-completion/completions/tactus
  tactus completions zsh > ~/.zfunc/_tactus
  tactus completions fish > ~/.config/fish/completions/tactus.fish")]
pub(crate) struct Completions {
    /// The shell
    shell: Shell,
}

/// Write the manual pages
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus man --out man && man man/tactus.1")]
pub(crate) struct Man {
    /// The folder to write; without it the first page is printed
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Writes completions of a command for a shell.
pub(crate) fn completions(
    args: &Completions,
    command: Command,
    out: &mut impl Write,
) -> io::Result<()> {
    let mut command = with_textures(command);
    // it panics where it cannot write, as into a pipe that nobody reads any more
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "tactus", &mut text);
    out.write_all(&text)
}

/// The command whose arguments for textures of the simulated world say which there are: for completion only, as they may also
/// be given by number, and with their real names.
fn with_textures(mut command: Command) -> Command {
    let below: Vec<String> = command
        .get_subcommands()
        .map(|below| below.get_name().to_owned())
        .collect();
    for name in below {
        command = command.mut_subcommand(name, with_textures);
    }
    for name in ["texture", "textures"] {
        if command
            .get_arguments()
            .any(|a| a.get_id() == name && a.get_long().is_some())
        {
            // clap wants them for as long as the program lasts, which is until they are printed
            let names = TEXTURES.iter().map(|t| &*plain_name(t.name).leak());
            command = command.mut_arg(name, |a| a.value_parser(PossibleValuesParser::new(names)));
        }
    }
    command
}

/// Writes a page for a command and each below it into a folder, or the first one to `out`.
pub(crate) fn pages(args: &Man, command: Command, out: &mut impl Write) -> anyhow::Result<()> {
    match &args.out {
        None => clap_mangen::Man::new(command).render(out)?,
        Some(folder) => {
            let write = || -> io::Result<()> {
                std::fs::create_dir_all(folder)?;
                clap_mangen::generate_to(command, folder)
            };
            write().with_context(|| folder.display().to_string())?;
            writeln!(out, "Try: man {}", folder.join("tactus.1").display())?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use tactus::sim::collection::texture_number;

    use super::*;

    #[test]
    fn every_texture_is_found_by_the_name_that_a_shell_completes() {
        for texture in TEXTURES {
            let plain = plain_name(texture.name);
            assert!(!plain.contains(|c: char| c != '-' && !c.is_alphanumeric()));
            assert_eq!(texture_number(&plain), Some(texture.number), "{plain}");
            assert_eq!(texture_number(texture.name), Some(texture.number));
        }
        assert_eq!(texture_number(""), None);
    }
}
