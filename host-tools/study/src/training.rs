//! Training: the properties of 117 textures, their correlations (Table 3), and their confusion (fig. 9).

use serde::Serialize;
use tactus_core::explorer::{Method, confusion};
use tactus_core::features::Property;
use tactus_core::table::{Action, Gaussian, Table};

use super::published::{CORRELATIONS, MOST_USEFUL};
use super::slides::{Named, TextureTrials, properties};
use tactus_lab::eval::learn::learn;
use tactus_lab::sim::collection::{Collection, texture_name};

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
    /// Pairs of textures whose geometric mean of the nine is over one half, and the same of the three.
    pub pairs_confused: (usize, usize),
    /// The tables that were learned, as files in the chip's format.
    pub tables: Vec<TableFile>,
}

/// A texture and its trials.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Trained {
    /// The texture.
    #[serde(flatten)]
    pub texture: Named,
    /// Traction, roughness and fineness by movement and trial.
    pub properties: Vec<Vec<[f32; 3]>>,
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

/// A table that was written.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TableFile {
    /// Name of the file.
    pub file: String,
    /// Its checksum.
    pub crc: String,
    /// The file itself.
    #[serde(skip)]
    pub data: Vec<u8>,
}

impl Training {
    /// The results of these trials.
    pub fn of(trials: &[TextureTrials]) -> anyhow::Result<Self> {
        let movements = Collection::MOVEMENTS;
        let names: Vec<String> = trials
            .iter()
            .map(|t| texture_name(t.texture).to_owned())
            .collect();
        let slides: Vec<_> = trials.iter().map(|t| t.slides.clone()).collect();
        let [gaussians, fused] = [
            ("gaussians.tact", Method::Paper),
            ("fused.tact", Method::Fused),
        ]
        .map(|(file, method)| {
            let data = learn(method, None, &names, &movements, &slides)?;
            let table = Table::read(&data)?;
            anyhow::Ok(TableFile {
                file: file.to_owned(),
                crc: format!("{:08x}", table.crc()),
                data,
            })
        });
        let tables = vec![gaussians?, fused?];
        let table = Table::read(&tables[0].data)?;
        let gaussian = |texture: usize, movement: usize, property| {
            let action = Action {
                movement: movement as u8,
                property: Some(property),
            };
            let known = table.gaussian(texture as u16, action);
            known.unwrap_or(Gaussian { mean: 0.0, sd: 1.0 })
        };
        let textures = trials.iter().map(|t| Trained {
            texture: Named::new(t.texture),
            properties: properties(&t.slides),
            new_skin: t.new_skin,
        });
        let textures: Vec<Trained> = textures.collect();
        let confusions: Vec<Confusion> = (0..movements.len())
            .flat_map(|m| Property::ALL.map(|property| (m, property)))
            .map(|(movement, property)| {
                let of: Vec<Gaussian> = (0..trials.len())
                    .map(|texture| gaussian(texture, movement, property))
                    .collect();
                let row = |a: &Gaussian| of.iter().map(|b| confusion(*a, *b)).collect();
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
            movements: movements.map(|m| m.written()).to_vec(),
            correlations: (0..movements.len())
                .map(|movement| Correlations {
                    ours: correlations(&textures, movement),
                    paper: CORRELATIONS[movement],
                })
                .collect(),
            pairs_confused: (over_half(&all), over_half(&most_useful)),
            confusion: confusions,
            geometric_mean: all,
            geometric_mean_most_useful: most_useful,
            tables,
            textures,
        })
    }
}

/// Geometric mean of matrices, element by element.
fn geometric_mean(of: &[&Confusion]) -> Vec<Vec<f32>> {
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
fn correlation(a: &[f64], b: &[f64]) -> f64 {
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
