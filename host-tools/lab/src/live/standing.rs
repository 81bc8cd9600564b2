//! What is known at a moment of an exploration: the core's explorer, given the slides so far and the one that goes on.

use std::sync::LazyLock;

use serde::Serialize;
use tactus_core::dsp::Plan;
use tactus_core::explorer::{Config, Explorer};
use tactus_core::features::{Block, Movement, Observation, PropertySet, Slide};
use tactus_core::sensor::pressure::samples_in;
use tactus_core::table::{Action, MAX_TEXTURES, Table};

/// Coefficients and angles, for all slides.
pub(super) static PLAN: LazyLock<Plan> = LazyLock::new(Plan::new);

/// What is known.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Standing {
    /// Probability of each texture of the table.
    pub posterior: Vec<f32>,
    /// By how much the slides are less like any of the textures than they may be, where the table can tell; above 0:
    /// new.
    pub log_odds: Option<f32>,
    /// Whether they are not like the most probable one as that was learned.
    pub changed: bool,
    /// By how much they are less like any of the textures, as these were learned, than they may be; above 0: changed,
    /// or new.
    pub changed_by: Option<f32>,
}

impl Standing {
    /// As an explorer has it.
    pub fn of<const N: usize>(explorer: &Explorer<'_, N>) -> Self {
        Self {
            posterior: explorer.posterior().to_vec(),
            log_odds: explorer.log_odds(),
            changed: explorer.is_changed(),
            changed_by: explorer.changed_by(),
        }
    }
}

/// An exploration from outside: what its probe said so far.
#[derive(Debug, Default)]
pub(super) struct Followed {
    config: Config,
    action: Option<Action>,
    slide: Option<Slide<'static>>,
    /// Lengths that the slide has reached.
    reached: usize,
    observed: Vec<(Action, Observation)>,
}

impl Followed {
    /// A new exploration.
    pub(super) fn begin(config: Config) -> Self {
        Self {
            config,
            ..Self::default()
        }
    }

    /// A slide begins.
    pub(super) fn chosen(&mut self, action: Action, movement: Movement) {
        self.action = Some(action);
        self.slide = Some(Slide::new(&PLAN, movement));
        self.reached = 0;
    }

    /// The movement of the slide.
    pub(super) fn movement(&self) -> Option<u8> {
        self.action.map(|action| action.movement)
    }

    /// Samples of the slide have come: where it has reached one of the table's lengths, that in ms, and what it says so
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

    /// What would be known if the slide had ended at the length that it has reached.
    pub(super) fn so_far(&self, table: Table<'_>, seen: &Observation) -> Option<Standing> {
        self.standing(table, Some((self.action?, self.reached as u8, seen)))
    }

    /// The slide has come to its end; what is known then.
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

    /// What is known after the whole slides so far and, if there is one, a slide up to a length of the table.
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
