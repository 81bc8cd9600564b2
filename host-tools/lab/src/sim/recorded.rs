//! Recorded slides of real textures, played on the simulated rig: see
//! [`World::play`](tactus_world::world::World::play).

use rand::SeedableRng as _;
use rand::seq::SliceRandom as _;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::Method;
use tactus_core::features::{Movement, Observation};
use tactus_core::rig::calibration::RigCalibration;

use crate::data::recording::{PAC_RATE_HZ, Recording};
use crate::data::recordings::{RecordingError, RecordingSet};
use crate::data::replay::measure;
use crate::eval::learn;
use crate::eval::show::count;
use crate::sim::collection::LearnError;
use crate::sim::rig::SimRig;
use tactus_world::played::{Played, SHEAR_HZ};
use tactus_world::world::Setup;

/// Recorded slides of one movement, divided into those that are learned and those that the unknown texture shows.
#[derive(Clone, Debug)]
pub struct RecordedTexture {
    /// Names of the textures.
    pub names: Vec<String>,
    /// The movement that made the recordings.
    pub movement: Movement,
    /// Per texture, the slides to learn from.
    pub train: Vec<Vec<Played>>,
    /// Per texture, all others.
    pub test: Vec<Vec<Played>>,
}

impl RecordedTexture {
    /// All textures of a folder; `train` slides of each, drawn by `seed` from its whole session, are to be learned from
    /// (interleaved).
    pub fn interleaved(
        set: &RecordingSet,
        train: usize,
        seed: u64,
    ) -> Result<Self, RecordingError> {
        let movements = set.movements();
        let &[movement] = movements.as_slice() else {
            let there = count(movements.len() as u64, "movement");
            return Err(RecordingError::said(format!(
                "the recordings are of {there}; play those of one movement"
            )));
        };
        let names: Vec<String> = set.textures().iter().map(|t| t.name.clone()).collect();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let (mut trains, mut tests) = (Vec::new(), Vec::new());
        for (index, name) in names.iter().enumerate() {
            let slides = set.load_texture(index)?;
            if train < 2 || train >= slides.len() {
                let there = count(slides.len() as u64, "slide");
                return Err(RecordingError::said(format!(
                    "{name} has {there}; learning from {train} takes 2 or more, and one must be left"
                )));
            }
            let mut slides = slides
                .iter()
                .map(|slide| {
                    played(slide).ok_or_else(|| {
                        let number = slide.number;
                        RecordingError::said(format!(
                            "slide {number} of {name} has no shear at {SHEAR_HZ} Hz; play recordings with a force \
                             sensor of that rate"
                        ))
                    })
                })
                .collect::<Result<Vec<_>, _>>()?;
            slides.shuffle(&mut random);
            tests.push(slides.split_off(train));
            trains.push(slides);
        }
        Ok(Self {
            names,
            movement,
            train: trains,
            test: tests,
        })
    }

    /// The rig that all recordings are played on; trials differ by `seed`. Its sample only carries the press.
    pub fn setup(seed: u64) -> Setup {
        Setup {
            trial_seed: seed,
            shimmed: true,
            ..Setup::default()
        }
    }

    /// A rig whose unknown texture is this one: its test slides, in an order that `seed` gives.
    pub fn unknown(&self, texture: usize, seed: u64) -> SimRig {
        // other trials than those that were learned
        let mut rig = SimRig::new(Self::setup(1000 * (seed + 1) + texture as u64));
        let slides = self.test.get(texture).cloned().unwrap_or_default();
        rig.world().play(slides, seed);
        rig
    }

    /// Learns a table for a method on the rig, which measures every slide to learn from once.
    /// Errors: the first fault of a rig, or slide without properties.
    pub fn learn(
        &self,
        method: Method,
        calibration: RigCalibration,
    ) -> Result<Vec<u8>, LearnError> {
        let plan = Plan::new();
        let measured = self
            .train
            .par_iter()
            .enumerate()
            .map(|(texture, slides)| {
                let seed = texture as u64;
                let mut rig = SimRig::new(Self::setup(seed));
                rig.world().play(slides.clone(), seed);
                rig.control()
                    .calibrate(calibration)
                    .map_err(|why| LearnError::Rig(why.into()))?;
                rig.home()?;
                let measured = (1..=slides.len())
                    .map(|slide| {
                        let measured = measure(&plan, &rig.record(self.movement)?);
                        let measured = measured.map_err(|source| LearnError::Slide {
                            texture: self.names[texture].clone(),
                            slide,
                            source,
                        })?;
                        Ok(Observation::from(&measured))
                    })
                    .collect::<Result<Vec<_>, LearnError>>()?;
                Ok(vec![measured])
            })
            .collect::<Result<Vec<_>, LearnError>>()?;
        let movements = [self.movement];
        Ok(learn::learn(
            method,
            None,
            &self.names,
            &movements,
            &measured,
        )?)
    }
}

/// A recorded slide from where its steady part begins, so that the rig's ramp already has the texture's vibration.
fn played(slide: &Recording) -> Option<Played> {
    let shear_mn = slide
        .shear_mn()
        .filter(|_| slide.shear_rate_hz == f64::from(SHEAR_HZ))?;
    Some(Played {
        pac: slide.pac().get(slide.steady(PAC_RATE_HZ))?.to_vec(),
        shear_mn: shear_mn.get(slide.steady(SHEAR_HZ))?.to_vec(),
    })
}
