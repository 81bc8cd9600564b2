//! The contents of a table as one object for programs: the JSON of `tactus table`.

use serde::Serialize;
use tactus_core::features::Property;
use tactus_core::sensor::FingerCode;
use tactus_core::table::{Action, Contents, Drift, OpenSet, Table};

use crate::eval::show::apart;

/// A table.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TableSummary {
    bytes: usize,
    /// CRC-32 of it, in hexadecimal digits.
    checksum: String,
    /// Basis of the comparison: the three properties, or a set of whitened features.
    features: &'static str,
    finger: FingerCode,
    /// Day on which that finger's force per count was measured, as 20261121; 1 if the day is unknown, 0 if it was not
    /// measured or that is unknown.
    pub(crate) finger_calibrated: u32,
    /// The drift that it expects; `null` in a table of properties.
    drift: Option<Drift>,
    /// The share of false alarms that its limits are for; `null` where it has none.
    false_alarm: Option<f32>,
    /// Its own figures; `null` where it has none.
    pub open_set: Option<OpenSet>,
    /// Lengths of shorter slides that it has statistics of, s at constant speed.
    pub(crate) lengths_s: Vec<f64>,
    /// Its movements, in the order of the table.
    pub movements: Vec<MovementSummary>,
    /// The textures, in the order of the table.
    pub(super) textures: Vec<TextureSummary>,
}

/// A movement of a table.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MovementSummary {
    force_n: Option<f32>,
    speed_mm_s: Option<f32>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub(crate) struct TextureSummary {
    pub(super) name: String,
    /// Slides from which it was learned: from the factory, from a user, and by the probe itself.
    pub(crate) slides_factory: u32,
    /// See [`Self::slides_factory`].
    pub(crate) slides_user: u32,
    /// See [`Self::slides_factory`].
    pub(crate) slides_itself: u32,
    /// True if its sample was moved or turned between trials; `null` if unknown.
    sample_moved: Option<bool>,
    /// Its statistics at each movement, in the order of the movements.
    pub(super) movements: Vec<KnownSummary>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub(crate) struct KnownSummary {
    pub(super) trials: u8,
    /// Mean and standard deviation; `null` where it was not learned, as in a table of whitened features.
    traction_n: Option<[f32; 2]>,
    /// Mean and standard deviation of the logarithm.
    roughness_ln: Option<[f32; 2]>,
    /// Mean and standard deviation of the logarithm.
    pub(crate) fineness_ln: Option<[f32; 2]>,
    /// The texture that is most like it here, in a table of whitened features.
    pub(super) nearest: Option<String>,
    /// Distance of the two, in standard deviations within a texture.
    pub(crate) nearest_sd: Option<f32>,
}

impl TableSummary {
    /// Of a table.
    pub fn new(table: Table<'_>) -> Self {
        Self {
            bytes: table.as_bytes().len(),
            checksum: format!("{:08x}", tactus_link::checksum(&table)),
            features: match table.contents() {
                Contents::Gaussians(_) => "properties",
                Contents::Fused(set, _) => set.name(),
            },
            finger: table.finger(),
            finger_calibrated: table.calibrated(),
            drift: table.drift(),
            false_alarm: table.limits().map(|limits| limits.false_alarm),
            open_set: table.open_set(),
            lengths_s: table.lengths_ms().map(|ms| f64::from(ms) / 1e3).collect(),
            movements: table
                .movements()
                .map(|movement| MovementSummary {
                    force_n: movement.known().0,
                    speed_mm_s: movement.known().1,
                })
                .collect(),
            textures: (0..table.textures())
                .map(|texture| TextureSummary::new(table, texture))
                .collect(),
        }
    }
}

impl TextureSummary {
    fn new(table: Table<'_>, texture: u16) -> Self {
        let tally = table.tally(texture);
        let movements = (0..).zip(table.movements());
        Self {
            name: table.name(texture).unwrap_or_default().to_owned(),
            slides_factory: tally.factory.into(),
            slides_user: tally.user.into(),
            slides_itself: tally.itself.into(),
            sample_moved: table.moved(texture),
            movements: movements
                .map(|(movement, _)| KnownSummary::new(table, texture, movement))
                .collect(),
        }
    }
}

impl KnownSummary {
    fn new(table: Table<'_>, texture: u16, movement: u8) -> Self {
        let gaussian = |property| {
            let action = Action {
                movement,
                property: Some(property),
            };
            table.gaussian(texture, action).map(|g| [g.mean, g.sd])
        };
        let is_fused = matches!(table.contents(), Contents::Fused(..));
        let others = (0..table.textures()).filter(|&other| is_fused && other != texture);
        let nearest = others
            .filter_map(|other| Some((apart(table, movement, [texture, other])?, other)))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        Self {
            trials: table.trials(texture, movement),
            traction_n: gaussian(Property::Traction),
            roughness_ln: gaussian(Property::Roughness),
            fineness_ln: gaussian(Property::Fineness),
            nearest: nearest.and_then(|(_, other)| Some(table.name(other)?.to_owned())),
            nearest_sd: nearest.map(|(sd, _)| sd),
        }
    }
}
