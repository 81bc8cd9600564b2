//! The textures of a simulated world: recorded trial by trial, and learned.

use std::fmt;
use std::path::Path;

use rayon::prelude::*;
use tactus_core::dsp::Plan;
use tactus_core::explorer::Method;
use tactus_core::features::{FeatureSet, Movement, Observation, SlideError};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::sensor::{FingerCode, FingerName};

use crate::data::recording::{Labels, Recording, Texture};
use crate::data::recordings::{RecordingError, RecordingWriter};
use crate::data::replay::measure;
use crate::eval::learn::{self, Expected, ObservedTrial, TableError};
use crate::sim::rig::{SimError, SimRig};
use tactus_world::textures::TEXTURES;
use tactus_world::world::Setup;

/// Textures of a simulated world, to record and to learn.
#[derive(Clone, Debug)]
pub struct Collection {
    /// The world's seed: its textures, motors and fingertip.
    pub seed: u64,
    /// Numbers of the textures in Table 1.
    pub textures: Vec<u8>,
    /// Trials of each texture and movement.
    pub trials: u32,
    /// The finger that touches them.
    pub finger: FingerName,
}

impl Collection {
    /// Textures that a BioTac touches.
    pub fn new(seed: u64, textures: Vec<u8>, trials: u32) -> Self {
        Self {
            seed,
            textures,
            trials,
            finger: FingerName::Biotac,
        }
    }

    /// The same with another finger.
    #[must_use]
    pub fn touched_by(self, finger: FingerName) -> Self {
        Self { finger, ..self }
    }

    /// The movements of the study.
    pub const MOVEMENTS: [Movement; 3] = [
        Movement::FOR_TRACTION,
        Movement::FOR_FINENESS,
        Movement::FOR_ROUGHNESS,
    ];

    /// The default lengths after which a slide may end, ms at constant speed.
    pub const LENGTHS_MS: [u16; 3] = [500, 1000, 2000];

    /// The textures of a collection of `among` that holds `unknown`: the others are spread over Table 1.
    pub fn spread(unknown: u8, among: u8) -> Vec<u8> {
        let others = u16::from(among.clamp(1, 117)) - 1;
        let mut textures: Vec<u8> = (0..others)
            .map(|n| (n * 116 / others) as u8 + 1)
            .map(|number| number + u8::from(number >= unknown))
            .collect();
        textures.push(unknown);
        textures.sort_unstable();
        textures
    }

    /// Begins a folder of recordings of it, or continues one that was interrupted.
    /// Errors: the folder cannot be written, or holds other recordings.
    pub fn writer(&self, folder: &Path) -> Result<RecordingWriter, RecordingError> {
        let named = self.textures.iter().map(|&number| Texture {
            id: number.into(),
            name: texture_name(number).to_owned(),
        });
        let numbers: Vec<String> = self.textures.iter().map(u8::to_string).collect();
        let (seed, trials, numbers) = (self.seed, self.trials, numbers.join(","));
        let finger_said = match self.finger {
            FingerName::Biotac => String::new(),
            other => format!(" --finger {other}"),
        };
        let command = format!(
            "tactus simulate --seed {seed} --trials {trials} --textures {numbers}{finger_said}"
        );
        let labels = Labels {
            finger: FingerCode::of(self.finger),
            ..Labels::default()
        };
        let writer = RecordingWriter::begin(folder, named.collect(), &command)?;
        Ok(writer.labelled(labels))
    }

    /// A rig of this world with a texture under it. Different trials of one texture are `trial` apart.
    pub fn setup(&self, texture: u8, trial: u64) -> Setup {
        Setup {
            texture,
            world_seed: self.seed,
            trial_seed: self
                .seed
                .wrapping_mul(1_000_003)
                .wrapping_add(u64::from(texture))
                .wrapping_mul(1009)
                + trial,
            finger_seed: self.seed,
            finger: self.finger,
            ..Setup::default()
        }
    }

    /// Names of the textures.
    pub fn names(&self) -> Vec<String> {
        self.textures
            .iter()
            .map(|&number| texture_name(number).to_owned())
            .collect()
    }

    /// Records all trials of all textures at the movements of the study, textures side by side; `done` is called after
    /// each. Returns the slides of each texture in the order of time.
    /// Errors: the first fault of a rig.
    pub fn record(
        &self,
        calibration: RigCalibration,
        done: impl Fn() + Sync,
    ) -> Result<Vec<Vec<Recording>>, TrialError> {
        self.record_at(&Self::MOVEMENTS, calibration, done)
    }

    fn record_at(
        &self,
        movements: &[Movement],
        calibration: RigCalibration,
        done: impl Fn() + Sync,
    ) -> Result<Vec<Vec<Recording>>, TrialError> {
        self.textures
            .par_iter()
            .enumerate()
            .map(|(index, &texture)| {
                let setup = self.setup(texture, 0);
                let mut slides = record_texture(setup, calibration, movements, self.trials)?;
                for slide in &mut slides {
                    slide.texture = index;
                }
                done();
                Ok(slides)
            })
            .collect()
    }

    /// Learns a texture table for a method from trials of all textures at the movements of the study.
    pub fn learn(
        &self,
        method: Method,
        calibration: RigCalibration,
        done: impl Fn() + Sync,
    ) -> Result<Vec<u8>, LearnError> {
        self.learn_at(&Self::MOVEMENTS, (method, None), &[], calibration, done)
    }

    /// The same at these movements; the fused method learns these features, or the best there are (band powers alone
    /// are for a rig that does not measure shear). With statistics of slides after each of these lengths, in ms at
    /// constant speed, the shortest first. Errors: the first fault of a rig, or slide without properties; lengths that
    /// no table has.
    pub fn learn_at(
        &self,
        movements: &[Movement],
        how: (Method, Option<FeatureSet>),
        lengths_ms: &[u16],
        calibration: RigCalibration,
        done: impl Fn() + Sync,
    ) -> Result<Vec<u8>, LearnError> {
        let slides = self.record_at(movements, calibration, done)?;
        self.table_of(movements, how, lengths_ms, &slides)
    }

    /// Learns a texture table for a method from the slides that [`Collection::record`] made.
    pub fn learn_from(
        &self,
        method: Method,
        slides: &[Vec<Recording>],
    ) -> Result<Vec<u8>, LearnError> {
        self.table_of(&Self::MOVEMENTS, (method, None), &[], slides)
    }

    fn table_of(
        &self,
        movements: &[Movement],
        how: (Method, Option<FeatureSet>),
        lengths_ms: &[u16],
        slides: &[Vec<Recording>],
    ) -> Result<Vec<u8>, LearnError> {
        let plan = Plan::new();
        let textures = slides.iter().zip(&self.textures);
        let trials: Vec<Vec<Vec<ObservedTrial>>> = textures
            .map(|(slides, &texture)| self.observe(&plan, movements, texture, slides, lengths_ms))
            .collect::<Result<_, TrialError>>()?;
        let usual = Expected::default();
        let table =
            learn::learn_lengths(&usual, how, &self.names(), movements, lengths_ms, &trials)?;
        let named = learn::name_finger(&table, FingerCode::of(self.finger), 0, "");
        Ok(named.map_err(TableError::from)?)
    }

    /// The features of the slides of a texture, whole and after each of these lengths, in ms at constant speed:
    /// movement by movement.
    pub fn observe(
        &self,
        plan: &Plan,
        movements: &[Movement],
        texture: u8,
        slides: &[Recording],
        lengths_ms: &[u16],
    ) -> Result<Vec<Vec<ObservedTrial>>, TrialError> {
        let of_movement = |movement: &Movement| {
            let trials = slides.iter().filter(|s| s.movement == *movement);
            let observed = (1..).zip(trials).map(|(trial, slide)| {
                let at = Trial {
                    world: self.seed,
                    texture,
                    slide: Some((*movement, trial)),
                };
                let first = lengths_ms.iter().map(|&ms| {
                    let first = slide.first(ms);
                    first.map(|first| at.measure(plan, &first)).transpose()
                });
                Ok(ObservedTrial {
                    first: first.collect::<Result<_, _>>()?,
                    whole: at.measure(plan, slide)?,
                })
            });
            observed.collect()
        };
        movements.iter().map(of_movement).collect()
    }
}

/// The place of a failure in a simulated world.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Trial {
    /// The world's seed.
    pub world: u64,
    /// Number of the texture in Table 1.
    pub texture: u8,
    /// The movement and the number of the trial, from 1; before the first, the rig powers up.
    pub slide: Option<(Movement, u32)>,
}

impl Trial {
    /// Adds the place of this trial to an error of the rig.
    pub fn made<T>(self, made: Result<T, SimError>) -> Result<T, TrialError> {
        made.map_err(|source| TrialError::Rig { at: self, source })
    }

    /// The features of a slide of this trial.
    pub fn measure(self, plan: &Plan, slide: &Recording) -> Result<Observation, TrialError> {
        let measured =
            measure(plan, slide).map_err(|source| TrialError::Slide { at: self, source })?;
        Ok(Observation::from(&measured))
    }
}

impl fmt::Display for Trial {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (texture, name) = (self.texture, texture_name(self.texture));
        write!(f, "world {}, T{texture} {name}, ", self.world)?;
        match self.slide {
            Some((movement, trial)) => write!(f, "{movement}, trial {trial}"),
            None => write!(f, "at power-up"),
        }
    }
}

/// Reasons why a trial in a simulated world failed.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// The rig failed.
    #[error("{at}: the simulated rig failed; another seed makes another world")]
    Rig {
        /// Its place.
        at: Trial,
        /// The rig's error.
        source: SimError,
    },
    /// The slide has no properties.
    #[error("{at}: the slide has no properties; another seed makes another world")]
    Slide {
        /// Its place.
        at: Trial,
        /// The reason.
        source: SlideError,
    },
}

/// Reasons why no table was learned in a simulated world.
#[derive(Debug, thiserror::Error)]
pub enum LearnError {
    /// A rig failed.
    #[error(transparent)]
    Rig(#[from] SimError),
    /// A trial failed.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// A recorded slide has no properties on the simulated rig.
    #[error(
        "slide {slide} of {texture} has no properties on the simulated rig; play other recordings"
    )]
    Slide {
        /// Name of the texture.
        texture: String,
        /// Which of the slides to learn from, from 1.
        slide: usize,
        /// The reason.
        source: SlideError,
    },
    /// The table cannot be learned.
    #[error(transparent)]
    Table(#[from] TableError),
}

/// Name of a texture by its number in Table 1.
pub fn texture_name(number: u8) -> &'static str {
    TEXTURES
        .iter()
        .find(|t| t.number == number)
        .map_or("?", |t| t.name)
}

/// A name as a shell takes it without quotes: "plastic-mesh-5-mm".
pub fn plain_name(name: &str) -> String {
    let words = name.split(|c: char| !c.is_alphanumeric());
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    words.join("-").to_lowercase()
}

/// Number of a texture by its name in Table 1, with any capitals and separators, or by its number.
pub fn texture_number(name: &str) -> Option<u8> {
    let number = name.trim_start_matches(['T', 't']).parse().ok();
    let plain = plain_name(name);
    TEXTURES
        .iter()
        .find(|t| plain_name(t.name) == plain || Some(t.number) == number)
        .map(|t| t.number)
}

/// Measures the unloaded current of the rig of a world once; all rigs of that world have the same motor.
pub fn calibrated(setup: Setup) -> Result<RigCalibration, SimError> {
    let mut rig = SimRig::new(setup);
    rig.home()?;
    rig.calibrate_current()
}

/// Trials of one texture at every movement, movement by movement, numbered in the order of time.
pub fn record_texture(
    setup: Setup,
    calibration: RigCalibration,
    movements: &[Movement],
    trials: u32,
) -> Result<Vec<Recording>, TrialError> {
    let mut slides = Vec::new();
    let mut rig = SimRig::new(setup);
    let at = Trial {
        world: setup.world_seed,
        texture: setup.texture,
        slide: None,
    };
    record_trials(
        &mut rig,
        at,
        calibration,
        movements,
        trials,
        |_, at, slide| {
            slides.push(Recording {
                number: slides.len() as u32 + 1,
                ..at.made(slide)?
            });
            Ok(Next::Trial)
        },
    )?;
    Ok(slides)
}

/// The step after a trial.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Next {
    /// The next one.
    Trial,
    /// The next movement, on a rig that has homed again.
    Movement,
}

/// Powers up a rig and makes trials of the texture under it, movement by movement; `each` gets every slide, or the
/// reason why the rig did not make it, and returns the next step.
pub fn record_trials(
    rig: &mut SimRig,
    at: Trial,
    calibration: RigCalibration,
    movements: &[Movement],
    trials: u32,
    mut each: impl FnMut(&mut SimRig, Trial, Result<Recording, SimError>) -> Result<Next, TrialError>,
) -> Result<(), TrialError> {
    let calibrated = rig.control().calibrate(calibration).map_err(SimError::from);
    at.made(calibrated.and_then(|()| rig.home()))?;
    for &movement in movements {
        for trial in 1..=trials {
            let at = Trial {
                slide: Some((movement, trial)),
                ..at
            };
            let slide = rig.record(movement);
            if each(rig, at, slide)? == Next::Movement {
                let reset = rig.control().reset().map_err(SimError::from);
                at.made(reset.and_then(|()| rig.home()))?;
                break;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests;
