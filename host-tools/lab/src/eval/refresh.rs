//! A table after the skin or the finger was replaced: a slide or more of each texture at each movement moves the
//! learned means to the new finger's.
//!
//! The shift that all textures have in common (the new finger's gain, for one) moves the features that are whitened to
//! 0; with them move all textures, those without a new slide too, and limits and drift stay as they are. A texture's
//! own shift moves its mean, along each axis by w = t^2 / (t^2 + 1/k + 1/n) of it: k new slides have the variance 1/k +
//! 1/n about a mean of n anyway, and t^2 is the variance of the textures' own shifts beyond that (empirical Bayes, by
//! moments). The mean's error then has the variance (1 - w)^2 (1/n + t^2) + w^2/k; the table notes as many slides for
//! the texture as would leave an error as large.

use tactus_core::features::{Vector, WHITE_STEPS};
use tactus_core::table::{Contents, EncodeError, Table, recentre, retell};
use tactus_link::for_probe;

use crate::eval::alike::alike;

/// A new slide.
#[derive(Clone, PartialEq, Debug)]
pub struct NewSlide {
    /// Index of the texture.
    pub texture: u16,
    /// Index of the movement.
    pub movement: u8,
    /// Its features, as the table has them.
    pub features: Vec<i16>,
}

/// A table that was moved by new slides.
#[derive(Clone, PartialEq, Debug)]
pub struct Refreshed {
    /// The table.
    pub bytes: Vec<u8>,
    /// Shift of all textures together: root mean square over movements and features, standard deviations of a slide.
    pub together: f64,
    /// Shift of each texture beyond that, the largest first; those that have a new slide.
    pub moved: Vec<Moved>,
    /// Pairs that ten slides do not separate any more.
    pub alike: Vec<Pair>,
}

/// Shift of a texture.
#[derive(Clone, PartialEq, Debug)]
pub struct Moved {
    /// Its name.
    pub texture: String,
    /// Root mean square over movements and features, standard deviations of a slide.
    pub moved: f64,
}

/// Two textures that ten slides do not separate.
#[derive(Clone, PartialEq, Debug)]
pub struct Pair {
    /// The one.
    pub first: String,
    /// The other.
    pub second: String,
    /// True if ten slides did not separate them before either.
    pub before: bool,
}

/// The reason why a table was not refreshed.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct RefreshError(String);

impl From<EncodeError> for RefreshError {
    fn from(why: EncodeError) -> Self {
        Self(why.to_string())
    }
}

/// Moves the learned means by new slides.
pub fn refresh(table: Table<'_>, slides: &[NewSlide]) -> Result<Refreshed, RefreshError> {
    let Contents::Fused(..) = table.contents() else {
        let why = "only tables with whitened features can be refreshed: learn this one again";
        return Err(RefreshError(why.to_owned()));
    };
    // of the new slides it is not noted which they are, so it says that of none
    let mut bytes = for_probe(&table);
    let mut together = Mean::default();
    let mut own = vec![Mean::default(); table.textures().into()];
    for movement in 0..table.movements().len() as u8 {
        let here: Vec<&NewSlide> = slides.iter().filter(|s| s.movement == movement).collect();
        let shifts: Vec<Shift> = (0..table.textures())
            .filter_map(|texture| Shift::new(&table, texture, movement, &here))
            .collect();
        let Some(first) = shifts.first() else {
            continue;
        };
        let axes = 0..first.by.len();
        let mean =
            |axis: usize| shifts.iter().map(|s| s.by[axis]).sum::<f64>() / shifts.len() as f64;
        let mut common: Vec<f64> = axes.clone().map(mean).collect();
        common.iter().for_each(|by| together.take(*by));
        let varies = varies(&shifts, &common);
        if let Some(centre) = centre(&table, movement, &common) {
            recentre(&mut bytes, movement, &centre)?;
        } else {
            // features that depend on each other: the means move instead, those that have a slide
            common.fill(0.0);
        }
        for shift in &shifts {
            let mut learned = table.whitened(shift.texture, movement);
            let mut variance = 0.0;
            for axis in axes.clone() {
                let of_all = mean(axis);
                let varies = varies[axis];
                let believed = varies / (varies + shift.new + shift.learned);
                let by = believed * (shift.by[axis] - of_all);
                variance += (1.0 - believed).powi(2) * (shift.learned + varies)
                    + believed.powi(2) * shift.new;
                own[usize::from(shift.texture)].take(by);
                let by = by + of_all - common[axis];
                let steps = f64::from(learned.mean[axis]) + by * f64::from(WHITE_STEPS);
                learned.mean[axis] = steps.round() as i16;
            }
            let variance = variance / shift.by.len() as f64;
            learned.slides = (1.0 / variance).round().clamp(1.0, 255.0) as u8;
            let tally = table.tally(shift.texture);
            retell(&mut bytes, shift.texture, movement, &learned, tally)?;
        }
    }
    let names = (0..).zip(table.names());
    let moved = names
        .zip(&own)
        .filter_map(|((_, name), own): ((u16, _), _)| {
            let moved = own.root()?;
            let texture = name.to_owned();
            Some(Moved { texture, moved })
        });
    let mut moved: Vec<Moved> = moved.collect();
    moved.sort_by(|a, b| b.moved.total_cmp(&a.moved));
    let alike = pairs(table, Table::read(&bytes).map_err(EncodeError::Invalid)?);
    Ok(Refreshed {
        together: together.root().ok_or_else(|| {
            RefreshError("no slide of a texture of the table was made".to_owned())
        })?,
        bytes,
        moved,
        alike,
    })
}

#[derive(Clone, Copy, Default)]
struct Mean {
    squares: f64,
    count: f64,
}

impl Mean {
    fn take(&mut self, x: f64) {
        self.squares += x * x;
        self.count += 1.0;
    }

    fn root(self) -> Option<f64> {
        (self.count > 0.0).then(|| (self.squares / self.count).sqrt())
    }
}

/// Difference between a texture's new slides and its learned mean.
struct Shift {
    texture: u16,
    /// Of their mean along each axis, standard deviations of a slide.
    by: Vec<f64>,
    new: f64,
    learned: f64,
}

impl Shift {
    /// `None` where the texture was not learned, or has no new slide.
    fn new(table: &Table<'_>, texture: u16, movement: u8, slides: &[&NewSlide]) -> Option<Self> {
        let trials = f64::from(table.trials(texture, movement));
        let its = slides.iter().filter(|slide| slide.texture == texture);
        let white = its.map(|slide| table.whiten(movement, &slide.features));
        let white: Vec<_> = white.collect::<Option<_>>()?;
        let count = white.len() as f64;
        let mean = table.white_mean(texture, movement).enumerate();
        let by = mean.map(|(axis, mean)| {
            let z = |white: &Vector| f64::from(white.get(axis).copied().unwrap_or_default());
            let sum: f64 = white.iter().map(z).sum();
            (sum / count - f64::from(mean)) / f64::from(WHITE_STEPS)
        });
        (trials > 0.0 && count > 0.0).then(|| Self {
            texture,
            by: by.collect(),
            new: 1.0 / count,
            learned: 1.0 / trials,
        })
    }
}

/// Variance of the textures' own shifts along each axis, beyond that which slides and means have anyway.
fn varies(shifts: &[Shift], common: &[f64]) -> Vec<f64> {
    let count = shifts.len() as f64;
    let anyway: f64 = shifts.iter().map(|s| s.new + s.learned).sum();
    let of_axis = |(axis, common): (usize, &f64)| {
        let squares: f64 = shifts.iter().map(|s| (s.by[axis] - common).powi(2)).sum();
        // of a single texture only the common shift is known
        (squares / (count - 1.0).max(1.0) - anyway / count).max(0.0)
    };
    common.iter().enumerate().map(of_axis).collect()
}

/// The features that are to be whitened to 0 where all whitened features shift so much; `None` where the whitening
/// cannot be turned round.
fn centre(table: &Table<'_>, movement: u8, shift: &[f64]) -> Option<Vec<i16>> {
    let whitening = table.whitening(movement)?;
    let features = whitening.features();
    let (mean, rest) = whitening.as_bytes().split_at(2 * features);
    let (places, rows) = rest.split_at(features);
    let word = |pair: &[u8]| f64::from(i16::from_le_bytes([pair[0], pair[1]]));
    // features come in 1/1024, weights in so many binary places
    let mut equations: Vec<Vec<f64>> = rows
        .chunks(2 * features)
        .zip(places)
        .zip(shift)
        .map(|((row, places), shift)| {
            let unit = f64::from(places_of_two(*places));
            let weights = row.chunks(2).map(|weight| word(weight) / unit / 1024.0);
            weights.chain([*shift]).collect()
        })
        .collect();
    let by = solve(&mut equations)?;
    let moved = mean.chunks(2).zip(by).map(|(mean, by)| {
        let to = (word(mean) + by).round();
        to.clamp(i16::MIN.into(), i16::MAX.into()) as i16
    });
    Some(moved.collect())
}

fn places_of_two(places: u8) -> u32 {
    1 << places.min(30)
}

/// Solves equations, the right sides at their ends (Gauss, with pivots); `None` if they depend on each other.
fn solve(equations: &mut [Vec<f64>]) -> Option<Vec<f64>> {
    let n = equations.len();
    for at in 0..n {
        let size = |row: &usize| equations[*row][at].abs();
        let pivot = (at..n).max_by(|a, b| size(a).total_cmp(&size(b)))?;
        if size(&pivot) < 1e-9 {
            return None;
        }
        equations.swap(at, pivot);
        let (done, rest) = equations.split_at_mut(at + 1);
        let top = &done[at];
        for row in rest {
            let factor = row[at] / top[at];
            row.iter_mut().zip(top).for_each(|(x, t)| *x -= factor * t);
        }
    }
    let mut x = vec![0.0; n];
    for at in (0..n).rev() {
        let row = &equations[at];
        let known: f64 = (at + 1..n).map(|other| row[other] * x[other]).sum();
        x[at] = (row[n] - known) / row[at];
    }
    Some(x)
}

/// The pairs that ten slides do not separate in the new table, and whether they did in the old one.
fn pairs(old: Table<'_>, new: Table<'_>) -> Vec<Pair> {
    let same = |table, a, b| alike(table, a, b).is_some_and(|alike| alike.feels_the_same);
    let name = |texture| new.name(texture).unwrap_or_default().to_owned();
    let all = (0..new.textures()).flat_map(|a| (a + 1..new.textures()).map(move |b| (a, b)));
    let alike = all.filter(|(a, b)| same(new, *a, *b) || same(new, *b, *a));
    alike
        .map(|(a, b)| Pair {
            first: name(a),
            second: name(b),
            before: same(old, a, b) || same(old, b, a),
        })
        .collect()
}
