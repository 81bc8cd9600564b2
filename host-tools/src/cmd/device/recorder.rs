//! Slides of a real finger in the project's format, from the raw samples that the probe streams while it explores.
//!
//! The probe is asked for an exploration that takes one movement after the other and is never sure. P_AC and shear are the
//! very samples that went into its features. P_DC is not streamed: it is computed back from the contact force, which the
//! probe reports 20 times a second.

use tactus::data::recording::{PAC_RATE_HZ, Recording};
use tactus_core::features::{Block, Movement};
use tactus_core::sensor::pressure::Calibration;
use tactus_core::wire::{Event, Live, Phase, Report};

/// How often the probe reports the force while the rig moves.
const LIVE_HZ: u32 = 20;

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
    ) -> Option<Result<Recording, RecordError>> {
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
            Event::Block(block) => slide.blocks.push(block.clone()),
            Event::SlideReport { .. } => {
                let slide = std::mem::take(slide);
                return Some(self.finish(texture, slide));
            }
            _ => {}
        }
        None
    }

    fn finish(&mut self, texture: usize, slide: Begun) -> Result<Recording, RecordError> {
        let mut numbered = slide.blocks.iter().enumerate();
        if let Some((missing, _)) = numbered.find(|(n, block)| usize::from(block.number) != *n) {
            return Err(RecordError::MissingBlock(missing as u16));
        }
        let (Some(movement), Some(began_ms)) = (self.movement, slide.began_ms) else {
            return Err(RecordError::NoSamples);
        };
        let moving = slide.blocks.iter().filter(|block| !block.still);
        let pac: usize = moving.map(|block| block.pac.len()).sum();
        let samples = |rate_hz: usize| (pac * rate_hz).div_ceil(PAC_RATE_HZ as usize);
        let pdc = (0..=samples(LIVE_HZ as usize)).map(|n| {
            let at_ms = began_ms + n as u32 * 1000 / LIVE_HZ;
            let forces = slide.forces.iter();
            let (_, force_mn) = forces.min_by_key(|(told, _)| told.abs_diff(at_ms))?;
            Some((f32::from(*force_mn) / self.calibration.force_mn_per_count).round() as i16)
        });
        let recording = pdc.collect::<Option<_>>().and_then(|pdc| {
            Recording::from_blocks(movement, slide.blocks, pdc, LIVE_HZ, samples(1000))
        });
        let recording = recording.ok_or(RecordError::NoSamples)?;
        self.numbers += 1;
        Ok(Recording {
            texture,
            number: self.numbers,
            ..recording
        })
    }
}
