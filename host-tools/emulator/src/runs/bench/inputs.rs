//! Inputs of the kernels: the samples of a slide, tables, and observed slides.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use rand::seq::IndexedRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::{
    FeatureSet, MAX_FEATURES, Movement, Observation, Properties, Property, PropertySet,
};
use tactus_core::table::{Action, Contents, Table};
use tactus_lab::data::recording::PAC_RATE_HZ;
use tactus_lab::data::recordings::RecordingSet;
use tactus_lab::eval::learn;

use super::DIFFERENT;
use super::counter::Bench;
use super::workload::{ObservedSlide, Workload};

/// Samples of a slide of 3 s.
pub(super) const SLIDE: usize = 6600;
/// Textures of the tables that the gates are of: as many as the paper has.
const OF_GATES: usize = 117;
/// Textures that are still likely before a decision.
const LIVE: usize = 50;
/// Less probable textures are left out of a choice: the core's own limit.
const NEGLIGIBLE: f32 = 1e-6;

/// 3 s of a slide of a real finger, or of a synthetic one where there are no recordings; and which.
pub(super) fn slide() -> anyhow::Result<(Vec<i16>, &'static str)> {
    let root = std::env::var_os("TACTUS_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let folder = root.join("biotac");
    if folder.is_dir() {
        let slides = RecordingSet::open(&folder)?.load_texture(0)?;
        let samples = slides.first().and_then(|slide| {
            let steady = slide.steady(PAC_RATE_HZ).start;
            Some(slide.pac().get(steady..steady + SLIDE)?.to_vec())
        });
        let too_short = "the first recorded material has no slide of 3 s";
        return Ok((samples.context(too_short)?, "a real finger's"));
    }
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let samples = (0..SLIDE).map(|n| {
        let noise: f64 = random.random_range(-40.0..40.0);
        (300.0 * (n as f64 * 0.3).sin() + noise) as i16
    });
    Ok((samples.collect(), "synthetic: there are no recordings"))
}

const MOVEMENTS: [Movement; 3] = [
    Movement::FOR_TRACTION,
    Movement::FOR_FINENESS,
    Movement::FOR_ROUGHNESS,
];

/// The table that decisions are counted with, its neighbours hard to tell apart, each learned from 5 slides of 3
/// movements: of made-up numbers, and not of the simulated world as the factory table is, so that a figure tells of the
/// code.
pub(super) fn of_gates(method: Method) -> anyhow::Result<Vec<u8>> {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let names: Vec<String> = (1..=OF_GATES).map(|t| format!("texture {t}")).collect();
    let slides: Vec<Vec<Vec<Observation>>> = names
        .iter()
        .map(|_| {
            let mut slides_of = |_: &Movement| {
                let mut around =
                    |centre: f32, reach: f32| random.random_range(centre - reach..centre + reach);
                let centre = [around(1.0, 0.8), around(8.0, 3.0), around(4.0, 1.0)];
                let bands: Vec<f32> = (0..12).map(|_| around(3.0, 3.0)).collect();
                let mut slide = |_| {
                    let properties = Properties::new(centre.map(|c| Some(around(c, 0.2))));
                    let bands = bands
                        .iter()
                        .filter_map(|b| tactus_core::features::fixed(around(*b, 0.5)));
                    Observation {
                        bands: bands.collect(),
                        ..Observation::from(properties)
                    }
                };
                (0..5).map(&mut slide).collect()
            };
            MOVEMENTS.iter().map(&mut slides_of).collect()
        })
        .collect();
    Ok(learn::learn(method, None, &names, &MOVEMENTS, &slides)?)
}

/// Compares signals that the figures below do not go through: any number of samples, beyond what 12 bits can differ by.
pub(super) fn extremes(bench: &mut Bench) -> anyhow::Result<()> {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    for samples in (1..20).map(|n| 31 * n).chain([264, 330, 1000]) {
        let reach = *[30.0, 4096.0, 32767.0].choose(&mut random).unwrap_or(&1.0);
        let words: Vec<i16> = (0..samples)
            .map(|_| random.random_range(-reach..=reach) as i16)
            .collect();
        let what = format!("samples: {samples}, reach: {reach}");
        let counted = bench.count(Workload::BandPower, &[], &words)?;
        ensure!(counted.equal, DIFFERENT.to_owned() + &what);
    }
    Ok(())
}

/// A slide, as words, after which [`LIVE`] textures are still likely, or as nearly as can be found.
pub(super) fn observed(table: &[u8], method: Method) -> anyhow::Result<Vec<i16>> {
    let table = Table::read(table)?;
    let mut random = ChaCha8Rng::seed_from_u64(LIVE as u64);
    let config = Config {
        method,
        ..Config::default()
    };
    let mut explorer = Explorer::<2000>::new(table, PropertySet::ALL, config)?;
    let mut best: Option<(usize, ObservedSlide)> = None;
    for _ in 0..20_000 {
        let observed = match table.contents() {
            Contents::Gaussians(_) => by_property(&table, method, &mut random),
            Contents::Fused(set, features) => by_bands(&table, set, features, &mut random),
        };
        let Some(observed) = observed else { continue };
        explorer.restart();
        if explorer.observe(observed.action, &observed.slide).is_err() {
            continue;
        }
        let left = explorer.posterior().iter().filter(|p| **p >= NEGLIGIBLE);
        let left = left.count();
        if best
            .as_ref()
            .is_none_or(|(best, _)| left.abs_diff(LIVE) < best.abs_diff(LIVE))
        {
            best = Some((left, observed));
        }
        if left == LIVE {
            break;
        }
    }
    let (_, observed) = best.context("no slide suits a decision")?;
    let mut words = Vec::new();
    observed.write(|word| words.push(word));
    Ok(words)
}

/// A slide of one of the textures, looked at by one property.
fn by_property(
    table: &Table<'_>,
    method: Method,
    random: &mut ChaCha8Rng,
) -> Option<ObservedSlide> {
    let texture = random.random_range(0..table.textures());
    let movement = random.random_range(0..table.movements().len() as u8);
    let looked_at = Property::ALL[random.random_range(0..3)];
    let values = Property::ALL.map(|property| {
        let property = Some(property);
        let known = table.gaussian(texture, Action { movement, property })?;
        Some(known.mean + known.sd * random.random_range(-2.0..2.0))
    });
    Some(ObservedSlide {
        method,
        action: Action {
            movement,
            property: Some(looked_at),
        },
        slide: Properties::new(values).into(),
    })
}

/// A slide somewhere between all textures, the farther out the more of them it leaves.
fn by_bands(
    table: &Table<'_>,
    set: FeatureSet,
    features: u8,
    random: &mut ChaCha8Rng,
) -> Option<ObservedSlide> {
    if set != FeatureSet::Force {
        return None;
    }
    let movement = random.random_range(0..table.movements().len() as u8);
    let whitening = table.whitening(movement)?;
    let mean: Vec<i16> = whitening
        .as_bytes()
        .chunks_exact(2)
        .take(features.into())
        .map(|pair| i16::from_le_bytes([pair[0], pair[1]]))
        .collect();
    let reach = random.random_range(0.0..3000.0f32);
    let values: heapless::Vec<i16, MAX_FEATURES> = mean
        .iter()
        .map(|mean| mean.saturating_add((reach * random.random_range(-1.0..1.0)) as i16))
        .collect();
    let (traction, bands) = values.split_first()?;
    let properties = [Some(f32::from(*traction) / 1024.0), Some(8.0), Some(4.0)];
    Some(ObservedSlide {
        method: Method::Fused,
        action: Action {
            movement,
            property: None,
        },
        slide: Observation {
            properties: Properties::new(properties),
            bands: bands.iter().copied().collect(),
            pressure: None,
            pace: None,
        },
    })
}
