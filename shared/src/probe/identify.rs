//! An exploration that a host asks for, from beginning to end: every step is told in the words of [`crate::wire`], so
//! that the host can follow each decision.

use heapless::Vec;

use super::explore::{ExplorationStep, Random, explore};
use crate::dsp::Plan;
use crate::explorer::{
    self, Answer, Config, EpisodeSummary, ExpectedOutcome, Explorer, ExplorerError, LEADING,
};
use crate::features::Measurement;
use crate::rig::{Rig, RigError};
use crate::table::{Contents, MAX_TEXTURES, Name, Table};
use crate::up_to;
use crate::wire::{Event, Failure, Identify, MAX_EXPECTED_OUTCOMES, Rejection, Verdict};

/// The result of an exploration.
#[derive(Clone, PartialEq, Debug)]
pub struct Identification {
    /// The most probable textures and their probabilities, the first one leading.
    pub leading: Vec<(u16, f32), LEADING>,
    /// The verdict.
    pub verdict: explorer::Verdict,
    /// Where the question was whether it is one texture: the answer.
    pub answer: Option<Answer>,
}

/// Explores what lies under the finger until there is an answer, and reports it. `config` is that of the request, with
/// what the probe adds to it; where it is to [verify](Config::verify), [`Event::Verified`] takes the verdict's place.
/// Errors: the request makes no sense with this table, or the exploration failed: see
/// [`crate::probe::explore::ExploreError`].
pub async fn identify<R>(
    wanted: &Identify,
    config: Config,
    rig: &mut R,
    table: Table<'_>,
    plan: &Plan,
    mut tell: impl FnMut(Event),
) -> Result<(EpisodeSummary, Identification), Failure>
where
    R: Rig<Error = RigError>,
{
    if config.verify {
        if wanted.among.len() != 1 {
            return Err(Failure::Explorer(ExplorerError::Candidates));
        }
        if table.limits().is_none() {
            return Err(Failure::NoLimits);
        }
    }
    let mut explorer = Explorer::<'_, MAX_TEXTURES>::empty(table);
    let candidates = candidates(&wanted.among, table.textures());
    explorer
        .consider(rig.measures(), config, candidates)
        .map_err(Failure::Explorer)?;
    let mut random = Random::new(wanted.seed);
    let random = || random.next_u32();
    let mut slide: u8 = 1;
    let step = |step: ExplorationStep<'_, RigError>| {
        if let ExplorationStep::Measured(_, measurement, _) = step {
            clipped(measurement).map(&mut tell);
        }
        if let ExplorationStep::Rejected(_, why) = step {
            let why = Failure::Slide(*why);
            tell(Event::Rejected { slide, why });
        }
        if let Some(event) = event_of(&step, table, &config, slide) {
            tell(event);
        }
        if let ExplorationStep::Measured(..) = step {
            slide = slide.saturating_add(1);
        }
    };
    let verdict = explore(rig, &mut explorer, plan, random, step).await?;
    let episode = EpisodeSummary {
        table: table.crc(),
        texture: verdict.texture,
        certain: explorer.may_learn(),
        observed: up_to(explorer.observed()),
        paces: up_to(explorer.paces()),
    };
    let verification = explorer.verification().filter(|_| config.verify);
    let identification = Identification {
        leading: explorer.leading(),
        verdict,
        answer: verification.map(|now| now.answer),
    };
    Ok((episode, identification))
}

/// The event that P_AC was cut off in a slide that counts.
pub(super) fn clipped(slide: &Measurement) -> Option<Event> {
    let why = Rejection::Slide(slide.clipped?);
    Some(Event::Trouble(Failure::Slide(why)))
}

/// The event of a step of an exploration, in which this slide is the next or has just been made; none of a rejected
/// slide, whose reason is the rig's.
pub fn event_of<E>(
    step: &ExplorationStep<'_, E>,
    table: Table<'_>,
    config: &Config,
    slide: u8,
) -> Option<Event> {
    Some(match *step {
        ExplorationStep::Chosen(action, expected) => Event::Chosen {
            slide,
            movement: table.movement(action.movement)?,
            action,
            expected: best(expected),
        },
        ExplorationStep::Early(ms) => Event::Early(ms),
        ExplorationStep::Measured(action, measurement, posterior) => Event::SlideReport {
            slide,
            action,
            observed: measurement.into(),
            posterior: Vec::from_slice(posterior).unwrap_or_default(),
        },
        ExplorationStep::Verified(now, slides) => Event::Verified { slides, now },
        ExplorationStep::Rejected(..) => return None,
        // whether it is the one asked for was told after the slide
        ExplorationStep::Decided { .. } | ExplorationStep::CutShort(..) if config.verify => {
            return None;
        }
        ExplorationStep::Decided {
            verdict,
            slides,
            certain,
        } => {
            let wants_label = matches!(table.contents(), Contents::Fused(..)) && !certain;
            told(table, verdict, slides, wants_label)
        }
        // nothing is kept that a label could be for
        ExplorationStep::CutShort(verdict, slides) => told(table, verdict, slides, false),
    })
}

/// The textures that it may be; none stands for all.
pub(crate) fn candidates(among: &[u16], textures: u16) -> impl Iterator<Item = u16> {
    let all = if among.is_empty() { 0..textures } else { 0..0 };
    among.iter().copied().chain(all)
}

fn told(table: Table<'_>, verdict: &explorer::Verdict, slides: u8, wants_label: bool) -> Event {
    Event::Verdict(Verdict {
        texture: verdict.texture,
        name: Name::try_from(table.name(verdict.texture).unwrap_or_default()).unwrap_or_default(),
        probability: verdict.probability,
        sure: verdict.sure,
        unknown: verdict.unknown,
        log_odds: verdict.log_odds,
        slides,
        wants_label,
        changed: verdict.changed,
        most_like: verdict.most_like,
    })
}

/// The most useful actions, best first. One after the other, for sorting them all takes the chip 2 KB.
pub(super) fn best(expected: &[ExpectedOutcome]) -> Vec<ExpectedOutcome, MAX_EXPECTED_OUTCOMES> {
    let mut best: Vec<ExpectedOutcome, MAX_EXPECTED_OUTCOMES> = Vec::new();
    for o in expected {
        let better = |p: &ExpectedOutcome| p.benefit.total_cmp(&o.benefit).is_ge();
        if best.is_full() {
            if best.last().is_some_and(better) {
                continue;
            }
            best.pop();
        }
        // one place is free now
        let _ = best.push(*o);
        let mut rest = best.as_mut_slice();
        while let [.., before, last] = rest
            && !better(before)
        {
            core::mem::swap(before, last);
            (rest, _) = rest.split_at_mut(rest.len().saturating_sub(1));
        }
    }
    best
}
