//! Slides of a real finger in the project's format, from the raw samples that the probe streams while it explores.
//!
//! The probe is asked for an exploration that takes one movement after the other and is never sure. P_AC and shear are the
//! very samples that went into its features. P_DC is not streamed: it is computed back from the contact force, which the
//! probe reports 20 times a second.

use tactus::data::recording::{Background, PAC_RATE_HZ, Slide};
use tactus_core::features::{Block, Movement};
use tactus_core::sensor::pressure::Calibration;
use tactus_core::wire::{Event, Live, Phase, Report};

/// How often the probe reports the force while the rig moves.
const LIVE_HZ: u32 = 20;
/// Rate of the shear samples.
const SHEAR_HZ: u32 = 1000;

/// Why a slide that counted is not recorded.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub(crate) enum RecordError {
    /// A report was lost on the line.
    #[error("block {0} of its samples is missing")]
    MissingBlock(u16),
    /// No samples came.
    #[error("its samples did not come")]
    NoSamples,
}

/// Puts slides together from reports.
#[derive(Debug)]
pub(crate) struct Recorder {
    calibration: Calibration,
    movement: Option<Movement>,
    numbers: u32,
    slide: Begun,
}

/// What has come of a slide.
#[derive(Debug, Default)]
struct Begun {
    blocks: Vec<Block>,
    missing: Option<u16>,
    /// when it began by the probe's clock, ms, and the force since then
    began_ms: Option<u32>,
    sliding: bool,
    forces: Vec<(u32, i16)>,
}

impl Recorder {
    /// A recorder of slides of one texture, with the probe's calibration.
    pub(crate) fn new(calibration: Calibration) -> Self {
        Self {
            calibration,
            movement: None,
            numbers: 0,
            slide: Begun::default(),
        }
    }

    /// Takes in a report; the slide that counts from now on, for the texture of this index.
    pub(crate) fn hear(
        &mut self,
        texture: usize,
        report: &Report,
    ) -> Option<Result<Slide, RecordError>> {
        let slide = &mut self.slide;
        match &report.event {
            Event::Chosen { movement, .. } => {
                self.movement = Some(*movement);
                self.slide = Begun::default();
            }
            Event::Rejected { .. } => self.slide = Begun::default(),
            Event::Phase(Phase::Sliding) => {
                slide.began_ms = Some(report.at_ms);
                slide.sliding = true;
            }
            Event::Live(Live { force_mn, .. }) if slide.sliding => {
                slide.forces.push((report.at_ms, *force_mn));
            }
            // a force reported while the finger is lifted is none of the slide's
            Event::Phase(_) if slide.began_ms.is_some() => slide.sliding = false,
            Event::Block(block) => {
                let expected = slide.blocks.len() as u16;
                if block.number != expected {
                    slide.missing.get_or_insert(expected);
                }
                slide.blocks.push(block.clone());
            }
            Event::SlideReport { .. } => {
                let slide = std::mem::take(slide);
                return Some(self.finish(texture, &slide));
            }
            _ => {}
        }
        None
    }

    fn finish(&mut self, texture: usize, slide: &Begun) -> Result<Slide, RecordError> {
        if let Some(block) = slide.missing {
            return Err(RecordError::MissingBlock(block));
        }
        let (still, moving): (Vec<&Block>, Vec<&Block>) =
            slide.blocks.iter().partition(|b| b.still);
        let steady = moving.iter().find_map(|block| block.steady);
        let (Some((from, to)), Some(movement), Some(began_ms)) =
            (steady, self.movement, slide.began_ms)
        else {
            return Err(RecordError::NoSamples);
        };
        let pac: Vec<i16> = moving.iter().flat_map(|b| b.pac.iter().copied()).collect();
        if pac.len() < to as usize || still.is_empty() {
            return Err(RecordError::NoSamples);
        }
        let seconds = |sample: u32| sample as f32 / PAC_RATE_HZ as f32;
        let samples =
            |rate_hz: u32| (pac.len() as u64 * u64::from(rate_hz)).div_ceil(2200) as usize;
        // shear comes at constant speed only
        let mut shear_mn = vec![0; (seconds(from) * SHEAR_HZ as f32).round() as usize];
        shear_mn.extend(moving.iter().flat_map(|b| b.shear_mn.iter().copied()));
        shear_mn.resize(samples(SHEAR_HZ).max(shear_mn.len()), 0);
        let pdc = (0..=samples(LIVE_HZ))
            .map(|n| {
                let at_ms = began_ms + n as u32 * 1000 / LIVE_HZ;
                let forces = slide.forces.iter();
                let nearest = forces.min_by_key(|(told, _)| told.abs_diff(at_ms));
                let (_, force_mn) = nearest.ok_or(RecordError::NoSamples)?;
                Ok((f32::from(*force_mn) / self.calibration.force_mn_per_count).round() as i16)
            })
            .collect::<Result<_, RecordError>>()?;
        self.numbers += 1;
        Ok(Slide {
            texture,
            number: self.numbers,
            movement,
            pac,
            pdc,
            pdc_rate_hz: LIVE_HZ,
            shear_mn: Some(shear_mn),
            shear_rate_hz: SHEAR_HZ,
            window: (seconds(from), seconds(to)),
            background: Background::Still(
                still.iter().flat_map(|b| b.pac.iter().copied()).collect(),
            ),
        })
    }
}
