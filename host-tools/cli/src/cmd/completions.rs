//! `tactus completions`: completions for a shell, made from the arguments themselves.

use std::io::Write;

use clap_complete::Shell;

/// Print completions for a shell
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

pub(crate) fn run(
    args: &Args,
    mut tactus: clap::Command,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    // it panics where it cannot write, as into a pipe that nobody reads any more
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut tactus, "tactus", &mut text);
    Ok(out.write_all(&text)?)
}
