//! A verification of the probe, held against the other textures of its table here.

use tactus_core::explorer::{Config, Explorer, ExplorerError, Method, Strategy};
use tactus_core::features::{Movement, PropertySet};
use tactus_core::table::{MAX_TEXTURES, Table, TableError};
use tactus_core::wire::{Event, Identify};

use crate::eval::verified::{NoLimits, Slide, Verified, name};
use crate::eval::verify::false_accept;

/// A verification under way.
pub struct Verifying<'t> {
    verified: Verified,
    texture: u16,
    /// what the probe says of its slides, held against the other textures here
    here: Box<Explorer<'t, MAX_TEXTURES>>,
    movement: Option<Movement>,
}

/// Why a probe's table verifies nothing.
#[derive(Debug, thiserror::Error)]
pub enum NoReference {
    /// It has no limits.
    #[error(transparent)]
    Limits(#[from] NoLimits),
    /// It does not read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// It cannot be explored.
    #[error(transparent)]
    Explorer(#[from] ExplorerError),
}

/// How a probe verifies that is asked like this.
pub fn config_of(asked: &Identify) -> Config {
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
    /// Before the first slide: the reference is this texture of the table.
    ///
    /// # Errors
    /// The table cannot say what is the same.
    pub fn new(bytes: &'t [u8], texture: u16, config: Config) -> Result<Self, NoReference> {
        let table = Table::read(bytes)?;
        Ok(Self {
            verified: Verified::new(table, texture, &config)?,
            texture,
            here: Box::new(Explorer::among(table, PropertySet::ALL, config, [texture])?),
            movement: None,
        })
    }

    /// The texture that it may be.
    pub fn reference(&self) -> &str {
        &self.verified.reference
    }

    /// Takes in what the probe says; the slide that was judged with it.
    pub fn hear(&mut self, event: &Event) -> Option<&Slide> {
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
                    force_n: self.movement.map_or(0.0, Movement::force_n),
                    speed_mm_s: self.movement.map_or(0.0, Movement::speed_mm_s),
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

    /// The answer, and what it is worth.
    pub fn end(mut self) -> Verified {
        self.verified.false_accept = false_accept(&self.here, self.texture);
        self.verified
    }
}

/// What is printed, without what is around it.
pub(super) fn words(print: impl FnOnce(&mut Vec<u8>) -> std::io::Result<()>) -> String {
    let mut out = Vec::new();
    // memory takes it
    let _ = print(&mut out);
    String::from_utf8_lossy(&out).trim().to_owned()
}
