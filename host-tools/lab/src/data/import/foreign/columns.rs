//! Which column of a file is which: the time and its unit, and the vibration.

use crate::data::import::settings::Settings;
use crate::data::import::signals::{Signals, bare, unit};

/// Names of columns of time.
const TIMES: [&str; 14] = [
    "time",
    "t",
    "timestamp",
    "timestamps",
    "seconds",
    "sec",
    "elapsed",
    "zeit",
    "uhrzeit",
    "datetime",
    "date",
    "ts",
    "ms",
    "us",
];
/// Words in names of columns of vibration.
const LIVELY: [&str; 15] = [
    "acc",
    "accel",
    "acceleration",
    "beschleunigung",
    "vib",
    "vibration",
    "mic",
    "audio",
    "piezo",
    "ax",
    "ay",
    "az",
    "x",
    "y",
    "z",
];
/// Words in names of columns of anything else.
const SLOW: [&str; 24] = [
    "force",
    "load",
    "pressure",
    "pdc",
    "shear",
    "temp",
    "temperature",
    "position",
    "speed",
    "velocity",
    "current",
    "battery",
    "count",
    "counter",
    "index",
    "sample",
    "label",
    "class",
    "id",
    "trial",
    "session",
    "run",
    "frame",
    "seq",
];
/// Units of time, and their seconds.
const UNITS: [(&str, f64); 4] = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];
/// Lowest rate of a sensor of vibration that a column of whole numbers without a unit may give, Hz.
const LEAST_HZ: f64 = 25.0;

fn words(name: &str) -> Vec<String> {
    let name = name.to_lowercase();
    let words = name.split(|c: char| !c.is_alphabetic() && c != 'µ');
    words.map(str::to_owned).collect()
}

/// Time as a file has it.
pub(super) struct Time {
    pub(super) name: String,
    /// s
    pub(super) times: Vec<f64>,
    /// The unit that was not said.
    pub(super) guessed: Option<&'static str>,
}

/// The file's column of time.
pub(super) fn time(signals: &Signals, settings: &Settings) -> Result<Option<Time>, String> {
    let column = match &settings.time {
        Some(time) => {
            let column = signals.channel(time);
            Some(column.ok_or_else(|| no_channel(signals, time))?)
        }
        None => {
            let is_time = |name: &str| TIMES.contains(&&*words(name)[0]);
            let mut named = signals.channels.iter().filter(|(name, _)| is_time(name));
            // a day is no time of it
            let goes_on = |values: &[f64]| values.windows(2).any(|pair| pair[0] != pair[1]);
            let named = named.find(|(_, values)| goes_on(values));
            named.or_else(|| unnamed(signals))
        }
    };
    Ok(column.map(|(name, values)| {
        let (scale, guessed) = scale(name, values);
        Time {
            name: name.clone(),
            times: values.iter().map(|t| t * scale).collect(),
            guessed,
        }
    }))
}

/// A first column without a name that rises by equal parts.
fn unnamed(signals: &Signals) -> Option<&(String, Vec<f64>)> {
    let first = signals.channels.first();
    let first = first.filter(|(name, _)| name == "1" && signals.channels.len() > 1)?;
    let steps = first.1.windows(2).map(|pair| pair[1] - pair[0]);
    let ends = |(low, high): (f64, f64), s: f64| (low.min(s), high.max(s));
    let (low, high) = steps.fold((f64::MAX, f64::MIN), ends);
    // numbers from 1 on count the samples
    (low > 0.0 && high < 1.5 * low && (low, high) != (1.0, 1.0)).then_some(first)
}

/// Seconds in the unit of a column of time, and that unit where nothing says it.
fn scale(name: &str, values: &[f64]) -> (f64, Option<&'static str>) {
    let said = |word: &String| {
        Some(match word.as_str() {
            "ns" | "nanoseconds" | "nanos" => 1e-9,
            "us" | "µs" | "μs" | "microseconds" | "micros" => 1e-6,
            "ms" | "milliseconds" | "millis" | "msec" => 1e-3,
            "s" | "sec" | "seconds" => 1.0,
            _ => return None,
        })
    };
    let unit = unit(name).map(words).unwrap_or_default();
    if let Some(scale) = unit.iter().chain(&words(name)).find_map(said) {
        return (scale, None);
    }
    // since 1970
    let largest = values.iter().copied().fold(0.0, f64::max);
    let by_size = [1e8, 1e11, 1e14, 1e17]
        .iter()
        .rposition(|least| largest > *least);
    let mut steps: Vec<f64> = steps(values).filter(|step| *step > 0.0).collect();
    steps.sort_by(f64::total_cmp);
    let middle = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    let whole = middle >= 1.0 && values.iter().all(|t| t.fract() == 0.0);
    let fast = |(_, scale): &(&str, f64)| whole && 1.0 / (middle * scale) >= LEAST_HZ;
    let by_steps = || UNITS.iter().position(fast);
    let (unit, scale) = UNITS[by_size.or_else(by_steps).unwrap_or(0)];
    (scale, Some(unit))
}

fn steps(times: &[f64]) -> impl Iterator<Item = f64> {
    times.windows(2).map(|pair| pair[1] - pair[0])
}

/// Samples per second by their times, and before which of them some are missing.
pub(super) fn rate_of(times: &[f64]) -> Result<(f64, Vec<usize>), String> {
    let stands = || "its time does not go on; give --rate HZ instead".to_owned();
    let mut rising: Vec<f64> = steps(times).filter(|step| *step > 0.0).collect();
    rising.sort_by(f64::total_cmp);
    let middle = rising.get(rising.len() / 2).copied().ok_or_else(stands)?;
    // samples that came in bursts have the right mean, and the median of a clock that jumps is not moved by it
    let usual = |step: &f64| (0.0..3.0 * middle).contains(step);
    let (sum, count) = steps(times)
        .filter(usual)
        .fold((0.0, 0_usize), |(sum, n), step| (sum + step, n + 1));
    if 2 * count < times.len() {
        return Err(stands());
    }
    let jumps = (1..).zip(steps(times)).filter(|(_, step)| !usual(step));
    let rate = count as f64 / sum;
    // the times are rounded, a clock is not
    let whole = rate.round();
    let rate = if (rate - whole).abs() < 1e-6 * whole {
        whole
    } else {
        rate
    };
    Ok((rate, jumps.map(|(at, _)| at).collect()))
}

/// The channels that may be the vibration, the liveliest first: by their names, then by how much they bend.
pub(super) fn lively(signals: &Signals, settings: &Settings) -> Result<Vec<String>, String> {
    let time = time(signals, settings)?.map(|time| time.name);
    let slow = [&settings.pressure, &settings.shear].into_iter().flatten();
    let slow = slow.filter_map(|name| Some(signals.channel(name)?.0.as_str()));
    let slow: Vec<&str> = slow.chain(time.as_deref()).collect();
    // a session may be called 1, as a channel
    let labels = [&settings.texture, &settings.session].into_iter().flatten();
    let labels: Vec<&String> = labels.collect();
    let is_other = |name: &str| {
        slow.contains(&name)
            || labels
                .iter()
                .any(|word| bare(name).eq_ignore_ascii_case(word))
    };
    let rank = |name: &str| {
        let words = words(bare(name));
        let is = |of: &[&str]| words.iter().any(|word| of.contains(&word.as_str()));
        if is(&SLOW) {
            0
        } else {
            1 + i32::from(is(&LIVELY))
        }
    };
    let mut found: Vec<(i32, f64, &str)> = Vec::new();
    for (name, samples) in &signals.channels {
        let bends = samples
            .windows(3)
            .map(|s| (s[2] - 2.0 * s[1] + s[0]).powi(2));
        let bend: f64 = bends.sum();
        let scale = samples.iter().fold(0.0, |most: f64, x| most.max(x.abs()));
        // a signal that stands or counts does not bend
        if !is_other(name) && bend > 1e-18 * scale * scale * samples.len() as f64 {
            found.push((rank(name), bend, name));
        }
    }
    found.sort_by(|a, b| b.0.cmp(&a.0).then(b.1.total_cmp(&a.1)));
    let best = found
        .first()
        .map(|(rank, ..)| *rank)
        .ok_or("no channel in it ever changes: is the sensor connected?")?;
    let best = found.into_iter().take_while(|(rank, ..)| *rank == best);
    Ok(best.map(|(_, _, name)| name.to_owned()).collect())
}

/// There is no such channel.
pub(super) fn no_channel(signals: &Signals, wanted: &str) -> String {
    format!(
        "no channel or column of numbers {wanted:?}; there are {}",
        names(signals)
    )
}

/// The names of all channels.
pub(super) fn names(signals: &Signals) -> String {
    let names = signals.channels.iter().map(|(name, _)| name.as_str());
    names.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_by_rounded_times_are_whole() {
        for rate in [100.0, 500.0, 1600.0, 2200.0, 44_100.0] {
            let times = |n: u32| (f64::from(n) / rate * 1e6).round() / 1e6;
            let times: Vec<f64> = (0..rate as u32 + 1).map(times).collect();
            assert_eq!(rate_of(&times), Ok((rate, Vec::new())));
        }
        // bursts of four, and a jump before the last one
        let bursts = [0.0, 0.0, 0.0, 0.0, 0.4, 0.4, 0.4, 0.4, 0.8, 9.0];
        assert_eq!(rate_of(&bursts).unwrap(), (10.0, vec![9]));
        assert!(
            rate_of(&[1.0, 1.0, 1.0])
                .unwrap_err()
                .contains("does not go on")
        );
    }
}
