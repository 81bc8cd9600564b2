//! Training: the properties of 117 textures, their correlations (Table 3), their confusion (figs. 8, 9), and the effect
//! of a worn skin on the data.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use tactus_core::explorer::{Method, confusion};
use tactus_core::features::Property;
use tactus_core::table::{Action, Gaussian, Table};

use super::error::StudyError;
use super::published::{CORRELATIONS, MOST_USEFUL, PILOT_TEXTURES, SKIN_CHANGES};
use super::slides::{Named, Session, StudyWorld, TextureTrials, VISIBLE_WEAR, properties};
use tactus_lab::eval::evaluate::EvaluateError;
use tactus_lab::eval::learn::learn;
use tactus_lab::sim::collection::{Collection, texture_name};

/// Wear at which the skin's effect is shown.
const WEAR: [f64; 5] = [0.0, VISIBLE_WEAR, 0.25, 0.5, 1.0];
/// Trials of each texture and movement at each of them.
const WEAR_TRIALS: u32 = 3;
/// Number of their session: the touches are the same at any wear.
const WEAR_SESSION: u64 = 4;
/// Pairs that are listed as the most confused.
const LISTED: usize = 12;

/// The results of the training.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Training {
    /// The movements: force in N, speed in mm/s.
    pub movements: Vec<(f32, f32)>,
    /// The textures.
    pub textures: Vec<Trained>,
    /// By movement: correlations of the properties over the textures' means (Table 3).
    pub correlations: Vec<Correlations>,
    /// Degrees of confusion (eq. 7) by movement and property, nine matrices.
    pub confusion: Vec<Confusion>,
    /// Geometric mean of the nine.
    pub geometric_mean: Vec<Vec<f32>>,
    /// Geometric mean of the three of the most useful movements and their properties.
    pub geometric_mean_most_useful: Vec<Vec<f32>>,
    /// By property: correlation over the textures of its values at two movements, mean over the pairs of movements.
    pub between_movements: [f64; 3],
    /// Pairs of textures whose geometric mean of the nine is over one half, and the same of the three.
    pub pairs_confused: (usize, usize),
    /// Pairs of the greatest geometric mean of all nine.
    pub most_confused: Vec<ConfusedPair>,
    /// Wear of the skin.
    pub skin: Skin,
    /// The tables that were learned, as files in the chip's format.
    pub tables: Vec<TableFile>,
}

/// A texture and its learned Gaussians.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Trained {
    /// The texture.
    #[serde(flatten)]
    pub texture: Named,
    /// Mean and standard deviation by movement and property, as the table has them.
    pub gaussians: Vec<[(f32, f32); 3]>,
    /// Traction, roughness and fineness by movement and trial.
    pub properties: Vec<Vec<[f32; 3]>>,
    /// Wear of the skin before the first slide and after the last, % of the ridges.
    pub wear: (f64, f64),
    /// True if the skin was changed before the first slide.
    pub new_skin: bool,
}

/// Correlations at one movement.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Correlations {
    /// Of our world, properties in their order.
    pub ours: [[f64; 3]; 3],
    /// Of Table 3: traction and roughness, traction and fineness, roughness and fineness.
    pub paper: [f64; 3],
}

/// A confusion matrix.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Confusion {
    /// Place of the movement.
    pub movement: usize,
    /// The property.
    pub property: Property,
    /// 1 on the diagonal, symmetric.
    pub matrix: Vec<Vec<f32>>,
}

/// Two textures and their confusion.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct ConfusedPair {
    /// The textures.
    pub textures: (Named, Named),
    /// Geometric mean of the nine degrees of confusion.
    pub all: f32,
    /// The same of the three most useful ones.
    pub most_useful: f32,
}

/// Wear of the skin during training, and its effect on the data.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Skin {
    /// The skin was changed before these textures.
    pub changed_before: Vec<Named>,
    /// Number of changes in the paper.
    pub paper_changes: u32,
    /// Wear at which it is changed, % of the ridges.
    pub changed_at: f64,
    /// Effects of wear, by wear and movement.
    pub effects: Vec<SkinEffect>,
}

/// Effect of a worn skin on the properties at one movement.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct SkinEffect {
    /// Wear, % of the ridges.
    pub wear: f64,
    /// Place of the movement.
    pub movement: usize,
    /// Mean change of each property against a new skin, in standard deviations of trials.
    pub shift: [f64; 3],
}

/// A table that was written.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TableFile {
    /// Name of the file.
    pub file: String,
    /// Its contents.
    pub contents: String,
    /// Its length.
    pub bytes: usize,
    /// Its checksum.
    pub crc: String,
    /// The file itself.
    #[serde(skip)]
    pub data: Vec<u8>,
}

impl Training {
    /// The results of these trials, and of those with worn skins.
    ///
    /// # Errors
    /// See [`StudyError`].
    pub fn of(trials: &[TextureTrials], worn: &[Worn]) -> Result<Self, StudyError> {
        let movements = Collection::MOVEMENTS;
        let names: Vec<String> = trials
            .iter()
            .map(|t| texture_name(t.texture).to_owned())
            .collect();
        let slides: Vec<_> = trials.iter().map(|t| t.slides.clone()).collect();
        let [gaussians, fused] = [
            (
                "gaussians.tact",
                Method::Paper,
                "one Gaussian per movement and property: the paper's way",
            ),
            (
                "fused.tact",
                Method::Fused,
                "all features of a slide, whitened",
            ),
        ]
        .map(|(file, method, contents)| {
            let data = learn(method, None, &names, &movements, &slides)?;
            let table = Table::read(&data).map_err(EvaluateError::from)?;
            Ok::<_, StudyError>(TableFile {
                file: file.to_owned(),
                contents: contents.to_owned(),
                bytes: data.len(),
                crc: format!("{:08x}", table.crc()),
                data,
            })
        });
        let tables = vec![gaussians?, fused?];
        let table = Table::read(&tables[0].data).map_err(EvaluateError::from)?;
        let gaussian = |texture: usize, movement: usize, property| {
            let action = Action {
                movement: movement as u8,
                property: Some(property),
            };
            let known = table.gaussian(texture as u16, action);
            known.unwrap_or(Gaussian { mean: 0.0, sd: 1.0 })
        };
        let textures = trials.iter().enumerate().map(|(index, t)| Trained {
            texture: Named::new(t.texture),
            gaussians: (0..movements.len())
                .map(|m| {
                    Property::ALL
                        .map(|p| gaussian(index, m, p))
                        .map(|g| (g.mean, g.sd))
                })
                .collect(),
            properties: properties(&t.slides),
            wear: (
                100.0 * t.wear.first().copied().unwrap_or(0.0),
                100.0 * t.wear.last().copied().unwrap_or(0.0),
            ),
            new_skin: t.new_skin,
        });
        let textures: Vec<Trained> = textures.collect();
        let confusions: Vec<Confusion> = (0..movements.len())
            .flat_map(|m| Property::ALL.map(|property| (m, property)))
            .map(|(movement, property)| {
                let of: Vec<Gaussian> = (0..trials.len())
                    .map(|texture| gaussian(texture, movement, property))
                    .collect();
                let row = |a: &Gaussian| of.iter().map(|b| degree(*a, *b)).collect();
                Confusion {
                    movement,
                    property,
                    matrix: of.iter().map(row).collect(),
                }
            })
            .collect();
        let all: Vec<&Confusion> = confusions.iter().collect();
        let most_useful: Vec<&Confusion> = confusions
            .iter()
            .filter(|c| MOST_USEFUL.contains(&(movements[c.movement], c.property)))
            .collect();
        let (all, most_useful) = (geometric_mean(&all), geometric_mean(&most_useful));
        Ok(Self {
            movements: movements.map(|m| (m.force_n(), m.speed_mm_s())).to_vec(),
            correlations: (0..movements.len())
                .map(|movement| Correlations {
                    ours: correlations(&textures, movement),
                    paper: CORRELATIONS[movement],
                })
                .collect(),
            between_movements: std::array::from_fn(|property| {
                let of = |movement| means(&textures, movement, property);
                let pairs = [(0, 1), (0, 2), (1, 2)];
                pairs
                    .map(|(a, b)| correlation(&of(a), &of(b)))
                    .iter()
                    .sum::<f64>()
                    / 3.0
            }),
            pairs_confused: (over_half(&all), over_half(&most_useful)),
            most_confused: most_confused(&textures, &all, &most_useful),
            confusion: confusions,
            geometric_mean: all,
            geometric_mean_most_useful: most_useful,
            skin: Skin {
                changed_before: textures
                    .iter()
                    .filter(|t| t.new_skin)
                    .map(|t| t.texture.clone())
                    .collect(),
                paper_changes: SKIN_CHANGES,
                changed_at: 100.0 * VISIBLE_WEAR,
                effects: skin_effects(worn, &textures),
            },
            tables,
            textures,
        })
    }
}

/// Degree of confusion (eq. 7), by the core.
fn degree(a: Gaussian, b: Gaussian) -> f32 {
    confusion(a, b)
}

/// Geometric mean of matrices, element by element.
pub fn geometric_mean(of: &[&Confusion]) -> Vec<Vec<f32>> {
    let Some(first) = of.first() else {
        return Vec::new();
    };
    let n = first.matrix.len();
    let element = |i: usize, j: usize| {
        // as logarithms: nine small factors are no number any more
        let logs = of.iter().map(|c| f64::from(c.matrix[i][j]).ln());
        (logs.sum::<f64>() / of.len() as f64).exp() as f32
    };
    (0..n)
        .map(|i| (0..n).map(|j| element(i, j)).collect())
        .collect()
}

fn most_confused(
    textures: &[Trained],
    all: &[Vec<f32>],
    most_useful: &[Vec<f32>],
) -> Vec<ConfusedPair> {
    let mut pairs: Vec<(usize, usize)> = (0..textures.len())
        .flat_map(|i| (0..i).map(move |j| (j, i)))
        .collect();
    pairs.sort_by(|a, b| all[b.0][b.1].total_cmp(&all[a.0][a.1]));
    let pairs = pairs.into_iter().take(LISTED);
    let pair = pairs.map(|(i, j)| ConfusedPair {
        textures: (textures[i].texture.clone(), textures[j].texture.clone()),
        all: all[i][j],
        most_useful: most_useful[i][j],
    });
    pair.collect()
}

/// Pairs whose degree is over one half.
fn over_half(matrix: &[Vec<f32>]) -> usize {
    let above = matrix.iter().enumerate().flat_map(|(i, row)| &row[..i]);
    above.filter(|degree| **degree > 0.5).count()
}

/// Mean of a property at a movement, by texture.
fn means(textures: &[Trained], movement: usize, property: usize) -> Vec<f64> {
    let mean = |t: &Trained| {
        let trials = &t.properties[movement];
        let sum: f64 = trials.iter().map(|p| f64::from(p[property])).sum();
        sum / trials.len().max(1) as f64
    };
    textures.iter().map(mean).collect()
}

/// Correlations of the textures' mean properties at a movement.
fn correlations(textures: &[Trained], movement: usize) -> [[f64; 3]; 3] {
    let values = [0, 1, 2].map(|property| means(textures, movement, property));
    std::array::from_fn(|a| std::array::from_fn(|b| correlation(&values[a], &values[b])))
}

/// Pearson's coefficient of correlation.
pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
    let (of_a, of_b) = (mean(a), mean(b));
    let sum = |x: &[f64], of_x: f64, y: &[f64], of_y: f64| -> f64 {
        x.iter().zip(y).map(|(x, y)| (x - of_x) * (y - of_y)).sum()
    };
    let spread = (sum(a, of_a, a, of_a) * sum(b, of_b, b, of_b)).sqrt();
    if spread > 0.0 {
        sum(a, of_a, b, of_b) / spread
    } else {
        0.0
    }
}

/// Slides over textures with a skin that is so worn before each of them.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Worn {
    /// The wear.
    pub wear: f64,
    /// The slides: the same touches as with any other wear.
    pub trials: Vec<TextureTrials>,
}

impl Worn {
    /// Textures of [`Worn::record`], for a progress bar.
    pub const TEXTURES: u64 = (WEAR.len() * PILOT_TEXTURES.len()) as u64;

    /// Slides over ten textures with a new skin, and with worn ones.
    ///
    /// # Errors
    /// See [`StudyError`].
    pub fn record(world: StudyWorld, done: impl Fn() + Sync) -> Result<Vec<Self>, StudyError> {
        let calibration = world.calibration()?;
        let session = Session {
            textures: &PILOT_TEXTURES,
            movements: &Collection::MOVEMENTS,
            trials: WEAR_TRIALS,
            number: WEAR_SESSION,
            force_guard: true,
            may_miss: false,
        };
        let at = |&wear: &f64| {
            let trials = world.record_worn(&session, wear, calibration, &done)?;
            Ok(Self { wear, trials })
        };
        WEAR.par_iter().map(at).collect()
    }
}

/// Changes by worn skins against the first of them, which is new.
fn skin_effects(worn: &[Worn], textures: &[Trained]) -> Vec<SkinEffect> {
    let Some(new) = worn.first() else {
        return Vec::new();
    };
    let mean = |t: &TextureTrials, movement: usize, property: usize| {
        let trials = &properties(&t.slides)[movement];
        let sum: f64 = trials.iter().map(|p| f64::from(p[property])).sum();
        sum / trials.len().max(1) as f64
    };
    let effect = |worn: &Worn, movement: usize| SkinEffect {
        wear: 100.0 * worn.wear,
        movement,
        shift: std::array::from_fn(|property| {
            let shifts = new.trials.iter().zip(&worn.trials).map(|(new, worn)| {
                let known = textures.iter().find(|t| t.texture.number == new.texture);
                let sd = known.map_or(1.0, |t| t.gaussians[movement][property].1);
                let change = mean(worn, movement, property) - mean(new, movement, property);
                change / f64::from(sd)
            });
            shifts.sum::<f64>() / new.trials.len().max(1) as f64
        }),
    };
    let movements = 0..Collection::MOVEMENTS.len();
    worn.iter()
        .flat_map(|worn| movements.clone().map(move |m| effect(worn, m)))
        .collect()
}
