//! Recorded slides, measured by the core: a [`Rig`] replays them one by one, or a whole folder is measured at once.

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tactus_core::dsp::{Kernels, Plain, Plan};
use tactus_core::features::{
    self, Block, Measurement, Movement, Property, PropertySet, SlideError,
};
use tactus_core::rig::Rig;

use crate::data::recording::{Background, PAC_RATE_HZ, Slide, Texture};
use crate::data::recordings::{RecordingError, RecordingSet};

/// Gives all samples of a recorded slide to the core, as a rig would.
pub fn play<K: Kernels>(recorded: &Slide, slide: &mut features::Slide<'_, K>) {
    let still: &[i16] = match &recorded.background {
        Background::Power(power) => {
            slide.set_background(*power);
            &[]
        }
        Background::Still(samples) => samples,
    };
    let shear = recorded
        .shear_mn
        .as_ref()
        .and_then(|s| s.get(recorded.steady(recorded.shear_rate_hz)));
    let steady = recorded.steady(PAC_RATE_HZ);
    let steady = steady.start as u32..steady.end as u32;
    for block in Block::cut(still, steady, &recorded.pac, shear.unwrap_or_default()) {
        slide.take(&block);
    }
    slide.push_pdc(
        recorded
            .pdc
            .get(recorded.steady(recorded.pdc_rate_hz))
            .unwrap_or_default(),
    );
}

/// The properties of one recorded slide.
///
/// # Errors
/// The slide has none: it is too short or silent.
pub fn measure(plan: &Plan, recorded: &Slide) -> Result<Measurement, SlideError> {
    let mut slide = features::Slide::<Plain>::new(plan, recorded.movement);
    play(recorded, &mut slide);
    slide.finish()
}

/// The features of one recorded slide.
#[derive(Clone, Debug)]
pub struct MeasuredSlide {
    /// Number of the slide, in the order of time.
    pub number: u32,
    /// The movement that made it.
    pub movement: Movement,
    /// What the core computed.
    pub measurement: Measurement,
}

/// Why a folder cannot be measured.
#[derive(Debug, thiserror::Error)]
pub enum MeasureError {
    /// It cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// One of its slides has no properties.
    #[error("slide {number} of {texture}: {why}")]
    Slide {
        /// Name of the texture.
        texture: String,
        /// Number of the slide.
        number: u32,
        /// What is wrong with it.
        why: SlideError,
    },
}

/// Measures every slide of a folder, several textures at once; `done` gets each texture when it is finished. Returns the
/// slides of each texture in the order of time.
///
/// # Errors
/// The first file that cannot be read, or the first slide that has no properties.
pub fn measure_all(
    set: &RecordingSet,
    done: impl Fn(&Texture) + Sync,
) -> Result<Vec<Vec<MeasuredSlide>>, MeasureError> {
    let plan = Plan::new();
    (0..set.textures().len())
        .into_par_iter()
        .map(|index| {
            let texture = &set.textures()[index];
            let measured = set
                .load_texture(index)?
                .iter()
                .map(|slide| {
                    let measurement = measure(&plan, slide).map_err(|why| MeasureError::Slide {
                        texture: texture.name.clone(),
                        number: slide.number,
                        why,
                    })?;
                    Ok(MeasuredSlide {
                        number: slide.number,
                        movement: slide.movement,
                        measurement,
                    })
                })
                .collect::<Result<Vec<_>, MeasureError>>()?;
            done(texture);
            Ok(measured)
        })
        .collect()
}

/// A rig whose unknown texture is a pile of recorded slides: each movement replays one of that movement, drawn with
/// replacement.
#[derive(Debug)]
pub struct Replay {
    slides: Vec<Slide>,
    random: ChaCha8Rng,
}

/// There is no recording of this movement.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("no slide of the movement {0} was recorded")]
pub struct NotRecorded(pub Movement);

impl Replay {
    /// A rig that replays `slides`.
    pub fn new(slides: Vec<Slide>, random: ChaCha8Rng) -> Self {
        Self { slides, random }
    }
}

impl Rig for Replay {
    type Error = NotRecorded;

    fn measures(&self) -> PropertySet {
        let traction = self.slides.iter().all(|s| s.shear_mn.is_some());
        Property::ALL
            .into_iter()
            .filter(|&p| traction || p != Property::Traction)
            .collect()
    }

    async fn perform<K: Kernels>(
        &mut self,
        slide: &mut features::Slide<'_, K>,
    ) -> Result<(), NotRecorded> {
        let movement = slide.movement();
        let recorded: Vec<&Slide> = self
            .slides
            .iter()
            .filter(|s| s.movement == movement)
            .collect();
        if recorded.is_empty() {
            return Err(NotRecorded(movement));
        }
        play(recorded[self.random.random_range(0..recorded.len())], slide);
        Ok(())
    }
}
