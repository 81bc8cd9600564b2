//! What `--verbose` tells on standard error: files, choices, and the frames of the link.

use tracing::level_filters::LevelFilter;
use tracing_subscriber::filter::Targets;
use tracing_subscriber::fmt::time::uptime;
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

/// From now on it is told: nothing, files and choices, or frames too.
pub(crate) fn be_verbose(times: u8) {
    let level = match times {
        0 => return,
        1 => LevelFilter::INFO,
        _ => LevelFilter::DEBUG,
    };
    let told = tracing_subscriber::fmt::layer()
        .with_writer(std::io::stderr)
        .with_timer(uptime());
    // what libraries of others say is theirs
    let ours = Targets::new().with_target("tactus", level);
    tracing_subscriber::registry().with(told).with(ours).init();
}
