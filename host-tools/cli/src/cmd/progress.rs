//! The bars that show how far a command is.

use std::borrow::Cow;
use std::fmt::Write;
use std::sync::OnceLock;
use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

/// Time left is told after so long, and when so much is done: before, it is a guess.
const KNOWN_AFTER: Duration = Duration::from_secs(2);
const KNOWN_SHARE: f32 = 0.05;

static QUIET: OnceLock<()> = OnceLock::new();

/// From now on no bar is shown.
pub(crate) fn be_quiet() {
    // a second time changes nothing
    let _ = QUIET.set(());
}

/// Whether nothing is to be shown but results and errors.
pub(crate) fn is_quiet() -> bool {
    QUIET.get().is_some()
}

/// Tells something beside the results, unless it is to be quiet.
pub(crate) fn notice(what: &str) {
    if !is_quiet() {
        eprintln!("{what}");
    }
}

/// A bar on the terminal; nothing where there is none, and with `--quiet`.
pub(crate) fn progress(length: u64, what: impl Into<Cow<'static, str>>) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(Some(length), ProgressDrawTarget::hidden());
    // a bar would be torn by the lines of --verbose
    if !is_quiet() && !tracing::enabled!(tracing::Level::INFO) {
        bar.set_draw_target(ProgressDrawTarget::stderr());
    }
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos} of {len} done{left}")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let left = |state: &ProgressState, out: &mut dyn Write| {
        if let Some(left) = left(state.elapsed(), state.fraction(), state.eta()) {
            // a bar without it is a bar, too
            let _ = write!(out, ", {:#} left", HumanDuration(left));
        }
    };
    bar.set_style(style.with_key("left", left));
    bar.set_message(what);
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}

/// How long it will still take, where that can be told.
fn left(elapsed: Duration, done: f32, eta: Duration) -> Option<Duration> {
    (elapsed >= KNOWN_AFTER && (KNOWN_SHARE..1.0).contains(&done)).then_some(eta)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_is_told_only_when_it_is_known() {
        let s = Duration::from_secs;
        for (elapsed, done, told) in [
            // at the beginning nothing is known, and at the end nothing is left
            (s(0), 0.0, false),
            (s(60), 0.0, false),
            (s(1), 0.5, false),
            (s(3), 0.5, true),
            (s(60), 1.0, false),
        ] {
            assert_eq!(
                left(elapsed, done, s(9)),
                told.then_some(s(9)),
                "{elapsed:?} {done}"
            );
        }
    }
}
