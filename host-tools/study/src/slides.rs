//! The slides of the study: textures one after the other under one finger, whose skin wears and is changed.
//!
//! Every slide is made by the whole simulated rig: the core's control presses and slides, the world answers in sensor
//! words, and the core decodes them and computes the features, as the chip does.

use std::fmt;

use anyhow::Context as _;
use rayon::prelude::*;
use serde::Serialize;
use tactus_core::dsp::Plan;
use tactus_core::features::{Movement, Observation, Property};
use tactus_core::rig::Fault;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::slide_path::SlidePath;

use super::published::{IDENTIFIED, TRIALS};
use tactus_lab::sim::collection::{
    Collection, Next, Trial, calibrated, record_trials, texture_name,
};
use tactus_lab::sim::rig::{SimError, SimRig};
use tactus_world::finger::wear_per_mm;
use tactus_world::{Conditions, textures};

/// Wear at which the ridges look worn: the skin is changed before the next texture (paper: at any visible sign).
/// Chosen, so that the 1755 slides of the training take about the two changes that they took in the paper.
pub const VISIBLE_WEAR: f64 = 0.05;

/// Numbers of the sessions of a world: trials of different sessions differ.
const TRAINING: u64 = 1;
const VALIDATION: u64 = 2;

/// One of the study's worlds: its textures, its finger, and the variation.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct StudyWorld {
    /// The world's seed.
    pub seed: u64,
    /// Variation of the trials: [`Conditions::variation`].
    pub variation: f64,
}

/// All trials of one texture.
#[derive(Clone, PartialEq, Debug)]
pub struct TextureTrials {
    /// Number of the texture.
    pub texture: u8,
    /// Slides by movement and trial.
    pub slides: Vec<Vec<Observation>>,
    /// Wear of the skin before the first slide, and after the last of each movement.
    pub wear: Vec<f64>,
    /// True if the skin was changed before the first slide.
    pub new_skin: bool,
    /// Movements that the rig could not make on this texture. Only those of the pilot, which keeps them in its own way.
    pub not_reached: Vec<NotReached>,
}

/// A movement that a rig could not make.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct NotReached {
    /// Place of the movement in the session.
    pub movement: usize,
    /// Number of the trial, from 1; those before it were made.
    pub trial: u32,
    /// The reason.
    pub why: SimError,
}

/// One session of slides: the same finger, movement by movement on each texture.
#[derive(Clone, Debug)]
pub struct Session<'a> {
    /// Numbers of the textures, in the order of time.
    pub textures: &'a [u8],
    /// The movements.
    pub movements: &'a [Movement],
    /// Trials of each movement.
    pub trials: u32,
    /// Tells sessions of one world apart: their trials differ.
    pub number: u64,
    /// True if a movement that the rig cannot make is a result, [`TextureTrials::not_reached`], and no failure, and the
    /// guard of the force is off. The paper's rig had none, and its pilot study needs forces up to 2 N, where the shear
    /// on a sticky texture alone takes P_DC over the guard's limit.
    pub pilot: bool,
}

impl StudyWorld {
    fn collection(self) -> Collection {
        Collection::new(self.seed, Vec::new(), 0)
    }

    /// The calibration that the rigs of this world share.
    pub fn calibration(self) -> anyhow::Result<RigCalibration> {
        calibrated(self.collection().setup(1, 0)).with_context(|| {
            let world = self.seed;
            format!("world {world}: the simulated rig cannot be calibrated; another --seed makes another world")
        })
    }

    /// Makes all slides of a session, textures side by side; `done` is called after each texture. Errors: The first
    /// fault of a rig, or slide without properties.
    pub fn record(
        self,
        session: &Session<'_>,
        calibration: RigCalibration,
        done: impl Fn() + Sync,
    ) -> anyhow::Result<Vec<TextureTrials>> {
        let plan = Plan::new();
        self.skins(session)
            .into_par_iter()
            .map(|(texture, wear, new_skin)| {
                let trials = self.record_texture(session, texture, wear, calibration, &plan)?;
                done();
                Ok(TextureTrials { new_skin, ..trials })
            })
            .collect()
    }

    fn record_texture(
        self,
        session: &Session<'_>,
        texture: u8,
        wear: f64,
        calibration: RigCalibration,
        plan: &Plan,
    ) -> anyhow::Result<TextureTrials> {
        let Session {
            movements, trials, ..
        } = *session;
        let setup = self.collection().setup(texture, session.number);
        let variation = self.variation;
        let unguarded = match session.pilot {
            true => Unguarded::against(Fault::ForceHigh),
            false => Unguarded::default(),
        };
        let mut rig = SimRig::under(setup, Conditions { variation, wear }, unguarded);
        rig.control().allow_high_force(session.pilot);
        let mut measured = TextureTrials {
            texture,
            slides: Vec::with_capacity(movements.len()),
            wear: vec![wear],
            new_skin: false,
            not_reached: Vec::new(),
        };
        let at = Trial {
            world: self.seed,
            texture,
            slide: None,
        };
        record_trials(
            &mut rig,
            at,
            calibration,
            movements,
            trials,
            |rig, at, slide| {
                let trial = at.slide.map_or(1, |(_, trial)| trial);
                if trial == 1 {
                    measured.slides.push(Vec::with_capacity(trials as usize));
                    measured.wear.push(0.0);
                }
                let slide = match slide {
                    Err(why) if session.pilot => {
                        measured.not_reached.push(NotReached {
                            movement: measured.slides.len() - 1,
                            trial,
                            why,
                        });
                        None
                    }
                    made => Some(at.measure(plan, &at.made(made)?)?),
                };
                let next = slide.as_ref().map_or(Next::Movement, |_| Next::Trial);
                if let (Some(slides), Some(wear)) =
                    (measured.slides.last_mut(), measured.wear.last_mut())
                {
                    slides.extend(slide);
                    *wear = rig.world().truth().wear;
                }
                Ok(next)
            },
        )?;
        Ok(measured)
    }

    /// The skin before each texture: its wear, and whether it is new.
    ///
    /// Wear only grows with sliding, so the wear by earlier textures follows from their friction, and all can be
    /// recorded side by side. A test compares it with the simulated wear.
    pub fn skins(self, session: &Session<'_>) -> Vec<(u8, f64, bool)> {
        let mut wear = 0.0;
        let next = session.textures.iter().map(|&number| {
            let new_skin = wear >= VISIBLE_WEAR;
            if new_skin {
                wear = 0.0;
            }
            let before = (number, wear, new_skin);
            let texture = textures::draw(number, self.seed);
            for movement in session.movements {
                let (force_n, speed) = (movement.force_n().into(), movement.speed_mm_s().into());
                let way = f64::from(session.trials) * slide_mm(*movement);
                wear += way * wear_per_mm(&texture, force_n, speed);
            }
            before
        });
        next.collect()
    }
}

/// Approximate length of a slide with a movement, mm: 3 s, or the length that the sample leaves.
fn slide_mm(movement: Movement) -> f64 {
    f64::from((3.0 * movement.speed_mm_s()).min(SlidePath::LONGEST_MM))
}

/// Variation of trials in the study's worlds: their one free parameter. Set on worlds 1 to 10, by
/// `tactus study identify --seed N --variation X`, so that Bayesian exploration is right about as often as in the
/// paper (95.4 %).
pub const VARIATION: f64 = 1.2;

/// The data for a world's identification: the training of all textures, and the validation trials of those of Tables
/// 4 and 5.
#[derive(Clone, PartialEq, Debug)]
pub struct Recorded {
    /// All 117.
    pub training: Vec<TextureTrials>,
    /// Those of [`IDENTIFIED`], with a new skin.
    pub validation: Vec<TextureTrials>,
}

impl StudyWorld {
    /// Textures of [`StudyWorld::train_and_validate`], for a progress bar.
    pub const RECORDED: u64 = 117 + IDENTIFIED.len() as u64;

    /// Makes the slides of training and validation; `done` is called after each texture.
    pub fn train_and_validate(self, done: impl Fn() + Sync) -> anyhow::Result<Recorded> {
        let calibration = self.calibration()?;
        let all: Vec<u8> = (1..=117).collect();
        let session = |textures, number| Session {
            textures,
            movements: &Collection::MOVEMENTS,
            trials: TRIALS,
            number,
            pilot: false,
        };
        let (training, validation) = rayon::join(
            || self.record(&session(&all, TRAINING), calibration, &done),
            || self.record(&session(&IDENTIFIED, VALIDATION), calibration, &done),
        );
        Ok(Recorded {
            training: training?,
            validation: validation?,
        })
    }
}

/// A texture by its number in Table 1 and its name.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Named {
    /// The number.
    pub number: u8,
    /// The name.
    pub name: &'static str,
}

impl Named {
    /// The texture of this number.
    pub fn new(number: u8) -> Self {
        Self {
            number,
            name: texture_name(number),
        }
    }
}

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "T{} {}", self.number, self.name)
    }
}

/// The three properties of slides, by movement and trial. The simulated rig measures all three.
pub(crate) fn properties(slides: &[Vec<Observation>]) -> Vec<Vec<[f32; 3]>> {
    let of = |slide: &Observation| Property::ALL.map(|p| slide.properties.get(p).unwrap_or(0.0));
    slides
        .iter()
        .map(|trials| trials.iter().map(of).collect())
        .collect()
}
