//! Explorations by the firmware, compared with the rig's truth and with the PC that follows them.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use tactus_core::dsp::Plan;
use tactus_core::features::{Movement, Property, PropertySet};
use tactus_core::table::{Action, Contents, Table, TableError, white};
use tactus_core::wire::{Command, Counts, Event, Identify, Report, SlideReport, Verdict};
use tactus_lab::eval::show::count;
use tactus_link::Request;
use tactus_link::follow::{ALLOWED, Agreement, Follower};
use tactus_world::played::PlayCounts;

use super::talk::{TIMEOUT_S, Talk, TalkError};
use crate::board::referee::Violation;
use crate::board::{self, Emulator, Slide};

/// Samples that the sensor sees at boot, while the firmware finds out which finger there is; 14 of an MCP3202, which
/// takes every command for one of its own.
const ASKED_AT_BOOT: u64 = 16;
/// A whole exploration, virtual seconds.
const EXPLORATION_S: f64 = 600.0;

/// Largest relative error of a slide's force ...
pub const FORCE_SHARE: f64 = 0.05;
/// ... unless it is less than a count of P_DC, N.
pub const FORCE_N: f64 = 0.0115;
/// Largest relative error of a slide's speed.
pub const SPEED_SHARE: f64 = 0.01;
/// Largest deviation of a slot from its grid, us.
pub const JITTER_US: f64 = 2.0;

/// Reasons why there is no exploration to judge.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExploreError {
    /// The firmware did not carry out a request.
    #[error(transparent)]
    Talk(#[from] TalkError),
    /// The table cannot be read.
    #[error("the table is damaged: {0}")]
    Table(#[from] TableError),
    /// The exploration cannot be followed.
    #[error("the exploration cannot be followed: {0}")]
    Follow(#[from] tactus_core::explorer::ExplorerError),
}

impl From<board::Error> for ExploreError {
    fn from(why: board::Error) -> Self {
        Self::Talk(why.into())
    }
}

/// The features of a slide, beside the learned ones of the true texture.
#[derive(Clone, PartialEq, Debug)]
pub struct Step {
    /// The movement.
    pub movement: Option<Movement>,
    /// The action.
    pub action: Action,
    /// The observed properties with their values; all where the action looks at everything.
    pub observed: Vec<(Property, f32)>,
    /// Distance of the observation from the learned mean of the true texture, in standard deviations: the root of the
    /// mean square over all observed features, about 1 if it is that texture. `None` if nothing was learned.
    pub distance_sd: Option<f32>,
    /// Posterior probability of the true texture.
    pub probability: f32,
    /// The most probable other texture.
    pub other: Option<Other>,
}

/// Another texture than the true one.
#[derive(Clone, PartialEq, Debug)]
pub struct Other {
    /// Its name.
    pub name: String,
    /// Its posterior probability.
    pub probability: f32,
    /// See [`Step::distance_sd`].
    pub distance_sd: Option<f32>,
}

/// An exploration, as the firmware reported it and in truth.
#[derive(Clone, Debug)]
pub struct Exploration {
    /// Name of the texture under the finger.
    pub truth: String,
    /// True if the table has it.
    pub known: bool,
    /// The verdict.
    pub found: Verdict,
    /// Slides that the probe has learned from by itself.
    pub learned: u8,
    /// From power-up to the end, virtual seconds.
    pub virtual_s: f64,
    /// The ground truth of every slide, and its movement.
    pub slides: Vec<(Movement, Slide)>,
    /// The features of every slide that counted.
    pub steps: Vec<Step>,
    /// The firmware's counters.
    pub counts: Counts,
    /// Sample commands that the sensor got, before and after the firmware's counters were read.
    pub commands: (u64, u64),
    /// Resets since power-up.
    pub resets: usize,
    /// The PC's agreement.
    pub agreement: Agreement,
    /// The parts that the PC could not compare.
    pub not_followed: Vec<String>,
    /// Reports that came damaged or not at all.
    pub lost_reports: u64,
    /// Counts of the recordings played, all 0 without any.
    pub played: PlayCounts,
    /// The firmware's violations of the vendor's rules since power-up.
    pub violations: Vec<Violation>,
}

/// Has the firmware identify the texture under its finger, and follows it. It must know `table` and be ready; `each`
/// gets all reports meanwhile, and `None` after every millisecond.
pub fn explore(
    talk: &mut Talk,
    table: &[u8],
    identify: Identify,
    truth: &str,
    mut each: impl FnMut(&mut Emulator, Option<&Report>),
) -> Result<Exploration, ExploreError> {
    let plan = Plan::new();
    let table = Table::read(table)?;
    let mut follower = Follower::new(table, PropertySet::ALL, &identify, &plan)?;
    let mut not_followed = Vec::new();
    let mut steps = Vec::new();
    let mut slides = Vec::new();
    let mut movement = None;
    let before = talk.board().rig().slides().len();
    talk.send(Command::Stream(true), TIMEOUT_S, &mut each)?;
    let asked = Request::identify(identify);
    let found = talk.run(asked, EXPLORATION_S, |board, report| {
        if let Some(report) = report {
            if let Err(why) = follower.hear(&report.event) {
                not_followed.push(why.to_string());
            }
            match &report.event {
                Event::Chosen {
                    movement: chosen, ..
                } => {
                    movement = Some(*chosen);
                    board.rig().expect_speed(chosen.speed_mm_s().into());
                }
                Event::SlideReport {
                    action,
                    observed,
                    posterior,
                    ..
                } => steps.push(step(table, truth, *action, observed, posterior)),
                _ => {}
            }
        } else if let Some(movement) = movement {
            let rig = board.rig();
            let new = rig.slides().iter().skip(before + slides.len());
            slides.extend(new.map(|slide| (movement, *slide)));
        }
        each(board, report);
    })?;
    let commands = talk.board().rig().sensor_commands();
    let status = talk.run(Request::status(), TIMEOUT_S, &mut each)?;
    let lost_reports = talk.session().damaged() + talk.session().missing();
    let board = talk.board();
    let commands = (commands, board.rig().sensor_commands());
    let played = board.rig().world().played();
    Ok(Exploration {
        truth: truth.to_owned(),
        known: table.find(truth).is_some(),
        found: found.verdict,
        learned: found.learned,
        virtual_s: board.now_ns() as f64 * 1e-9,
        slides,
        steps,
        counts: status.counts,
        commands,
        resets: board.resets()?.len(),
        agreement: follower.agreement().clone(),
        not_followed,
        lost_reports,
        played,
        violations: board.violations()?,
    })
}

fn step(
    table: Table<'_>,
    truth: &str,
    action: Action,
    observed: &SlideReport,
    posterior: &[f32],
) -> Step {
    let number = table.find(truth);
    let others = posterior.iter().zip(0..);
    let other = others
        .filter(|(_, texture)| Some(*texture) != number)
        .max_by(|a, b| a.0.total_cmp(b.0));
    let distance_sd = |texture| distance_sd(table, texture, action, observed);
    let looked_at = |property: &Property| action.property.is_none_or(|only| only == *property);
    let properties = observed.properties();
    Step {
        movement: table.movement(action.movement),
        action,
        observed: Property::ALL
            .into_iter()
            .filter(looked_at)
            .filter_map(|property| Some((property, properties.get(property)?)))
            .collect(),
        distance_sd: number.and_then(distance_sd),
        probability: number
            .and_then(|number| posterior.get(usize::from(number)).copied())
            .unwrap_or(0.0),
        other: other.map(|(probability, texture)| Other {
            name: table.name(texture).unwrap_or("?").to_owned(),
            probability: *probability,
            distance_sd: distance_sd(texture),
        }),
    }
}

fn distance_sd(
    table: Table<'_>,
    texture: u16,
    action: Action,
    observed: &SlideReport,
) -> Option<f32> {
    let squares: Vec<f32> = match table.contents() {
        Contents::Fused(set, features) => {
            if table.trials(texture, action.movement) == 0 {
                return None;
            }
            let vector = observed.observation().vector(set, features.into())?;
            let observed = table.whiten(action.movement, &vector)?;
            let learned = table.white_mean(texture, action.movement);
            let apart = observed
                .into_iter()
                .zip(learned)
                .map(|(z, m)| white(z) - white(m));
            apart.map(|sd| sd * sd).collect()
        }
        Contents::Gaussians(measured) => measured
            .iter()
            .filter(|property| action.property.is_none_or(|only| only == *property))
            .map(|property| {
                let property_of = Action {
                    property: Some(property),
                    ..action
                };
                let learned = table.gaussian(texture, property_of)?;
                let sd = (observed.properties().get(property)? - learned.mean) / learned.sd;
                Some(sd * sd)
            })
            .collect::<Option<_>>()?,
    };
    let mean = squares.iter().sum::<f32>() / squares.len() as f32;
    mean.is_finite().then(|| mean.sqrt())
}

/// Largest error of a slide's force: N, relative, and true if it is too large.
fn force_error(slides: &[(Movement, Slide)]) -> (f64, f64, bool) {
    let errors = slides.iter().map(|(movement, slide)| {
        let wanted = f64::from(movement.force_n());
        let error = (slide.force_n - wanted).abs();
        (error, error / wanted)
    });
    errors.fold((0.0, 0.0, false), |worst, (newtons, share)| {
        let over = newtons > FORCE_N && share > FORCE_SHARE;
        (
            f64::max(worst.0, newtons),
            f64::max(worst.1, share),
            worst.2 || over,
        )
    })
}

impl Exploration {
    /// Returns true if the verdict is the texture under the finger, or is right that the table does not have it.
    pub fn right(&self) -> bool {
        if self.found.unknown {
            !self.known
        } else {
            self.found.name.as_str() == self.truth
        }
    }

    /// Returns true if the PC has the same result, from the raw samples.
    pub fn follows(&self) -> bool {
        self.agreement.agrees() && self.not_followed.is_empty()
    }

    /// Largest error of a slide's force: N, and relative.
    pub fn force_error(&self) -> (f64, f64) {
        let (newtons, share, _) = force_error(&self.slides);
        (newtons, share)
    }

    /// Error of the force of each slide.
    fn force_errors(&self) -> Vec<f64> {
        let each = self.slides.iter();
        let each = each
            .map(|(movement, slide)| (slide.force_n / f64::from(movement.force_n()) - 1.0).abs());
        each.collect()
    }

    /// Largest relative error of a slide's speed.
    pub fn speed_error(&self) -> f64 {
        let errors = self.slides.iter().map(|(_, slide)| slide.speed_error);
        errors.fold(0.0, f64::max)
    }

    /// Largest deviation of a slot from its grid, us.
    pub fn jitter_us(&self) -> f64 {
        let jitters = self.slides.iter().map(|(_, slide)| slide.slot_jitter_us);
        jitters.fold(0.0, f64::max)
    }

    /// Slots in which the sensor was not asked, as the sensor saw it, during the slides.
    pub fn missed_slots(&self) -> usize {
        self.slides
            .iter()
            .map(|(_, slide)| slide.missed_slots)
            .sum()
    }

    /// Largest difference of a property or of the signal it comes from.
    pub fn features_difference(&self) -> f32 {
        self.agreement.properties.max(self.agreement.signal)
    }

    /// The limits that were missed, for any verdict; none if all is well. The rig has no fault: every sample that is
    /// lost, late or damaged is the firmware's.
    pub fn missed(&self) -> Vec<String> {
        let mut missed = Vec::new();
        let mut check = |good: bool, what: String| {
            if !good {
                missed.push(what);
            }
        };
        let (newtons, share, too_far) = force_error(&self.slides);
        let (mn, percent) = (newtons * 1e3, share * 100.0);
        check(!too_far, format!("force off by {mn:.1} mN, {percent:.1} %"));
        let speed = self.speed_error();
        check(
            speed <= SPEED_SHARE,
            format!("speed off by {:.2} %", speed * 100.0),
        );
        let jitter = self.jitter_us();
        check(jitter <= JITTER_US, format!("slots off by {jitter:.2} us"));
        check(self.resets == 0, format!("{} resets", self.resets));
        for violation in &self.violations {
            check(false, format!("not allowed by the chip: {violation}"));
        }
        let counts = self.counts;
        check(
            counts.lost_samples == 0,
            format!("{} lost", count(counts.lost_samples, "sample")),
        );
        check(
            counts.late_slots == 0,
            format!("{} late", count(counts.late_slots, "slot")),
        );
        check(
            self.missed_slots() as u64 <= u64::from(counts.late_slots),
            format!(
                "the sensor missed {}, the firmware tells of {}",
                count(self.missed_slots() as u64, "slot"),
                counts.late_slots
            ),
        );
        let slots = u64::from(counts.slots);
        // a slot is counted before its command goes out; while the finger is looked for, its part is asked outside of
        // slots
        let least = self.commands.0.saturating_sub(ASKED_AT_BOOT);
        let possible = least..=self.commands.1 + u64::from(counts.late_slots) + 1;
        check(
            possible.contains(&slots),
            format!("slots told: {slots}, the sensor saw {possible:?}"),
        );
        check(
            counts.parity_errors == 0 && counts.error_frames == 0,
            format!(
                "{} and {}, and the sensor sent none",
                count(counts.parity_errors, "parity error"),
                count(counts.error_frames, "error frame")
            ),
        );
        check(
            counts.lost_reports == 0 && self.lost_reports == 0,
            format!(
                "{} lost by the firmware's account, {} by the PC's",
                count(counts.lost_reports, "report"),
                self.lost_reports
            ),
        );
        check(
            !self.slides.is_empty() && self.steps.len() == usize::from(self.found.slides),
            format!(
                "{} made, {} observed, {} counted",
                count(self.slides.len() as u64, "slide"),
                self.steps.len(),
                self.found.slides
            ),
        );
        check(
            self.agreement.agrees(),
            format!("the PC does not agree: {:?}", self.agreement),
        );
        for why in &self.not_followed {
            check(false, format!("not followed: {why}"));
        }
        missed
    }

    /// For programs: everything in the units of its name.
    pub fn json(&self) -> Value {
        let (force_n, force_share) = self.force_error();
        let steps = self.steps.iter().map(|step| {
            json!({
                "movement": step.movement.map(|movement| movement.to_string()),
                "looked_at": step.action.what(),
                "observed": step.observed.iter().map(|(p, x)| (p.name(), *x)).collect::<BTreeMap<_, _>>(),
                "distance_sd": step.distance_sd,
                "probability_true": step.probability,
                "other": step.other.as_ref().map(|other| &other.name),
                "distance_sd_other": step.other.as_ref().map(|other| other.distance_sd),
                "probability_other": step.other.as_ref().map(|other| other.probability),
            })
        });
        let mut json = json!({
            "texture_true": self.truth,
            "texture_identified": self.found.name.as_str(),
            "right": self.right(),
            "probability": self.found.probability,
            "sure": self.found.sure,
            "unknown": self.found.unknown,
            "unknown_log_odds": self.found.log_odds,
            "slides_learned_by_itself": self.learned,
            "slides": self.found.slides,
            "virtual_seconds": self.virtual_s,
            "lost_samples": self.counts.lost_samples,
            "late_slots": self.counts.late_slots,
            "parity_errors": self.counts.parity_errors,
            "missed_slots_true": self.missed_slots(),
            "resets": self.resets,
            "silicon_violations": self.violations.len(),
            "violations": self.violations.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "force_error_max": force_share,
            "force_error_max_n": force_n,
            "force_errors": self.force_errors(),
            "lost": u64::from(self.counts.lost_samples) + u64::from(self.counts.lost_reports) + self.lost_reports,
            "late": self.counts.late_slots,
            "damaged": self.counts.parity_errors + self.counts.error_frames,
            "speed_error_max": self.speed_error(),
            "slot_jitter_us": self.jitter_us(),
            "features_difference": number(self.features_difference()),
            "posterior_difference": number(self.agreement.posterior),
            "other_choices": self.agreement.other_choices.len(),
            "follows": self.follows(),
            "bars_missed": self.missed(),
            "log": steps.collect::<Vec<_>>(),
        });
        if self.played != PlayCounts::default() {
            json["played"] = json!({
                "recordings": self.played.slides,
                "samples_clipped": self.played.clipped,
                "samples_beyond_the_end": self.played.over,
                "movements": 1,
                "seconds_used": "3 of 5",
            });
        }
        json
    }

    /// Time and property of each step of the exploration, a line for each slide.
    pub fn log(&self) -> Vec<String> {
        let lines = self.steps.iter().zip(1..).map(|(step, number)| {
            let movement = step.movement.map_or("?".into(), |m| m.to_string());
            let observed: Vec<String> = step
                .observed
                .iter()
                .map(|(p, x)| format!("{p} {x:.3}"))
                .collect();
            let away = |sd: Option<f32>| {
                sd.map_or("never measured".into(), |sd| format!("{sd:.1} sd away"))
            };
            let other = step.other.as_ref().map_or("no other".into(), |other| {
                let p = other.probability * 100.0;
                format!("{} {p:.1} % ({})", other.name, away(other.distance_sd))
            });
            format!(
                "slide {number}: {} at {movement}, observed {}; {} {:.1} % ({}), {other}",
                step.action.what(),
                observed.join(", "),
                self.truth,
                step.probability * 100.0,
                away(step.distance_sd),
            )
        });
        lines.collect()
    }

    /// The PC's agreement, for people.
    pub fn followed(&self) -> String {
        let agreement = &self.agreement;
        format!(
            "{}: features within {:.1e}, posterior within {:.1e} (allowed {ALLOWED:.0e}), {} other choices of {}",
            if self.follows() {
                "the PC agrees"
            } else {
                "THE PC DOES NOT AGREE"
            },
            self.features_difference(),
            agreement.posterior,
            agreement.other_choices.len(),
            agreement.choices
        )
    }
}

/// JSON has no infinity; a difference that has no value must not read as none.
fn number(difference: f32) -> Value {
    if difference.is_finite() {
        json!(difference)
    } else {
        json!("infinite")
    }
}
