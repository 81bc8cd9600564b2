//! The PC follows the probe: from the reports of one exploration with streaming on, it computes everything anew with
//! the same core, and compares.

use tactus_core::dsp::Plan;
use tactus_core::explorer::{Explorer, ExplorerError, NEGLIGIBLE};
use tactus_core::features::{Block, FEATURE_STEPS, Measurement, PropertySet, Slide, SlideError};
use tactus_core::probe::explore::Random;
use tactus_core::sensor::pressure::samples_in;
use tactus_core::table::{Action, Contents, MAX_TEXTURES, Table};
use tactus_core::wire::{
    Event, ExpectedOutcome, Identify, MAX_EXPECTED_OUTCOMES, SlideReport, Verdict,
};

/// Chip and PC do the same operations in the same order and agree to the bit; more than this apart they do not agree.
pub const ALLOWED: f32 = 1e-4;

/// The reason why a stretch of an exploration could not be compared. The rest is followed nevertheless.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
#[error("{0}")]
pub struct FollowError(String);

/// Another choice than the one here.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OtherChoice {
    /// Number of the slide.
    pub slide: u8,
    /// The probe's choice.
    pub there: Action,
    /// The choice here.
    pub here: Action,
}

/// The agreement of probe and PC: largest absolute differences, infinite where one has a value and the other has none.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Agreement {
    /// Slides whose features were computed again and compared.
    pub slides: u32,
    /// Of the properties, in their units.
    pub properties: f32,
    /// Of the background, counts^2, of the logarithms of the band powers, and of P_DC in 100 counts.
    pub signal: f32,
    /// Posteriors compared.
    pub posteriors: u32,
    /// Of posterior probabilities, the verdict's too, and of its log-odds.
    pub posterior: f32,
    /// Choices compared.
    pub choices: u32,
    /// Of the uncertainties and benefits expected from each action.
    pub expected: f32,
    /// Choices that are others here.
    pub other_choices: Vec<OtherChoice>,
    /// Slides that were rejected there.
    pub rejected: u32,
    /// Of these, those that count here.
    pub rejected_only_there: u32,
    /// Verdicts compared.
    pub verdicts: u32,
    /// Verdicts that are others here: their texture, how sure they are, whether it is unknown, what the probe would
    /// learn, or after how many slides.
    pub other_verdicts: u32,
}

impl Agreement {
    /// The largest of all differences.
    pub fn largest(&self) -> f32 {
        let all = [self.properties, self.signal, self.posterior, self.expected];
        all.into_iter().fold(0.0, f32::max)
    }

    /// Returns true where nothing differs by more than [`ALLOWED`], and there was something to compare.
    pub fn agrees(&self) -> bool {
        self.slides > 0
            && self.posteriors > 0
            && self.largest() <= ALLOWED
            && self.other_choices.is_empty()
            && self.rejected_only_there == 0
            && self.other_verdicts == 0
    }
}

/// Follows one exploration.
#[derive(Clone, Debug)]
pub struct Follower<'t> {
    explorer: Explorer<'t, MAX_TEXTURES>,
    plan: &'t Plan,
    /// the same numbers as the probe's
    random: Random,
    /// The slide as far as its samples have come; `None` once a block is missing.
    samples: Option<Slide<'t>>,
    /// P_DC of the slide so far, and which samples are at constant speed.
    pdc: Vec<i16>,
    steady: Option<(u32, u32)>,
    /// The slide as it was at each length of the table that it has reached.
    looks: Vec<Result<Measurement, SlideError>>,
    /// The length at which it ended, from 1, where that was before its end.
    early: Option<u8>,
    /// The probe's last choice.
    chosen: Option<Action>,
    agreement: Agreement,
}

impl<'t> Follower<'t> {
    /// A follower of the exploration that was asked for, on the probe's table, with a rig that measures `measured`.
    pub fn new(
        table: Table<'t>,
        measured: PropertySet,
        asked: &Identify,
        plan: &'t Plan,
    ) -> Result<Self, ExplorerError> {
        let config = asked.config(table.contents());
        let explorer = if asked.among.is_empty() {
            Explorer::new(table, measured, config)?
        } else {
            Explorer::among(table, measured, config, asked.among.iter().copied())?
        };
        Ok(Self {
            explorer,
            plan,
            random: Random::new(asked.seed),
            samples: None,
            pdc: Vec::new(),
            steady: None,
            looks: Vec::new(),
            early: None,
            chosen: None,
            agreement: Agreement::default(),
        })
    }

    /// The agreement so far.
    pub fn agreement(&self) -> &Agreement {
        &self.agreement
    }

    /// Takes in what the probe says, report by report.
    pub fn hear(&mut self, event: &Event) -> Result<(), FollowError> {
        match event {
            Event::Chosen {
                slide,
                movement,
                action,
                expected,
            } => {
                self.samples = Some(Slide::new(self.plan, *movement));
                self.looks.clear();
                self.early = None;
                self.chosen(*slide, *action, expected)
            }
            Event::Block(block) => self.block(block),
            Event::Pdc(counts) => {
                self.pdc.extend_from_slice(counts);
                Ok(())
            }
            Event::Early(ms) => {
                let mut lengths = (1..).zip(self.explorer.table().lengths_ms());
                let ended = lengths.find(|(_, length)| length == ms);
                self.early = ended.map(|(n, _)| n);
                Ok(())
            }
            Event::SlideReport {
                slide,
                action,
                observed,
                posterior,
            } => self.observed(*slide, *action, observed, posterior),
            Event::Rejected { slide, .. } => self.rejected(*slide),
            Event::Verdict(there) => {
                self.verdict(there);
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn verdict(&mut self, there: &Verdict) {
        let whole = self.explorer.verdict();
        // an exploration that was cut short says what is known so far, and asks for no label
        let here = whole.unwrap_or(self.explorer.best());
        let is_fused = matches!(self.explorer.table().contents(), Contents::Fused(..));
        let wants_label = whole.is_some() && is_fused && !self.explorer.is_certain();
        let same = here.texture == there.texture
            && here.sure == there.sure
            && here.most_like == there.most_like
            && here.unknown == there.unknown
            && self.explorer.slides() == there.slides
            && wants_label == there.wants_label;
        let agreement = &mut self.agreement;
        agreement.verdicts += 1;
        agreement.other_verdicts += u32::from(!same);
        for (here, there) in [
            (Some(here.probability), Some(there.probability)),
            (here.log_odds, there.log_odds),
        ] {
            widen(&mut agreement.posterior, apart(here, there));
        }
    }

    fn due(&self) -> u8 {
        self.explorer.slides().saturating_add(1)
    }

    fn in_order(&self, got: u8) -> Result<(), FollowError> {
        let expected = self.due();
        if got != expected {
            return Err(FollowError(format!(
                "slide {got} came where slide {expected} was due; a report was lost, record the session again"
            )));
        }
        Ok(())
    }

    fn chosen(
        &mut self,
        slide: u8,
        there: Action,
        told: &[ExpectedOutcome],
    ) -> Result<(), FollowError> {
        self.chosen = Some(there);
        let random = self.random.next_u32();
        self.in_order(slide)?;
        let expected = self.explorer.expected_outcomes();
        let agreement = &mut self.agreement;
        if told.len() != expected.len().min(MAX_EXPECTED_OUTCOMES) {
            agreement.expected = f32::INFINITY;
        }
        for outcome in told {
            let here = expected.iter().find(|here| here.action == outcome.action);
            for (here, there) in [
                (here.map(|o| o.uncertainty), outcome.uncertainty),
                (here.map(|o| o.benefit), outcome.benefit),
            ] {
                widen(&mut agreement.expected, apart(here, Some(there)));
            }
        }
        agreement.choices += 1;
        let here = self.explorer.choose(&expected, random);
        if here != there {
            agreement
                .other_choices
                .push(OtherChoice { slide, there, here });
        }
        Ok(())
    }

    fn block(&mut self, block: &Block) -> Result<(), FollowError> {
        let slide_number = self.due();
        let Some(slide) = &mut self.samples else {
            return Ok(());
        };
        if block.number == 0 {
            // a person has pressed anew
            *slide = Slide::new(self.plan, slide.movement());
            self.pdc.clear();
            self.looks.clear();
        }
        self.steady = block.steady.or(self.steady);
        let expected = slide.next_block();
        if block.number != expected {
            self.samples = None;
            let got = block.number;
            return Err(FollowError(format!(
                "slide {slide_number}: block {expected} is missing, block {got} came; the slide is not compared"
            )));
        }
        slide.take(block);
        // as the probe does: after each block of a slide
        let mut lengths = self.explorer.table().lengths_ms().skip(self.looks.len());
        if let Some(ms) = lengths.next() {
            let wanted = samples_in(ms);
            if !block.still && slide.samples() >= wanted {
                self.looks.push(slide.look(wanted));
            }
        }
        Ok(())
    }

    fn observed(
        &mut self,
        slide: u8,
        action: Action,
        observed: &SlideReport,
        posterior: &[f32],
    ) -> Result<(), FollowError> {
        self.in_order(slide)?;
        let compared = self.compare(slide, observed);
        // with what the probe reported, so that a difference of the slide is not counted again
        let observation = observed.observation();
        let taken = match self.early.take() {
            Some(n) => self.explorer.observe_early(action, n, &observation),
            None => self.explorer.observe(action, &observation).map(|()| true),
        };
        if taken != Ok(true) {
            return Err(FollowError(format!(
                "slide {slide}: the explorer here cannot use the slide; read the table of the probe again (`tactus \
                 device identify --log` does)"
            )));
        }
        let here = self.explorer.posterior();
        let agreement = &mut self.agreement;
        agreement.posteriors += 1;
        if here.len() != posterior.len() {
            agreement.posterior = f32::INFINITY;
        }
        for (&here, &there) in here.iter().zip(posterior) {
            // too improbable to be reported
            if there == 0.0 && here < NEGLIGIBLE {
                continue;
            }
            widen(&mut agreement.posterior, apart(Some(here), Some(there)));
        }
        compared
    }

    /// Features computed here from the samples, against those that the probe reported.
    fn compare(&mut self, slide: u8, there: &SlideReport) -> Result<(), FollowError> {
        let here = match self.samples.take() {
            // the missing block was an error before
            None => return Ok(()),
            Some(samples) if samples.next_block() == 0 => {
                return Err(FollowError(format!(
                    "slide {slide}: no samples came; ask for them with `Stream` before the exploration"
                )));
            }
            Some(mut samples) => {
                let pdc = core::mem::take(&mut self.pdc);
                let (from, to) = self.steady.take().unwrap_or_default();
                let steady = pdc.get(from as usize..to as usize);
                samples.push_pdc(steady.unwrap_or_default());
                let early = self.early.map(|n| self.looks.get(usize::from(n) - 1));
                let measured = match early {
                    Some(look) => look.cloned().unwrap_or(Err(SlideError::NotStarted)),
                    None => samples.finish(),
                };
                measured.map_err(|why| {
                    FollowError(format!(
                        "slide {slide}: the samples give no properties here ({why}); the last blocks may be missing"
                    ))
                })?
            }
        };
        let here = SlideReport::from(&here);
        let agreement = &mut self.agreement;
        agreement.slides += 1;
        for (here, there) in here.properties.into_iter().zip(there.properties) {
            widen(&mut agreement.properties, apart(here, there));
        }
        if here.roughness_is_bound != there.roughness_is_bound {
            agreement.properties = f32::INFINITY;
        }
        let (background, bands) = (here.background, &here.bands);
        widen(
            &mut agreement.signal,
            apart(Some(background), Some(there.background)),
        );
        let bands = bands.iter().zip(&there.bands);
        let (here_pdc, there_pdc) = (
            here.pressure.iter().flatten(),
            there.pressure.iter().flatten(),
        );
        for (here, there) in bands.chain(here_pdc.zip(there_pdc)) {
            let (here, there) = (f32::from(*here), f32::from(*there));
            widen(&mut agreement.signal, (here - there).abs() / FEATURE_STEPS);
        }
        if here.bands.len() != there.bands.len()
            || here.pressure.is_some() != there.pressure.is_some()
        {
            agreement.signal = f32::INFINITY;
        }
        Ok(())
    }

    fn rejected(&mut self, slide: u8) -> Result<(), FollowError> {
        self.agreement.rejected += 1;
        if let Some(mut samples) = self.samples.take()
            && samples.finish().is_ok()
        {
            self.agreement.rejected_only_there += 1;
        }
        if let Some(action) = self.chosen {
            self.explorer.reject(action);
        }
        self.in_order(slide)
    }
}

fn widen(largest: &mut f32, difference: f32) {
    *largest = largest.max(difference);
}

/// The distance of two values; infinite if only one is there or is a number.
fn apart(here: Option<f32>, there: Option<f32>) -> f32 {
    match (here, there) {
        (None, None) => 0.0,
        (Some(here), Some(there)) if (here - there).is_finite() => (here - there).abs(),
        _ => f32::INFINITY,
    }
}

#[cfg(test)]
mod tests;
