//! The requests of a display, and the replies.

use serde::{Deserialize, Serialize};
use tactus_core::explorer::ExpectedOutcome;
use tactus_core::features::{FEATURE_STEPS, Movement, Observation, Property};
use tactus_core::table::{Action, Table};
use tactus_core::wire::Phase;

use super::standing::Standing;
use crate::eval::transcript::Answer;

/// The probe's world, and its table.
#[derive(Clone, PartialEq, Debug, Deserialize)]
pub(crate) struct Settings {
    /// The world: seed of its textures, motors and fingertip.
    pub(crate) world: u64,
    /// Number of textures that it knows, 2 to 117.
    pub(crate) textures: u8,
    /// True to decide as published, one property a slide; otherwise by all features at once.
    pub(crate) paper: bool,
    /// Expected change of finger and samples, in parts of the usual one (see [`tactus_core::table::Drift`]).
    pub(crate) drift: f32,
    /// Seed of the sample's place and of the noise.
    pub(crate) trial: u64,
}

#[derive(Clone, PartialEq, Debug, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
pub(crate) enum Request {
    /// Asks for the names of Table 1: [`Reply::Textures`].
    Textures,
    /// Another probe: answered with [`Reply::Preparing`], then [`Request::Prepare`] is due.
    World(Settings),
    /// The next part of the work until the probe is there: [`Reply::Preparing`], in the end [`Reply::Ready`].
    Prepare,
    Identify {
        texture: u8,
        seed: u32,
        threshold: f32,
        /// Share of the known textures that may be taken for new ones; the table's own, unless given.
        false_alarm: Option<f32>,
        /// Number of slides after which the most probable texture is the answer.
        max_slides: u8,
    },
    Move {
        texture: u8,
        seed: u32,
        force_n: f32,
        speed_mm_s: f32,
    },
    /// Names the texture of the last exploration: the probe learns it.
    Label {
        /// Its name, 1 to 31 bytes.
        name: String,
    },
    /// Puts a skin on the finger, 0 new to 1 without ridges.
    Skin { wear: f64 },
    /// Stops the request, and lifts the finger.
    Stop,
    /// So many milliseconds pass, or less if the probe has nothing more to do: [`Reply::Frame`].
    Step {
        /// ms.
        ms: u32,
    },
}

#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(tag = "is", rename_all = "kebab-case")]
#[allow(clippy::large_enum_variant)] // one at a time
pub(crate) enum Reply {
    /// The names of Table 1.
    Textures {
        names: Vec<&'static str>,
    },
    Preparing {
        done: usize,
        of: usize,
    },
    Ready(KnownTable),
    Frame(Frame),
    /// The request is invalid; the reason.
    Error {
        why: String,
    },
}

#[derive(Clone, PartialEq, Debug, Serialize, Default)]
pub(crate) struct KnownTable {
    pub(crate) textures: Vec<String>,
    /// Their numbers in Table 1; `None` for one that was taught under another name.
    pub(crate) numbers: Vec<Option<u8>>,
    pub(crate) movements: Vec<(f32, f32)>,
    pub(crate) lengths_ms: Vec<u16>,
    /// Per movement, the place of each texture in a plane; in standard deviations between slides of one texture.
    pub(crate) maps: Vec<Vec<(f64, f64)>>,
    pub(crate) bytes: usize,
    pub(crate) crc: u32,
    /// Its own figures in a sentence, if it has any.
    pub(crate) figures: Option<String>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub(crate) struct Frame {
    pub(crate) at_ms: u64,
    pub(crate) busy: bool,
    pub(crate) phase: Phase,
    /// Height of the undeformed fingertip over the steel plate, mm.
    pub(crate) tip_mm: f64,
    pub(crate) indentation_mm: f64,
    pub(crate) stage_mm: f64,
    pub(crate) speed_mm_s: f64,
    pub(crate) force_n: f64,
    pub(crate) shear_n: f64,
    pub(crate) texture: u8,
    /// Wear of the skin, 0 to 1.
    pub(crate) wear: f64,
    /// P_AC of still finger and slide, counts about the still finger's, at 2200 Hz.
    pub(crate) pac: Vec<i16>,
    /// P_DC every 10 ms, counts.
    pub(crate) pdc: Vec<u16>,
    /// Spectra of the last 233 ms, one every 64 samples: dB of the mean power of four bins, of 17.2 Hz together.
    pub(crate) spectra: Vec<Vec<i8>>,
    pub(crate) happened: Vec<Happening>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(tag = "what", rename_all = "kebab-case")]
#[allow(clippy::large_enum_variant)] // a few at a time
pub(crate) enum Happening {
    Chosen {
        slide: u8,
        movement: u8,
        /// The one property that is looked at; `None` for all features.
        property: Option<&'static str>,
        expected: Vec<Expected>,
    },
    Look {
        ms: u16,
        /// The posterior if it ended now; `None` if the table has no statistics for it.
        standing: Option<Standing>,
        place: Option<(f64, f64)>,
    },
    Slide {
        slide: u8,
        movement: u8,
        early_ms: Option<u16>,
        measured: Measured,
        standing: Standing,
        place: Option<(f64, f64)>,
    },
    Moved {
        movement: Option<u8>,
        measured: Measured,
        place: Option<(f64, f64)>,
    },
    /// The slide does not count.
    Rejected {
        why: String,
    },
    Verdict {
        #[serde(flatten)]
        answer: Answer,
        index: u16,
        wants_label: bool,
    },
    Learned {
        name: String,
        slides: u8,
        known: KnownTable,
    },
    Judged {
        slide: u32,
        answer: &'static str,
        said: String,
    },
    Verified {
        answer: &'static str,
        said: String,
    },
    Refused {
        why: String,
    },
    Done,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub(crate) struct Expected {
    pub(crate) movement: u8,
    /// The property that is looked at; `None` for all features.
    pub(crate) property: Option<&'static str>,
    /// Uncertainty that is expected to remain (eq. 11), 0 to 1.
    pub(crate) uncertainty: f32,
    /// Benefit (eq. 12).
    pub(crate) benefit: f32,
}

impl From<&ExpectedOutcome> for Expected {
    fn from(outcome: &ExpectedOutcome) -> Self {
        Self {
            movement: outcome.action.movement,
            property: name(outcome.action),
            uncertainty: outcome.uncertainty,
            benefit: outcome.benefit,
        }
    }
}

pub(super) fn name(action: Action) -> Option<&'static str> {
    action.property.map(Property::name)
}

#[derive(Clone, PartialEq, Debug, Serialize)]
pub(crate) struct Measured {
    pub(crate) force_n: f32,
    pub(crate) speed_mm_s: f32,
    pub(crate) traction_n: Option<f32>,
    pub(crate) roughness_ln: Option<f32>,
    pub(crate) fineness_ln: Option<f32>,
    pub(crate) bands_ln: Vec<f32>,
}

impl Measured {
    pub(crate) fn new(movement: Movement, slide: &Observation) -> Self {
        let of = |property| slide.properties.get(property);
        let bands = slide.bands.iter();
        Self {
            force_n: movement.written().0,
            speed_mm_s: movement.written().1,
            traction_n: of(Property::Traction),
            roughness_ln: of(Property::Roughness),
            fineness_ln: of(Property::Fineness),
            bands_ln: bands.map(|b| f32::from(*b) / FEATURE_STEPS).collect(),
        }
    }
}

pub(super) fn movement_of(table: Table<'_>, movement: Movement) -> Option<u8> {
    let mut all = (0..).zip(table.movements());
    all.find(|(_, other)| *other == movement).map(|(n, _)| n)
}
