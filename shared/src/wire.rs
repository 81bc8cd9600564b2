//! What host and probe say to each other: [`Request`]s to the probe, [`Report`]s from it.
//!
//! A frame is a message in postcard's format and the CRC-32 (ISO-HDLC, little-endian) of it, both in COBS, and a 0. A 0 is
//! nowhere else, so that after any disturbance the next frame is understood again. A frame that is damaged, too long or no
//! message is counted and dropped: see [`Receiver`].

use core::fmt;

use crc::{CRC_32_ISO_HDLC, Crc};
use heapless::{String, Vec};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::explorer::{Method, Strategy};
use crate::features::{FUSED_BANDS, Measurement, Properties, Property};
use crate::fused::Observation;
use crate::movement::Movement;
use crate::rig::guard::Fault;
use crate::table::Action;

/// Version of the messages. The two ends must have the same.
pub const PROTOCOL: u8 = 3;
/// Most textures in one message; the probe's table holds no more.
pub const MAX_TEXTURES: usize = 128;
/// Longest message, bytes.
pub const MAX_MESSAGE: usize = 768;
/// Longest frame without its closing 0: message, CRC, and what COBS adds, a byte and one for every 254.
pub const MAX_FRAME: usize = MAX_MESSAGE + CRC_BYTES + (MAX_MESSAGE + CRC_BYTES) / 254 + 1;
/// Bytes of a table in one message.
pub const PART: usize = 256;
/// Most actions of an outlook that are told, the best ones.
pub const MAX_OUTLOOK: usize = 16;
/// P_AC samples in one block.
pub const BLOCK: usize = 64;

const CRC_BYTES: usize = 4;
const CRC32: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// Name of a texture.
pub type Name = String<40>;
/// A sentence.
pub type Text = String<120>;

/// From the host.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Request {
    /// Comes back in the answer.
    pub id: u16,
    /// What is asked for.
    pub ask: Ask,
}

/// What the host may ask for. Every request is answered with [`Tell::Done`] or [`Tell::Refused`] when it is over; what it
/// does in between, and what it was asked for, is told before that.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub enum Ask {
    /// How are you? [`Tell::Status`].
    Status,
    /// Ends a fault, then finds the limit switches.
    Home,
    /// Stops what is being done and lifts the finger.
    Stop,
    /// Finds out what lies under the finger.
    Identify(Identify),
    /// What lay under the finger in the last exploration: one of the textures known, or a new one. The probe learns it from
    /// the slides of that exploration.
    Answer(Name),
    /// Learns what lies under the finger.
    Train(Train),
    /// Gives a texture another name.
    Rename {
        /// Its name.
        from: Name,
        /// Its new name.
        to: Name,
    },
    /// Forgets what was learned.
    Forget(Forget),
    /// Measures the motor's current without load, takes and keeps it. [`Tell::Calibration`].
    Calibrate,
    /// [`Tell::Calibration`].
    ReadCalibration,
    /// Takes and keeps these constants: [`crate::rig::calibration::RigCalibration::to_bytes`].
    WriteCalibration(Vec<u8, 64>),
    /// Whether raw samples are told: [`Tell::Block`].
    Stream(bool),
    /// The table in use from this byte on. [`Tell::TablePart`].
    ReadTable(u32),
    /// A table of so many bytes follows.
    BeginTable(u32),
    /// The next bytes of it.
    WriteTable {
        /// Where they belong.
        offset: u32,
        /// The bytes.
        bytes: Vec<u8, PART>,
    },
    /// The table is complete: from now on it is the one in use, if it is whole.
    CommitTable,
    /// Goes back to the table that came with the firmware.
    FactoryTable,
}

/// An exploration.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Identify {
    /// Indices of the textures that it may be; none stands for all.
    pub among: Vec<u16, MAX_TEXTURES>,
    /// A texture more probable than this is the answer.
    pub threshold: f32,
    /// After this many slides the most probable texture is the answer.
    pub max_slides: u8,
    /// How what was felt is compared with what is known; the best one for the table, unless given.
    pub method: Option<Method>,
    /// How the next movement is chosen.
    pub strategy: Strategy,
    /// Whether the answer may be that it is none of them.
    pub open: bool,
    /// Whether the probe learns from a verdict that is certain.
    pub learn: bool,
    /// For random choices, and for where on the sample slides begin.
    pub seed: u32,
}

/// What is to be forgotten.
#[derive(Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Forget {
    /// A texture, whoever taught it.
    Texture(Name),
    /// All that the probe has learned by itself: the table is again as it was taught.
    SelfTaught,
    /// The unfinished training of a texture, or a finished pilot.
    Training(Name),
}

/// A texture to learn.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Train {
    /// Its name. One that is known already goes on where it stood.
    pub name: Name,
    /// How often each movement is to have been made in the end.
    pub trials: u8,
    /// All movements of the grid up to 1.26 N, instead of those of the table.
    pub pilot: bool,
    /// For where on the sample slides begin.
    pub seed: u32,
}

/// From the probe.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Report {
    /// One more than the last one's: a gap is a lost frame.
    pub number: u16,
    /// Since the probe booted, ms.
    pub at_ms: u32,
    /// What there is to say.
    pub tell: Tell,
}

/// What the probe may say.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant)] // no allocation here, and only one at a time
pub enum Tell {
    /// The probe has booted.
    Booted {
        /// [`PROTOCOL`] of the probe.
        protocol: u8,
        /// Version of the firmware.
        version: String<16>,
        /// Why.
        reset: Reset,
        /// What the firmware had to say before it gave up, if it did.
        last_words: Option<Text>,
    },
    /// Answer to [`Ask::Status`].
    Status(Status),
    /// The request of this number is over.
    Done(u16),
    /// The request of this number is refused or came to nothing.
    Refused {
        /// Its number.
        id: u16,
        /// Why, and what to do.
        why: Text,
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
        /// What the best actions promise, best first.
        outlook: Vec<Promise, MAX_OUTLOOK>,
    },
    /// The slide was made and taken in.
    Felt {
        /// Number of the slide, from 1.
        slide: u8,
        /// What was looked at.
        action: Action,
        /// What was felt.
        felt: Felt,
        /// Probability of every texture of the table. On the line only those that are not 0: most are soon.
        #[serde(with = "sparse")]
        posterior: Vec<f32, MAX_TEXTURES>,
    },
    /// The slide was made and does not count; it is repeated.
    Rejected {
        /// Number of the slide, from 1.
        slide: u8,
        /// Why.
        why: Text,
    },
    /// What lies under the finger.
    Verdict {
        /// Index in the table.
        texture: u16,
        /// Name in the table.
        name: Name,
        /// Posterior probability.
        probability: f32,
        /// Whether it is over the threshold.
        sure: bool,
        /// Whether it is rather none of the textures known; the one named is the most alike.
        unknown: bool,
        /// Log-odds of that, where they can be told.
        log_odds: Option<f32>,
        /// Slides that counted.
        slides: u8,
        /// Whether the probe would learn from [`Ask::Answer`]: it is not certain.
        asks: bool,
    },
    /// The probe has learned from what it felt: so many slides.
    Taught {
        /// Name of the texture.
        name: Name,
        /// How many slides.
        slides: u8,
        /// Whether by itself; otherwise from the user.
        itself: bool,
    },
    /// A movement of a texture that is learned was made.
    Learned {
        /// The movement.
        movement: Movement,
        /// Its trial, from 1.
        trial: u8,
        /// Trials to come after it, of all movements.
        left: u16,
        /// What was felt.
        felt: Felt,
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

/// What the rig does: [`crate::rig::control::Phase`] without its fault.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Phase {
    /// It does not know where it is.
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

impl From<crate::rig::control::Phase> for Phase {
    fn from(phase: crate::rig::control::Phase) -> Self {
        use crate::rig::control::Phase as Rig;
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
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
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
    /// Whether it came with the firmware.
    pub factory: bool,
    /// Day of the calibration, as 20261121; 0 for constants that nobody measured.
    pub calibrated: u32,
    /// What was counted since boot.
    pub counts: Counts,
    /// Work that the skin has seen, mJ, and that part of it that wears.
    pub skin_mj: (u32, u32),
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
    /// Words that found no room on their way to the features.
    pub lost_samples: u32,
    /// Reports that found no room on their way to the host.
    pub lost_reports: u32,
    /// Frames from the host that were damaged.
    pub damaged_frames: u32,
}

/// What an action promises.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Promise {
    /// The action.
    pub action: Action,
    /// Uncertainty that is expected to remain (eq. 11).
    pub uncertainty: f32,
    /// Its benefit (eq. 12).
    pub benefit: f32,
}

/// Numbers most of which are 0: how many there are, and the others with their places, ascending.
mod sparse {
    use serde::de::Error as _;
    use serde::ser::Error as _;
    use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

    use super::{MAX_TEXTURES, Vec};
    use crate::up_to;

    const _: () = assert!(MAX_TEXTURES <= 1 << u8::BITS);

    type OnLine = (u16, Vec<(u8, f32), MAX_TEXTURES>);

    pub(super) fn serialize<S: Serializer>(
        numbers: &Vec<f32, MAX_TEXTURES>,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let others = numbers.iter().zip(0..);
        let others = others.filter(|(number, _)| number.to_bits() != 0);
        let others = up_to(others.map(|(number, place)| (place, *number)));
        let count = u16::try_from(numbers.len()).map_err(S::Error::custom)?;
        OnLine::from((count, others)).serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<f32, MAX_TEXTURES>, D::Error> {
        let (count, others) = OnLine::deserialize(deserializer)?;
        let mut numbers = Vec::new();
        numbers
            .resize(count.into(), 0.0)
            .map_err(|_| D::Error::custom("too many textures"))?;
        let mut next = 0;
        for (place, number) in others {
            match numbers.get_mut(usize::from(place)) {
                Some(there) if place >= next => *there = number,
                _ => return Err(D::Error::custom("textures out of order")),
            }
            next = place.saturating_add(1);
        }
        Ok(numbers)
    }
}

/// What one slide says.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Felt {
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
}

impl Felt {
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
        }
    }
}

impl From<&Measurement> for Felt {
    fn from(slide: &Measurement) -> Self {
        let Observation {
            properties,
            bands,
            pressure,
        } = slide.into();
        Self {
            properties: Property::ALL.map(|p| properties.get(p)),
            roughness_is_bound: slide.roughness_is_bound,
            background: slide.background,
            bands,
            pressure,
        }
    }
}

/// What the rig is at.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
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

/// Raw samples of the still finger or of a slide, gap-free: `number` says the order.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Block {
    /// One more than the last block's of the same movement, from 0.
    pub number: u16,
    /// The still finger: the background. Otherwise the slide.
    pub still: bool,
    /// With the first block of a slide: which of its P_AC samples are at constant speed, from and to.
    pub steady: Option<(u32, u32)>,
    /// P_AC, counts about the still finger's baseline.
    pub pac: Vec<i16, BLOCK>,
    /// Shear at constant speed, mN.
    pub shear_mn: Vec<i16, BLOCK>,
    /// Samples that were lost, so that the slide does not count.
    pub lost: u32,
}

/// Why a message does not fit into a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct TooLong;

impl fmt::Display for TooLong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the message is longer than {MAX_MESSAGE} bytes")
    }
}

impl core::error::Error for TooLong {}

/// A frame of `message`, its closing 0 included, at the beginning of `room`.
///
/// # Errors
/// [`TooLong`].
pub fn encode<'r, M: Serialize>(
    message: &M,
    room: &'r mut [u8; MAX_FRAME + 1],
) -> Result<&'r [u8], TooLong> {
    let mut bytes = [0; MAX_MESSAGE + CRC_BYTES];
    let (body, _) = bytes.split_at_mut(MAX_MESSAGE);
    let length = postcard::to_slice(message, body)
        .map_err(|_| TooLong)?
        .len();
    let body = bytes.get(..length).ok_or(TooLong)?;
    let crc = CRC32.checksum(body).to_le_bytes();
    let whole = bytes.get_mut(..length + CRC_BYTES).ok_or(TooLong)?;
    let end = whole.last_chunk_mut::<CRC_BYTES>().ok_or(TooLong)?;
    *end = crc;
    let length = cobs::try_encode(whole, room).map_err(|_| TooLong)?;
    // the room was chosen for it
    let frame = room.get_mut(..=length).ok_or(TooLong)?;
    if let Some(closing) = frame.last_mut() {
        *closing = 0;
    }
    Ok(frame)
}

/// What is wrong with a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum FrameError {
    /// More bytes without a 0 than any frame has.
    TooLong,
    /// No COBS.
    Cobs,
    /// The CRC differs.
    Crc,
    /// Whole, and no message of this protocol.
    Message,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the frame is too long",
            Self::Cobs => "the frame is damaged (COBS)",
            Self::Crc => "the frame is damaged (CRC)",
            Self::Message => "the frame is no message: do both ends have the same version?",
        })
    }
}

impl core::error::Error for FrameError {}

/// The message in a frame without its closing 0; the frame is used up.
///
/// # Errors
/// See [`FrameError`].
pub fn decode<M: DeserializeOwned>(frame: &mut [u8]) -> Result<M, FrameError> {
    let length = cobs::decode_in_place(frame).map_err(|_| FrameError::Cobs)?;
    let whole = frame.get(..length).ok_or(FrameError::Cobs)?;
    let (body, crc) = whole
        .split_last_chunk::<CRC_BYTES>()
        .ok_or(FrameError::Crc)?;
    if CRC32.checksum(body) != u32::from_le_bytes(*crc) {
        return Err(FrameError::Crc);
    }
    match postcard::take_from_bytes(body) {
        Ok((message, [])) => Ok(message),
        _ => Err(FrameError::Message),
    }
}

/// Puts frames together from the bytes of a line.
#[derive(Debug, Default)]
pub struct Receiver {
    frame: Vec<u8, MAX_FRAME>,
    too_long: bool,
}

impl Receiver {
    /// One that has heard nothing yet.
    pub const fn new() -> Self {
        Self {
            frame: Vec::new(),
            too_long: false,
        }
    }

    /// Takes in a byte; at the end of a frame, the message in it. An empty frame is nothing: a 0 more does no harm.
    pub fn push<M: DeserializeOwned>(&mut self, byte: u8) -> Option<Result<M, FrameError>> {
        if byte != 0 {
            self.too_long |= self.frame.push(byte).is_err();
            return None;
        }
        let message = if self.too_long {
            Some(Err(FrameError::TooLong))
        } else if self.frame.is_empty() {
            None
        } else {
            Some(decode(&mut self.frame))
        };
        self.frame.clear();
        self.too_long = false;
        message
    }
}

#[cfg(test)]
mod tests;
