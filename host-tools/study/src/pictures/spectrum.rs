//! The unknown texture's features beside those of its two best candidates.

use tactus_core::dsp::BIN_HZ;
use tactus_core::features::{
    FEATURE_STEPS, FUSED_BANDS, FUSED_EDGES, FeatureSet, Observation, Property, WHITE_STEPS,
};
use tactus_core::table::{Action, Contents, Table};

use crate::chart::{Chart, DrawError, Figure, MARKS, Series, WIDTH};
use tactus_lab::eval::show::apart;

/// A slide that counted.
#[derive(Clone, Debug)]
pub(super) struct Counted {
    pub(super) action: Action,
    pub(super) observed: Observation,
    /// Of every texture of the table.
    pub(super) posterior: Vec<f32>,
}

/// Mean and standard deviation.
type Feature = (f64, f64);

/// The figure, at the movement of which the most slides counted: the band powers where the table has them, else the
/// three properties. None where the table knows neither of the two at that movement.
pub(super) fn figure(
    table: Table<'_>,
    slides: &[Counted],
    best: &[(u16, f32)],
) -> Result<Option<Figure>, DrawError> {
    let made = |movement: u8| slides.iter().filter(move |s| s.action.movement == movement);
    // the last of equals
    let movement = slides.iter().map(|s| s.action.movement);
    let Some(movement) = movement.max_by_key(|&m| made(m).count()) else {
        return Ok(None);
    };
    let unknown = mean(made(movement).filter_map(|slide| features(table, slide)));
    let candidates: Vec<(String, Vec<Feature>)> = two_best(table, best, movement)
        .filter_map(|(texture, p)| {
            let name = format!("{} ({:.1} %)", table.name(texture)?, 100.0 * p);
            Some((name, known(table, texture, movement)?))
        })
        .collect();
    let (Some(unknown), false) = (unknown, candidates.is_empty()) else {
        return Ok(None);
    };
    let at = table.movement(movement);
    let at = at.map_or_else(String::new, |at| format!(" at {at}"));
    let others = match table.contents() {
        Contents::Fused(set, _) if set != FeatureSet::Properties => set.others(),
        Contents::Fused(..) | Contents::Gaussians(_) => {
            return properties(&unknown, &candidates, &at).map(Some);
        }
    };
    bands(others, &unknown, &candidates, &at).map(Some)
}

/// The two most probable textures. Where no second one is probable at all, it is the one most like the first.
fn two_best(
    table: Table<'_>,
    best: &[(u16, f32)],
    movement: u8,
) -> impl Iterator<Item = (u16, f32)> {
    let first = best.first().copied();
    let others = best.get(1..).unwrap_or_default();
    let second = match others.first() {
        Some((_, p)) if *p <= 0.0 => {
            let to_first = |texture: u16| apart(table, movement, [first?.0, texture]);
            let near = others
                .iter()
                .filter_map(|other| Some((to_first(other.0)?, other)));
            let nearest = near.min_by(|a, b| a.0.total_cmp(&b.0));
            nearest.map(|(_, other)| *other).or(others.first().copied())
        }
        other => other.copied(),
    };
    first.into_iter().chain(second)
}

/// The features of a slide as the table compares them, in their units.
fn features(table: Table<'_>, slide: &Counted) -> Option<Vec<f64>> {
    match table.contents() {
        Contents::Fused(set, length) => {
            let vector = slide.observed.vector(set, length.into())?;
            let unit = f64::from(FEATURE_STEPS);
            Some(vector.iter().map(|&step| f64::from(step) / unit).collect())
        }
        Contents::Gaussians(_) => {
            let value = |p| slide.observed.properties.get(p).map_or(f64::NAN, f64::from);
            Some(Property::ALL.map(value).to_vec())
        }
    }
}

fn mean(vectors: impl Iterator<Item = Vec<f64>>) -> Option<Vec<f64>> {
    let mut sum: Option<(Vec<f64>, f64)> = None;
    for vector in vectors {
        let (sum, count) = sum.get_or_insert_with(|| (vec![0.0; vector.len()], 0.0));
        *count += 1.0;
        sum.iter_mut().zip(vector).for_each(|(sum, x)| *sum += x);
    }
    sum.map(|(sum, count)| sum.into_iter().map(|x| x / count).collect())
}

/// The learned Gaussians of a texture at a movement.
fn known(table: Table<'_>, texture: u16, movement: u8) -> Option<Vec<Feature>> {
    if table.trials(texture, movement) == 0 {
        return None;
    }
    match table.contents() {
        Contents::Gaussians(_) => {
            let of = |property| {
                let gaussian = table.gaussian(texture, Action::of(movement, property));
                gaussian.map_or((f64::NAN, f64::NAN), |g| (g.mean.into(), g.sd.into()))
            };
            Some(Property::ALL.map(of).to_vec())
        }
        Contents::Fused(..) => unwhitened(table, texture, movement),
    }
}

/// The mean of a texture as features, and their scatter within a texture: the inverse of the table's whitening z = W (x
/// - g).
fn unwhitened(table: Table<'_>, texture: u16, movement: u8) -> Option<Vec<Feature>> {
    let whitening = table.whitening(movement)?;
    let n = whitening.features();
    let (mean, rest) = whitening.as_bytes().split_at_checked(2 * n)?;
    let (places, rows) = rest.split_at_checked(n)?;
    let number = |pair: &[u8; 2]| f64::from(i16::from_le_bytes(*pair));
    let rows: Vec<f64> = rows.as_chunks().0.iter().map(number).collect();
    let rows = rows.chunks(n).zip(places);
    let weights = rows.map(|(row, &places)| {
        let scale = 0.5_f64.powi(places.into());
        row.iter().map(|w| w * scale).collect()
    });
    let inverse = inverse(weights.collect())?;
    let white: Vec<f64> = table
        .white_mean(texture, movement)
        .map(|step| f64::from(step) / f64::from(WHITE_STEPS))
        .collect();
    let means = mean.as_chunks().0.iter().map(number);
    let features = inverse.iter().zip(means).map(|(row, g)| {
        let off: f64 = row.iter().zip(&white).map(|(v, z)| v * z).sum();
        let sd = row.iter().map(|v| v * v).sum::<f64>().sqrt();
        (g / f64::from(FEATURE_STEPS) + off, sd)
    });
    Some(features.collect())
}

/// The inverse of a square matrix (Gauss and Jordan); `None` if it has none.
fn inverse(mut of: Vec<Vec<f64>>) -> Option<Vec<Vec<f64>>> {
    let n = of.len();
    for (r, row) in of.iter_mut().enumerate() {
        row.extend((0..n).map(|c| f64::from(u8::from(r == c))));
    }
    for c in 0..n {
        let pivot = (c..n).max_by(|&a, &b| of[a][c].abs().total_cmp(&of[b][c].abs()))?;
        of.swap(c, pivot);
        let row = of[c].clone();
        if row[c].abs() < 1e-9 {
            return None;
        }
        for (r, other) in of.iter_mut().enumerate() {
            let factor = if r == c {
                1.0 - 1.0 / row[c]
            } else {
                other[c] / row[c]
            };
            other
                .iter_mut()
                .zip(&row)
                .for_each(|(x, y)| *x -= factor * y);
        }
    }
    Some(of.into_iter().map(|mut row| row.split_off(n)).collect())
}

/// Decibels of a natural logarithm of power.
fn decibels(ln: f64) -> f64 {
    10.0 * std::f64::consts::LOG10_E * ln
}

fn bands(
    others: usize,
    unknown: &[f64],
    candidates: &[(String, Vec<Feature>)],
    at: &str,
) -> Result<Figure, DrawError> {
    let edges = FUSED_EDGES.windows(2).take(FUSED_BANDS);
    let middles = edges.map(|e| (f64::from(BIN_HZ) * ((e[0] * e[1]) as f64).sqrt()).log2());
    let middles: Vec<f64> = middles.collect();
    let mut series = Vec::new();
    for (n, (name, features)) in candidates.iter().enumerate() {
        // side by side, so that no error bar hides another
        let aside = 0.027 * (2.0 * n as f64 - 1.0);
        let of = middles.iter().zip(features.iter().skip(others));
        let (mut points, mut bars, mut says) = (Vec::new(), Vec::new(), Vec::new());
        for (x, (mean, sd)) in of {
            points.push((x + aside, decibels(*mean)));
            bars.push((decibels(mean - sd), decibels(mean + sd)));
            says.push(format!(
                "{name}, {:.0} Hz: {:.2} dB, sd {:.2} dB",
                x.exp2(),
                decibels(*mean),
                decibels(*sd)
            ));
        }
        series.push(Series {
            bars,
            says,
            ..Series::curve(n + 1, MARKS[n + 1], name, points)
        });
    }
    let own = middles.iter().zip(unknown.iter().skip(others));
    let own: Vec<(f64, f64)> = own.map(|(x, ln)| (*x, decibels(*ln))).collect();
    let says = own
        .iter()
        .map(|(x, db)| format!("the unknown, {:.0} Hz: {db:.2} dB", x.exp2()));
    let says = says.collect();
    series.push(Series {
        says,
        ..Series::curve(0, MARKS[0], "the unknown", own)
    });
    let beside = |name: &str, of: &dyn Fn(usize) -> String| {
        let of = (0..others).map(of).collect::<Vec<_>>().join(" and ");
        format!("{name} {of}")
    };
    let mut below = "Bars: one standard deviation between slides of a texture.".to_owned();
    if others > 0 {
        let what = if others == 1 {
            "traction, N"
        } else {
            "P_DC, mean and sd, in 100 counts"
        };
        let mut all = vec![beside("the unknown", &|n| format!("{:.2}", unknown[n]))];
        all.extend(candidates.iter().map(|(name, features)| {
            beside(name, &|n| {
                format!("{:.2} \u{b1} {:.2}", features[n].0, features[n].1)
            })
        }));
        below += &format!(" Compared, too ({what}): {}.", all.join("; "));
    }
    let hz = |x: f64| format!("{:.0}", x.exp2());
    Chart {
        x_text: &hz,
        below: &below,
        size: (WIDTH, 440),
        ..Chart::new(
            format!("The unknown and its two best candidates{at}"),
            "frequency (Hz)",
            "power per bin (dB, 1 count\u{b2})",
            (3.9, 10.0),
            series,
        )
    }
    .figure("spectrum")
}

/// The three properties, in standard deviations of the best candidate.
fn properties(
    unknown: &[f64],
    candidates: &[(String, Vec<Feature>)],
    at: &str,
) -> Result<Figure, DrawError> {
    let best = &candidates[0].1;
    let mut series = Vec::new();
    for (n, (name, features)) in candidates.iter().enumerate() {
        let (mut points, mut bars, mut says) = (Vec::new(), Vec::new(), Vec::new());
        for ((x, &(mean, sd)), &(zero, unit)) in (0..).map(f64::from).zip(features).zip(best) {
            let y = (mean - zero) / unit;
            if y.is_finite() {
                let aside = 0.1 * (n as f64 + 1.0);
                points.push((x + aside, y));
                bars.push((y - sd / unit, y + sd / unit));
                says.push(format!("{name}: {mean:.3}, sd {sd:.3}"));
            }
        }
        series.push(Series {
            bars,
            says,
            ..Series::points(n + 1, MARKS[n + 1], name, points)
        });
    }
    let mut own = Series::points(0, MARKS[0], "the unknown", Vec::new());
    for ((x, &value), &(zero, unit)) in (0..).map(f64::from).zip(unknown).zip(best) {
        let y = (value - zero) / unit;
        if y.is_finite() {
            own.points.push((x - 0.1, y));
            own.says.push(format!("the unknown: {value:.3}"));
        }
    }
    series.push(own);
    let name = |x: f64| {
        let property = Property::ALL.get(x.round() as usize);
        property.map_or_else(String::new, ToString::to_string)
    };
    Chart {
        x_marks: 3,
        x_text: &name,
        below: "0 and 1: mean and standard deviation of the best candidate. This table holds no spectrum.",
        size: (WIDTH, 400),
        ..Chart::new(
            format!("The unknown and its two best candidates{at}"),
            "",
            "standard deviations",
            (-0.5, 2.5),
            series,
        )
    }
    .figure("spectrum")
}
