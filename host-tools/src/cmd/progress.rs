//! The bars that show how far a command is.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// A bar on the terminal; nothing where there is none.
pub(crate) fn progress(length: u64, what: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len}, {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(length)
        .with_style(style)
        .with_message(what);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Does work with a bar: the work calls the function that it is given, `length` times.
pub(crate) fn with_progress<T, E>(
    length: u64,
    what: &'static str,
    work: impl FnOnce(&(dyn Fn() + Sync)) -> Result<T, E>,
) -> Result<T, E> {
    let bar = progress(length, what);
    let done = work(&|| bar.inc(1))?;
    bar.finish_and_clear();
    Ok(done)
}
