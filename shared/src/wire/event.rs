//! What the probe tells the host.

use heapless::{String, Vec};
use serde::{Deserialize, Serialize};

use super::command::PART;
use super::failure::Failure;
use super::prompt::Prompt;
use super::sparse;
use super::text::Text;
use crate::explorer::{self, ExpectedOutcome, Verification};
use crate::features::{
    BLOCK, Block, FUSED_BANDS, Measurement, Movement, Observation, Properties, Property,
};
use crate::rig::Fault;
use crate::rig::arm::ArmOrder;
use crate::sensor::FingerCode;
use crate::table::{Action, MAX_TEXTURES, Name};

/// How many expected outcomes are sent at most: those of the best actions.
pub const MAX_EXPECTED_OUTCOMES: usize = 16;

/// From the probe.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Report {
    /// One more than the last one's: a gap is a lost frame.
    pub number: u16,
    /// Since the probe booted, ms.
    pub at_ms: u32,
    /// What happened.
    pub event: Event,
}

/// What can happen.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)] // no allocation here, and only one at a time
pub enum Event {
    /// The probe has booted.
    Booted {
        /// [`PROTOCOL`](super::PROTOCOL) of the probe.
        protocol: u8,
        /// Version of the firmware.
        version: String<16>,
        /// Why.
        reset: Reset,
        /// Why the firmware gave up before the reset, if it did.
        last_words: Option<Text>,
        /// Its finger.
        finger: FingerCode,
    },
    /// Answer to [`super::Command::Status`].
    Status(Status),
    /// The request of this number is over.
    Done(u16),
    /// The request of this number is refused or came to nothing.
    Refused {
        /// Its number.
        id: u16,
        /// Why, and what to do next.
        why: Failure,
    },
    /// A frame was damaged; so many were since the probe booted.
    Damaged(u32),
    /// The rig does something else now.
    Phase(Phase),
    /// This comes next.
    Chosen {
        /// Number of the slide, from 1.
        slide: u8,
        /// The movement.
        movement: Movement,
        /// What is looked at.
        action: Action,
        /// Expected outcomes of the best actions, best first.
        expected: Vec<ExpectedOutcome, MAX_EXPECTED_OUTCOMES>,
    },
    /// The slide was made and taken in.
    SlideReport {
        /// Number of the slide, from 1.
        slide: u8,
        /// What was looked at.
        action: Action,
        /// What was measured.
        observed: SlideReport,
        /// Probability of every texture of the table. On the line only those of a millionth or more: the others are 0
        /// there.
        #[serde(with = "sparse")]
        posterior: Vec<f32, MAX_TEXTURES>,
    },
    /// The slide failed, or gave no features: it does not count. It is made again, then another movement is chosen.
    Rejected {
        /// Number of the slide, from 1.
        slide: u8,
        /// Why.
        why: Failure,
    },
    /// What lies under the finger.
    Verdict(Verdict),
    /// The probe has learned a texture from the slides of an exploration.
    TextureLearned(TextureLearned),
    /// A movement of a texture that is learned was made.
    TrainingSlide {
        /// The movement.
        movement: Movement,
        /// Its trial, from 1.
        trial: u8,
        /// Trials to come after it, of all movements.
        left: u16,
        /// What was measured.
        observed: SlideReport,
    },
    /// What the rig is at, 20 times a second while it moves.
    Live(Live),
    /// A fault: the motors are stopped, and the finger is being lifted.
    Fault(Fault),
    /// Samples as they went into the features.
    Block(Block),
    /// The constants in use.
    Calibration(Vec<u8, 64>),
    /// A part of the table in use.
    TablePart {
        /// Where it belongs.
        offset: u32,
        /// Bytes of the whole table.
        length: u32,
        /// The bytes.
        bytes: Vec<u8, PART>,
    },
    /// Something went wrong that is no answer to a request.
    Trouble(Failure),
    /// A probe without motors asks the person who holds it to do this: when it changes, and once a second.
    Prompt(Prompt),
    /// P_DC of a slide by hand from its begin on, gap-free, counts about that of the lifted finger.
    Pdc(Vec<i16, BLOCK>),
    /// Mean P_DC under a known weight.
    Weighed {
        /// The weight, mN.
        mn: u16,
        /// Counts above that of the lifted finger.
        counts: f32,
    },
    /// True if it is the texture asked for, after so many slides.
    Verified {
        /// Slides that counted.
        slides: u8,
        /// What they say.
        now: Verification,
    },
    /// What an accelerometer felt that was turned over.
    Turned {
        /// Counts of P_AC that 1 g makes.
        g_counts: f32,
        /// Its zero is off by so many counts.
        offset_counts: f32,
    },
    /// The slide whose report comes next ended early, after so many ms at constant speed, for the verdict is certain:
    /// it is reported as it was then.
    Early(u16),
    /// The arm that moves the finger is to do this, in the place of what it does; said again until the arm answers,
    /// with [`super::Command::Arm`].
    Arm(ArmOrder),
}

/// Why the chip started.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Reset {
    /// Power came on.
    Power,
    /// The reset pin.
    Pin,
    /// The watchdog: the firmware hung.
    Watchdog,
    /// The firmware itself, after it gave up.
    Software,
    /// Something else.
    Other,
}

/// What the rig does: [`crate::rig::Phase`] without its fault.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub enum Phase {
    /// It does not know where it is.
    #[default]
    Parked,
    /// It looks for its limit switches.
    Homing,
    /// Lifted and waiting.
    Ready,
    /// The stage goes to where the slide begins.
    Positioning,
    /// The lever comes down.
    Pressing,
    /// The still finger is measured.
    Background,
    /// The slide.
    Sliding,
    /// The finger is lifted.
    Lifting,
    /// The stage moves without load.
    Unloaded,
    /// A fault was seen.
    Faulted,
}

impl From<crate::rig::Phase> for Phase {
    fn from(phase: crate::rig::Phase) -> Self {
        use crate::rig::Phase as Rig;
        match phase {
            Rig::Parked => Self::Parked,
            Rig::Homing => Self::Homing,
            Rig::Ready => Self::Ready,
            Rig::Positioning => Self::Positioning,
            Rig::Pressing => Self::Pressing,
            Rig::Background => Self::Background,
            Rig::Sliding => Self::Sliding,
            Rig::Lifting => Self::Lifting,
            Rig::Unloaded => Self::Unloaded,
            Rig::Faulted(_) => Self::Faulted,
        }
    }
}

/// How the probe is.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, Default)]
pub struct Status {
    /// What the rig does.
    pub phase: Phase,
    /// Why it does nothing, if it does not.
    pub fault: Option<Fault>,
    /// Textures of the table in use.
    pub textures: u16,
    /// Bytes of it.
    pub table_bytes: u32,
    /// The last four bytes of it: its CRC-32.
    pub table_crc: u32,
    /// True if it came with the firmware.
    pub factory: bool,
    /// Day on which the force per count was measured, as 20261121, 1 where nobody knew the day; 0 if it is the paper's.
    pub calibrated: u32,
    /// What was counted since boot.
    pub counts: Counts,
    /// Work that the skin has seen, mJ, and that part of it that wears.
    pub skin_mj: (u32, u32),
    /// Share of false alarms that limits are for, if it was set: see [`super::Command::SetFalseAlarm`].
    pub false_alarm: Option<f32>,
    /// True if movements may press with up to 2 N: see [`super::Command::SetHighForce`].
    pub high_force: bool,
    /// The finger that the firmware is for.
    pub finger: FingerCode,
}

/// What the acquisition and the link count, since boot.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
pub struct Counts {
    /// Slots, of 1/4400 s.
    pub slots: u32,
    /// Slots that came too late; they have no word.
    pub late_slots: u32,
    /// Words with a parity or padding error.
    pub parity_errors: u32,
    /// Error frames of the sensor, and words of no sensor.
    pub error_frames: u32,
    /// Words dropped because a queue on the way to the features was full.
    pub lost_samples: u32,
    /// Reports dropped because the queue to the host was full.
    pub lost_reports: u32,
    /// Frames from the host that were damaged.
    pub damaged_frames: u32,
    /// Sectors of the flash that were erased: each bears it 10,000 times. Older logs do not say.
    #[serde(default)]
    pub erasures: u32,
}

/// What one slide says.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, Default)]
pub struct SlideReport {
    /// Values in the order of [`Property::ALL`].
    pub properties: [Option<f32>; 3],
    /// The roughness is an upper bound.
    pub roughness_is_bound: bool,
    /// Power of the still finger, counts^2.
    pub background: f32,
    /// Natural logarithms of the band powers, in steps of 1/1024.
    pub bands: Vec<i16, FUSED_BANDS>,
    /// Mean and standard deviation of P_DC, in steps of 1/1024 of 100 counts.
    pub pressure: Option<[i16; 2]>,
    /// Natural logarithm of the speed in parts of the movement's, in steps of 1/1024, where the probe measured it.
    pub pace: Option<i16>,
}

impl SlideReport {
    /// The properties.
    pub const fn properties(&self) -> Properties {
        Properties::new(self.properties)
    }

    /// What an exploration makes of it.
    pub fn observation(&self) -> Observation {
        Observation {
            properties: self.properties(),
            bands: self.bands.clone(),
            pressure: self.pressure,
            pace: self.pace,
        }
    }
}

impl From<&Measurement> for SlideReport {
    fn from(slide: &Measurement) -> Self {
        let Observation {
            properties,
            bands,
            pressure,
            pace,
        } = slide.into();
        Self {
            properties: Property::ALL.map(|p| properties.get(p)),
            roughness_is_bound: slide.roughness_is_bound,
            background: slide.background,
            bands,
            pressure,
            pace,
        }
    }
}

/// What lies under the finger.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, Default)]
pub struct Verdict {
    /// Index in the table.
    pub texture: u16,
    /// Name in the table.
    pub name: Name,
    /// Posterior probability.
    pub probability: f32,
    /// True if it is over the threshold.
    pub sure: bool,
    /// True if it is rather none of the textures known; the one named is the most alike.
    pub unknown: bool,
    /// Log-odds of that, where they can be told.
    pub log_odds: Option<f32>,
    /// Slides that counted.
    pub slides: u8,
    /// True if the probe asks for [`super::Command::Label`]: the table is fused, and the probe is not certain.
    pub wants_label: bool,
    /// True if it is sure, but the texture is not as it was learned.
    pub changed: bool,
    /// True if it would be sure, but the table is sure of a wrong name for too many new textures.
    pub most_like: bool,
}

impl From<&Verdict> for explorer::Verdict {
    fn from(told: &Verdict) -> Self {
        Self {
            texture: told.texture,
            probability: told.probability,
            sure: told.sure,
            most_like: told.most_like,
            unknown: told.unknown,
            changed: told.changed,
            log_odds: told.log_odds,
        }
    }
}

/// What the probe has learned from the slides of an exploration.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct TextureLearned {
    /// Name of the texture.
    pub name: Name,
    /// How many slides.
    pub slides: u8,
    /// True if by itself; otherwise from the user.
    pub itself: bool,
}

/// What the rig is at.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, Default)]
pub struct Live {
    /// Contact force by P_DC, mN.
    pub force_mn: i16,
    /// Steps of the lever, downwards positive.
    pub steps: i32,
    /// Place of the stage, um.
    pub stage_um: i32,
    /// Speed of the stage, um/s.
    pub speed_um_s: i32,
    /// Motor current, mA.
    pub current_ma: i16,
}
