//! Recorded slides, measured by the core: a [`Rig`] replays them one by one, or a whole folder is measured at once.

use std::collections::HashMap;
use std::fmt::Display;

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use tactus_core::dsp::{BINS, FUSED_BANDS, Plan, Spectrum};
use tactus_core::features::{
    Measurement, Movement, Observation, Property, PropertySet, Slide, SlideError,
};
use tactus_core::rig::Rig;
use tactus_core::table::SlideHash;

use crate::data::quality::{DuplicateSearch, Fingerprint, SlideMarks, check};
use crate::data::recording::{Labels, Recording, Texture};
use crate::data::recordings::files::each_in_flight;
use crate::data::recordings::{RecordingError, RecordingSet};

/// The properties of one recorded slide.
/// Errors: the slide has none: it is too short or silent.
pub fn measure(plan: &Plan, recorded: &Recording) -> Result<Measurement, SlideError> {
    let mut slide = Slide::new(plan, recorded.movement);
    recorded.play(&mut slide);
    slide.finish()
}

/// The features of one recorded slide.
#[derive(Clone, Debug)]
pub struct MeasuredSlide {
    /// Number of the slide, in the order of time.
    pub number: u32,
    /// The movement that made it.
    pub movement: Movement,
    /// The core's measurement.
    pub measurement: Measurement,
    /// By which its samples are known again.
    pub marks: SlideMarks,
    /// Session and run, as [`Labels`] have them; empty if unknown.
    pub session: [String; 2],
    /// Features of one's own, where these count in place of the measurement's.
    pub given: Option<Observation>,
}

impl MeasuredSlide {
    /// Measures a slide; of the session and run of `labels`.
    /// Errors: as [`measure`].
    pub fn of(plan: &Plan, slide: &Recording, labels: &Labels) -> Result<Self, SlideError> {
        Ok(Self {
            number: slide.number,
            movement: slide.movement,
            measurement: measure(plan, slide)?,
            marks: SlideMarks::of(slide),
            session: [labels.session.clone(), labels.run.clone()],
            given: None,
        })
    }

    /// Features of one's own as a slide of an unknown movement; `number` is that among all slides.
    pub fn given(number: u32, features: Observation, session: String) -> Self {
        let mut hash = SlideHash::default();
        hash.iter_mut()
            .zip(number.to_le_bytes())
            .for_each(|(to, from)| *to = from);
        Self {
            number,
            movement: Movement::UNKNOWN,
            measurement: Measurement {
                properties: features.properties,
                roughness_is_bound: false,
                clipped: None,
                pdc: None,
                pace: None,
                bands: 0,
                background: 0.0,
                spectrum: Spectrum::new(0, [0.0; BINS], [0.0; FUSED_BANDS]),
            },
            marks: hash.into(),
            session: [session, String::new()],
            given: Some(features),
        }
    }

    /// Leaves it coarse bands only.
    pub fn with_coarse_bands(&mut self) {
        self.given = Some(self.observation().with_coarse_bands());
    }

    /// The features that textures are told apart by.
    pub fn observation(&self) -> Observation {
        let measured = || observation(&self.measurement);
        self.given.clone().unwrap_or_else(measured)
    }
}

/// Fewest frames of a slide that give it fine bands: 1.5 s. With six frames, and five slides of a class, they doubled
/// the wrong names of a robot's terrains.
const FRAMES_FOR_FINE: u32 = 12;

/// The features of a whole slide: with coarse bands where the frames are few, for then fine ones scatter too much.
pub fn observation(measurement: &Measurement) -> Observation {
    let observation = Observation::from(measurement);
    if measurement.spectrum.frames() < FRAMES_FOR_FINE {
        observation.with_coarse_bands()
    } else {
        observation
    }
}

/// Number of each slide of a texture among those of its movement, from 1.
pub fn trials(slides: &[MeasuredSlide]) -> Vec<usize> {
    let mut trials = HashMap::new();
    let numbers = slides.iter().map(|slide| {
        let trial = trials.entry(slide.movement).or_insert(0);
        *trial += 1;
        *trial
    });
    numbers.collect()
}

/// Measures every slide of a folder, several textures at once; `done` gets each texture when it is finished. Returns
/// the slides of each texture in the order of time.
/// Errors: the first file that cannot be read, or the first slide that has no properties, is that of a dead sensor, or
/// is a copy of another.
pub fn measure_all(
    set: &RecordingSet,
    done: impl Fn(&Texture) + Sync,
) -> Result<Vec<Vec<MeasuredSlide>>, RecordingError> {
    measure_each(set, done, MeasuredSlide::of)
}

/// A recorded slide, and the features of its first part alone.
#[derive(Clone, Debug)]
pub struct CutSlide {
    /// The whole slide.
    pub whole: MeasuredSlide,
    /// Its length at constant speed, s.
    pub seconds: f32,
    /// Its first part, for each requested length; `None` if it does not last longer.
    pub first: Vec<Option<Measurement>>,
}

/// As [`measure_all`], and the first part of each slide, of each of these lengths, in ms at constant speed.
/// Errors: as [`measure_all`]; the first part of a slide may be too short to have properties, too.
pub fn measure_cut(
    set: &RecordingSet,
    lengths_ms: &[u16],
    done: impl Fn(&Texture) + Sync,
) -> Result<Vec<Vec<CutSlide>>, RecordingError> {
    measure_each(set, done, |plan, slide, labels| {
        let first = |&ms: &u16| {
            slide
                .first(ms)
                .map(|first| measure(plan, &first))
                .transpose()
        };
        Ok(CutSlide {
            first: lengths_ms.iter().map(first).collect::<Result<_, _>>()?,
            seconds: slide.window.1 - slide.window.0,
            whole: MeasuredSlide::of(plan, slide, labels)?,
        })
    })
}

fn measure_each<T: Send>(
    set: &RecordingSet,
    done: impl Fn(&Texture) + Sync,
    of: impl Fn(&Plan, &Recording, &Labels) -> Result<T, SlideError> + Sync,
) -> Result<Vec<Vec<T>>, RecordingError> {
    let plan = Plan::new();
    let textures: Vec<usize> = (0..set.textures().len()).collect();
    let memory = |index: &usize| set.memory(*index);
    let measured = each_in_flight(&textures, memory, |&index| {
        let texture = &set.textures()[index];
        let (mut prints, mut measured) = (Vec::new(), Vec::new());
        // in the order of time, as slides are read
        let mut keys = set.slides(index).iter();
        set.each_slide(index, &mut |slide| {
            check(&slide).map_err(|why| unusable(texture, slide.number, &why))?;
            prints.push((slide.number, Fingerprint::of(&slide)));
            let labels = keys.next().map(|key| key.labels.clone());
            let labels = labels.unwrap_or_default();
            measured.push(of(&plan, &slide, &labels).map_err(|why| {
                RecordingError::said(format!("{}: {why}", slide_name(texture, slide.number)))
            })?);
            Ok(())
        })?;
        done(texture);
        Ok((prints, measured))
    })?;
    let mut copies = DuplicateSearch::default();
    for (texture, (prints, _)) in set.textures().iter().zip(&measured) {
        for (number, print) in prints {
            let added = copies.add(print, slide_name(texture, *number));
            added.map_err(|why| unusable(texture, *number, &why))?;
        }
    }
    Ok(measured.into_iter().map(|(_, measured)| measured).collect())
}

pub(crate) fn slide_name(texture: &Texture, number: u32) -> String {
    format!("slide {number} of {}", texture.name)
}

fn unusable(texture: &Texture, number: u32, why: &dyn Display) -> RecordingError {
    let slide = slide_name(texture, number);
    RecordingError::said(format!(
        "{slide}: {why} (record it again, or let `tactus import` leave it out)"
    ))
}

/// A rig whose unknown texture is a pile of recorded slides: each movement replays one of that movement, drawn without
/// replacement. A slide that was seen before is no fresh evidence.
#[derive(Debug)]
pub struct Replay {
    /// Those that were not replayed yet.
    slides: Vec<Recording>,
    movements: Vec<Movement>,
    measures: PropertySet,
    random: ChaCha8Rng,
}

/// There is no slide to replay.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ReplayError {
    /// There never was.
    #[error("no slide of the movement {0} was recorded")]
    NotRecorded(Movement),
    /// All of them were replayed.
    #[error("no recorded slide at {0} is left")]
    RanOut(Movement),
}

impl Replay {
    /// A rig that replays `slides`.
    pub fn new(slides: Vec<Recording>, random: ChaCha8Rng) -> Self {
        let traction = slides.iter().all(|s| s.outside_mn.is_some());
        let mut movements = Vec::new();
        for slide in &slides {
            if !movements.contains(&slide.movement) {
                movements.push(slide.movement);
            }
        }
        Self {
            measures: Property::ALL
                .into_iter()
                .filter(|&p| traction || p != Property::Traction)
                .collect(),
            slides,
            movements,
            random,
        }
    }
}

impl Rig for Replay {
    type Error = ReplayError;

    fn measures(&self) -> PropertySet {
        self.measures
    }

    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), ReplayError> {
        let movement = slide.movement();
        let recorded = (0..).zip(&self.slides);
        let recorded: Vec<usize> = recorded
            .filter(|(_, s)| s.movement == movement)
            .map(|(at, _)| at)
            .collect();
        if recorded.is_empty() {
            return Err(if self.movements.contains(&movement) {
                ReplayError::RanOut(movement)
            } else {
                ReplayError::NotRecorded(movement)
            });
        }
        let drawn = recorded[self.random.random_range(0..recorded.len())];
        self.slides.remove(drawn).play(slide);
        Ok(())
    }

    async fn recover(&mut self, _failed: &ReplayError) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use embassy_futures::block_on;
    use rand::SeedableRng as _;

    use super::*;

    #[test]
    fn no_slide_is_replayed_twice() {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../recordings/simulated");
        let set = RecordingSet::open(folder.as_ref()).unwrap();
        let slides = set.load_texture(0).unwrap();
        let movement = slides[0].movement;
        let there = slides.iter().filter(|s| s.movement == movement).count();
        assert!(there > 2);
        let plan = Plan::new();
        let mut rig = Replay::new(slides, ChaCha8Rng::seed_from_u64(1));
        let mut seen = Vec::new();
        let mut slide = |movement| {
            let mut slide = Slide::new(&plan, movement);
            block_on(rig.perform(&mut slide))?;
            Ok(slide.finish().unwrap().properties)
        };
        for _ in 0..there {
            let properties = slide(movement).unwrap();
            assert!(!seen.contains(&properties));
            seen.push(properties);
        }
        assert_eq!(slide(movement), Err(ReplayError::RanOut(movement)));
        let elsewhere = Movement::grid().find(|m| !set.movements().contains(m));
        let elsewhere = elsewhere.unwrap();
        assert_eq!(slide(elsewhere), Err(ReplayError::NotRecorded(elsewhere)));
    }
}
