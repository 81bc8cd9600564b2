//! Progress of a run on stderr, for people.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

pub(crate) fn spinner(what: &'static str) -> ProgressBar {
    ticking(ProgressBar::new_spinner().with_message(what))
}

/// A bar up to `length`; `left` is the text behind its numbers, in indicatif's template language.
pub fn bar(what: &'static str, length: u64, left: &str) -> ProgressBar {
    let style =
        ProgressStyle::with_template(&format!("{{msg}} {{wide_bar}} {{pos}}/{{len}}{left}"))
            .unwrap_or_else(|_| ProgressStyle::default_bar());
    ticking(
        ProgressBar::new(length)
            .with_style(style)
            .with_message(what),
    )
}

fn ticking(bar: ProgressBar) -> ProgressBar {
    bar.enable_steady_tick(Duration::from_millis(200));
    bar
}
