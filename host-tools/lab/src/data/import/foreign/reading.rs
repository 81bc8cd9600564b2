//! How the samples of a file are read: its rate, its channel, its slides.

use std::ops::Range;

use super::{Found, SLOW_HZ, STILL, WIDTH};
use crate::data::import::cut::{Parts, parts};
use crate::data::import::resample::{RATES_HZ, resample};
use crate::data::import::settings::{Named, Settings};
use crate::data::import::signals::Signals;
use crate::data::recording::PAC_RATE_HZ;

/// Names of columns of time.
const TIMES: [&str; 7] = [
    "time",
    "t",
    "timestamp",
    "seconds",
    "sec",
    "elapsed",
    "zeit",
];
/// Samples of the slides into which longer sliding is divided: 3 s, and what a slow sensor can have in 20 s.
const LENGTH: usize = 6600;
const SLOW_LENGTH: usize = 2000;

/// How the samples of a file are read.
pub(super) struct How {
    pub(super) rate_hz: f64,
    /// the rate that the signal is resampled from; `None` where a sample stays a sample
    from_hz: Option<u32>,
}

impl How {
    pub(super) fn new(signals: &Signals, settings: &Settings) -> std::result::Result<Self, String> {
        let timed = time(signals, settings)?
            .map(|(_, times)| rate_of(&times))
            .transpose()?;
        let rate = settings
            .rate
            .or(signals.rate_hz)
            .or(timed.map(|(rate, _)| rate));
        let Some(rate_hz) = rate else {
            let columns: Vec<&str> = signals
                .channels
                .iter()
                .map(|(name, _)| name.as_str())
                .collect();
            return Err(format!(
                "no rate: give --rate HZ, or --time COLUMN; the columns of numbers are {}",
                columns.join(", ")
            ));
        };
        if !(1.0..=*RATES_HZ.end()).contains(&rate_hz) {
            return Err(format!(
                "a rate of {rate_hz} Hz; it is 1 to {} Hz. Is the time in s? Its column's name may say ms or us",
                RATES_HZ.end()
            ));
        }
        let from_hz = RATES_HZ
            .contains(&rate_hz)
            .then_some(rate_hz.round() as u32);
        Ok(Self { rate_hz, from_hz })
    }

    pub(super) fn look(
        &self,
        path: &str,
        named: &Named,
        signals: &Signals,
        channel: &str,
        settings: &Settings,
    ) -> std::result::Result<Vec<Found>, String> {
        let own = Self::new(signals, settings)?;
        if (own.rate_hz / self.rate_hz - 1.0).abs() > 0.02 {
            return Err(format!(
                "{:.1} Hz, and the first file has {:.1} Hz: import files of one kind at a time, chosen by --texture \
                 \"{{texture}}/*_imu.csv\" and the like",
                own.rate_hz, self.rate_hz
            ));
        }
        let all = self::channel(signals, channel)?;
        if self.samples(all.len()) > MOST_SAMPLES {
            let hours = self.samples(all.len()) / self.out_hz() / 3600.0;
            return Err(format!("{hours:.1} h in one file; split it"));
        }
        let gaps = match time(signals, settings)? {
            Some((_, times)) => rate_of(&times)?.1,
            None => Vec::new(),
        };
        let stretches = stretches(signals, settings, named, all.len())?.into_iter();
        let found = stretches.map(|(texture, rows)| {
            // a stretch that is too short for a slide is not looked at: of a column of words there may be many
            let (out, mut ranges) = if self.samples(rows.len()) < LEAST as f64 {
                (about(&all[rows.clone()]), Parts::default())
            } else {
                let out = self.resampled(&all[rows.clone()]);
                let ranges = self.ranges(&out, settings)?;
                (out, ranges)
            };
            let there = ranges.slides.len();
            let scale = out.len() as f64 / rows.len() as f64;
            let inside = gaps.iter().filter_map(|gap| gap.checked_sub(rows.start));
            let inside: Vec<usize> = inside.map(|gap| (gap as f64 * scale) as usize).collect();
            ranges
                .slides
                .retain(|range| !inside.iter().any(|gap| range.contains(gap)));
            let part = |at: usize| at as f32 / out.len() as f32;
            let slides = ranges.slides.iter();
            let session = settings.session.as_ref().unwrap_or(&named.session);
            Ok(Found {
                path: path.to_owned(),
                texture,
                session: session.clone(),
                seconds: rows.len() as f64 / self.rate_hz,
                envelope: envelope(&out),
                slides: slides.map(|r| (part(r.start), part(r.end))).collect(),
                gaps: there - ranges.slides.len(),
                still: ranges.still.is_some(),
                peak: out.iter().fold(0.0, |most: f64, x| most.max(x.abs())),
                pressure: match &settings.pressure {
                    Some(column) => span(&self::channel(signals, column)?[rows.clone()]),
                    None => 0.0,
                },
                rows,
                ranges,
            })
        });
        found.collect()
    }

    /// Where the settings say that the finger slides, or where it seems to.
    fn ranges(&self, out: &[f64], settings: &Settings) -> std::result::Result<Parts, String> {
        let length = match (settings.length, self.from_hz) {
            (Some(seconds), _) => (seconds * self.out_hz()) as usize,
            (None, Some(_)) => LENGTH,
            (None, None) => SLOW_LENGTH,
        };
        let mut ranges = match settings.window()? {
            Some((from, to)) => {
                let at = |s: f64| ((s * self.out_hz()) as usize).min(out.len());
                Parts {
                    slides: Vec::from_iter(Some(at(from)..at(to))),
                    still: (at(from) >= STILL / 2).then_some(0..at(from)),
                }
            }
            None => parts(out, length.max(1), LEAST),
        };
        ranges.slides.retain(|range| range.len() >= LEAST);
        Ok(ranges)
    }

    /// Seconds of the sensor's clock in one of 2200 Hz.
    fn stretch(&self) -> f64 {
        match self.from_hz {
            Some(_) => 1.0,
            None => f64::from(PAC_RATE_HZ) / self.rate_hz,
        }
    }

    /// Samples of P_AC per second of the sensor's clock.
    fn out_hz(&self) -> f64 {
        f64::from(PAC_RATE_HZ) / self.stretch()
    }

    /// Samples of P_AC that so many rows become.
    fn samples(&self, rows: usize) -> f64 {
        rows as f64 * self.out_hz() / self.rate_hz
    }

    /// The signal about its mean, at 2200 Hz.
    fn resampled(&self, samples: &[f64]) -> Vec<f64> {
        match self.from_hz {
            Some(from_hz) => resample(&about(samples), from_hz, PAC_RATE_HZ),
            None => about(samples),
        }
    }

    pub(super) fn pac(
        &self,
        signals: &Signals,
        channel: &str,
        rows: Range<usize>,
        gain: f64,
    ) -> Vec<i16> {
        let all = signals.channel(channel).map_or(&[][..], |(_, all)| all);
        let out = self.resampled(all.get(rows).unwrap_or_default());
        // `as` saturates
        out.into_iter().map(|x| (x * gain).round() as i16).collect()
    }

    /// The rows that a part of P_AC, which has so many samples in all, was made of.
    pub(super) fn rows(&self, found: &Found, part: &Range<usize>, samples: usize) -> Range<usize> {
        let at = |sample: usize| found.rows.start + sample * found.rows.len() / samples.max(1);
        at(part.start)..at(part.end)
    }

    /// A slow column at [`SLOW_HZ`] of the resampled clock: the mean of what falls between two of its samples.
    pub(super) fn slow(
        &self,
        signals: &Signals,
        column: &str,
        found: &Found,
        gain: f64,
    ) -> std::result::Result<Vec<i16>, String> {
        let all = channel(signals, column)?;
        let values = all.get(found.rows.clone()).unwrap_or_default();
        let each = self.rate_hz * self.stretch() / f64::from(SLOW_HZ);
        let samples = (values.len() as f64 / each).ceil() as usize;
        let at = |n: usize| ((n as f64 * each) as usize).min(values.len() - 1);
        let mean = |n: usize| {
            let some = &values[at(n)..at(n + 1).max(at(n) + 1)];
            some.iter().sum::<f64>() / some.len() as f64
        };
        Ok((0..samples)
            .map(|n| (mean(n) * gain).round() as i16)
            .collect())
    }
}

/// A signal about its mean.
fn about(samples: &[f64]) -> Vec<f64> {
    let mean = samples.iter().sum::<f64>() / samples.len().max(1) as f64;
    samples.iter().map(|x| x - mean).collect()
}

/// The samples of a channel.
fn channel<'s>(signals: &'s Signals, wanted: &str) -> std::result::Result<&'s [f64], String> {
    signals
        .channel(wanted)
        .map(|(_, samples)| samples.as_slice())
        .ok_or_else(|| {
            let names: Vec<&str> = signals
                .channels
                .iter()
                .map(|(name, _)| name.as_str())
                .collect();
            format!("no channel {wanted:?}; there are {}", names.join(", "))
        })
}

/// The textures of a file: its own, or those that a column of words names, each with its rows.
fn stretches(
    signals: &Signals,
    settings: &Settings,
    named: &Named,
    rows: usize,
) -> std::result::Result<Vec<(String, Range<usize>)>, String> {
    let column = settings.texture.as_ref();
    let Some(column) = column.filter(|texture| !texture.contains(['{', '*'])) else {
        return Ok(vec![(named.texture.clone(), 0..rows)]);
    };
    let words = signals.words.iter().find(|(name, _)| name == column);
    let (_, words) = words.ok_or_else(|| format!("no column of words {column:?}"))?;
    if words.is_empty() {
        return Err(format!(
            "column {column:?} has too many words for names of textures; name another by --texture"
        ));
    }
    let begins = [0].into_iter().chain(words.iter().map(|(_, end)| *end));
    let runs = words.iter().zip(begins);
    let runs = runs.map(|((word, end), begin)| (word.clone(), begin..*end));
    Ok(runs.filter(|(word, _)| !word.is_empty()).collect())
}

/// The largest value of a signal that changes, else 0.
fn span(values: &[f64]) -> f64 {
    let ends = |(low, high): (f64, f64), x: &f64| (low.min(*x), high.max(*x));
    let (low, high) = values.iter().fold((f64::MAX, f64::MIN), ends);
    if high > low {
        low.abs().max(high.abs())
    } else {
        0.0
    }
}

/// Fewest samples of a slide: spectra of some frames.
pub(super) const LEAST: usize = 1100;
/// Most samples of P_AC of a file: two hours.
const MOST_SAMPLES: f64 = 7200.0 * PAC_RATE_HZ as f64;

/// The file's column of time, in s.
fn time(
    signals: &Signals,
    settings: &Settings,
) -> std::result::Result<Option<(String, Vec<f64>)>, String> {
    let is_time = |name: &str| {
        let name = name.to_lowercase();
        let word = name.split(['_', ' ', '(', '[']).next().unwrap_or_default();
        TIMES.contains(&word)
    };
    let column = match &settings.time {
        Some(time) => Some(
            signals
                .channel(time)
                .ok_or_else(|| format!("no column {time:?}"))?,
        ),
        None => signals.channels.iter().find(|(name, _)| is_time(name)),
    };
    Ok(column.map(|(name, values)| {
        let lower = name.to_lowercase();
        let has = |unit: &str| {
            lower
                .split(|c: char| !c.is_alphanumeric())
                .any(|part| part == unit)
        };
        let unit = match () {
            () if has("ns") => 1e-9,
            () if has("us") || has("µs") => 1e-6,
            () if has("ms") => 1e-3,
            () => 1.0,
        };
        (name.clone(), values.iter().map(|t| t * unit).collect())
    }))
}

/// Samples per second by their times, and before which of them some are missing.
fn rate_of(times: &[f64]) -> std::result::Result<(f64, Vec<usize>), String> {
    let mut steps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let gaps = steps.clone();
    steps.sort_by(f64::total_cmp);
    let middle = steps[steps.len() / 2];
    if middle <= 0.0 {
        return Err("its time does not go on; give --rate HZ instead".to_owned());
    }
    // samples that came in bursts have the right mean, and the median of a clock that jumps is not moved by it
    let usual: Vec<f64> = gaps
        .iter()
        .copied()
        .filter(|s| (0.0..3.0 * middle).contains(s))
        .collect();
    let mean = usual.iter().sum::<f64>() / usual.len() as f64;
    let jumps = gaps
        .iter()
        .enumerate()
        .filter(|(_, s)| !(0.0..=3.0 * middle).contains(*s));
    Ok((1.0 / mean, jumps.map(|(at, _)| at + 1).collect()))
}

/// The channel that changes most from sample to sample, in parts of its range.
pub(super) fn liveliest(
    signals: &Signals,
    settings: &Settings,
) -> std::result::Result<String, String> {
    let time = time(signals, settings)?.map(|(name, _)| name);
    let slow = [&time, &settings.pressure, &settings.shear];
    let others = signals
        .channels
        .iter()
        .filter(|(name, _)| !slow.contains(&&Some(name.clone())));
    let energy = |samples: &[f64]| {
        samples
            .windows(2)
            .map(|p| (p[1] - p[0]).powi(2))
            .sum::<f64>()
    };
    let best = others.max_by(|(_, a), (_, b)| energy(a).total_cmp(&energy(b)));
    best.map(|(name, _)| name.clone())
        .ok_or_else(|| "no column of numbers beside the time".to_owned())
}

/// Two digits, rounded down.
pub(super) fn rounded(gain: f64) -> f64 {
    let scale = 10_f64.powf(gain.log10().floor() - 1.0);
    (gain / scale).floor() * scale
}

fn envelope(out: &[f64]) -> Vec<f32> {
    let each = out.len().div_ceil(WIDTH).max(1);
    let powers: Vec<f64> = out
        .chunks(each)
        .map(|part| (part.iter().map(|x| x * x).sum::<f64>() / part.len() as f64).sqrt())
        .collect();
    let most = powers.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    powers
        .into_iter()
        .map(|power| (power / most) as f32)
        .collect()
}
