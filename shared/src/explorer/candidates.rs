//! Which textures an exploration tells apart, and by which actions.

use super::config::{Config, ExplorerError, Method};
use super::novelty::NoveltyModel;
use super::posterior::{Explorer, OUT};
use super::student::ShrinkagePrior;
use crate::features::{Property, PropertySet};
use crate::table::{Action, Contents, Table};
use crate::up_to;

impl<'t, const N: usize> Explorer<'t, N> {
    /// An explorer for all textures of the table, for a rig that measures `measured`.
    pub fn new(
        table: Table<'t>,
        measured: PropertySet,
        config: Config,
    ) -> Result<Self, ExplorerError> {
        Self::among(table, measured, config, 0..table.textures())
    }

    /// An explorer that only considers `candidates` (Methods, "Texture Discrimination": a pair, all others at
    /// probability 0).
    pub fn among(
        table: Table<'t>,
        measured: PropertySet,
        config: Config,
        candidates: impl IntoIterator<Item = u16>,
    ) -> Result<Self, ExplorerError> {
        let mut explorer = Self::empty(table);
        explorer.consider(measured, config, candidates)?;
        Ok(explorer)
    }

    /// Makes an empty one what [`Explorer::among`] gives, where it lies: it is too large for a chip's stack to hold
    /// twice.
    pub(crate) fn consider(
        &mut self,
        measured: PropertySet,
        config: Config,
        candidates: impl IntoIterator<Item = u16>,
    ) -> Result<(), ExplorerError> {
        self.config = config;
        let table = self.table;
        self.log
            .resize(table.textures().into(), OUT)
            .map_err(|_| ExplorerError::NoSpace {
                textures: table.textures(),
                capacity: N,
            })?;
        for texture in candidates {
            *self
                .log
                .get_mut(usize::from(texture))
                .ok_or(ExplorerError::Candidates)? = 0;
        }
        self.candidates = self.log.iter().filter(|&&l| l == 0).count() as u16;
        if self.candidates == 0 {
            return Err(ExplorerError::Candidates);
        }
        if !config.method.suits(table.contents()) {
            return Err(ExplorerError::Method(config.method));
        }
        if let Contents::Fused(set, _) = table.contents()
            && !set.measured_by(measured)
        {
            return Err(ExplorerError::Features(set));
        }
        let measured = measured.and(table.measured());
        self.measured = measured;
        let learned_by = |movement, most: fn(u8) -> bool| {
            let mut candidates = self.log.iter().zip(0..).filter(|(l, _)| **l == 0);
            candidates.all(|(_, texture)| most(table.trials(texture, movement)))
        };
        let movements = 0..table.movements().len() as u8;
        let all_of = |movement| Action {
            movement,
            property: None,
        };
        self.actions = match config.method {
            Method::Paper | Method::Student => table
                .actions()
                .filter(|a| a.property.is_some_and(|p| measured.contains(p)))
                .filter(|a| learned_by(a.movement, |trials| trials >= 2))
                .collect(),
            Method::StudentAll => movements
                .filter(|&m| !measured.is_empty() && learned_by(m, |trials| trials >= 2))
                .map(all_of)
                .collect(),
            // one slide is enough, and a texture without any is not much in the way
            Method::Fused => movements
                .filter(|&m| !learned_by(m, |trials| trials == 0))
                .map(all_of)
                .collect(),
        };
        if self.actions.is_empty() {
            return Err(ExplorerError::NothingToMeasure);
        }
        self.learn_of_all();
        self.posterior = up_to(self.log.iter().map(|_| 0.0));
        self.restart();
        let actions = self.actions.iter();
        self.at_first = actions
            .map(|a| self.uncertainty(config.method, *a))
            .collect();
        Ok(())
    }

    fn learn_of_all(&mut self) {
        let table = self.table;
        if let Method::Student | Method::StudentAll = self.config.method {
            for movement in 0..table.movements().len() as u8 {
                let of =
                    Property::ALL.map(|property| ShrinkagePrior::new(&table, movement, property));
                self.shrinkage.extend(of);
            }
        }
        if self.config.method == Method::Fused {
            let actions = self.actions.iter();
            self.novelty_models
                .extend(actions.map(|a| NoveltyModel::new(&table, a.movement)));
            self.limits = table.limits();
        }
    }
}
