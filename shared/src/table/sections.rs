//! The sections that a table may have behind its names, each with its kind and length: a reader skips unknown kinds.
//!
//! | bytes | what |
//! |---|---|
//! | 2 | kind |
//! | 2 | length n |
//! | n | contents |
//!
//! Numbers are f32. Kind 1, how it drifts: [`Drift::bands`], [`Drift::traction`]; per movement variances along each two
//! axes of its whitening. Kind 2, what textures are like, and the limits of scores: [`Limits`], begin and excess of six
//! tails; per movement the axes of the population as a whitening, and d variances along them. Kind 3 is for people:
//! [`super::samples`]. Kind 4, how means go with the speed: [`super::slopes`]. Kind 5, the finger that it was learned
//! with: [`super::finger`]. Kind 6, what shorter slides say: [`super::lengths`].

use heapless::Vec;

use super::drift::{Drift, Drifts};
use super::format::{DRIFT, HEAD, LENGTH, MAX_MOVEMENTS, SLOPES, TWO, TableError, array, each};
use super::limits::{Limits, Numbers};
use super::population::{LEAST, Population};
use super::slopes::{self, Slopes};
use super::view::Table;
use super::whitening::{View, Whitening};
use crate::features::MAX_FEATURES;

pub(super) const NOVELTY: u16 = 2;
pub(super) const SAMPLES: u16 = 3;
pub(super) const FINGER: u16 = 5;

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
    /// Bytes that they take, of so many features.
    pub fn length(&self, features: usize) -> usize {
        let (_, drifts) = self.drift;
        let novelty = self.novelty.map_or(0, |(_, populations)| {
            HEAD + Limits::BYTES + populations.len() * of_population(features)
        });
        let slopes = self.slopes;
        let slopes = slopes.map_or(0, |slopes| HEAD + of_slopes(&slopes, features));
        HEAD + TWO + drifts.len() * of_drift(features) + novelty + slopes
    }

    /// Gives the bytes, piece by piece, of so many features.
    pub(super) fn write(&self, features: usize, mut put: impl FnMut(&[u8])) {
        let head = |put: &mut dyn FnMut(&[u8]), kind: u16, length: usize| {
            put(&kind.to_le_bytes());
            put(&(length as u16).to_le_bytes());
        };
        let (drift, drifts) = self.drift;
        head(&mut put, DRIFT, TWO + drifts.len() * of_drift(features));
        for number in [drift.bands, drift.traction] {
            put(&number.to_le_bytes());
        }
        for variance in drifts
            .iter()
            .flat_map(|d| d.iter().take(features.div_ceil(2)))
        {
            put(&variance.to_le_bytes());
        }
        if let Some((limits, populations)) = self.novelty {
            let length = Limits::BYTES + populations.len() * of_population(features);
            head(&mut put, NOVELTY, length);
            limits.bytes().for_each(|number| put(&number));
            for population in populations {
                put(population.axes.as_bytes());
                for variance in population.variances.iter().take(features) {
                    put(&variance.to_le_bytes());
                }
            }
        }
        if let Some(slopes) = self.slopes {
            head(&mut put, SLOPES, of_slopes(&slopes, features));
            slopes.write(features, put);
        }
    }
}

/// Bytes of a movement's variances of the drift.
pub(super) const fn of_drift(features: usize) -> usize {
    4 * features.div_ceil(2)
}

/// Bytes of all slopes.
fn of_slopes(slopes: &Slopes<'_>, features: usize) -> usize {
    let movements = slopes.paces.len();
    slopes::length(features, slopes.slopes.len() / movements.max(1), movements)
}

/// Bytes of a movement's population.
pub(super) const fn of_population(features: usize) -> usize {
    Whitening::bytes(features) + 4 * features
}

/// A [`Population`] where its table lies.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PopulationView<'t> {
    pub(crate) axes: View<'t>,
    pub(crate) variances: Numbers<'t>,
}

impl<'a> Table<'a> {
    /// Heads and contents of all sections but those of this kind.
    pub(super) fn other_sections(
        &self,
        left_out: u16,
    ) -> impl Iterator<Item = ([u8; HEAD], &'a [u8])> {
        let others = each(self.sections).flatten();
        let others = others.filter(move |(kind, _)| *kind != left_out);
        others.map(|(kind, contents)| {
            let [k0, k1] = kind.to_le_bytes();
            // it was read from as many bytes
            let [l0, l1] = (contents.len() as u16).to_le_bytes();
            ([k0, k1, l0, l1], contents)
        })
    }

    /// Returns how much drift the table was made for; `None` for a table of Gaussians.
    pub fn drift(&self) -> Option<Drift> {
        let section = self.section(DRIFT)?;
        Some(Drift {
            bands: f32::from_le_bytes(array(section, 0)?),
            traction: f32::from_le_bytes(array(section, 4)?),
        })
    }

    /// Variances of the drift along each two axes of a movement, where there is any.
    pub(crate) fn drifts(&self, movement: u8) -> Option<Numbers<'a>> {
        if let Some((shorter, movement)) = self.shorter(movement) {
            return shorter.drifts(movement);
        }
        let bytes = of_drift(self.features());
        let at = usize::from(movement) * bytes;
        self.drifts.get(at..at + bytes).map(Numbers::new)
    }

    /// Returns from which scores on a texture is new, or has changed; `None` for a table that is not calibrated: one of
    /// Gaussians, or of fewer than three textures when it was made.
    pub fn limits(&self) -> Option<Limits> {
        Limits::read(self.novelty.get(..Limits::BYTES)?)
    }

    /// The population of textures at a movement, in a table that is calibrated.
    pub(crate) fn population(&self, movement: u8) -> Option<PopulationView<'a>> {
        let population = self.population_bytes(movement)?;
        let (_, variances) = population.split_at_checked(Whitening::bytes(self.features()))?;
        Some(PopulationView {
            axes: View::checked(population, self.features()),
            variances: Numbers::new(variances),
        })
    }

    /// Axes and variances.
    fn population_bytes(&self, movement: u8) -> Option<&'a [u8]> {
        if let Some((shorter, movement)) = self.shorter(movement) {
            return shorter.population_bytes(movement);
        }
        let features = self.features();
        let at = Limits::BYTES + usize::from(movement) * of_population(features);
        self.novelty.get(at..)?.get(..of_population(features))
    }

    /// The populations of all movements, in a table that is calibrated.
    pub fn populations(&self) -> Option<Vec<Population, MAX_MOVEMENTS>> {
        (0..self.movements)
            .map(|movement| {
                let (axes, numbers) = self
                    .population_bytes(movement)?
                    .split_at_checked(Whitening::bytes(self.features()))?;
                let mut variances = [0.0; MAX_FEATURES];
                for (to, from) in variances.iter_mut().zip(Numbers::new(numbers)) {
                    *to = from;
                }
                Some(Population {
                    axes: Whitening::read(axes, self.features())?,
                    variances,
                })
            })
            .collect()
    }

    /// Looks up what a slide asks for.
    pub(super) fn find_sections(&mut self) {
        let drifts = self.drift().is_some_and(|drift| !drift.is_none());
        let section = self.section(DRIFT).filter(|_| drifts);
        self.drifts = section.and_then(|s| s.get(TWO..)).unwrap_or_default();
        self.novelty = self.section(NOVELTY).unwrap_or_default();
        self.slopes = self.section(SLOPES).unwrap_or_default();
    }

    /// That the sections are sections, and those that are known what they say.
    pub(super) fn check_sections(&self) -> Result<(), TableError> {
        let (features, movements) = (self.features(), usize::from(self.movements));
        let mut seen = [false; 3];
        for section in each(self.sections) {
            let (kind, contents) = section.ok_or(TableError::Sections)?;
            let fits = match kind {
                DRIFT => {
                    are_drifts(contents, features, movements)
                        && self.drift().is_some_and(Drift::is_possible)
                }
                NOVELTY => are_limits(contents, features, movements),
                LENGTH => continue,
                SLOPES => slopes::are_slopes(contents, features, self.textures.into(), movements),
                _ => continue,
            };
            let first = seen.get_mut(match kind {
                DRIFT => 0,
                NOVELTY => 1,
                _ => 2,
            });
            let again = first.is_none_or(|seen| core::mem::replace(seen, true));
            if features == 0 || again || !fits {
                return Err(TableError::Section(kind));
            }
        }
        Ok(())
    }
}

/// Returns whether the contents of a section of drift have its variances.
#[inline(always)]
pub(super) fn are_drifts(contents: &[u8], features: usize, movements: usize) -> bool {
    let rest = contents.get(TWO..).unwrap_or_default();
    let mut variances = rest.chunks(of_drift(features).max(1));
    rest.len() == movements * of_drift(features)
        && variances.all(|v| Numbers::new(v).are_variances(0.0))
}

/// Returns whether these are the contents of a section of limits and population.
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
