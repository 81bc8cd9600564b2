//! The slides that a watched probe has learned from: trials of a simulated world, made here or before.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};
use tactus_core::dsp::Plan;
use tactus_core::explorer::Method;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::sensor::{FingerCode, FingerName};
use tactus_core::table::{Drift, EncodeError};

use crate::eval::learn::{Expected, ObservedTrial, TableError, learn_lengths, name_finger};
use crate::sim::collection::{Collection, TrialError, record_texture, texture_name};

/// The world whose trials come with the program: that of the firmware's table.
pub(crate) const WORLD: u64 = 1;
pub(crate) const TRIALS: u32 = 5;

#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub(crate) struct Trials {
    pub(crate) texture: u8,
    /// Per movement of [`Collection::MOVEMENTS`].
    pub(crate) movements: Vec<Vec<ObservedTrial>>,
}

impl Trials {
    pub(crate) fn make(
        world: u64,
        texture: u8,
        calibration: RigCalibration,
    ) -> Result<Self, TrialError> {
        let collection = Collection::new(world, vec![texture], TRIALS);
        let setup = collection.setup(texture, 0);
        let movements = &Collection::MOVEMENTS;
        let slides = record_texture(setup, calibration, movements, TRIALS)?;
        let plan = Plan::new();
        Ok(Self {
            texture,
            movements: collection.observe(
                &plan,
                movements,
                texture,
                &slides,
                &Collection::LENGTHS_MS,
            )?,
        })
    }

    /// All textures of [`WORLD`], as they were made before.
    pub(crate) fn of_world() -> Result<Vec<Self>, postcard::Error> {
        postcard::from_bytes(made_before())
    }
}

static BROUGHT: OnceLock<Vec<u8>> = OnceLock::new();
/// Those that are in the program; in a page they lie beside the module, which is small then.
const BUILT_IN: &[u8] = if cfg!(target_family = "wasm") {
    &[]
} else {
    include_bytes!("world-1.trials")
};

fn made_before() -> &'static [u8] {
    BROUGHT.get().map_or(BUILT_IN, Vec::as_slice)
}

/// Brings the trials of world 1 to a program without them, before anything asks for them; once is enough.
pub fn bring_world(trials: Vec<u8>) {
    // the first ones are the same
    let _ = BROUGHT.set(trials);
}

/// The table that these trials make, for the fused method or the paper's.
pub(super) fn table(trials: &[Trials], paper: bool, drift: f32) -> Result<Vec<u8>, TableError> {
    let usual = Drift::default();
    let expected = Expected {
        drift: Some(Drift {
            bands: drift * usual.bands,
            traction: drift * usual.traction,
        }),
        ..Expected::default()
    };
    let method = if paper { Method::Paper } else { Method::Fused };
    let names: Vec<String> = trials
        .iter()
        .map(|trials| texture_name(trials.texture).to_owned())
        .collect();
    let slides: Vec<_> = trials.iter().map(|t| t.movements.clone()).collect();
    let movements = &Collection::MOVEMENTS;
    let lengths_ms = &Collection::LENGTHS_MS;
    let table = learn_lengths(
        &expected,
        (method, None),
        &names,
        movements,
        lengths_ms,
        &slides,
    )?;
    let named = name_finger(&table, FingerCode::of(FingerName::Biotac), 0, "");
    named.map_err(|why: EncodeError| why.into())
}
