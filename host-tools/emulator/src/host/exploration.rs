//! Explorations by the firmware, compared with the rig's truth and with the PC that follows them.

use serde_json::{Value, json};
use tactus_core::dsp::Plan;
use tactus_core::features::{Movement, PropertySet};
use tactus_core::table::Table;
use tactus_core::wire::{Command, Counts, Event, Identify, Report, Verdict};
use tactus_lab::eval::show::count;
use tactus_link::Request;
use tactus_link::follow::{ALLOWED, Agreement, Follower};
use tactus_world::played::PlayCounts;

use super::talk::{TIMEOUT_S, Talk};
use crate::board::referee::Violation;
use crate::board::{Emulator, Slide};

/// Samples that the sensor sees at boot, while the firmware finds out which finger there is; 14 of an MCP3202, which
/// takes every command for one of its own.
const ASKED_AT_BOOT: u64 = 16;
/// A whole exploration, virtual seconds.
const EXPLORATION_S: f64 = 600.0;

/// Largest relative error of a slide's force ...
pub(crate) const FORCE_SHARE: f64 = 0.05;
/// ... unless it is less than a count of P_DC, N.
pub(crate) const FORCE_N: f64 = 0.0115;
/// Largest relative error of a slide's speed.
pub const SPEED_SHARE: f64 = 0.01;
/// Largest deviation of a slot from its grid, us.
pub(crate) const JITTER_US: f64 = 2.0;

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
    pub(crate) virtual_s: f64,
    /// The ground truth of every slide, and its movement.
    pub slides: Vec<(Movement, Slide)>,
    /// Slides that the firmware reported.
    pub observed: usize,
    /// The firmware's counters.
    pub counts: Counts,
    /// Sample commands that the sensor got, before and after the firmware's counters were read.
    pub commands: (u64, u64),
    /// Resets since power-up.
    pub resets: usize,
    /// The PC's agreement.
    pub agreement: Agreement,
    pub(crate) not_followed: Vec<String>,
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
) -> anyhow::Result<Exploration> {
    let plan = Plan::new();
    let table = Table::read(table)?;
    let mut follower = Follower::new(table, PropertySet::ALL, &identify, &plan)?;
    let mut not_followed = Vec::new();
    let mut observed = 0;
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
                Event::SlideReport { .. } => observed += 1,
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
    let (damaged, missing) = talk.losses();
    let lost_reports = damaged + missing;
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
        observed,
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

    /// Largest error of a slide's force: N, relative, and true if it is too large.
    pub(crate) fn force_error(&self) -> (f64, f64, bool) {
        let errors = self.slides.iter().map(|(movement, slide)| {
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
    pub(crate) fn jitter_us(&self) -> f64 {
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
    pub(crate) fn features_difference(&self) -> f32 {
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
        let (newtons, share, too_far) = self.force_error();
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
        let none = [
            (counts.lost_samples, "sample", "lost"),
            (counts.late_slots, "slot", "late"),
        ];
        for (number, what, how) in none {
            check(number == 0, format!("{} {how}", count(number, what)));
        }
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
            !self.slides.is_empty() && self.observed == usize::from(self.found.slides),
            format!(
                "{} made, {} observed, {} counted",
                count(self.slides.len() as u64, "slide"),
                self.observed,
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
        json!({
            "texture_true": self.truth,
            "texture_identified": self.found.name.as_str(),
            "probability": self.found.probability,
            "sure": self.found.sure,
            "unknown": self.found.unknown,
            "slides": self.found.slides,
            "virtual_seconds": self.virtual_s,
            "silicon_violations": self.violations.len(),
            "violations": self.violations.iter().map(ToString::to_string).collect::<Vec<_>>(),
            "force_errors": self.force_errors(),
            "lost": u64::from(self.counts.lost_samples) + u64::from(self.counts.lost_reports) + self.lost_reports,
            "late": self.counts.late_slots,
            "damaged": self.counts.parity_errors + self.counts.error_frames,
            "follows": self.follows(),
        })
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
