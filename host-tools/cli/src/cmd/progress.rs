//! The bars that show how far a command is.

use std::borrow::Cow;
use std::sync::OnceLock;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::printed::say;

static QUIET: OnceLock<()> = OnceLock::new();

pub(crate) fn be_quiet() {
    // a second time changes nothing
    let _ = QUIET.set(());
}

/// Returns true if only results and errors are shown.
pub(crate) fn is_quiet() -> bool {
    QUIET.get().is_some()
}

/// Tells something beside the results, unless it is to be quiet.
pub(crate) fn notice(what: &str) {
    if !is_quiet() {
        say(what);
    }
}

/// A bar on the terminal; nothing where there is none, and with `--quiet`.
pub(crate) fn progress(length: u64, what: impl Into<Cow<'static, str>>) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::hidden());
    if !is_quiet() {
        bar.set_draw_target(ProgressDrawTarget::stderr());
    }
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos} of {len} done, {eta} left");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.set_message(what);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// Does work with a bar: the work calls the function that it is given, `length` times.
pub(crate) fn with_progress<T, E>(
    length: u64,
    what: impl Into<Cow<'static, str>>,
    work: impl FnOnce(&(dyn Fn() + Sync)) -> Result<T, E>,
) -> Result<T, E> {
    let bar = progress(length, what);
    let done = work(&|| bar.inc(1))?;
    bar.finish_and_clear();
    Ok(done)
}
