//! The slides of one virtual exploration.

use std::collections::{HashMap, HashSet};

use rand::RngExt as _;
use rand_chacha::ChaCha8Rng;
use tactus_core::explorer::Method;
use tactus_core::features::Observation;
use tactus_core::table::{OpenSet, Table};

use super::{Experiment, Pool};
use crate::eval::learn::{TableError, learn_for};
use crate::eval::open_set::{all_learned, figures, noted};

/// One virtual exploration, ready to begin.
#[derive(Clone, Debug)]
pub struct Run<'e> {
    pub(super) experiment: &'e Experiment,
    /// The part that is tested, where parts are tested in turn.
    pub(super) part: usize,
    /// In which order slides are taken, by movement and how many there are; that of time, where nothing is drawn.
    pub(super) orders: HashMap<(usize, usize), Vec<usize>>,
    /// Slides that were shown, by movement and place, where each is shown once.
    pub(super) shown: HashSet<(usize, usize)>,
    /// The texture to be identified.
    pub unknown: usize,
    /// Drawn from for the slides; an explorer's own random choices go through it too.
    pub random: ChaCha8Rng,
}

impl<'e> Run<'e> {
    /// Training slides per texture and movement.
    pub fn training(&self) -> Vec<Vec<Vec<Observation>>> {
        let of = |(movement, pool): (usize, &Pool)| {
            let learned = match self.experiment.all {
                true => 0..pool.train.len(),
                false => 0..self.experiment.train_slides,
            };
            let there = pool.to_learn(self.part);
            let place = |n| there[self.place(movement, there.len(), n)];
            learned.map(|n| pool.train[place(n)].clone()).collect()
        };
        let pools = self.experiment.pools.iter();
        pools
            .map(|pools| pools.iter().enumerate().map(of).collect())
            .collect()
    }

    /// Place of the `n`th slide of a pool: the training slides come first, then those to test with.
    fn place(&self, movement: usize, slides: usize, n: usize) -> usize {
        let order = self.orders.get(&(movement, slides));
        order.map_or(n, |order| order[n])
    }

    /// The texture table learned from the training slides, as bytes.
    pub fn learn(&self, method: Method) -> Result<Vec<u8>, TableError> {
        self.learn_without(method, &[])
    }

    /// The figures of its table by the slides that it learns from: see [`open_set`](super::super::open_set).
    pub(crate) fn open_set(
        &self,
        method: Method,
        done: impl Fn() + Sync,
    ) -> Result<Option<OpenSet>, TableError> {
        let (bytes, taught) = (self.learn(method)?, all_learned(&self.training()));
        let expected = &self.experiment.expected;
        figures(Table::read(&bytes)?, expected, &taught, done)
    }

    pub(crate) fn learn_without(
        &self,
        method: Method,
        out: &[usize],
    ) -> Result<Vec<u8>, TableError> {
        let of = self.experiment;
        let all = (0..).zip(of.names.iter().cloned().zip(self.training()));
        let kept = all.filter(|(texture, _)| !out.contains(texture));
        let (names, training): (Vec<_>, Vec<_>) = kept.map(|(_, of)| of).unzip();
        let expected = &of.expected;
        let bytes = learn_for(
            expected,
            method,
            of.features,
            &names,
            &of.movements,
            &training,
        )?;
        match &of.open_set {
            Some(figures) => Ok(noted(&bytes, figures)?),
            None => Ok(bytes),
        }
    }

    /// One more slide of the unknown texture; `None` where each is shown once, and all of this movement were.
    pub fn slide(&mut self, movement: usize) -> Option<&'e Observation> {
        let n = self.draw(movement)?;
        let of = self.experiment;
        let pool = &of.pools[self.unknown][movement];
        Some(match &pool.test {
            Some(test) => &test[n],
            None if !pool.parts.is_empty() => &pool.train[self.tested(pool)[n]],
            None => &pool.train[self.place(movement, pool.train.len(), of.train_slides + n)],
        })
    }

    /// Places of the slides of the part that is tested.
    fn tested(&self, pool: &Pool) -> Vec<usize> {
        pool.places(|of| of == self.part)
    }

    fn draw(&mut self, movement: usize) -> Option<usize> {
        let pool = &self.experiment.pools[self.unknown][movement];
        let learned = self.experiment.train_slides;
        let slides = match &pool.test {
            Some(test) => test.len(),
            None if !pool.parts.is_empty() => self.tested(pool).len(),
            None => pool.train.len() - learned,
        };
        if self
            .shown
            .iter()
            .filter(|slide| slide.0 == movement)
            .count()
            == slides
        {
            return None;
        }
        loop {
            // drawn again until it is a new one: so the first slide of a run is the same either way
            let n = self.random.random_range(0..slides);
            if !self.experiment.once || self.shown.insert((movement, n)) {
                break Some(n);
            }
        }
    }
}
