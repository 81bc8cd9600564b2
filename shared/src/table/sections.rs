//! The sections that a table may have behind its names, each with its kind and length: a reader skips unknown kinds.

use heapless::Vec;

use super::drift::{Drift, Drifts};
use super::encode::{EncodeError, Writer};
use super::finger::is_finger;
use super::format::{DRIFT, MAX_MOVEMENTS, SLOPES, TWO, TableError, array, each};
use super::limits::{Limits, Numbers};
use super::open_set::OpenSet;
use super::population::{LEAST, Population};
use super::slopes::{self, Slopes};
use super::view::Table;
use super::whitening::{View, Whitening};
use crate::features::MAX_FEATURES;

pub(super) const NOVELTY: u16 = 2;
pub(super) const SAMPLES: u16 = 3;
pub(super) const FINGER: u16 = 5;
pub(super) const OPEN_SET: u16 = 7;
pub(super) const LEARNED: u16 = 8;
/// Most sections, of unknown kinds as well: whoever looks for one passes the others.
const MAX_SECTIONS: usize = 32;

/// The parts of a fused table beside textures.
#[derive(Clone, Copy, Debug)]
pub struct Sections<'a> {
    /// The expected drift, and its variances at every movement.
    pub drift: (Drift, &'a [Drifts]),
    /// The limits, and the population of every movement; `None` for a table of too few textures.
    pub novelty: Option<(Limits, &'a [Population])>,
    /// The slopes of the means over the speed; `None` for a table that knows no speeds.
    pub slopes: Option<Slopes<'a>>,
}

impl Sections<'_> {
    pub(super) fn write(
        &self,
        features: usize,
        writer: &mut Writer<'_>,
    ) -> Result<(), EncodeError> {
        let (drift, drifts) = self.drift;
        writer.section(DRIFT, |writer| {
            writer.put_floats([drift.bands, drift.traction].into_iter());
            for variances in drifts {
                writer.put_floats(variances.iter().take(features.div_ceil(2)).copied());
            }
        })?;
        if let Some((limits, populations)) = self.novelty {
            writer.section(NOVELTY, |writer| {
                writer.put_floats(limits.numbers());
                for population in populations {
                    writer.put(population.axes.as_bytes());
                    writer.put_floats(population.variances.iter().take(features).copied());
                }
            })?;
        }
        match self.slopes {
            Some(slopes) => writer.section(SLOPES, |writer| slopes.write(features, writer)),
            None => Ok(()),
        }
    }
}

pub(super) const fn of_drift(features: usize) -> usize {
    4 * features.div_ceil(2)
}

pub(super) const fn of_population(features: usize) -> usize {
    Whitening::bytes(features) + 4 * features
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct PopulationView<'t> {
    pub(crate) axes: View<'t>,
    pub(crate) variances: Numbers<'t>,
}

impl<'a> Table<'a> {
    /// Returns how much drift the table was made for; `None` for a table of Gaussians.
    pub fn drift(&self) -> Option<Drift> {
        drift_of(self.section(DRIFT)?)
    }

    pub(crate) fn drifts(&self, movement: u8) -> Option<Numbers<'a>> {
        let (table, movement) = self.at(movement)?;
        let bytes = of_drift(self.features());
        let at = usize::from(movement) * bytes;
        table.drifts.get(at..at + bytes).map(Numbers::new)
    }

    /// Returns from which scores on a texture is new, or has changed; `None` for a table that is not calibrated: one of
    /// Gaussians, or of fewer than three textures when it was made.
    pub fn limits(&self) -> Option<Limits> {
        Limits::read(self.novelty.get(..Limits::BYTES)?)
    }

    pub(crate) fn population(&self, movement: u8) -> Option<PopulationView<'a>> {
        let (table, movement) = self.at(movement)?;
        let features = self.features();
        let at = Limits::BYTES + usize::from(movement) * of_population(features);
        let population = table.novelty.get(at..)?.get(..of_population(features))?;
        let (axes, variances) = population.split_at_checked(Whitening::bytes(features))?;
        Some(PopulationView {
            axes: View {
                features,
                bytes: axes,
            },
            variances: Numbers::new(variances),
        })
    }

    /// The populations of all movements, in a table that is calibrated.
    pub fn populations(&self) -> Option<Vec<Population, MAX_MOVEMENTS>> {
        let of_movement = |movement| {
            let found = self.population(movement)?;
            let mut variances = [0.0; MAX_FEATURES];
            for (to, from) in variances.iter_mut().zip(found.variances) {
                *to = from;
            }
            let axes = Whitening::read(found.axes.bytes, self.features())?;
            Some(Population { axes, variances })
        };
        (0..self.movements).map(of_movement).collect()
    }

    pub(super) fn find_sections(&mut self) {
        let drifts = self.drift().is_some_and(|drift| !drift.is_none());
        let section = self.section(DRIFT).filter(|_| drifts);
        self.drifts = section.and_then(|s| s.get(TWO..)).unwrap_or_default();
        self.novelty = self.section(NOVELTY).unwrap_or_default();
        self.slopes = self.section(SLOPES).unwrap_or_default();
    }

    pub(super) fn check_sections(&self) -> Result<(), TableError> {
        let (features, movements) = (self.features(), usize::from(self.movements));
        let mut seen = 0_u8;
        for (section, count) in each(self.sections).zip(0..) {
            let (kind, contents) = section
                .filter(|_| count < MAX_SECTIONS)
                .ok_or(TableError::Sections)?;
            let fits = match kind {
                DRIFT => are_drifts(contents, features, movements),
                NOVELTY => are_limits(contents, features, movements),
                SLOPES => slopes::are_slopes(contents, features, self.textures.into(), movements),
                FINGER => is_finger(contents),
                OPEN_SET => OpenSet::read(contents).is_some(),
                _ => continue,
            };
            let bit = 1 << kind;
            if seen & bit != 0 || !fits || (features == 0 && kind != FINGER) {
                return Err(TableError::Section(kind));
            }
            seen |= bit;
        }
        Ok(())
    }
}

fn drift_of(section: &[u8]) -> Option<Drift> {
    Some(Drift {
        bands: f32::from_le_bytes(array(section, 0)?),
        traction: f32::from_le_bytes(array(section, 4)?),
    })
}

#[inline(always)]
pub(super) fn are_drifts(contents: &[u8], features: usize, movements: usize) -> bool {
    let (drift, rest) = contents.split_at_checked(TWO).unwrap_or_default();
    let mut variances = rest.chunks(of_drift(features).max(1));
    rest.len() == movements * of_drift(features)
        && drift_of(drift).is_some_and(Drift::is_possible)
        && variances.all(|v| Numbers::new(v).are_variances(0.0))
}

#[inline(always)]
pub(super) fn are_limits(contents: &[u8], features: usize, movements: usize) -> bool {
    let (limits, populations) = contents.split_at_checked(Limits::BYTES).unwrap_or_default();
    let mut populations_of = populations.chunks(of_population(features).max(1));
    populations.len() == movements * of_population(features)
        && Limits::read(limits).is_some_and(|limits| limits.are_possible())
        && populations_of.all(|population| {
            let found = population.split_at_checked(Whitening::bytes(features));
            found.is_some_and(|(axes, variances)| {
                View::new(axes, features).is_some() && Numbers::new(variances).are_variances(LEAST)
            })
        })
}
