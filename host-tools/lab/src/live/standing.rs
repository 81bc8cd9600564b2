//! The posterior at a moment of an exploration: the core's explorer with the slides so far and the current one.

use std::sync::LazyLock;

use serde::Serialize;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer};
use tactus_core::features::{Block, Movement, Observation, PropertySet, Slide};
use tactus_core::sensor::pressure::samples_in;
use tactus_core::table::{Action, MAX_TEXTURES, Table};

pub(super) static PLAN: LazyLock<Plan> = LazyLock::new(Plan::new);

#[derive(Clone, PartialEq, Debug, Serialize)]
pub(crate) struct Standing {
    pub(crate) posterior: Vec<f32>,
    /// Excess of the slides' distance from all textures over its limit, if the table has one; above 0: new.
    pub(crate) log_odds: Option<f32>,
    /// True if they differ from the most probable one as that was learned.
    pub(crate) changed: bool,
    /// Excess of their distance from all textures as learned over its limit; above 0: changed, or new.
    pub(crate) changed_by: Option<f32>,
}

impl Standing {
    pub(crate) fn of<const N: usize>(explorer: &Explorer<'_, N>) -> Self {
        Self {
            posterior: explorer.posterior().to_vec(),
            log_odds: explorer.log_odds(),
            changed: explorer.best().changed,
            changed_by: explorer.changed_by(),
        }
    }
}

/// An exploration from outside: its messages so far.
#[derive(Debug, Default)]
pub(super) struct Followed {
    config: Config,
    action: Option<Action>,
    slide: Option<Slide<'static>>,
    reached: usize,
    observed: Vec<(Action, Observation)>,
}

impl Followed {
    pub(super) fn begin(config: Config) -> Self {
        Self {
            config,
            ..Self::default()
        }
    }

    pub(super) fn chosen(&mut self, action: Action, movement: Movement) {
        self.action = Some(action);
        self.slide = Some(Slide::new(&PLAN, movement));
        self.reached = 0;
    }

    pub(super) fn movement(&self) -> Option<u8> {
        self.action.map(|action| action.movement)
    }

    /// Takes samples of the slide; returns the length in ms if it has reached one of the table's, with its features so
    /// far.
    pub(super) fn block(
        &mut self,
        lengths_ms: &[u16],
        block: &Block,
    ) -> Option<(u16, Observation)> {
        let slide = self.slide.as_mut()?;
        slide.take(block);
        let &ms = lengths_ms.get(self.reached)?;
        let wanted = samples_in(ms);
        if block.still || slide.samples() < wanted {
            return None;
        }
        self.reached += 1;
        Some((ms, Observation::from(&slide.look(wanted).ok()?)))
    }

    pub(super) fn so_far(&self, table: Table<'_>, seen: &Observation) -> Option<Standing> {
        self.standing(table, Some((self.action?, self.reached as u8, seen)))
    }

    pub(super) fn observed(
        &mut self,
        table: Table<'_>,
        action: Action,
        seen: Observation,
        early_ms: Option<u16>,
    ) -> Option<Standing> {
        self.slide = None;
        if let Some(ms) = early_ms {
            let n = table.lengths_ms().position(|length| length == ms)? + 1;
            return self.standing(table, Some((action, n as u8, &seen)));
        }
        self.observed.push((action, seen));
        self.standing(table, None)
    }

    /// The posterior after the whole slides so far and, if there is one, a slide up to a length of the table.
    fn standing(
        &self,
        table: Table<'_>,
        part: Option<(Action, u8, &Observation)>,
    ) -> Option<Standing> {
        let explorer = Explorer::<MAX_TEXTURES>::new(table, PropertySet::ALL, self.config);
        let mut explorer = Box::new(explorer.ok()?);
        for (action, slide) in &self.observed {
            explorer.observe(*action, slide).ok()?;
        }
        if let Some((action, n, slide)) = part {
            let taken = explorer.observe_early(action, n, slide).ok()?;
            taken.then_some(())?;
        }
        Some(Standing::of(&explorer))
    }
}
