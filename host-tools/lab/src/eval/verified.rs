//! The comparison of a sample with a reference, for people and programs.

use std::io::{self, Write};

use serde::Serialize;
use tactus_core::explorer::{Answer, Config, ENOUGH_TRIALS, same_below};
use tactus_core::table::Table;
use tactus_core::wire::Failure;

use super::learned::LeftOut;
use super::show::{about_percent, count, percent};

/// The output of `verify --format json`.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Verified {
    /// The texture to compare with.
    pub reference: String,
    /// The expected texture of the sample, if known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sample: Option<String>,
    /// `same`, `different` or `unsure`.
    pub answer: &'static str,
    pub(crate) reference_slides: u8,
    /// True if these are too few to rely on.
    pub few: bool,
    /// Share of the reference's own episodes that would be called different.
    pub false_alarm: f32,
    /// Least probability of "the same".
    pub threshold: f32,
    /// The score below which they are the same, where that is below the limit.
    pub same_below: f32,
    /// Share of other textures' episodes of as many slides that would be called the same; `null`: the table has no
    /// other.
    pub false_accept: Option<f64>,
    /// Slides of recordings that were left out, as the table was learned from them.
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    pub left_out: Option<LeftOut>,
    /// One after the other.
    pub slides: Vec<Slide>,
}

/// The table has no limits for a comparison.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
#[error("{}", Failure::NoLimits)]
pub struct NoLimits;

impl Verified {
    /// Before the first slide.
    pub fn new(table: Table<'_>, texture: u16, config: &Config) -> Result<Self, NoLimits> {
        let limits = table.limits().ok_or(NoLimits)?;
        let movements = 0..table.movements().len() as u8;
        let trials = movements.map(|at| table.trials(texture, at));
        let reference_slides = trials.filter(|n| *n > 0).min().unwrap_or(0);
        Ok(Self {
            reference: table.name(texture).unwrap_or_default().to_owned(),
            sample: None,
            answer: name(Answer::Unsure),
            reference_slides,
            few: reference_slides < ENOUGH_TRIALS,
            false_alarm: config.false_alarm.unwrap_or(limits.false_alarm),
            threshold: config.threshold,
            same_below: same_below(config.threshold),
            false_accept: None,
            left_out: None,
            slides: Vec::new(),
        })
    }
}

/// The state after a slide.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Slide {
    /// From 1.
    pub number: u32,
    /// Contact force, N.
    pub force_n: Option<f32>,
    /// mm/s.
    pub speed_mm_s: Option<f32>,
    /// Difference of the slides from the reference.
    pub score: f32,
    /// Above it they are different.
    pub limit: f32,
    /// As that of [`Verified`].
    pub answer: &'static str,
}

/// The word for programs.
pub fn name(answer: Answer) -> &'static str {
    match answer {
        Answer::Same => "same",
        Answer::Different => "different",
        Answer::Unsure => "unsure",
    }
}

/// Prints the state after a slide.
pub fn print_slide(slide: &Slide, out: &mut impl Write) -> io::Result<()> {
    let says = match slide.answer {
        "same" => "the same",
        "different" => "different",
        _ => "not sure yet",
    };
    let force = slide.force_n.map(|n| format!(", {n:.2} N"));
    let speed = slide.speed_mm_s.map(|v| format!(" at {v:.1} mm/s"));
    writeln!(
        out,
        "  slide {}{}{}: score {:.1}, different above {:.1}: {says}",
        slide.number,
        force.unwrap_or_default(),
        speed.unwrap_or_default(),
        slide.score,
        slide.limit
    )
}

/// The answer in a sentence.
pub fn sentence(v: &Verified) -> String {
    let reference = &v.reference;
    match v.answer {
        "same" => format!("The same as {reference}."),
        "different" => {
            format!("Different from {reference}, or {reference} has changed more than expected.")
        }
        _ => format!("Not sure yet whether it is {reference}: more slides would decide."),
    }
}

/// Prints the answer, and what its score means.
pub fn print_answer(v: &Verified, out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{}", sentence(v))?;
    print_score(v, out)
}

/// Prints what the last score means, and how often its limits are wrong.
pub fn print_score(v: &Verified, out: &mut impl Write) -> io::Result<()> {
    let reference = &v.reference;
    if let Some(Slide { score, limit, .. }) = v.slides.last() {
        let times = match f64::from(score.abs()).exp() {
            times if times > 1e6 => "over a million".to_owned(),
            times if times < 10.0 => format!("{times:.1}"),
            times => {
                let digit = 10_f64.powi(times.log10() as i32 - 1);
                format!("{:.0}", (times / digit).round() * digit)
            }
        };
        let (better, worse) = match *score > 0.0 {
            true => ("another texture", &reference[..]),
            false => (&reference[..], "another texture"),
        };
        let accepted = v.false_accept.map_or(String::new(), |share| {
            let share = about_percent(share);
            format!(" ({share} of the table's other textures would be)")
        });
        writeln!(
            out,
            "Score {score:.1}: {better} explains the slides {times} times as well as {worse} does. Above {limit:.1} \
             they are different ({} of {reference}'s own would be), below {:.1} the same{accepted}.",
            percent(v.false_alarm.into()),
            v.same_below.min(*limit)
        )?;
    }
    if v.few {
        writeln!(
            out,
            "The reference has only {} at a movement: record more of it, five make it much surer.",
            count(v.reference_slides, "slide")
        )?;
    }
    Ok(())
}
