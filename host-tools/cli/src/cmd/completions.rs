//! `tactus completions`: completions for a shell, made from the arguments themselves.

use std::io::Write;

use clap::builder::PossibleValuesParser;
use clap::{Arg, Command};
use clap_complete::Shell;
use tactus_lab::sim::collection::plain_name;
use tactus_world::textures::TEXTURES;

/// Print completions for a shell: commands, options and the textures of the simulated world
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus completions bash > ~/.local/share/bash-completion/completions/tactus
  tactus completions zsh > ~/.zfunc/_tactus
  tactus completions fish > ~/.config/fish/completions/tactus.fish")]
pub(crate) struct Args {
    /// The shell
    shell: Shell,
}

/// Writes completions of a command for a shell.
pub(crate) fn run(args: &Args, command: Command, out: &mut impl Write) -> anyhow::Result<()> {
    // clap wants the names for as long as the program lasts, which is until they are printed
    let names = TEXTURES.iter().map(|t| &*plain_name(t.name).leak());
    let mut command = with_textures(command, &PossibleValuesParser::new(names));
    // it panics where it cannot write, as into a pipe that nobody reads any more
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "tactus", &mut text);
    Ok(out.write_all(&text)?)
}

/// Returns the command with `textures` as the values of each option that takes some of the simulated world: for
/// completion only, as they may also be given by number, and with their real names.
fn with_textures(mut command: Command, textures: &PossibleValuesParser) -> Command {
    let names = |subcommand: &Command| subcommand.get_name().to_owned();
    for name in command.get_subcommands().map(names).collect::<Vec<_>>() {
        command = command.mut_subcommand(&name, |under| with_textures(under, textures));
    }
    // those of `device record` have any names
    let is_texture = |argument: &&Arg| {
        let id = argument.get_id().as_str();
        argument.get_long().is_some() && matches!(id, "texture" | "textures")
    };
    let arguments = command.get_arguments().filter(is_texture);
    for argument in arguments.map(|a| a.get_id().clone()).collect::<Vec<_>>() {
        command = command.mut_arg(argument, |a| a.value_parser(textures.clone()));
    }
    command
}

#[cfg(test)]
mod tests {
    use tactus_lab::sim::collection::texture_number;

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
