//! One recorded slide: the movement that made it, its blocks of samples, and what no block has.

use serde::{Deserialize, Deserializer, Serialize};
use sha2::{Digest as _, Sha256};
use std::ops::Range;
use tactus_core::features::{Block, Movement, Slide};
use tactus_core::sensor::FingerCode;
use tactus_core::sensor::pressure::RATE_HZ;
use tactus_core::table::SlideHash;

use crate::data::recordings::npy::MAX_SAMPLES;

/// Rate of P_AC in every recording: the BioTac's 2200 Hz.
pub const PAC_RATE_HZ: u32 = RATE_HZ;
const SHEAR_HZ: f64 = 1000.0;
/// A remedy where a force or a speed is out of its range.
pub(crate) const LEAVE_OUT: &str =
    "leave it out where it is unknown, or not of a finger that slides";

/// One slide over one texture.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Recording {
    /// Index of the texture in [`RecordingSet::textures`](crate::data::recordings::RecordingSet::textures).
    pub texture: usize,
    /// Number of the slide; slides of a texture were made in the order of their numbers.
    pub number: u32,
    /// The movement that made it.
    #[serde(deserialize_with = "any_movement")]
    pub movement: Movement,
    /// Start and end of the part at constant speed, in seconds from the start of the record.
    pub window: (f32, f32),
    /// P_AC at [`PAC_RATE_HZ`] of the still finger and of the slide, and the tangential force at constant speed.
    pub blocks: Vec<Block>,
    /// Power of the still finger in counts^2 after the band-pass, where its samples are not recorded; 0 where it was
    /// not measured.
    pub background: Option<f32>,
    /// P_DC in counts about the still baseline, from the start of the record; empty if not measured.
    pub pdc: Vec<i16>,
    /// Rate of [`pdc`](Self::pdc) in Hz.
    pub pdc_rate_hz: f64,
    /// Tangential force in mN before and after constant speed, positive against the motion; `None` if the rig could not
    /// measure it.
    pub outside_mn: Option<[Vec<i16>; 2]>,
    /// Speed of the slide, if measured: see [`Observation::pace`](tactus_core::features::Observation::pace).
    pub pace: Option<i16>,
    /// Rate of the tangential force in Hz, also where there is none.
    pub shear_rate_hz: f64,
    /// Highest frequency that the sensor measured, Hz, where that is less than P_AC's rate can carry.
    pub highest_hz: Option<f32>,
}

/// A movement that may be unknown.
fn any_movement<'de, D: Deserializer<'de>>(from: D) -> Result<Movement, D::Error> {
    let (force_mn, speed_um_s) = Deserialize::deserialize(from)?;
    Movement::stored(force_mn, speed_um_s).map_err(serde::de::Error::custom)
}

/// One texture of a set.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Serialize, Deserialize)]
pub struct Texture {
    /// The number that the recordings give it.
    pub id: u32,
    /// Its name.
    pub name: String,
}

/// Facts of a slide that are known before its samples are read.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct SlideKey {
    /// As [`Recording::number`].
    pub number: u32,
    /// As [`Recording::movement`].
    pub movement: Movement,
    /// Labels of its sample, and its operator.
    pub labels: Labels,
}

/// Labels of a slide for quality control besides its texture; empty if unknown.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
pub struct Labels {
    /// Batch or piece that the sample was taken from.
    pub lot: String,
    /// Operator of the slide.
    pub operator: String,
    /// Anything else.
    pub note: String,
    /// True if the sample was moved or turned since the slide before.
    pub moved: Option<bool>,
    /// The session, and the run of the rig in it; empty if unknown.
    pub session: String,
    /// See [`session`](Self::session).
    pub run: String,
    /// The finger; a BioTac if unknown.
    pub finger: FingerCode,
    /// Name of the sensor, where the finger is [`FingerCode::OTHER`].
    pub sensor: String,
    /// Day on which that finger's force per count was measured, as 20261121; 1 if the day is unknown, 0 if it was not
    /// measured or that is unknown.
    pub calibrated: u32,
}

impl Labels {
    /// Labels by which slides are selected.
    pub const SELECTING: [&'static str; 4] = ["lot", "operator", "session", "run"];

    /// The label of a column of [`SELECTING`](Self::SELECTING); empty for any other.
    pub fn get(&self, column: &str) -> &str {
        match column {
            "lot" => &self.lot,
            "operator" => &self.operator,
            "session" => &self.session,
            "run" => &self.run,
            _ => "",
        }
    }
}

impl Recording {
    /// A recording from blocks, with P_DC beside them, of so many ms. Texture and number are left at 0. `None`: samples
    /// are missing.
    pub(crate) fn from_blocks(
        movement: Movement,
        blocks: Vec<Block>,
        pdc: Vec<i16>,
        pdc_rate_hz: f64,
        ms: usize,
    ) -> Option<Self> {
        let (from, to) = blocks.iter().find_map(|block| block.steady)?;
        let seconds = |sample: u32| sample as f32 / PAC_RATE_HZ as f32;
        let before = (f64::from(seconds(from)) * SHEAR_HZ).round() as usize;
        let inside: usize = blocks.iter().map(|block| block.shear_mn.len()).sum();
        let after = ms.saturating_sub(before + inside);
        let recording = Self {
            texture: 0,
            number: 0,
            movement,
            window: (seconds(from), seconds(to)),
            blocks,
            background: None,
            pdc,
            pdc_rate_hz,
            // a rig sends shear at constant speed only, a handheld none
            outside_mn: (inside > 0).then(|| [vec![0; before], vec![0; after]]),
            pace: None,
            shear_rate_hz: SHEAR_HZ,
            highest_hz: None,
        };
        recording.check().is_ok().then_some(recording)
    }

    /// Takes the samples of whole streams, from the start of the record, in place of those it has: `still` is P_AC of
    /// the finger at rest, empty where its power is known.
    /// Errors: the fault of the recording.
    pub fn cut(
        mut self,
        still: &[i16],
        pac: &[i16],
        shear_mn: Option<&[i16]>,
    ) -> Result<Self, String> {
        let steady = self.steady(self.shear_rate_hz);
        let shear = shear_mn.map(|mn| {
            let (rest, after) = mn.split_at(steady.end.min(mn.len()));
            let (before, inside) = rest.split_at(steady.start.min(rest.len()));
            (inside, [before.to_vec(), after.to_vec()])
        });
        let (inside, outside) = shear.unzip();
        self.outside_mn = outside;
        let steady = self.steady(PAC_RATE_HZ);
        let steady = steady.start as u32..steady.end as u32;
        self.blocks = Block::cut(still, steady, pac, inside.unwrap_or_default()).collect();
        self.check()?;
        Ok(self)
    }

    /// Gives all samples to the core, as a rig would.
    pub fn play(&self, slide: &mut Slide<'_>) {
        if let Some(power) = self.background {
            slide.set_background(power);
        }
        for block in &self.blocks {
            slide.take(block);
        }
        let steady = self.pdc.get(self.steady(self.pdc_rate_hz));
        slide.push_pdc(steady.unwrap_or_default());
        slide.set_pace(self.pace);
        if let Some(hz) = self.highest_hz {
            slide.set_highest(hz);
        }
    }

    /// The same slide, had it ended after so many ms at constant speed; `None` if it does not last longer.
    pub fn first(&self, ms: u16) -> Option<Self> {
        let (start, end) = self.window;
        let until = start + f32::from(ms) / 1000.0;
        if until >= end {
            return None;
        }
        let shear = self.shear_mn();
        let first = Self {
            window: (start, until),
            ..self.clone()
        };
        first.cut(&self.still(), &self.pac(), shear.as_deref()).ok()
    }

    /// P_AC of the finger at rest before this slide, in counts about its baseline.
    pub fn still(&self) -> Vec<i16> {
        self.samples(true, |block| &block.pac)
    }

    /// P_AC of the slide in counts about the still baseline, from the start of the record.
    pub fn pac(&self) -> Vec<i16> {
        self.samples(false, |block| &block.pac)
    }

    /// Tangential force in mN from the start of the record, if the rig could measure it.
    pub fn shear_mn(&self) -> Option<Vec<i16>> {
        let [before, after] = self.outside_mn.as_ref()?;
        let inside = self.samples(false, |block| &block.shear_mn);
        Some([before, &inside, after].map(Vec::as_slice).concat())
    }

    /// The hash by which it is known again, whatever its file or row: of P_AC.
    pub fn hash(&self) -> SlideHash {
        let pac: Vec<u8> = self.pac().iter().flat_map(|x| x.to_le_bytes()).collect();
        let mut hash = SlideHash::default();
        hash.iter_mut()
            .zip(Sha256::digest(pac))
            .for_each(|(to, from)| *to = from);
        hash
    }

    /// Memory of its samples.
    pub(crate) fn bytes(&self) -> u64 {
        let outside = self
            .outside_mn
            .iter()
            .flatten()
            .map(Vec::len)
            .sum::<usize>();
        let counts = (self.pdc.len() + outside) * size_of::<i16>();
        (counts + self.blocks.len() * size_of::<Block>()) as u64
    }

    fn samples(&self, still: bool, stream: fn(&Block) -> &[i16]) -> Vec<i16> {
        let blocks = self.blocks.iter().filter(|block| block.still == still);
        blocks.flat_map(stream).copied().collect()
    }

    /// The part at constant speed as sample numbers of a stream with `rate_hz`.
    pub fn steady(&self, rate_hz: impl Into<f64>) -> Range<usize> {
        let rate_hz = rate_hz.into();
        // `as` saturates and turns not-a-number into 0
        let sample = |s: f32| (f64::from(s) * rate_hz).round() as usize;
        sample(self.window.0)..sample(self.window.1)
    }

    pub(crate) fn check(&self) -> Result<(), String> {
        let (start, end) = self.window;
        if !(start.is_finite() && end.is_finite() && 0.0 <= start && start < end) {
            return Err(format!(
                "the steady window {start} s to {end} s is not a stretch of time"
            ));
        }
        let streams = [
            ("P_AC", f64::from(PAC_RATE_HZ), Some(self.pac().len())),
            (
                "P_DC",
                self.pdc_rate_hz,
                Some(self.pdc.len()).filter(|samples| *samples > 0),
            ),
            (
                "shear",
                self.shear_rate_hz,
                self.shear_mn().map(|s| s.len()),
            ),
        ];
        for (stream, rate_hz, samples) in streams {
            let Some(samples) = samples else {
                continue;
            };
            if !(rate_hz > 0.0 && rate_hz <= 100_000.0) {
                return Err(format!("a rate of {rate_hz} Hz for {stream} is impossible"));
            }
            if samples > MAX_SAMPLES {
                return Err(format!(
                    "the samples of {stream} are {samples}, more than a slide can have ({MAX_SAMPLES})"
                ));
            }
            if samples < self.steady(rate_hz).end {
                return Err(format!(
                    "{stream} (samples: {samples}, at {rate_hz} Hz) ends before the steady window does ({end} s)"
                ));
            }
        }
        match self.background {
            Some(power) if !power.is_finite() || power < 0.0 => {
                Err(format!("a background power of {power} is impossible"))
            }
            None if self.still().is_empty() => {
                Err("the record of the still finger is empty".to_owned())
            }
            _ => Ok(()),
        }
    }
}
