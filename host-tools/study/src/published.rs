//! Published numbers of Fishel & Loeb (Front. Neurorobot. 6:4, 2012), for comparison with the study's own.

use tactus_core::features::{Movement, Property};

/// The ten textures of the pilot study (Table 2), by their numbers.
pub const PILOT_TEXTURES: [u8; 10] = [2, 10, 30, 43, 45, 46, 47, 84, 87, 100];
/// Trials of each movement in the pilot study.
pub(crate) const PILOT_TRIALS: u32 = 6;
/// The three movements that the pilot study found, and the property that each is most useful for (fig. 7, 10).
pub(crate) const MOST_USEFUL: [(Movement, Property); 3] = [
    (Movement::FOR_TRACTION, Property::Traction),
    (Movement::FOR_FINENESS, Property::Fineness),
    (Movement::FOR_ROUGHNESS, Property::Roughness),
];
/// Trials of each movement in training and in validation.
pub const TRIALS: u32 = 5;

/// Correlations of Table 3 by movement: traction and roughness, traction and fineness, roughness and fineness.
pub(crate) const CORRELATIONS: [[f64; 3]; 3] = [
    [-0.5564, -0.3560, 0.2183],
    [-0.4916, -0.5100, 0.3981],
    [-0.4019, -0.5472, 0.5581],
];

/// A row of Table 4: two textures, and the shares of right answers of people and of Bayesian exploration, %.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Pair {
    /// Numbers of the textures.
    pub textures: [u8; 2],
    /// Of five people.
    pub(crate) human: f64,
    /// Of the machine.
    pub machine: f64,
}

const fn pair(a: u8, b: u8, human: f64, machine: f64) -> Pair {
    Pair {
        textures: [a, b],
        human,
        machine,
    }
}

/// Table 4.
pub const PAIRS: [Pair; 8] = [
    pair(1, 3, 60.0, 99.3),
    pair(50, 54, 80.0, 100.0),
    pair(12, 96, 90.0, 100.0),
    pair(57, 58, 70.0, 100.0),
    pair(107, 111, 100.0, 100.0),
    pair(18, 19, 85.0, 97.7),
    pair(102, 104, 90.0, 100.0),
    pair(51, 53, 75.0, 100.0),
];

/// A column of Table 5, %.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Column {
    /// Right answers.
    pub correct: f64,
    /// Right answers that also converged.
    pub converged: f64,
    /// Median number of movements; the table's 10* for cycling, where fewer than half converged.
    pub median: &'static str,
    /// Right answers for each of [`IDENTIFIED`].
    pub textures: [f64; 16],
}

/// The textures to be identified, in the order of Table 5.
pub const IDENTIFIED: [u8; 16] = [
    1, 3, 50, 54, 12, 96, 57, 58, 107, 111, 18, 19, 102, 104, 51, 53,
];

/// Table 5: uninformed cycling.
pub(crate) const CYCLING: Column = Column {
    correct: 49.9,
    converged: 36.4,
    median: "10*",
    textures: [
        0.0, 0.0, 58.0, 88.6, 100.0, 33.4, 100.0, 0.0, 99.2, 14.2, 27.6, 86.2, 100.0, 26.6, 3.0,
        61.2,
    ],
};
/// Table 5: random selection.
pub(crate) const RANDOM: Column = Column {
    correct: 84.1,
    converged: 68.3,
    median: "8",
    textures: [
        57.8, 81.2, 84.4, 86.6, 94.2, 83.4, 99.6, 51.4, 94.0, 90.6, 86.4, 88.0, 99.2, 91.8, 75.4,
        80.8,
    ],
};
/// Table 5: Bayesian exploration.
pub(crate) const BAYESIAN: Column = Column {
    correct: 95.4,
    converged: 89.3,
    median: "5",
    textures: [
        82.0, 99.6, 100.0, 99.6, 96.4, 100.0, 100.0, 67.2, 99.8, 99.6, 100.0, 94.4, 100.0, 96.8,
        93.6, 97.6,
    ],
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_means_are_those_of_the_rows() {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        for column in [CYCLING, RANDOM, BAYESIAN] {
            assert!(
                (mean(&column.textures) - column.correct).abs() < 0.06,
                "{column:?}"
            );
        }
        assert!((mean(&PAIRS.map(|p| p.human)) - 81.3).abs() < 0.06);
        assert!((mean(&PAIRS.map(|p| p.machine)) - 99.6).abs() < 0.06);
        let mut of_pairs: Vec<u8> = PAIRS.iter().flat_map(|p| p.textures).collect();
        let mut identified = IDENTIFIED.to_vec();
        of_pairs.sort_unstable();
        identified.sort_unstable();
        assert_eq!(of_pairs, identified);
    }
}
