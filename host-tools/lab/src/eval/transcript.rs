//! An exploration as one object for programs: the JSON of `tactus identify` and `tactus device identify`.

use std::fmt::Display;

use serde::Serialize;
use tactus_core::explorer::{ExpectedOutcome, Verdict, VerdictKind};
use tactus_core::features::Property;
use tactus_core::table::{Action, Table};
use tactus_core::wire::{Event, SlideReport};

/// Textures less probable than this are left out of a slide's posterior.
const LISTED: f32 = 1e-6;

/// The slides of an exploration, as they come.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
#[serde(transparent)]
pub struct Transcript {
    slides: Vec<SlideRecord>,
}

/// A slide: the reason for it, its measurements, and the posterior after it.
#[derive(Clone, PartialEq, Debug, Serialize, Default)]
struct SlideRecord {
    force_n: Option<f32>,
    speed_mm_s: Option<f32>,
    /// The one property that was looked at; `null` for all features.
    property: Option<&'static str>,
    /// Uncertainty that was expected after it (eq. 11), 0 to 1.
    pub(crate) expected_uncertainty: Option<f32>,
    traction_n: Option<f32>,
    /// Roughness, a logarithm.
    roughness_ln: Option<f32>,
    /// True if the surface is at most as rough as that.
    roughness_is_bound: bool,
    /// Fineness, a logarithm.
    pub(crate) fineness_ln: Option<f32>,
    /// End of the slide, seconds at constant speed, if it ended early.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) ended_after_s: Option<f64>,
    /// The reason why the slide does not count, if it does not.
    rejected: Option<String>,
    /// The textures after the slide, the most probable first.
    posterior: Vec<Candidate>,
}

#[derive(Clone, PartialEq, Debug, Serialize)]
struct Candidate {
    texture: String,
    /// 0 to 1.
    probability: f32,
}

/// The verdict.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Answer {
    /// `sure`, `most-like`, `changed`, `new` or `undecided`.
    pub told: &'static str,
    /// The most probable texture; it is the answer with `sure`, and with `changed` if the user says so.
    pub texture: String,
    /// Its posterior probability, 0 to 1.
    pub probability: f32,
    /// Log-odds that it is none of those known, where the method can tell.
    log_odds: Option<f32>,
    /// Slides that counted.
    pub slides: u8,
}

impl Answer {
    /// A verdict in words for programs.
    pub fn new(verdict: Verdict, slides: u8, table: Table<'_>) -> Self {
        Self {
            told: match verdict.kind() {
                VerdictKind::Sure => "sure",
                VerdictKind::MostLike => "most-like",
                VerdictKind::New => "new",
                VerdictKind::Changed => "changed",
                VerdictKind::Undecided => "undecided",
            },
            texture: table.name(verdict.texture).unwrap_or_default().to_owned(),
            probability: verdict.probability,
            log_odds: verdict.log_odds,
            slides,
        }
    }
}

impl Transcript {
    /// Takes an event of an exploration with `table`; ignores any other.
    pub fn event(&mut self, event: &Event, table: Table<'_>) {
        match event {
            Event::Chosen {
                action, expected, ..
            } => self.slides.push(SlideRecord::new(*action, expected, table)),
            Event::Early(ms) => {
                if let Some(slide) = self.slides.last_mut() {
                    slide.ended_after_s = Some(f64::from(*ms) / 1e3);
                }
            }
            Event::SlideReport {
                observed,
                posterior,
                ..
            } => self.measured(observed, posterior, table),
            Event::Rejected { why, .. } => self.rejected(why),
            _ => {}
        }
    }

    /// Notes why the last slide does not count.
    pub fn rejected(&mut self, why: &impl Display) {
        if let Some(slide) = self.slides.last_mut() {
            slide.rejected = Some(why.to_string());
        }
    }

    fn measured(&mut self, observed: &SlideReport, posterior: &[f32], table: Table<'_>) {
        let Some(slide) = self.slides.last_mut() else {
            return;
        };
        [slide.traction_n, slide.roughness_ln, slide.fineness_ln] = observed.properties;
        slide.roughness_is_bound = observed.roughness_is_bound;
        let candidates = table.names().zip(posterior);
        let listed = candidates.filter(|(_, probability)| **probability >= LISTED);
        slide.posterior = listed
            .map(|(name, &probability)| Candidate {
                texture: name.to_owned(),
                probability,
            })
            .collect();
        slide
            .posterior
            .sort_by(|a, b| b.probability.total_cmp(&a.probability));
    }
}

impl SlideRecord {
    fn new(action: Action, expected: &[ExpectedOutcome], table: Table<'_>) -> Self {
        let movement = table.movement(action.movement);
        let chosen = expected.iter().find(|o| o.action == action);
        Self {
            force_n: movement.and_then(|movement| movement.known().0),
            speed_mm_s: movement.and_then(|movement| movement.known().1),
            property: action.property.map(Property::name),
            expected_uncertainty: chosen.map(|chosen| chosen.uncertainty),
            ..Self::default()
        }
    }
}
