//! The paper's exploration written for numpy (`oracle/evaluate.py`): without a fixed point or the core's kernels, for
//! figures and for speed.
use std::path::Path;
use std::process::Command;

/// What it came to.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Found {
    /// Right answers, 0 to 1.
    pub accuracy: f64,
    /// Share of the runs that were sure.
    pub sure: f64,
    /// Median of slides.
    pub median: f64,
    /// Runs a second, without the reading.
    pub runs_per_second: f64,
}

/// Plays so many runs on a file of properties.
///
/// # Errors
/// There is no python3 with numpy.
///
/// # Panics
/// The program fails, or prints something else.
pub fn evaluate(file: &Path, runs: u64) -> Result<Found, &'static str> {
    let python = || Command::new("python3");
    let has = python().args(["-c", "import numpy"]).output();
    if !has.is_ok_and(|has| has.status.success()) {
        return Err("no python3 with numpy (apt-get install python3-numpy)");
    }
    let oracle = concat!(env!("CARGO_MANIFEST_DIR"), "/core/oracle/evaluate.py");
    let mut play = python();
    play.arg(oracle).arg(file).arg(runs.to_string());
    let played = play.output().expect("python3 can be started");
    assert!(played.status.success(), "{played:?}");
    let told = String::from_utf8_lossy(&played.stdout);
    let of = |what| {
        let mut words = told.split_whitespace().skip_while(|word| *word != what);
        let number = words.nth(1).and_then(|number| number.parse().ok());
        number.unwrap_or_else(|| panic!("no {what} in {told:?}"))
    };
    Ok(Found {
        accuracy: of("accuracy"),
        sure: of("sure"),
        median: of("median"),
        runs_per_second: of("runs_per_second"),
    })
}
