//! How the samples of a file are read: its rate, its channel, its slides.

use std::borrow::Cow;
use std::ops::Range;

use tactus_core::features::Movement;

use super::columns::{Time, names, no_channel, rate_of, time};
use super::{Found, SLOW_HZ, STILL, WIDTH};
use crate::data::import::cut::{Parts, parts};
use crate::data::import::resample::{RATES_HZ, resample};
use crate::data::import::settings::{Named, Settings};
use crate::data::import::signals::{Piece, Signals};
use crate::data::recording::{LEAVE_OUT, PAC_RATE_HZ};

/// Samples of the slides into which longer sliding is divided: 3 s, and what a slow sensor can have in 20 s.
const LENGTH: usize = 6600;
const SLOW_LENGTH: usize = 2000;

/// How the samples of a file are read.
pub(super) struct How {
    pub(super) rate_hz: f64,
    /// the rate that the signal is resampled from; `None` where a sample stays a sample
    from_hz: Option<u32>,
    /// the column of time, and its unit that nothing says
    pub(super) unit: Option<(String, &'static str)>,
    /// before which samples some are missing
    gaps: Vec<usize>,
}

impl How {
    pub(super) fn new(signals: &Signals, settings: &Settings) -> Result<Self, String> {
        let time = time(signals, settings)?;
        let timed = time.as_ref().map(|time| rate_of(&time.times)).transpose();
        // a rate that is given takes the place of a time that stands
        let timed = match timed {
            Err(why) if settings.rate.is_none() => return Err(why),
            timed => timed.unwrap_or_default(),
        };
        let (timed, gaps) = timed.unzip();
        let Some(rate_hz) = settings.rate.or(timed).or(signals.rate_hz) else {
            return Err(format!(
                "no rate: give --rate HZ, or --time COLUMN; the columns of numbers are {}",
                names(signals)
            ));
        };
        if !(1.0..=*RATES_HZ.end()).contains(&rate_hz) {
            return Err(format!(
                "a rate of {rate_hz} Hz; it is 1 to {} Hz. Is the time in s? Its column's name may say ms or us, or \
                 give --rate HZ",
                RATES_HZ.end()
            ));
        }
        let from_hz = RATES_HZ
            .contains(&rate_hz)
            .then_some(rate_hz.round() as u32);
        let unit = |time: Time| Some((time.name, time.guessed?));
        Ok(Self {
            rate_hz,
            from_hz,
            unit: time.and_then(unit).filter(|_| settings.rate.is_none()),
            gaps: gaps.unwrap_or_default(),
        })
    }

    /// True if a file is of the same kind of sensor as another.
    pub(super) fn is_like(&self, first: &Self) -> bool {
        (self.rate_hz / first.rate_hz - 1.0).abs() <= 0.02
    }

    pub(super) fn look(
        &self,
        path: &str,
        named: &Named,
        signals: &Signals,
        channel: &str,
        settings: &Settings,
    ) -> Result<Vec<Found>, String> {
        let (name, all) = self::channel(signals, channel)?;
        if self.samples(all.len()) > MOST_SAMPLES {
            let hours = self.samples(all.len()) / self.out_hz() / 3600.0;
            return Err(format!("{hours:.1} h in one file; split it"));
        }
        let missing = signals.missing.get(name).into_iter().flatten();
        let mut gaps: Vec<usize> = missing.chain(&self.gaps).copied().collect();
        gaps.sort_unstable();
        let stretches = stretches(signals, settings, (path, named), all.len())?.into_iter();
        let found = stretches.map(|(named, rows)| {
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
            let place = |row: usize| gaps.partition_point(|gap| *gap < row);
            // a gap before all of a stretch is not in it
            let inside =
                gaps[place(rows.start + 1)..place(rows.end).max(place(rows.start + 1))].iter();
            let inside = inside.map(|gap| ((gap - rows.start) as f64 * scale) as usize);
            let inside: Vec<usize> = inside.collect();
            ranges.slides.retain(|range| {
                let first = inside.partition_point(|gap| *gap < range.start);
                inside.get(first).is_none_or(|gap| *gap >= range.end)
            });
            let part = |at: usize| at as f32 / out.len() as f32;
            let slides = ranges.slides.iter();
            Ok(Found {
                path: path.to_owned(),
                movement: movement(&named, settings)?,
                texture: named.texture,
                session: named.session,
                run: named.run,
                seconds: rows.len() as f64 / self.rate_hz,
                envelope: envelope(&out),
                slides: slides.map(|r| (part(r.start), part(r.end))).collect(),
                gaps: there - ranges.slides.len(),
                still: ranges.still.is_some(),
                peak: out.iter().fold(0.0, |most: f64, x| most.max(x.abs())),
                short: (self.samples(rows.len()) < LEAST as f64)
                    .then(|| LEAST as f64 / self.out_hz()),
                pressure: match &settings.pressure {
                    Some(column) => span(&self::channel(signals, column)?.1[rows.clone()]),
                    None => 0.0,
                },
                rows,
                ranges,
            })
        });
        found.collect()
    }

    /// Where the settings say that the finger slides, or where it seems to.
    fn ranges(&self, out: &[f64], settings: &Settings) -> Result<Parts, String> {
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
    ) -> Result<Vec<i16>, String> {
        let (_, all) = channel(signals, column)?;
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

/// A channel: its whole name, and its samples.
fn channel<'s>(signals: &'s Signals, wanted: &str) -> Result<(&'s str, &'s [f64]), String> {
    let found = signals.channel(wanted);
    found
        .map(|(name, samples)| (name.as_str(), samples.as_slice()))
        .ok_or_else(|| no_channel(signals, wanted))
}

/// The movement that a path or the settings say.
fn movement(named: &Named, settings: &Settings) -> Result<Movement, String> {
    let (force, speed) = (
        named.force.or(settings.force),
        named.speed.or(settings.speed),
    );
    Movement::partly(force, speed).map_err(|why| format!("{why}; {LEAVE_OUT}"))
}

/// Words, each with the row behind its last one in a row; `None` where no column says them.
type Runs<'s> = Option<Cow<'s, [(String, usize)]>>;

/// The columns of the texture and of the session.
fn labels<'s>(signals: &'s Signals, settings: &Settings) -> Result<[Runs<'s>; 2], String> {
    let runs = |column: &String| {
        let runs = signals.runs(column)?;
        Some(match runs.is_empty() {
            true => Err(format!(
                "column {column:?} has too many words for names of textures or sessions; name another"
            )),
            false => Ok(runs),
        })
    };
    let column = settings
        .texture
        .as_ref()
        .filter(|_| settings.pattern().is_none());
    let textures = column.map(|column| {
        runs(column).unwrap_or_else(|| {
            let words = signals.words.iter().map(|(name, _)| name.as_str());
            let words: Vec<&str> = words.collect();
            let words = if words.is_empty() {
                "none".to_owned()
            } else {
                words.join(", ")
            };
            Err(format!(
                "{}; the columns of words are {words}. To give all files this name, put them into a folder of it",
                no_channel(signals, column)
            ))
        })
    });
    let textures = textures.transpose()?;
    let sessions = settings.session.as_ref().and_then(runs).transpose()?;
    Ok([textures, sessions])
}

/// The recordings in a file with their rows: those that it tells apart, or where a column says another texture or
/// session.
fn stretches(
    signals: &Signals,
    settings: &Settings,
    (path, named): (&str, &Named),
    rows: usize,
) -> Result<Vec<(Named, Range<usize>)>, String> {
    let [textures, sessions] = labels(signals, settings)?;
    let both = [&textures, &sessions].into_iter().flatten();
    let mut cuts: Vec<usize> = both
        .flat_map(|runs| runs.iter().map(|(_, end)| *end))
        .collect();
    cuts.sort_unstable();
    cuts.dedup();
    let whole = [Piece {
        rows: 0..rows,
        ..Piece::default()
    }];
    let pieces = if signals.pieces.is_empty() {
        &whole[..]
    } else {
        &signals.pieces
    };
    let mut found = Vec::new();
    for piece in pieces {
        let Range { mut start, end } = piece.rows.clone();
        let inside =
            cuts.partition_point(|cut| *cut <= start)..cuts.partition_point(|cut| *cut < end);
        for end in cuts[inside.start..inside.end.max(inside.start)]
            .iter()
            .copied()
            .chain([end])
        {
            let at = |runs: &Runs<'_>| {
                let runs = runs.as_ref()?;
                let run = runs.get(runs.partition_point(|(_, behind)| *behind <= start))?;
                Some(run.0.clone())
            };
            let texture = at(&textures).or_else(|| piece.texture.clone());
            let session = at(&sessions).or_else(|| settings.session.clone());
            let session = session.or_else(|| piece.session.clone());
            let run = || {
                if named.run.is_empty() {
                    path
                } else {
                    &named.run
                }
                .to_owned()
            };
            let own = Named {
                texture: texture.unwrap_or_else(|| named.texture.clone()),
                session: session.unwrap_or_else(|| named.session.clone()),
                run: piece.run.clone().unwrap_or_else(run),
                ..named.clone()
            };
            if !own.texture.trim().is_empty() && start < end {
                found.push((own, start..end));
            }
            start = end;
        }
    }
    Ok(found)
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
