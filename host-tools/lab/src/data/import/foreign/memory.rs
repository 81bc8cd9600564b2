//! Signals and files in memory as recordings: an import without a file system.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::paths::paths_named;
use super::reading::LEAST;
use super::{Source, Survey};
use crate::data::import::resample::RATES_HZ;
use crate::data::import::settings::{Named, Settings};
use crate::data::import::signals::Signals;
use crate::data::recording::PAC_RATE_HZ;
use crate::data::recordings::{RecordingError, RecordingSet, Result};

/// What stands for a folder in the errors of recordings in memory.
pub(super) const FOLDER: &str = "arrays";

/// One recording in memory.
#[derive(Clone, Debug)]
pub struct InMemory {
    signals: Signals,
    /// The path of a file, empty for an array.
    pub(super) path: String,
    /// Its texture.
    pub texture: String,
    /// Its session and its run; empty if unknown.
    pub session: String,
    /// See [`session`](Self::session).
    pub run: String,
}

impl InMemory {
    /// A recording from an array of one or two dimensions, in the order of its rows: samples, or samples and channels.
    /// Errors: it has another shape, or a value is no number.
    pub fn new(shape: &[usize], data: Vec<f64>) -> std::result::Result<Self, String> {
        if let Some(at) = data.iter().position(|sample| !sample.is_finite()) {
            let wrong = data[at];
            return Err(format!(
                "value {at} is {wrong}, which nobody measured; cut it out"
            ));
        }
        let samples_of = |channel: usize, channels: usize| -> Vec<f64> {
            data.iter()
                .skip(channel)
                .step_by(channels)
                .copied()
                .collect()
        };
        let channels = match *shape {
            [_] => 1,
            [samples, channels] if (1..=samples).contains(&channels) => channels,
            _ => {
                return Err(format!(
                    "an array of shape {shape:?}; give (samples,), or (samples, channels)"
                ));
            }
        };
        let channel = |c: usize| ((c + 1).to_string(), samples_of(c, channels));
        Ok(Self {
            signals: Signals {
                channels: (0..channels).map(channel).collect(),
                kind: "array",
                ..Signals::default()
            },
            path: String::new(),
            texture: String::new(),
            session: String::new(),
            run: String::new(),
        })
    }

    /// Number of its channels.
    pub fn channels(&self) -> usize {
        self.signals.channels.len()
    }
}

impl Survey {
    /// Looks at signals in memory, of which the settings say the rate; those shorter than a slide are left out.
    /// Errors: as [`Survey::of`]; a texture has none that is long enough.
    pub fn of_memory(all: Vec<InMemory>, settings: Settings) -> Result<Self> {
        settings.check().map_err(RecordingError::said)?;
        let short = too_short(&all, &settings);
        let paths = (0..).zip(&all).filter(|(at, _)| !short.contains_key(at));
        let paths: Vec<_> = paths.map(|(at, one)| (name(at), named(one))).collect();
        let has = |texture: &str| paths.iter().any(|(_, named)| named.texture == texture);
        if let Some((_, why)) = short.iter().find(|(at, _)| !has(&all[**at].texture)) {
            return Err(RecordingError::said(why.clone()));
        }
        Self::look(Source::Memory(all.into()), &paths, settings, &|_, _| ())
    }

    /// Looks at the bytes of files, each with its path, as [`Survey::of`] does at those below a folder.
    /// Errors: as there.
    pub fn of_files(files: Vec<(String, Vec<u8>)>, settings: Settings) -> Result<Self> {
        settings.check().map_err(RecordingError::said)?;
        let (mut all, mut left_out) = (Vec::new(), Vec::new());
        for (path, bytes) in files {
            match Signals::of(&bytes) {
                Ok(signals) => all.push(InMemory {
                    signals,
                    path,
                    texture: String::new(),
                    session: String::new(),
                    run: String::new(),
                }),
                Err(why) => left_out.push(format!("{path}: {why}")),
            }
        }
        let paths = all.iter().map(|one| one.path.clone()).collect();
        let paths = paths_named(paths, &settings);
        if let (true, Some(why)) = (paths.is_empty(), left_out.first()) {
            return Err(RecordingError::said(why.clone()));
        }
        let mut survey = Self::look(Source::Memory(all.into()), &paths, settings, &|_, _| ())?;
        survey.left_out.extend(left_out);
        Ok(survey)
    }

    /// The slides as recordings in memory, and those that were left out, and why: those of a dead sensor, copies, those
    /// that are too short.
    /// Errors: no slide is left of a texture.
    pub fn recordings(&self) -> Result<(RecordingSet, Vec<String>)> {
        let mut slides: Vec<Vec<_>> = self.textures.iter().map(|_| Vec::new()).collect();
        let mut left_out = match &self.source {
            Source::Memory(all) if self.source.is_arrays() => {
                too_short(all, &self.settings).into_values().collect()
            }
            _ => Vec::new(),
        };
        left_out.extend(self.each_slide(&mut |slide, labels| {
            slides[slide.texture].push((slide, labels));
            Ok(())
        })?);
        let all = self.texture_list().into_iter().zip(slides).collect();
        Ok((RecordingSet::in_memory(FOLDER.as_ref(), all), left_out))
    }
}

/// The recordings that are too short for a slide, by their places.
fn too_short(all: &[InMemory], settings: &Settings) -> BTreeMap<usize, String> {
    let rate_hz = settings.rate.unwrap_or_default();
    let wanted = match RATES_HZ.contains(&rate_hz) {
        true => (LEAST as f64 * rate_hz / f64::from(PAC_RATE_HZ)).ceil(),
        false => LEAST as f64,
    };
    let short = |(at, one): (usize, &InMemory)| {
        let samples = one.signals.channels.first().map_or(0, |(_, s)| s.len());
        let why = format!(
            "{}: too short for a slide, {samples} samples at {rate_hz} Hz; it takes {wanted} ({:.2} s)",
            name(at),
            wanted / rate_hz
        );
        ((samples as f64) < wanted).then_some((at, why))
    };
    all.iter().enumerate().filter_map(short).collect()
}

fn named(one: &InMemory) -> Named {
    Named {
        texture: one.texture.clone(),
        session: one.session.clone(),
        run: one.run.clone(),
        ..Named::default()
    }
}

/// The name of a recording: its place, as Python counts.
fn name(at: usize) -> String {
    format!("array {at}")
}

fn place(path: &str) -> Option<usize> {
    path.strip_prefix("array ")?.parse().ok()
}

pub(super) fn find<'m>(all: &'m Arc<[InMemory]>, path: &str) -> Result<&'m Signals> {
    let array = place(path).and_then(|at| all.get(at));
    let array = array.filter(|one| one.path.is_empty());
    let found = array.or_else(|| all.iter().find(|one| one.path == path));
    let found = found.ok_or_else(|| RecordingError::at(path.as_ref(), "there is no such signal"));
    Ok(&found?.signals)
}
