//! Shell completions and manual pages, made from the arguments themselves.

use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::Context as _;
use clap::builder::PossibleValuesParser;
use clap::{Arg, Command};
use clap_complete::Shell;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::sim::collection::plain_name;
use tactus_world::textures::TEXTURES;

use super::table_file::read_table;

/// Print completions for a shell: commands, options and textures
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  tactus completions bash > ~/.local/share/bash-completion/completions/tactus
  tactus completions zsh > ~/.zfunc/_tactus
  tactus completions fish > ~/.config/fish/completions/tactus.fish
Those of the simulated world are always completed. Of recordings, and of a probe, they are as they are now:
  tactus device table pull probe.tact
  tactus completions bash --recordings DIR --table probe.tact > ~/.local/share/bash-completion/completions/tactus")]
pub(crate) struct Completions {
    /// The shell
    shell: Shell,
    /// Complete the names of these recordings, too, for --material
    #[arg(long, value_name = "DIR")]
    recordings: Option<PathBuf>,
    /// And those of this table, for `tactus device`
    #[arg(long, value_name = "FILE")]
    table: Option<PathBuf>,
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
) -> anyhow::Result<()> {
    let plain = |names: &mut dyn Iterator<Item = &str>| names.map(plain_name).collect();
    let recorded: Vec<String> = match &args.recordings {
        Some(folder) => {
            let set = RecordingSet::open(folder)?;
            plain(&mut set.textures().iter().map(|t| &t.name[..]))
        }
        None => Vec::new(),
    };
    let mut bytes = Vec::new();
    let of_probe = match &args.table {
        Some(file) => plain(&mut read_table(file, &mut bytes)?.names()),
        None => Vec::new(),
    };
    let simulated = plain(&mut TEXTURES.iter().map(|t| t.name));
    let mut command = with_textures(command, &|path, argument| match (
        path,
        argument.get_id().as_str(),
    ) {
        // those of `device record` have any names
        (_, "texture" | "textures") if argument.get_long().is_some() => &simulated,
        (_, "material") => &recorded,
        (["device", ..], "among" | "name" | "from" | "forgotten") => &of_probe,
        _ => &[],
    });
    // it panics where it cannot write, as into a pipe that nobody reads any more
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "tactus", &mut text);
    Ok(out.write_all(&text)?)
}

/// Textures that an argument of a command, which is named from the first word behind the program's on, may be one of.
type Known<'k> = dyn Fn(&[&str], &Arg) -> &'k [String] + 'k;

/// The command whose arguments for textures say which there are: for completion only, as they may also be given by number, and
/// with their real names.
fn with_textures(command: Command, known: &Known<'_>) -> Command {
    below(command, &[], known)
}

/// The same for a command under these.
fn below(mut command: Command, path: &[&str], known: &Known<'_>) -> Command {
    let names = |subcommand: &Command| subcommand.get_name().to_owned();
    for name in command.get_subcommands().map(names).collect::<Vec<_>>() {
        let path = [path, &[&name]].concat();
        command = command.mut_subcommand(&name, |under| below(under, &path, known));
    }
    let arguments = command.get_arguments();
    let arguments: Vec<_> = arguments
        .map(|a| (a.get_id().clone(), known(path, a)))
        .collect();
    for (argument, textures) in arguments {
        if !textures.is_empty() {
            // clap wants them for as long as the program lasts, which is until they are printed
            let textures = textures.iter().map(|name| &*name.clone().leak());
            let parser = PossibleValuesParser::new(textures);
            command = command.mut_arg(argument, |a| a.value_parser(parser));
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
