//! Shell completions and manual pages, made from the arguments themselves.

use std::io::{self, Write};
use std::path::Path;

use anyhow::Context as _;
use clap::CommandFactory as _;
use clap_complete::Shell;

use crate::cli::Tactus;

pub(crate) const COMPLETIONS: &str = "\
Examples:
  tactus completions bash > ~/.local/share/bash-completion/completions/tactus
  tactus completions zsh > ~/.zfunc/_tactus
  tactus completions fish > ~/.config/fish/completions/tactus.fish";

/// Writes completions for a shell.
pub(crate) fn completions(shell: Shell, out: &mut impl Write) {
    clap_complete::generate(shell, &mut Tactus::command(), "tactus", out);
}

/// Writes a page for every command into a folder, or the first one to `out`.
pub(crate) fn pages(folder: Option<&Path>, out: &mut impl Write) -> anyhow::Result<()> {
    let command = Tactus::command();
    match folder {
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
