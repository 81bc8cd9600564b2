//! `cargo xtask docs`: the book, its generated parts, and their test.
use anyhow::{Result, ensure};
use clap::Args;

use crate::bundle::printed;
use crate::emulate::workspace;
use crate::shell::{root, run, target};

pub(crate) const EXAMPLES: &str = "\
Examples:
  cargo xtask docs            the book as pages, in target/book (needs mdBook)
  cargo xtask docs --check    links, commands, outputs, recordings and generated tables, without mdBook
  cargo xtask docs --write    writes outputs, recordings and tables again
  cargo xtask docs --parts    the printed parts as STL, in target/hardware (needs OpenSCAD)";

#[derive(Args)]
pub(crate) struct Options {
    /// Check README and book instead of building pages
    #[arg(long, conflicts_with = "write")]
    check: bool,
    /// Write what is generated from the code instead of building pages
    #[arg(long)]
    write: bool,
    /// Make the printed parts instead
    #[arg(long, conflicts_with_all = ["check", "write"])]
    parts: bool,
}

pub(crate) fn docs(options: &Options) -> Result<()> {
    if options.parts {
        printed::lacks()?;
        let folder = target().join("hardware");
        std::fs::create_dir_all(&folder)?;
        for name in printed::all(&folder)?.into_keys() {
            println!("{}", folder.join(name).display());
        }
        return Ok(());
    }
    if options.check || options.write {
        return parts(options.write);
    }
    let mdbook = || std::process::Command::new("mdbook");
    ensure!(
        mdbook().arg("--version").output().is_ok(),
        "mdBook is not installed: cargo install mdbook --locked"
    );
    let pages = target().join("book");
    run(mdbook()
        .arg("build")
        .arg(root().join("docs"))
        .arg("--dest-dir")
        .arg(&pages))?;
    println!("{}", pages.join("index.html").display());
    Ok(())
}

fn parts(write: bool) -> Result<()> {
    // outputs and plots are made from the recordings that one of the tests writes
    let all = ["book::the_recordings", "book::"];
    for filter in &all[usize::from(!write)..] {
        let mut test = workspace("test");
        test.args(["--test", "documents", filter]);
        if write {
            // one after the other: two of them may write one page
            test.env("TACTUS_BOOK", "write")
                .args(["--", "--test-threads", "1"]);
        }
        run(&mut test)?;
    }
    Ok(())
}
