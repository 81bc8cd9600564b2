//! Arguments that several commands take.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use tactus_core::explorer::Config;
use tactus_core::features::FeatureSet;
use tactus_core::table::{Drift, MAX_LENGTHS, is_false_alarm};
use tactus_lab::data::recording::Labels;
use tactus_lab::data::recordings::{RecordingError, RecordingSet};
use tactus_lab::eval::evaluate::Method;

use super::output::UsageError;

/// The value of a variable of the environment, unless it is empty.
pub(crate) fn named(variable: &str) -> Option<OsString> {
    std::env::var_os(variable).filter(|value| !value.is_empty())
}

#[derive(Args, Clone)]
pub(crate) struct Recordings {
    /// Folder of recordings; that of TACTUS_RECORDINGS unless given
    #[arg(long, value_name = "DIR")]
    pub(crate) recordings: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) only: Only,
}

/// Which slides of a folder count.
#[derive(Args, Clone, Default)]
pub(crate) struct Only {
    /// Take only slides of this lot, operator, session or run, such as lot=7; given again, all have to hold
    #[arg(long, value_name = "COLUMN=VALUE", value_parser = label)]
    pub(crate) only: Vec<(String, String)>,
}

impl Only {
    pub(crate) fn is_all(&self) -> bool {
        self.only.is_empty()
    }

    /// The selected slides of a folder.
    pub(crate) fn open(&self, folder: &Path) -> Result<RecordingSet, RecordingError> {
        let mut set = RecordingSet::open(folder)?;
        if !self.is_all() {
            set.select(&self.only)?;
        }
        Ok(set)
    }
}

fn label(text: &str) -> Result<(String, String), String> {
    let parts = text
        .split_once('=')
        .map(|(column, value)| (column.trim(), value.trim()));
    match parts {
        Some((column, value)) if Labels::SELECTING.contains(&column) => {
            Ok((column.to_owned(), value.to_owned()))
        }
        _ => Err(format!(
            "one of {} and a value, such as lot=7",
            Labels::SELECTING.join(", ")
        )),
    }
}

impl Recordings {
    /// The folder that was given, or that the environment names.
    pub(crate) fn folder(&self) -> Result<PathBuf, UsageError> {
        let folder = self.recordings.clone();
        folder.or_else(|| named("TACTUS_RECORDINGS").map(PathBuf::from)).ok_or_else(|| {
            let say = "give a folder of recordings: --recordings DIR, or TACTUS_RECORDINGS in the environment";
            UsageError(say.to_owned())
        })
    }
}

#[derive(Args, Clone)]
pub(crate) struct Stop {
    /// Stop when a texture is more probable than this
    #[arg(long, default_value_t = 0.99, value_parser = probability)]
    pub(crate) threshold: f32,
    /// Stop after this many slides
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(u8).range(1..=254))]
    pub(crate) max_slides: u8,
    /// Share of the known textures that may be taken for new ones, such as 0.02; the table's own unless given
    #[arg(long, value_name = "SHARE", value_parser = false_alarm)]
    pub(crate) false_alarm: Option<f32>,
}

/// What a fused table that is learned expects.
#[derive(Args, Clone)]
pub(crate) struct Expecting {
    /// How much fingers and samples change from one session to the next, for a table that is learned with the method
    /// fused: standard deviations of band powers, ln, and of traction as a share of its mean; 0 for one session and
    /// samples that stay where they are
    #[arg(long, value_name = "BANDS,TRACTION|0", default_value = "0.12,0.04", value_parser = drift)]
    pub(crate) drift: Drift,
}

fn drift(text: &str) -> Result<Drift, String> {
    let number = |text: &str| text.trim().parse::<f32>().ok();
    let drift = match text.split_once(',') {
        Some((bands, traction)) => number(bands)
            .zip(number(traction))
            .map(|(bands, traction)| Drift { bands, traction }),
        None => number(text)
            .filter(|none| *none == 0.0)
            .map(|_| Drift::NONE),
    };
    drift.filter(|drift| drift.is_possible()).ok_or_else(|| {
        "two numbers from 0 to 10, such as 0.12,0.04, or 0 for no drift at all".to_owned()
    })
}

pub(crate) fn rising(lengths_ms: &[u16]) -> Result<Vec<u16>, UsageError> {
    if lengths_ms.len() > MAX_LENGTHS || !lengths_ms.is_sorted_by(|a, b| a < b) {
        let say = format!("--lengths: at most {MAX_LENGTHS}, the shortest first, such as 1,2,3");
        return Err(UsageError(say));
    }
    Ok(lengths_ms.to_vec())
}

pub(crate) fn length(text: &str) -> Result<u16, String> {
    match text.trim().parse::<f64>() {
        Ok(s) if (0.3..=60.0).contains(&s) => Ok((s * 1e3).round() as u16),
        _ => Err("seconds from 0.3 to 60, such as 1.5".to_owned()),
    }
}

pub(crate) fn false_alarm(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(share) if is_false_alarm(share) => Ok(share),
        _ => Err("a share from 0.0005 to 0.2, such as 0.02".to_owned()),
    }
}

impl Stop {
    pub(crate) fn config(&self, method: Method) -> Config {
        Config {
            method: method.method(),
            strategy: method.strategy(),
            threshold: self.threshold,
            max_slides: self.max_slides,
            open: false,
            false_alarm: self.false_alarm,
            ..Config::default()
        }
    }
}

fn probability(text: &str) -> Result<f32, String> {
    match text.parse() {
        Ok(p) if 0.0 < p && p <= 1.0 => Ok(p),
        _ => Err("a probability between 0 and 1, such as 0.99; 1 is never exceeded".to_owned()),
    }
}

/// What a fused table is learned from.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Features {
    /// Traction, and the logarithms of band powers
    Force,
    /// Mean of P_DC, logarithm of its scatter, and the band powers: for a rig without force sensing
    Pressure,
    /// The band powers alone
    Bands,
    /// The three properties of the paper
    Properties,
}

impl Features {
    pub(crate) fn set(self) -> FeatureSet {
        match self {
            Self::Force => FeatureSet::Force,
            Self::Pressure => FeatureSet::Pressure,
            Self::Bands => FeatureSet::Bands,
            Self::Properties => FeatureSet::Properties,
        }
    }
}
