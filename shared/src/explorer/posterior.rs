//! The posterior of every texture (eq. 3), and the verdict.
//!
//! Probabilities are kept as logarithms in fixed point, and in f32. Host and chip use the same operations in the same
//! order, so they agree to the bit.

use heapless::Vec;

use super::config::{Config, Method};
use super::episode::{Episode, MovementSums};
use super::novelty::NoveltyModel;
use super::student::ShrinkagePrior;
use super::whitened;
use crate::dsp::fixed::exp_neg_q30;
use crate::features::{PropertySet, Vector};
use crate::table::{Action, Against, Contents, Limits, MAX_ACTIONS, MAX_MOVEMENTS, Table};
use crate::up_to;

/// Logarithm of the posterior, Q16, of a texture that is no candidate. The slides of an exploration make it neither a
/// candidate's nor overflow: at most 1024 are taken from it by each, and it is set again after four.
pub(super) const OUT: i32 = -(5 << 28);
/// Logarithms of candidates are never below, those of others always.
pub(super) const LEAST: i32 = -(1 << 30);
/// Least logarithm of a candidate beside a greatest of 0: however improbable, it stays one.
const FLOOR: i32 = -(1 << 28);
/// Log-odds for "none of these" over which a texture counts as unknown, after one slide and after more (the recipe has
/// 2 and 0). In simulated worlds 21 to 24 a limit of 0 takes one in fifteen known textures for a new one; 1.5 rather
/// than 1 or 2 was chosen on the BioTac recordings, one material left out, to keep false alarms below 3 %.
const UNKNOWN_OVER: [f32; 2] = [2.0, 1.5];
/// Slides from which the probe may learn by itself. Each begins at another place of the sample.
const LEAST_TO_LEARN: u8 = 2;
/// Log-odds up to which a verdict is certain enough to learn from.
const CERTAIN: f32 = -2.0;
/// Fewest slides after which a texture may be called unknown, unless it is [`FAR`].
const UNKNOWN_SLIDES: u8 = 2;
/// Share of the known textures that one slide may make unknown.
const FAR: f32 = 0.0005;
/// Share of the known textures that fit too badly to be told as sure in the first [`PATIENT`] slides: the next one says
/// more. Afterwards whatever is not unknown fits.
const POOR_FIT: f32 = 0.3;
/// See [`POOR_FIT`].
const PATIENT: u8 = 4;

/// Textures that [`Explorer::leading`] names.
pub const LEADING: usize = 3;

/// An answer.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Verdict {
    /// Index of the most probable texture.
    pub texture: u16,
    /// Its posterior probability.
    pub probability: f32,
    /// True if that exceeds the threshold, and the slides fit the texture.
    pub sure: bool,
    /// True if it would be sure, but the table's [`OpenSet`](crate::table::OpenSet) says that a new texture would too
    /// often be called so.
    pub most_like: bool,
    /// True if it is rather none of them.
    pub unknown: bool,
    /// True if it is sure, but not as it was learned: worn, drifted, or something much like it.
    pub changed: bool,
    /// Log-odds that it is none of them, where the method can tell; with a calibrated table, by how much its score
    /// exceeds the limit.
    pub log_odds: Option<f32>,
}

/// The kind of a verdict, as the user hears it. Every count of right and wrong answers goes by this.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum VerdictKind {
    /// "It is this texture": a name told as sure.
    Sure,
    /// "It is this texture, but not as I learned it": a name told as sure, with a remark.
    Changed,
    /// "It is none of those I know."
    New,
    /// "It is most like this texture": the name, not told as sure, for a new texture would too often get one.
    MostLike,
    /// "Not sure; most likely this one": no answer, whatever the name.
    Undecided,
}

impl Verdict {
    /// Its kind.
    pub fn kind(&self) -> VerdictKind {
        match self {
            Self { unknown: true, .. } => VerdictKind::New,
            Self { changed: true, .. } => VerdictKind::Changed,
            Self { sure: true, .. } => VerdictKind::Sure,
            Self {
                most_like: true, ..
            } => VerdictKind::MostLike,
            _ => VerdictKind::Undecided,
        }
    }
}

/// One exploration after another with the same table and candidates; room for `N` textures.
#[derive(Clone, Debug)]
pub struct Explorer<'t, const N: usize> {
    pub(super) table: Table<'t>,
    pub(super) config: Config,
    pub(super) measured: PropertySet,
    /// Logarithm of the posterior, Q16, up to a constant; below [`LEAST`] for textures that are no candidates.
    pub(super) log: Vec<i32, N>,
    pub(super) posterior: Vec<f32, N>,
    pub(super) candidates: u16,
    pub(super) actions: Vec<Action, MAX_ACTIONS>,
    pub(super) made: Vec<u8, MAX_ACTIONS>,
    /// Expected uncertainty of each action when nothing is known: a constant of table and candidates.
    pub(super) at_first: Vec<f32, MAX_ACTIONS>,
    pub(super) slides: u8,
    /// Slides of each movement that came to nothing, since one of it counted.
    pub(super) failed: Vec<u8, MAX_MOVEMENTS>,
    pub(super) episode: Episode,
    pub(super) log_odds: Option<f32>,
    /// The texture that each slide of the episode by itself is most like; `None` before the first one, and where they
    /// disagree.
    pub(super) agreed: Option<u16>,
    /// For Student's t: movement by movement, properties in their order.
    pub(super) shrinkage: Vec<ShrinkagePrior, MAX_ACTIONS>,
    /// For the fused method: what a texture that is not in the table is like, at every movement.
    pub(super) novelty_models: Vec<NoveltyModel, MAX_MOVEMENTS>,
    /// For the fused method: the table's, if it is calibrated.
    pub(super) limits: Option<Limits>,
}

impl<'t, const N: usize> Explorer<'t, N> {
    /// One without candidates, for [`Explorer::consider`].
    pub(crate) fn empty(table: Table<'t>) -> Self {
        Self {
            table,
            config: Config::default(),
            measured: PropertySet::default(),
            log: Vec::new(),
            posterior: Vec::new(),
            candidates: 0,
            actions: Vec::new(),
            made: Vec::new(),
            at_first: Vec::new(),
            slides: 0,
            failed: Vec::new(),
            episode: Vec::new(),
            log_odds: None,
            agreed: None,
            shrinkage: Vec::new(),
            novelty_models: Vec::new(),
            limits: None,
        }
    }

    /// Starts the next exploration, with the same candidates equally probable.
    pub fn restart(&mut self) {
        let prior = 1.0 / f32::from(self.candidates);
        self.reset_to_prior();
        for (posterior, log) in self.posterior.iter_mut().zip(&self.log) {
            *posterior = if *log < LEAST { 0.0 } else { prior };
        }
        self.made = self.actions.iter().map(|_| 0).collect();
        self.slides = 0;
        self.failed = self.table.movements().map(|_| 0).collect();
        self.episode.clear();
        self.log_odds = None;
        self.agreed = None;
        if self.config.method == Method::Fused {
            // one for each action; those of shorter slides are behind them
            self.novelty_models.truncate(self.actions.len());
        }
    }

    /// The table.
    pub fn table(&self) -> Table<'t> {
        self.table
    }

    /// Its configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// Slides made in this exploration.
    pub fn slides(&self) -> u8 {
        self.slides
    }

    /// Posterior probability of every texture of the table (eq. 3).
    pub fn posterior(&self) -> &[f32] {
        &self.posterior
    }

    /// The most probable textures and their probabilities, the first one leading.
    pub fn leading(&self) -> Vec<(u16, f32), LEADING> {
        let mut leading: Vec<(u16, f32), LEADING> = Vec::new();
        for (&probability, texture) in self.posterior.iter().zip(0..) {
            let place = leading
                .iter()
                .position(|(_, other)| probability > *other)
                .unwrap_or(leading.len());
            if place < LEADING {
                leading.truncate(leading.len().min(LEADING - 1));
                // one place is free now, and `place` is at most the end
                let _ = leading.insert(place, (texture, probability));
            }
        }
        leading
    }

    /// The answer, once there is one: the threshold is exceeded, the texture is unknown, or the last slide was made.
    /// There is none before the first slide, however few the candidates.
    pub fn verdict(&self) -> Option<Verdict> {
        let best = self.best();
        let least = if self.config.learn { LEAST_TO_LEARN } else { 1 };
        let sure = (best.sure || best.most_like) && self.slides >= least;
        let enough = self.limits.is_some() || self.slides >= UNKNOWN_SLIDES;
        let unknown = best.unknown && enough;
        (sure || unknown || self.slides >= self.config.max_slides).then_some(best)
    }

    /// Log-odds that the texture is none of the candidates, after the slides so far; `None` where the method or the
    /// table cannot tell.
    pub fn log_odds(&self) -> Option<f32> {
        self.log_odds
    }

    /// True if the texture is rather none of the candidates, as far as can be told.
    pub fn is_unknown(&self) -> bool {
        let [at_once, later] = UNKNOWN_OVER;
        let limit = match (&self.limits, self.slides < UNKNOWN_SLIDES) {
            (Some(limits), true) => self.above(limits, FAR).max(0.0),
            (Some(_), false) => 0.0,
            (None, true) => at_once,
            (None, false) => later,
        };
        self.log_odds.is_some_and(|log_odds| log_odds > limit)
    }

    /// True if the slides are as like one of the candidates as those of known textures mostly are: a texture is not
    /// sure otherwise, however probable. True where the method or the table cannot tell.
    pub fn fits(&self) -> bool {
        let limit = match &self.limits {
            Some(limits) if self.slides <= PATIENT => self.above(limits, POOR_FIT).min(0.0),
            _ => 0.0,
        };
        self.log_odds.is_none_or(|log_odds| log_odds <= limit)
    }

    /// By how much the limit for this share of false alarms is above that for the share that is wanted.
    fn above(&self, limits: &Limits, share: f32) -> f32 {
        let at = |share| self.limit(limits, Against::Drifted, self.slides, share);
        at(Some(share)) - at(self.config.false_alarm)
    }

    /// True if no name is told as sure: new textures would too often get one, and may come.
    pub fn is_guarded(&self) -> bool {
        self.config.open && self.table.open_set().is_some_and(|of| !of.may_name())
    }

    fn is_calibrated(&self) -> bool {
        self.limits.is_some()
    }

    pub(super) fn is_changed(&self) -> bool {
        self.changed_by().is_some_and(|over| over > 0.0)
    }

    /// By how much the slides are less like any of the candidates, as these were learned, than they may be: above 0,
    /// the texture has changed, as far as it is one of them, for without the drift that the table expects it would be
    /// none. `None` before the first slide, and where the table is not calibrated or expects no drift.
    pub fn changed_by(&self) -> Option<f32> {
        let drifts = self.table.drift().is_some_and(|drift| !drift.is_none());
        let limits = self.limits.filter(|_| drifts && self.slides > 0)?;
        let share = self.config.false_alarm;
        let limit = self.limit(&limits, Against::Same, self.slides, share);
        let score = self.score(&self.episode, Against::Same)?;
        Some(score - limit)
    }

    /// The limit after so many slides, for this share of false alarms; with a shorter one among them its own, where
    /// that is less.
    pub(super) fn limit(
        &self,
        limits: &Limits,
        against: Against,
        slides: u8,
        share: Option<f32>,
    ) -> f32 {
        let mut least = limits.limit(against, slides, share);
        // models of shorter slides are behind those of the actions
        if self.novelty_models.len() > self.actions.len() {
            for sums in self
                .episode
                .iter()
                .filter(|v| !self.table.is_whole(v.movement))
            {
                let own = self.table.limits_at(sums.movement);
                least = own.map_or(least, |own| least.min(own.limit(against, slides, share)));
            }
        }
        least
    }

    /// How much an episode looks like none of the candidates, by the movements made, their slides and the whitened
    /// mean of these: what the limits of a calibrated table are limits of. `None` where the table is not.
    pub fn score_of(&self, visits: &[(u8, u8, Vector)], against: Against) -> Option<f32> {
        let mut episode = Episode::new();
        for (movement, slides, mean) in visits {
            episode
                .push(MovementSums::of(*movement, *slides, mean))
                .ok()?;
        }
        self.score(&episode, against)
    }

    pub(super) fn score(&self, episode: &Episode, against: Against) -> Option<f32> {
        if !self.is_calibrated() {
            return None;
        }
        let mut log: Vec<i32, N> = up_to(self.log.iter().map(|l| if *l < LEAST { OUT } else { 0 }));
        let mut odds: Vec<f32, N> = up_to(log.iter().map(|_| 0.0));
        let (table, models) = (&self.table, &self.novelty_models);
        let drifting = against == Against::Drifted;
        let (elsewhere, _) =
            whitened::add_likelihoods(table, episode, models, drifting, &mut log, &mut odds)?;
        let top = log.iter().copied().max().unwrap_or(0);
        Some(elsewhere - top as f32 / 65536.0)
    }

    /// True if the verdict needs no word of the user's. Never by the paper's properties alone: one in ten updates by
    /// them would be wrong.
    pub fn is_certain(&self) -> bool {
        let known = if self.is_calibrated() {
            self.fits() && !self.is_changed()
        } else {
            self.log_odds.is_some_and(|log_odds| log_odds <= CERTAIN)
        };
        known && !self.is_guarded() && self.best().probability > self.config.threshold
    }

    /// True if the probe may learn from it by itself: it [is certain](Self::is_certain) after two slides or more,
    /// each of them by itself is most like the texture, and the table would not name too many new textures.
    pub fn may_learn(&self) -> bool {
        let agreed = self.agreed == Some(self.best().texture);
        let may = self.table.open_set().is_none_or(|of| of.may_learn());
        may && self.slides >= LEAST_TO_LEARN && agreed && self.is_certain()
    }

    /// The movements made, with the number of slides and their whitened mean: what a fused table can learn from this
    /// exploration. A slide that ended early is none of them.
    pub fn observed(&self) -> impl Iterator<Item = (u8, u8, Vector)> + '_ {
        let features = match self.table.contents() {
            Contents::Fused(_, features) => usize::from(features),
            Contents::Gaussians(_) => 0,
        };
        let episode = self.whole_slides().filter(move |_| features > 0);
        episode.map(move |v| (v.movement, v.slides, v.mean(features)))
    }

    /// At each of [`Explorer::observed`] the mean of ln(speed): see [`super::EpisodeSummary::paces`].
    pub fn paces(&self) -> impl Iterator<Item = i16> + '_ {
        let slopes = |movement| self.table.slopes_at(movement);
        let pace = move |v: &MovementSums| slopes(v.movement).map_or(0, |s| v.pace(s).mean);
        self.whole_slides().map(pace)
    }

    fn whole_slides(&self) -> impl Iterator<Item = &MovementSums> {
        let table = self.table;
        let slides = self.episode.iter();
        slides.filter(move |v| table.is_whole(v.movement))
    }

    /// The most probable texture as things stand, the first of equals: the answer also where no further slide can be
    /// made.
    pub fn best(&self) -> Verdict {
        let mut best = Verdict {
            texture: 0,
            probability: 0.0,
            sure: false,
            most_like: false,
            unknown: self.config.open && self.is_unknown(),
            changed: false,
            log_odds: self.log_odds,
        };
        let fits = !self.config.open || self.fits();
        for (&probability, texture) in self.posterior.iter().zip(0..) {
            if probability > best.probability {
                best = Verdict {
                    texture,
                    probability,
                    sure: probability > self.config.threshold && fits,
                    ..best
                };
            }
        }
        best.most_like = best.sure && self.is_guarded();
        best.sure &= !best.most_like;
        best.changed = self.config.open && best.sure && self.is_changed();
        best
    }

    pub(super) fn reset_to_prior(&mut self) {
        for log in &mut self.log {
            *log = if *log < LEAST { OUT } else { 0 };
        }
    }

    /// The posterior from its logarithms; the logarithm of the greatest likelihood, and the sum of all in parts of it,
    /// Q30.
    pub(super) fn normalize(&mut self) -> (f32, f32) {
        let (top, sum) = posterior(&self.log, &mut self.posterior);
        (top as f32 / 65536.0, sum)
    }

    /// The logarithm of the candidates' mean likelihood in parts of the greatest one, from their sum.
    pub(super) fn mean_of(&self, sum: f32) -> f32 {
        libm::logf(sum / (1 << 30) as f32 / f32::from(self.candidates))
    }
}

/// Computes the posterior (eq. 3) from its logarithms, Q16, of which there are as many, at least one. Returns the
/// greatest of them, and the sum of the probabilities in parts of that one's, Q30. No two logarithms are 2^31 apart.
#[inline(never)]
fn posterior(logs: &[i32], posterior: &mut [f32]) -> (i32, f32) {
    let top = logs.iter().copied().max().unwrap_or(0);
    let mut sum = 0u64;
    for (p, log) in posterior.iter_mut().zip(logs) {
        let likely = exp_neg_q30(top.abs_diff(*log));
        sum += u64::from(likely);
        *p = likely as f32;
    }
    let total = sum as f32;
    for p in posterior {
        *p /= total;
    }
    (top, total)
}

/// Subtracts the greatest logarithm from all, so that the fixed point keeps its range for later slides.
#[inline(never)]
pub(super) fn rebase(log: &mut [i32]) {
    let top = log.iter().copied().max().unwrap_or(0);
    for log in log {
        *log = if *log < LEAST {
            OUT
        } else {
            (*log - top).max(FLOOR)
        };
    }
}
