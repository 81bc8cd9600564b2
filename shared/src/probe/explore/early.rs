//! A slide that may end before its end: see [`crate::explorer::Look`].

use crate::explorer::{Explorer, ObserveError, most_doubt};
use crate::features::{Measurement, Observation, Slide, SlideError};
use crate::rig::Rig;
use crate::sensor::pressure::samples_in;
use crate::table::Action;

#[derive(Clone, Copy)]
pub(super) struct Length {
    /// Its number, from 1.
    n: u8,
    pub(super) ms: u16,
}

/// Makes a slide; the length at which it ended, if the verdict was certain before its end.
pub(super) async fn perform<R: Rig, const N: usize>(
    rig: &mut R,
    explorer: &mut Explorer<'_, N>,
    action: Action,
    slide: &mut Slide<'_>,
) -> Result<Option<Length>, R::Error> {
    let Some(most) = most_doubt(explorer.config().method) else {
        return rig.perform(slide).await.map(|()| None);
    };
    let mut lengths = (1..).zip(explorer.table().lengths_ms());
    let mut next = lengths.next();
    let mut ended = None;
    let enough = &mut |slide: &mut Slide<'_>| {
        let Some((n, ms)) = next.filter(|(_, ms)| slide.samples() >= samples_in(*ms)) else {
            return false;
        };
        next = lengths.next();
        let length = Length { n, ms };
        // whatever is wrong with the slide is for its end to say
        let look = slide.look(samples_in(ms)).ok().and_then(|slide| {
            let look = explorer.look(action, n, &Observation::from(&slide));
            look.ok().flatten()
        });
        ended = look
            .is_some_and(|look| look.is_enough(most))
            .then_some(length);
        ended.is_some()
    };
    rig.perform_until(slide, enough).await.map(|()| ended)
}

/// Measures a slide that ended at this length, or at its end.
pub(super) fn measure(
    slide: &mut Slide<'_>,
    length: Option<Length>,
) -> Result<Measurement, SlideError> {
    match length {
        Some(length) => slide.look(samples_in(length.ms)),
        None => slide.finish(),
    }
}

/// Takes in a slide that ended at this length, or at its end.
pub(super) fn observe<const N: usize>(
    explorer: &mut Explorer<'_, N>,
    action: Action,
    length: Option<Length>,
    slide: &Measurement,
) -> Result<(), ObserveError> {
    let slide = Observation::from(slide);
    match length {
        // the table knows the length: it was looked at
        Some(length) => explorer.observe_early(action, length.n, &slide).map(|_| ()),
        _ => explorer.observe(action, &slide),
    }
}
