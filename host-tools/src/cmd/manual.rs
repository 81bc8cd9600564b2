//! Shell completions and manual pages, made from the arguments themselves.

use std::io::{self, Write};
use std::path::PathBuf;

use anyhow::Context as _;
use clap::Command;
use clap_complete::Shell;

/// Print completions for a shell
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
    mut command: Command,
    out: &mut impl Write,
) -> io::Result<()> {
    // it panics where it cannot write, as into a pipe that nobody reads any more
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "tactus", &mut text);
    out.write_all(&text)
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
