//! A verification of the probe, held against the other textures of its table here.

use tactus_core::explorer::{Config, Explorer, Method, Strategy};
use tactus_core::features::{Movement, PropertySet};
use tactus_core::table::{MAX_TEXTURES, Table};
use tactus_core::wire::{Event, Identify};

use crate::eval::verified::{Slide, Verified, name};
use crate::eval::verify::false_accept;
use tactus_link::OperationError;

pub(super) struct Verifying<'t> {
    verified: Verified,
    texture: u16,
    /// the probe's slides, compared with the other textures
    here: Box<Explorer<'t, MAX_TEXTURES>>,
    movement: Option<Movement>,
}

pub(super) fn config_of(asked: &Identify) -> Config {
    Config {
        method: Method::Fused,
        strategy: Strategy::Cycling,
        threshold: asked.threshold,
        max_slides: asked.max_slides,
        false_alarm: asked.false_alarm,
        verify: true,
        ..Config::default()
    }
}

impl<'t> Verifying<'t> {
    pub(super) fn new(
        bytes: &'t [u8],
        texture: u16,
        config: Config,
    ) -> Result<Self, OperationError> {
        let table = Table::read(bytes)?;
        let here = Explorer::among(table, PropertySet::ALL, config, [texture]);
        Ok(Self {
            verified: Verified::new(table, texture, &config).map_err(OperationError::said)?,
            texture,
            here: Box::new(here.map_err(OperationError::said)?),
            movement: None,
        })
    }

    pub(super) fn reference(&self) -> &str {
        &self.verified.reference
    }

    /// Takes in what the probe says; the slide that was judged with it.
    pub(super) fn hear(&mut self, event: &Event) -> Option<&Slide> {
        match event {
            Event::Chosen { movement, .. } => self.movement = Some(*movement),
            Event::SlideReport {
                action, observed, ..
            } => {
                // a slide that says nothing here is the probe's to judge
                let _ = self.here.observe(*action, &observed.observation());
            }
            Event::Verified { slides, now, .. } => {
                let slide = Slide {
                    number: u32::from(*slides),
                    force_n: self.movement.and_then(|made| made.known().0),
                    speed_mm_s: self.movement.and_then(|made| made.known().1),
                    score: now.score,
                    limit: now.limit,
                    answer: name(now.answer),
                };
                self.verified.answer = slide.answer;
                self.verified.slides.push(slide);
                return self.verified.slides.last();
            }
            _ => {}
        }
        None
    }

    pub(super) fn end(mut self) -> Verified {
        self.verified.false_accept = false_accept(&self.here, self.texture);
        self.verified
    }
}

pub(super) fn words(print: impl FnOnce(&mut Vec<u8>) -> std::io::Result<()>) -> String {
    let mut out = Vec::new();
    // memory takes it
    let _ = print(&mut out);
    String::from_utf8_lossy(&out).trim().to_owned()
}
