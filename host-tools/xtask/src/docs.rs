//! `cargo xtask docs`: the book, its generated parts, and their test.
use anyhow::{Result, ensure};
use clap::Args;

use crate::shell::{cargo, root, run, target};
use crate::{emulate, timeline};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask docs            the book as pages, in target/book (needs mdBook)
  cargo xtask docs --check    links, commands, outputs, recordings and generated tables, without mdBook
  cargo xtask docs --write    writes outputs, recordings, tables and the moving picture again
  cargo xtask docs --scope    draws the oscilloscope's pictures again, from the pins of the emulated board
  cargo xtask docs --timeline draws what each second goes to, on emulated boards";

#[derive(Args)]
pub(crate) struct Options {
    /// Check README and book instead of building pages
    #[arg(long, conflicts_with = "write")]
    check: bool,
    /// Write what is generated from the code instead of building pages
    #[arg(long)]
    write: bool,
    /// Draw the oscilloscope's pictures again; builds firmware and emulator
    #[arg(long, conflicts_with_all = ["check", "write"])]
    scope: bool,
    /// Draw what each second goes to again; builds firmware and emulator
    #[arg(long, conflicts_with_all = ["check", "write", "scope"])]
    timeline: bool,
}

pub(crate) fn docs(options: &Options) -> Result<()> {
    if options.scope {
        let pages = root().join("docs/src");
        return emulate::start("scope", &["--out".into(), pages.into()]);
    }
    if options.timeline {
        let picture = root().join("docs/src/timeline.svg");
        return timeline::timeline(&picture.to_string_lossy(), &[]);
    }
    if options.check || options.write {
        // outputs, plots, and the page of bad input are made from the recordings that one of the book's tests writes
        let all = [
            ("documents", "book::the_recordings"),
            ("documents", "book::"),
            ("command", "bad_input::"),
        ];
        let begin = usize::from(!options.write);
        for (name, filter) in &all[begin..] {
            let mut test = cargo();
            test.args(["test", "--package", "tactus-probe", "--test", name, filter]);
            if options.write {
                // one after the other: two of them may write one page
                test.env("TACTUS_BOOK", "write")
                    .args(["--", "--test-threads", "1"]);
            }
            run(&mut test)?;
        }
        return Ok(());
    }
    let mdbook = || std::process::Command::new("mdbook");
    ensure!(
        mdbook().arg("--version").output().is_ok(),
        "mdBook is not installed: cargo install mdbook --locked"
    );
    run(mdbook()
        .arg("build")
        .arg(root().join("docs"))
        .arg("--dest-dir")
        .arg(target().join("book")))?;
    println!("{}", target().join("book/index.html").display());
    Ok(())
}
