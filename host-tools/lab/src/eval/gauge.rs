//! Repeatability of a probe and its operators: the variance of a property by part, by operator and by repetition
//! (crossed random effects, analysis of variance; Automotive Industry Action Group, Measurement Systems Analysis, 4th
//! edition).

use serde::Serialize;

/// One measured value.
#[derive(Clone, PartialEq, Debug)]
pub struct Reading {
    /// The part that was touched.
    pub part: String,
    /// The operator; empty if unknown.
    pub operator: String,
    /// Number of the slide, in the order of time.
    pub slide: u32,
    /// The value.
    pub value: f64,
}

/// Standard deviations of the components of a value, in its unit.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Deviations {
    /// One operator on one part, again and again.
    pub repeatability: f64,
    /// Between operators; `None`: there is one, or not all of them touched all parts.
    pub operator: Option<f64>,
    /// Between operators, of one part more than of another; as [`operator`](Self::operator).
    pub operator_by_part: Option<f64>,
    /// Repeatability and operators together: the measurement's part.
    pub gauge: f64,
    /// Between parts.
    pub part: f64,
    /// All together.
    pub total: f64,
}

/// The analysis of the readings of one property.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Study {
    /// Mean of the parts' means.
    pub mean: f64,
    /// Their components.
    pub sd: Deviations,
    /// Share of [`Deviations::gauge`] in [`Deviations::total`]; 0 where nothing differs.
    pub gauge_share: f64,
    /// Classes of parts that the gauge separates, 1.41 times part by gauge; `None`: the gauge is exact.
    pub distinct_categories: Option<u32>,
    /// Largest distance of a reading from the mean of its part and operator: three standard deviations, by the mean
    /// moving range.
    pub control_limit: f64,
    /// Readings that are further away, as numbers of [`Study::away`].
    pub outside: Vec<usize>,
    /// Distance of each reading from the mean of its part and operator, in the order of the readings.
    #[serde(skip)]
    pub away: Vec<f64>,
}

/// The reason why readings make no study.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error("{0}")]
pub struct GaugeError(&'static str);

const ONE_PART: GaugeError = GaugeError(
    "one part; a gauge study compares parts: give recordings of at least two textures or lots",
);
const NO_REPETITION: GaugeError = GaugeError(
    "no part has two slides by one operator; repeatability takes at least two: record with --slides 3",
);

/// Mean moving range of two normal values in standard deviations, 2/sqrt(pi).
const RANGE_IN_SD: f64 = std::f64::consts::FRAC_2_SQRT_PI;
/// sqrt(2): half-widths of a class that holds 97 % of the readings of one part.
const CLASS: f64 = std::f64::consts::SQRT_2;

/// Each of these once, in the order in which they come.
pub fn distinct<T: PartialEq>(all: impl Iterator<Item = T>) -> Vec<T> {
    let mut seen = Vec::new();
    for one in all {
        if !seen.contains(&one) {
            seen.push(one);
        }
    }
    seen
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Splits the differences of the readings. Where numbers of repetitions differ, cells count alike, each as their
/// harmonic mean (unweighted means). An interaction that is no larger than repetition explains counts as repetition.
pub fn study(readings: &[Reading]) -> Result<Study, GaugeError> {
    let parts = distinct(readings.iter().map(|r| r.part.as_str()));
    let operators = distinct(readings.iter().map(|r| r.operator.as_str()));
    if parts.len() < 2 {
        return Err(ONE_PART);
    }
    let cell_of = |r: &Reading| {
        let part = parts.iter().position(|p| *p == r.part).unwrap_or_default();
        let operator = operators.iter().position(|o| *o == r.operator);
        part * operators.len() + operator.unwrap_or_default()
    };
    let mut cells = vec![Vec::new(); parts.len() * operators.len()];
    for reading in readings {
        cells[cell_of(reading)].push(reading.value);
    }
    let means: Vec<f64> = cells.iter().map(|cell| mean(cell)).collect();
    let away: Vec<f64> = readings
        .iter()
        .map(|r| r.value - means[cell_of(r)])
        .collect();
    let filled = cells.iter().filter(|cell| !cell.is_empty());
    let repeated = readings.len() - filled.clone().count();
    if repeated == 0 {
        return Err(NO_REPETITION);
    }
    let squares: f64 = away.iter().map(|a| a * a).sum();
    let mut within = squares / repeated as f64;
    let moves: Vec<f64> = cells
        .iter()
        .flat_map(|cell| cell.windows(2))
        .map(|pair| (pair[1] - pair[0]).abs())
        .collect();
    let control_limit = 3.0 * mean(&moves) / RANGE_IN_SD;

    let harmonic = |cells: &[&Vec<f64>]| {
        let inverse: f64 = cells.iter().map(|cell| 1.0 / cell.len() as f64).sum();
        cells.len() as f64 / inverse
    };
    let is_crossed = operators.len() > 1 && cells.iter().all(|cell| !cell.is_empty());
    let (p, o) = (parts.len() as f64, operators.len() as f64);
    let part_means: Vec<f64>;
    let variances = if is_crossed {
        let each = harmonic(&cells.iter().collect::<Vec<_>>());
        part_means = means.chunks(operators.len()).map(mean).collect();
        let operator_mean = |o: usize| {
            let column: Vec<f64> = means
                .iter()
                .skip(o)
                .step_by(operators.len())
                .copied()
                .collect();
            mean(&column)
        };
        let operator_means: Vec<f64> = (0..operators.len()).map(operator_mean).collect();
        let all = mean(&means);
        let about = |values: &[f64]| values.iter().map(|v| (v - all).powi(2)).sum::<f64>();
        let (of_parts, of_operators) = (about(&part_means), about(&operator_means));
        let freedom = (p - 1.0) * (o - 1.0);
        let crossed = (about(&means) - o * of_parts - p * of_operators).max(0.0);
        let mut interaction = each * crossed / freedom;
        if interaction <= within {
            // pooled
            let freedoms = repeated as f64 + freedom;
            within = (within * repeated as f64 + interaction * freedom) / freedoms;
            interaction = within;
        }
        let ms_part = each * o * of_parts / (p - 1.0);
        let ms_operator = each * p * of_operators / (o - 1.0);
        let variance = |more: f64, less: f64, times: f64| ((more - less) / times).max(0.0);
        (
            variance(ms_part, interaction, each * o),
            Some(variance(ms_operator, interaction, each * p)),
            Some(variance(interaction, within, each)),
        )
    } else {
        let of = |part: &[Vec<f64>]| part.concat();
        let by_part: Vec<Vec<f64>> = cells.chunks(operators.len()).map(of).collect();
        part_means = by_part.iter().map(|part| mean(part)).collect();
        let all = mean(&part_means);
        let squares: f64 = part_means.iter().map(|m| (m - all).powi(2)).sum();
        let each = harmonic(&by_part.iter().collect::<Vec<_>>());
        let part = squares / (p - 1.0) - within / each;
        (part.max(0.0), None, None)
    };
    let (part, operator, operator_by_part) = variances;
    let gauge = within + operator.unwrap_or(0.0) + operator_by_part.unwrap_or(0.0);
    let sd = Deviations {
        repeatability: within.sqrt(),
        operator: operator.map(f64::sqrt),
        operator_by_part: operator_by_part.map(f64::sqrt),
        gauge: gauge.sqrt(),
        part: part.sqrt(),
        total: (gauge + part).sqrt(),
    };
    let share = sd.gauge / sd.total;
    let classes = CLASS * sd.part / sd.gauge;
    let beyond = |(_, away): &(usize, &f64)| away.abs() > control_limit;
    Ok(Study {
        mean: mean(&part_means),
        sd,
        gauge_share: if sd.total > 0.0 { share } else { 0.0 },
        distinct_categories: classes.is_finite().then(|| (classes as u32).max(1)),
        control_limit,
        outside: away
            .iter()
            .enumerate()
            .filter(beyond)
            .map(|(n, _)| n)
            .collect(),
        away,
    })
}

#[cfg(test)]
mod tests;
