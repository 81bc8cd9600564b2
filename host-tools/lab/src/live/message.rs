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
pub struct Settings {
    /// The world: seed of its textures, motors and fingertip.
    pub world: u64,
    /// Number of textures that it knows, 2 to 117.
    pub textures: u8,
    /// True to decide as published, one property a slide; otherwise by all features at once.
    pub paper: bool,
    /// Expected change of finger and samples, in parts of the usual one (see [`tactus_core::table::Drift`]).
    pub drift: f32,
    /// Seed of the sample's place and of the noise.
    pub trial: u64,
}

/// The requests of a display.
#[derive(Clone, PartialEq, Debug, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
pub enum Request {
    /// Asks for the names of Table 1: [`Reply::Textures`].
    Textures,
    /// Another probe: answered with [`Reply::Preparing`], then [`Request::Prepare`] is due.
    World(Settings),
    /// The next part of the work until the probe is there: [`Reply::Preparing`], in the end [`Reply::Ready`].
    Prepare,
    /// Puts a texture under the finger and asks the probe to identify it.
    Identify {
        /// Its number in Table 1.
        texture: u8,
        /// Seed of the places on the sample where slides begin.
        seed: u32,
        /// A texture more probable than this is the answer.
        threshold: f32,
        /// Share of the known textures that may be taken for new ones; the table's own, unless given.
        false_alarm: Option<f32>,
        /// Number of slides after which the most probable texture is the answer.
        max_slides: u8,
    },
    /// Puts a texture under the finger and makes one movement.
    Move {
        /// Its number in Table 1.
        texture: u8,
        /// Seed of the place on the sample where the slide begins.
        seed: u32,
        /// Contact force, N.
        force_n: f32,
        /// Speed, mm/s.
        speed_mm_s: f32,
    },
    /// Names the texture of the last exploration: the probe learns it.
    Label {
        /// Its name, 1 to 31 bytes.
        name: String,
    },
    /// Puts a skin on the finger, 0 new to 1 without ridges.
    Skin {
        /// Its wear.
        wear: f64,
    },
    /// Stops the request, and lifts the finger.
    Stop,
    /// So many milliseconds pass, or less if the probe has nothing more to do: [`Reply::Frame`].
    Step {
        /// ms.
        ms: u32,
    },
}

/// The answer.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(tag = "is", rename_all = "kebab-case")]
#[allow(clippy::large_enum_variant)] // one at a time
pub enum Reply {
    /// The names of Table 1.
    Textures {
        /// In its order.
        names: Vec<&'static str>,
    },
    /// So much of the work is done.
    Preparing {
        /// Parts that are done.
        done: usize,
        /// All parts.
        of: usize,
    },
    /// The probe waits for requests.
    Ready(KnownTable),
    /// The events since the last one.
    Frame(Frame),
    /// The request is invalid; the reason.
    Error {
        /// A sentence.
        why: String,
    },
}

/// The probe's textures and movements.
#[derive(Clone, PartialEq, Debug, Serialize, Default)]
pub struct KnownTable {
    /// Names of its textures, in the order of the table.
    pub textures: Vec<String>,
    /// Their numbers in Table 1; `None` for one that was taught under another name.
    pub numbers: Vec<Option<u8>>,
    /// The movements: force, N, and speed, mm/s.
    pub movements: Vec<(f32, f32)>,
    /// Lengths at which a slide may end, ms at constant speed.
    pub lengths_ms: Vec<u16>,
    /// Per movement, the place of each texture in a plane; in standard deviations between slides of one texture.
    pub maps: Vec<Vec<(f64, f64)>>,
    /// Bytes of the table.
    pub bytes: usize,
    /// Its CRC-32.
    pub crc: u32,
}

/// A moment of the probe, with the events since the last one.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Frame {
    /// Time of the rig, ms.
    pub at_ms: u64,
    /// True if the probe is at work.
    pub busy: bool,
    /// Phase of the rig.
    pub phase: Phase,
    /// Height of the undeformed fingertip over the steel plate, mm.
    pub tip_mm: f64,
    /// Depth of the sample in it, mm; negative is a gap.
    pub indentation_mm: f64,
    /// Place of the stage, mm from its lower hard stop.
    pub stage_mm: f64,
    /// Speed of the stage, mm/s.
    pub speed_mm_s: f64,
    /// Contact force, N.
    pub force_n: f64,
    /// Shear on the stage, N.
    pub shear_n: f64,
    /// Number in Table 1 of the texture under the finger.
    pub texture: u8,
    /// Wear of the skin, 0 to 1.
    pub wear: f64,
    /// P_AC of still finger and slide, counts about the still finger's, at 2200 Hz.
    pub pac: Vec<i16>,
    /// P_DC every 10 ms, counts.
    pub pdc: Vec<u16>,
    /// Spectra of the last 233 ms, one every 64 samples: dB of the mean power of four bins, of 17.2 Hz together.
    pub spectra: Vec<Vec<i8>>,
    /// The probe's events.
    pub happened: Vec<Happening>,
}

/// An event of a probe.
#[derive(Clone, PartialEq, Debug, Serialize)]
#[serde(tag = "what", rename_all = "kebab-case")]
#[allow(clippy::large_enum_variant)] // a few at a time
pub enum Happening {
    /// This movement comes next.
    Chosen {
        /// Number of the slide, from 1.
        slide: u8,
        /// Of the movement.
        movement: u8,
        /// The one property that is looked at; `None` for all features.
        property: Option<&'static str>,
        /// Expected results of the best actions, best first.
        expected: Vec<Expected>,
    },
    /// The slide has reached a length that the table knows.
    Look {
        /// At constant speed.
        ms: u16,
        /// The posterior if it ended now; `None` if the table has no statistics for it.
        standing: Option<Standing>,
        /// Its place among the textures at this movement.
        place: Option<(f64, f64)>,
    },
    /// The slide was made and taken in.
    Slide {
        /// Number of the slide, from 1.
        slide: u8,
        /// Of the movement.
        movement: u8,
        /// Its length in ms at constant speed, if it ended early.
        early_ms: Option<u16>,
        /// Its measurements.
        measured: Measured,
        /// The posterior now.
        standing: Standing,
        /// Its place among the textures at this movement.
        place: Option<(f64, f64)>,
    },
    /// A slide by a direct request was made.
    Moved {
        /// Of the movement, where the table has it.
        movement: Option<u8>,
        /// Its measurements.
        measured: Measured,
        /// Its place among the textures at this movement.
        place: Option<(f64, f64)>,
    },
    /// The slide does not count.
    Rejected {
        /// The reason.
        why: String,
    },
    /// The answer.
    Verdict {
        /// As programs read it.
        #[serde(flatten)]
        answer: Answer,
        /// Index of the texture in the table.
        index: u16,
        /// True if the probe asks for a label.
        wants_label: bool,
    },
    /// A texture was learned: the table is another one now.
    Learned {
        /// Its name.
        name: String,
        /// From so many slides.
        slides: u8,
        /// The table.
        known: KnownTable,
    },
    /// A verification has judged a slide.
    Judged {
        /// Number of the slide, from 1.
        slide: u32,
        /// `same`, `different` or `unsure`.
        answer: &'static str,
        /// The answer in words.
        said: String,
    },
    /// A verification is over.
    Verified {
        /// `same`, `different` or `unsure`.
        answer: &'static str,
        /// The answer in words, and its error rates.
        said: String,
    },
    /// A slide of recordings.
    Recorded {
        /// Its index, from 0.
        at: usize,
        /// Its texture.
        texture: String,
        /// Its number.
        number: u32,
        /// Force, N, and speed, mm/s.
        movement: (f32, f32),
        /// Its measurements.
        measured: Option<Measured>,
        /// The reason why it has none.
        why: Option<String>,
    },
    /// The request was refused.
    Refused {
        /// The reason, and a remedy.
        why: String,
    },
    /// The request is done.
    Done,
}

/// Expected result of an action.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Expected {
    /// Of the movement.
    pub movement: u8,
    /// The property that is looked at; `None` for all features.
    pub property: Option<&'static str>,
    /// Uncertainty that is expected to remain (eq. 11), 0 to 1.
    pub uncertainty: f32,
    /// Benefit (eq. 12).
    pub benefit: f32,
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

/// Name of the property that is looked at.
pub(super) fn name(action: Action) -> Option<&'static str> {
    action.property.map(Property::name)
}

/// Measurements of a slide.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Measured {
    /// Force of its movement, N.
    pub force_n: f32,
    /// Speed, mm/s.
    pub speed_mm_s: f32,
    /// Mean tangential force, N.
    pub traction_n: Option<f32>,
    /// A logarithm.
    pub roughness_ln: Option<f32>,
    /// A logarithm.
    pub fineness_ln: Option<f32>,
    /// Logarithms of the powers of the twelve bands.
    pub bands_ln: Vec<f32>,
}

impl Measured {
    /// By a slide of this movement.
    pub fn new(movement: Movement, slide: &Observation) -> Self {
        let of = |property| slide.properties.get(property);
        let bands = slide.bands.iter();
        Self {
            force_n: movement.force_n(),
            speed_mm_s: movement.speed_mm_s(),
            traction_n: of(Property::Traction),
            roughness_ln: of(Property::Roughness),
            fineness_ln: of(Property::Fineness),
            bands_ln: bands.map(|b| f32::from(*b) / FEATURE_STEPS).collect(),
        }
    }
}

/// The number of a movement in a table.
pub(super) fn movement_of(table: Table<'_>, movement: Movement) -> Option<u8> {
    let mut all = (0..).zip(table.movements());
    all.find(|(_, other)| *other == movement).map(|(n, _)| n)
}
