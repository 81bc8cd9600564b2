//! Slides of a real finger in the project's format, from the raw samples that the probe streams while it explores.
//!
//! The probe gets a request for an exploration that takes one movement after the other and is never sure. P_AC and
//! shear are the very samples of its features, and so is P_DC of a handheld. A rig does not stream P_DC: it is computed
//! back from the contact force, which the rig reports 20 times a second.

use crate::data::recording::{PAC_RATE_HZ, Recording};
use tactus_core::explorer::Strategy;
use tactus_core::features::{Block, Movement};
use tactus_core::sensor::pressure::Calibration;
use tactus_core::wire::{Event, Identify, Live, Phase, Report};

/// Rate at which the probe reports the force while the rig moves, Hz.
const LIVE_HZ: u32 = 20;

/// Reasons why a slide that counted is not recorded.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// A report was lost on the line.
    #[error("block {0} of its samples is missing")]
    MissingBlock(u16),
    /// No samples came.
    #[error("its samples did not come")]
    NoSamples,
}

/// Puts slides together from reports.
#[derive(Debug)]
pub struct Recorder {
    calibration: Calibration,
    movement: Option<Movement>,
    numbers: u32,
    slide: Begun,
}

#[derive(Debug, Default)]
struct Begun {
    blocks: Vec<Block>,
    /// when it began by the probe's clock, ms, and the force since then
    began_ms: Option<u32>,
    sliding: bool,
    forces: Vec<(u32, i16)>,
    /// P_DC from the slide's begin on, counts about that of the lifted finger, if the probe sends it
    pdc: Vec<i16>,
    /// it ended before its end
    early: bool,
}

impl Recorder {
    /// The exploration of a trial, counted from 0, that makes the slides to record: with this threshold it does not end
    /// before.
    pub fn wanted(trial: usize, slides: u8, seed: u32) -> Identify {
        Identify {
            threshold: 1.0,
            max_slides: slides,
            strategy: Strategy::Cycling,
            open: false,
            // those of the next trial begin elsewhere, too
            seed: seed.wrapping_add(trial as u32),
            ..Identify::default()
        }
    }

    /// A recorder of slides of one texture, with the probe's calibration.
    pub fn new(calibration: Calibration) -> Self {
        Self {
            calibration,
            movement: None,
            numbers: 0,
            slide: Begun::default(),
        }
    }

    /// Takes in a report; the slide that counts from now on, for the texture of this index. One that ended early is no
    /// recording of its movement.
    pub fn hear(
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
            // a force reported while the finger is lifted does not belong to the slide
            Event::Phase(_) if slide.began_ms.is_some() => slide.sliding = false,
            Event::Block(block) => {
                if block.number == 0 {
                    // a person has pressed anew
                    slide.blocks.clear();
                    slide.pdc.clear();
                }
                slide.blocks.push(block.clone());
            }
            Event::Pdc(counts) => slide.pdc.extend_from_slice(counts),
            Event::Early(_) => slide.early = true,
            Event::SlideReport { observed, .. } => {
                let slide = std::mem::take(slide);
                if slide.early {
                    return None;
                }
                return Some(self.finish(texture, slide, observed.pace));
            }
            _ => {}
        }
        None
    }

    fn finish(
        &mut self,
        texture: usize,
        slide: Begun,
        pace: Option<i16>,
    ) -> Result<Recording, RecordError> {
        let mut numbered = slide.blocks.iter().enumerate();
        if let Some((missing, _)) = numbered.find(|(n, block)| usize::from(block.number) != *n) {
            return Err(RecordError::MissingBlock(missing as u16));
        }
        let movement = self.movement.ok_or(RecordError::NoSamples)?;
        let moving = slide.blocks.iter().filter(|block| !block.still);
        let pac: usize = moving.map(|block| block.pac.len()).sum();
        let samples = |rate_hz: usize| (pac * rate_hz).div_ceil(PAC_RATE_HZ as usize);
        let (pdc, rate_hz) = if slide.pdc.is_empty() {
            let pdc = (0..=samples(LIVE_HZ as usize)).map(|n| {
                let at_ms = slide.began_ms?.wrapping_add(n as u32 * 1000 / LIVE_HZ);
                let forces = slide.forces.iter();
                let (_, force_mn) = forces.min_by_key(|(told, _)| told.abs_diff(at_ms))?;
                Some((f32::from(*force_mn) / self.calibration.force_mn_per_count).round() as i16)
            });
            let pdc: Option<Vec<i16>> = pdc.collect();
            (pdc.ok_or(RecordError::NoSamples)?, LIVE_HZ)
        } else {
            (slide.pdc, PAC_RATE_HZ)
        };
        let recording =
            Recording::from_blocks(movement, slide.blocks, pdc, rate_hz.into(), samples(1000))
                .ok_or(RecordError::NoSamples)?;
        self.numbers += 1;
        Ok(Recording {
            texture,
            number: self.numbers,
            pace,
            ..recording
        })
    }
}
