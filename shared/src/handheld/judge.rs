//! Judgement of an episode's slides: the most probable textures of the table.

use heapless::Vec;

use crate::explorer::{
    Answer, Config, EpisodeSummary, Explorer, ExplorerError, LEADING, Method, ObserveError,
};
use crate::features::{FeatureSet, Movement, Observation, PropertySet};
use crate::probe::{Identification, candidates};
use crate::table::{Action, MAX_TEXTURES, Name, Table};

/// The person's movement: half a newton, 25 mm/s.
pub const MOVEMENT: Movement = Movement::FOR_FINENESS;
/// The features that a handheld's table is learned from.
pub const FEATURES: FeatureSet = FeatureSet::Pressure;
/// Slides after which the most probable texture is the verdict, sure or not, and the person may add more.
pub const ASK_AFTER: usize = 5;
/// Slides after which the probe asks for no more: in the simulated world the next two identify 1 % more textures, or 2
/// %.
pub const MAX_SLIDES: usize = 10;
/// The judgement of an episode. Where the question is whether it is one texture, that is the leading one: it is `sure`
/// where it is the same, and `unknown` where it is different.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Judgement {
    /// The most probable textures and their probabilities, the first one leading.
    pub leading: Vec<(u16, f32), LEADING>,
    /// The first one is more probable than 99 %.
    pub sure: bool,
    /// It is rather none of them.
    pub unknown: bool,
    /// It is surely the first one, but not as it was learned: the probe asks the person whether it is.
    pub changed: bool,
    /// Further slides may decide.
    pub open: bool,
}

impl From<Identification> for Judgement {
    fn from(found: Identification) -> Self {
        let mut judgement = Self {
            leading: found.leading,
            sure: found.verdict.sure,
            unknown: found.verdict.unknown,
            changed: found.verdict.changed,
            open: false,
        };
        if let Some(answer) = found.answer {
            judgement.answered(answer);
        }
        judgement
    }
}

impl Judgement {
    fn answered(&mut self, answer: Answer) {
        self.sure = answer == Answer::Same;
        self.unknown = answer == Answer::Different;
        self.changed = false;
    }
}

/// Reasons why an episode cannot be judged.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum JudgeError {
    /// The table cannot be used by a handheld probe.
    #[error(transparent)]
    Table(ExplorerError),
    /// A slide lacks what the table compares.
    #[error(transparent)]
    Slide(ObserveError),
    /// The table has no movement.
    #[error("the table has no movement")]
    Movement,
    /// The table has no limits, by which slides are the same as a texture's or different.
    #[error("the table has no limits for same and different")]
    NoLimits,
}

/// Compares the slides of an episode with every texture of the table, or with `reference` alone: is it that one?
/// Returns the judgement to show and the summary that the probe can learn from. The share of false alarms is the
/// table's own, unless given.
/// Errors: the table is not one for a handheld probe, or a slide lacks a feature.
pub fn judge(
    table: Table<'_>,
    slides: &[Observation],
    reference: Option<u16>,
    false_alarm: Option<f32>,
) -> Result<(Judgement, EpisodeSummary), JudgeError> {
    let most = match reference {
        Some(_) => ASK_AFTER,
        None => MAX_SLIDES,
    };
    judge_at_most(table, slides, reference, false_alarm, most)
}

/// The same where `most` slides, up to 255, are the last ones, sure or not.
pub fn judge_at_most(
    table: Table<'_>,
    slides: &[Observation],
    reference: Option<u16>,
    false_alarm: Option<f32>,
    most: usize,
) -> Result<(Judgement, EpisodeSummary), JudgeError> {
    let config = Config {
        method: Method::Fused,
        max_slides: most as u8,
        open: true,
        false_alarm,
        verify: reference.is_some(),
        ..Config::default()
    };
    let mut explorer = Explorer::<'_, MAX_TEXTURES>::empty(table);
    let among = candidates(reference.as_slice(), table.textures());
    explorer
        .consider(PropertySet::default(), config, among)
        .map_err(JudgeError::Table)?;
    let action = Action {
        movement: movement(&table).ok_or(JudgeError::Movement)?,
        property: None,
    };
    for slide in slides {
        explorer.observe(action, slide).map_err(JudgeError::Slide)?;
    }
    let best = explorer.best();
    let verdict = explorer.end();
    let mut judgement = Judgement {
        leading: explorer.leading(),
        sure: verdict.is_some_and(|verdict| verdict.sure),
        unknown: verdict.is_some_and(|verdict| verdict.unknown),
        changed: verdict.is_some_and(|verdict| verdict.changed),
        open: verdict.is_none(),
    };
    if reference.is_some() {
        let now = explorer.verification().ok_or(JudgeError::NoLimits)?;
        judgement.answered(now.answer);
    }
    let episode = EpisodeSummary {
        table: table.crc(),
        texture: best.texture,
        certain: explorer.is_certain(),
        observed: explorer.observed().collect(),
        paces: explorer.paces().collect(),
    };
    Ok((judgement, episode))
}

/// The movement of the table that the person makes: the one nearest to [`MOVEMENT`] is the only one in a handheld's
/// table.
fn movement(table: &Table<'_>) -> Option<u8> {
    let mut movements = table.movements().zip(0u8..);
    let first = movements.next();
    movements
        .find(|(movement, _)| *movement == MOVEMENT)
        .or(first)
        .map(|(_, index)| index)
}

pub(super) fn trials(table: &Table<'_>, texture: u16) -> u8 {
    movement(table).map_or(0, |movement| table.trials(texture, movement))
}

/// A name for a texture that the person does not want to spell: the first of "sample 1", "sample 2" that is free.
pub(crate) fn free_name(table: &Table<'_>) -> Name {
    use core::fmt::Write as _;
    let numbered = |number: u32| {
        let mut name = Name::new();
        // 40 bytes hold it
        let _ = write!(name, "sample {number}");
        name
    };
    (1..=MAX_TEXTURES as u32 + 1)
        .map(numbered)
        .find(|name| table.find(name).is_none())
        .unwrap_or_default()
}
