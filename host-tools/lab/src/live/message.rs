//! What a display asks for, and what it gets.

use serde::{Deserialize, Serialize};
use tactus_core::explorer::ExpectedOutcome;
use tactus_core::features::{FEATURE_STEPS, Movement, Observation, Property};
use tactus_core::table::{Action, Table};
use tactus_core::wire::Phase;

use super::standing::Standing;
use crate::eval::transcript::Answer;

/// The probe's world, and what it is to know.
#[derive(Clone, PartialEq, Debug, Deserialize)]
pub struct Settings {
    /// The world: what its textures, motors and fingertip are like.
    pub world: u64,
    /// How many textures it knows, 2 to 117.
    pub textures: u8,
    /// Whether it decides as published, one property a slide; otherwise by all features at once.
    pub paper: bool,
    /// How much change of finger and samples it is to expect, in parts of the usual one (see
    /// [`tactus_core::table::Drift`]).
    pub drift: f32,
    /// Where the sample lies, and what the noise is like.
    pub trial: u64,
}

/// What a display asks for.
#[derive(Clone, PartialEq, Debug, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case")]
pub enum Request {
    /// Asks for the names of Table 1: [`Reply::Textures`].
    Textures,
    /// Another probe: answered with [`Reply::Preparing`], then [`Request::Prepare`] is due.
    World(Settings),
    /// The next part of the work until the probe is there: [`Reply::Preparing`], in the end [`Reply::Ready`].
    Prepare,
    /// Puts a texture under the finger and has the probe find out what it is.
    Identify {
        /// Its number in Table 1.
        texture: u8,
        /// For where on the sample slides begin.
        seed: u32,
        /// A texture more probable than this is the answer.
        threshold: f32,
        /// Share of the known textures that may be taken for new ones; the table's own, unless given.
        false_alarm: Option<f32>,
        /// After so many slides the most probable texture is the answer.
        max_slides: u8,
    },
    /// Puts a texture under the finger and makes one movement.
    Move {
        /// Its number in Table 1.
        texture: u8,
        /// For where on the sample the slide begins.
        seed: u32,
        /// Contact force, N.
        force_n: f32,
        /// Speed, mm/s.
        speed_mm_s: f32,
    },
    /// What the texture of the last exploration is called: the probe learns it.
    Label {
        /// Its name, 1 to 31 bytes.
        name: String,
    },
    /// Puts a skin on the finger, 0 new to 1 without ridges.
    Skin {
        /// How worn it is.
        wear: f64,
    },
    /// Stops what is being done, and lifts the finger.
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
    /// What has been since the last one.
    Frame(Frame),
    /// The request makes no sense, and why.
    Error {
        /// A sentence.
        why: String,
    },
}

/// What the probe knows.
#[derive(Clone, PartialEq, Debug, Serialize, Default)]
pub struct KnownTable {
    /// Names of its textures, in the order of the table.
    pub textures: Vec<String>,
    /// Their numbers in Table 1; `None` for one that was taught under a name that is not there.
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

/// A moment of the probe, and what has happened since the last one.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Frame {
    /// Time of the rig, ms.
    pub at_ms: u64,
    /// Whether the probe is at work.
    pub busy: bool,
    /// What the rig does.
    pub phase: Phase,
    /// Height of the undeformed fingertip over the steel plate, mm.
    pub tip_mm: f64,
    /// How deep the sample pushes into it, mm; negative is a gap.
    pub indentation_mm: f64,
    /// Place of the stage, mm from its lower hard stop.
    pub stage_mm: f64,
    /// Speed of the stage, mm/s.
    pub speed_mm_s: f64,
    /// Contact force, N.
    pub force_n: f64,
    /// Shear on the stage, N.
    pub shear_n: f64,
    /// Number in Table 1 of what lies under the finger.
    pub texture: u8,
    /// Wear of the skin, 0 to 1.
    pub wear: f64,
    /// P_AC of still finger and slide, counts about the still finger's, at 2200 Hz.
    pub pac: Vec<i16>,
    /// P_DC every 10 ms, counts.
    pub pdc: Vec<u16>,
    /// Spectra of the last 233 ms, one every 64 samples: dB of the mean power of four bins, of 17.2 Hz together.
    pub spectra: Vec<Vec<i8>>,
    /// What the probe said.
    pub happened: Vec<Happening>,
}

/// What a probe said.
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
        /// What the best actions are expected to bring, best first.
        expected: Vec<Expected>,
    },
    /// The slide has reached a length that the table knows.
    Look {
        /// At constant speed.
        ms: u16,
        /// What is known if it ended now; `None` where the table cannot tell.
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
        /// Where it ended early: after so many ms at constant speed.
        early_ms: Option<u16>,
        /// What it measured.
        measured: Measured,
        /// What is known now.
        standing: Standing,
        /// Its place among the textures at this movement.
        place: Option<(f64, f64)>,
    },
    /// A slide that was asked for by hand was made.
    Moved {
        /// Of the movement, where the table has it.
        movement: Option<u8>,
        /// What it measured.
        measured: Measured,
        /// Its place among the textures at this movement.
        place: Option<(f64, f64)>,
    },
    /// The slide does not count.
    Rejected {
        /// Why.
        why: String,
    },
    /// The answer.
    Verdict {
        /// As programs read it.
        #[serde(flatten)]
        answer: Answer,
        /// Index of the texture in the table.
        index: u16,
        /// Whether the probe asks what it is.
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
        /// That in words.
        said: String,
    },
    /// A verification is over.
    Verified {
        /// `same`, `different` or `unsure`.
        answer: &'static str,
        /// That in words, and what it is worth.
        said: String,
    },
    /// A slide of recordings.
    Recorded {
        /// Which of them, from 0.
        at: usize,
        /// What it was recorded on.
        texture: String,
        /// Its number.
        number: u32,
        /// Force, N, and speed, mm/s.
        movement: (f32, f32),
        /// What it measured.
        measured: Option<Measured>,
        /// Why it measured nothing.
        why: Option<String>,
    },
    /// What was asked for is not done.
    Refused {
        /// Why, and what to do.
        why: String,
    },
    /// What was asked for is over.
    Done,
}

/// What an action is expected to bring.
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

/// What a slide measured.
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
