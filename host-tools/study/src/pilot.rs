//! The pilot study: the best of 36 movements for separating ten textures by each property (figs. 5, 6, 7).

use serde::Serialize;
use tactus_core::explorer::{Config, Explorer, Method};
use tactus_core::features::{Movement, Property, PropertySet};
use tactus_core::table::Table;

use super::published::{MOST_USEFUL, PILOT_TEXTURES, PILOT_TRIALS};
use super::slides::{Named, Session, StudyWorld, TextureTrials, properties};
use tactus_lab::eval::learn::learn;
use tactus_lab::sim::collection::texture_name;

/// Number of the pilot's session: see [`Session::number`].
const SESSION: u64 = 3;

/// The results of the pilot study.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Pilot {
    /// The textures.
    pub textures: Vec<Named>,
    /// The 36 movements, force by force.
    pub movements: Vec<PilotMovement>,
    /// For each property, the movement of the least uncertainty among those that do not wear the skin.
    pub most_useful: Vec<MostUseful>,
    /// Traction, roughness and fineness by texture, movement and trial.
    pub properties: Vec<Vec<Vec<[f32; 3]>>>,
}

/// One of the 36 movements.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct PilotMovement {
    /// Contact force, N.
    pub force_n: f32,
    /// Sliding speed, mm/s.
    pub speed_mm_s: f32,
    /// True if it is avoided for its wear.
    pub high_wear: bool,
    /// Uncertainty that one slide leaves among the textures, by property (eq. 11); 1, which is all, for a movement that
    /// was not reached on every texture.
    pub uncertainty: [f32; 3],
    /// Textures on which the rig could not make it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_reached: Vec<Missed>,
}

/// A texture on which the rig could not make a movement.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Missed {
    /// Number of the texture.
    pub texture: u8,
    /// Number of the trial that failed, from 1.
    pub trial: u32,
    /// The reason.
    pub reason: String,
}

/// The best movement for a property.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MostUseful {
    /// The property.
    pub property: Property,
    /// Place of the movement in [`Pilot::movements`].
    pub movement: usize,
    /// The same for the one that the paper found.
    pub paper: usize,
}

impl PilotMovement {
    /// Force, N, and speed, mm/s.
    pub(crate) fn at(&self) -> (f32, f32) {
        (self.force_n, self.speed_mm_s)
    }
}

impl Pilot {
    /// Textures of [`Pilot::run`], for a progress bar.
    pub const TEXTURES: u64 = PILOT_TEXTURES.len() as u64;

    /// Makes the slides of the pilot study, and looks for the most useful movements.
    pub fn run(world: StudyWorld, done: impl Fn() + Sync) -> anyhow::Result<Self> {
        let movements: Vec<Movement> = Movement::grid().collect();
        let session = Session {
            textures: &PILOT_TEXTURES,
            movements: &movements,
            trials: PILOT_TRIALS,
            number: SESSION,
            pilot: true,
        };
        let trials = world.record(&session, world.calibration()?, done)?;
        Self::of(&movements, &trials)
    }

    /// The results of these trials.
    pub fn of(movements: &[Movement], trials: &[TextureTrials]) -> anyhow::Result<Self> {
        let missed = |movement: usize| {
            let of = |t: &TextureTrials| {
                let missed = t.not_reached.iter().find(|m| m.movement == movement)?;
                Some(Missed {
                    texture: t.texture,
                    trial: missed.trial,
                    reason: missed.why.to_string(),
                })
            };
            trials.iter().filter_map(of).collect::<Vec<_>>()
        };
        let reached: Vec<usize> = (0..movements.len())
            .filter(|&movement| missed(movement).is_empty())
            .collect();
        let uncertainty = uncertainty(movements, &reached, trials)?;
        let rows = movements.iter().zip(&uncertainty).enumerate();
        let rows = rows.map(|(m, (movement, uncertainty))| PilotMovement {
            force_n: movement.written().0,
            speed_mm_s: movement.written().1,
            high_wear: movement.is_high_wear(),
            uncertainty: *uncertainty,
            not_reached: missed(m),
        });
        let best = |property: Property| {
            let all = movements.iter().zip(&uncertainty).enumerate();
            all.filter(|(_, (movement, _))| !movement.is_high_wear())
                .min_by(|a, b| {
                    let [a, b] = [a, b].map(|(_, (_, u))| u[property.index()]);
                    a.total_cmp(&b)
                })
                .map_or(0, |(at, _)| at)
        };
        let most_useful = MOST_USEFUL.map(|(paper, property)| MostUseful {
            property,
            movement: best(property),
            paper: movements.iter().position(|m| *m == paper).unwrap_or(0),
        });
        Ok(Self {
            textures: trials.iter().map(|t| Named::new(t.texture)).collect(),
            movements: rows.collect(),
            most_useful: most_useful.to_vec(),
            properties: trials.iter().map(|t| properties(&t.slides)).collect(),
        })
    }
}

/// Uncertainty of every movement and property when all textures are equally probable, by the core's explorer; 1 for
/// movements that were not `reached`.
fn uncertainty(
    movements: &[Movement],
    reached: &[usize],
    trials: &[TextureTrials],
) -> anyhow::Result<Vec<[f32; 3]>> {
    let names = trials.iter().map(|t| texture_name(t.texture).to_owned());
    let slides = |t: &TextureTrials| reached.iter().map(|&m| t.slides[m].clone()).collect();
    let slides: Vec<Vec<_>> = trials.iter().map(slides).collect();
    let names: Vec<String> = names.collect();
    let made: Vec<Movement> = reached.iter().map(|&m| movements[m]).collect();
    let bytes = learn(Method::Paper, None, &names, &made, &slides)?;
    let table = Table::read(&bytes)?;
    let explorer = Explorer::<128>::new(table, PropertySet::ALL, Config::default())?;
    let mut left = vec![[1.0; 3]; movements.len()];
    for outcome in explorer.expected_outcomes() {
        let movement = reached.get(usize::from(outcome.action.movement));
        let of_movement = movement.and_then(|&movement| left.get_mut(movement));
        if let (Some(left), Some(property)) = (of_movement, outcome.action.property) {
            left[property.index()] = outcome.uncertainty;
        }
    }
    Ok(left)
}
