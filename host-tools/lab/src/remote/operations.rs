//! Operations on a probe whose slides are compared with a table here, or recorded. The others are those of
//! [`link::operations`](tactus_link::operations).

use std::io::{self, Write as _};

use serde::Deserialize;
use tactus_core::explorer::{Strategy, Verdict};
use tactus_core::table::{Contents, Table};
use tactus_core::wire::{Command, Event, Identify, Report, Status};

use super::say::compare;
use super::verifying::{Verifying, config_of};
use crate::data::recorder::{RecordError, Recorder};
use crate::data::recording::{Labels, Recording};
use crate::eval::alike::{self, Alike};
use crate::eval::refresh::{NewSlide, Refreshed, refresh as moved_table};
use crate::eval::samples::Trials;
use crate::eval::show::Show;
use crate::eval::verified::{Verified, print_answer, print_slide};
pub use tactus_link::operations::Learned;
use tactus_link::operations::{self, Sample, Training, ask_to_lay, ask_to_move};
use tactus_link::person::QuestionKind;
use tactus_link::say::{Prompts, count, show_verifying};
use tactus_link::{Identified, LinkError, OperationError, Probe, Request, foreign};

type Result<T> = std::result::Result<T, OperationError>;

/// Textures that are named as having moved most.
const NAMED: usize = 5;

/// Has the probe explore, and shows every step; the verdict and after how many slides it came.
pub async fn identify(
    probe: &Probe,
    wanted: Identify,
    mut each: impl FnMut(&Report),
) -> Result<(Identified, Option<(Verdict, u8)>)> {
    let bytes = probe.table().await?;
    let table = Table::read(&bytes)?;
    let among = match wanted.among.len() {
        0 => usize::from(table.textures()),
        some => some,
    };
    let (mut words, seed) = (probe.words(), wanted.seed);
    writeln!(words, "An unknown texture, one of {among} (seed {seed}).")?;
    let mut show = Show::new(table, words);
    let slides = wanted.max_slides;
    let identified = operations::identify(probe, wanted, |report| {
        can_be(report, table, slides)?;
        each(report);
        show.event(&report.event)
    });
    let identified = identified.await?;
    Ok((identified, show.answered()))
}

/// Errors: the report is of another exploration, or damaged.
fn can_be(report: &Report, table: Table<'_>, slides: u8) -> io::Result<()> {
    match foreign(&report.event, table, slides) {
        None => Ok(()),
        Some(what) => Err(io::Error::other(LinkError::Impossible(what))),
    }
}

/// Names the texture of the last exploration, and compares it with the others.
pub async fn teach(probe: &Probe, name: &str) -> Result<(Learned, Option<Alike>)> {
    compared(probe, operations::teach(probe, name).await?)
}

/// Has the probe make slides of a texture and learn it, and compares it with the others.
pub async fn train(probe: &Probe, training: &Training) -> Result<(Learned, Option<Alike>)> {
    compared(probe, operations::train(probe, training).await?)
}

fn compared(probe: &Probe, learned: Learned) -> Result<(Learned, Option<Alike>)> {
    let table = Table::read(&learned.table)?;
    let texture = table.find(&learned.name);
    let nearest = texture.and_then(|texture| alike::nearest(table, texture));
    if let Some(nearest) = &nearest {
        compare(&learned.name, learned.is_new, nearest, &mut probe.words())?;
    }
    Ok((learned, nearest))
}

/// Has the probe find out whether what lies under its finger is this texture of its table.
pub async fn verify(probe: &Probe, texture: u16, wanted: Identify) -> Result<Verified> {
    let bytes = probe.table().await?;
    let wanted = Identify {
        among: std::iter::once(texture).collect(),
        strategy: Strategy::Cycling,
        ..wanted
    };
    let slides = wanted.max_slides;
    let mut verifying = Verifying::new(&bytes, texture, config_of(&wanted))?;
    let (mut prompts, mut words) = (Prompts::default(), probe.words());
    writeln!(words, "Is it {}?", verifying.reference())?;
    let request = Request::command(Command::Verify(wanted));
    let table = Table::read(&bytes)?;
    let each = |report: &Report| {
        can_be(report, table, slides)?;
        match verifying.hear(&report.event) {
            Some(slide) => print_slide(slide, &mut words),
            None => show_verifying(report, &mut prompts, &mut words),
        }
    };
    probe.run(request, each).await?;
    let verified = verifying.end();
    print_answer(&verified, &mut probe.words())?;
    Ok(verified)
}

/// A recording to be made.
#[derive(Clone, PartialEq, Debug, Deserialize)]
pub struct Wanted {
    /// The texture.
    pub name: String,
    /// Its index in the recordings.
    #[serde(default)]
    pub index: usize,
    /// Slides.
    pub slides: u8,
    /// Knowledge of the sample.
    #[serde(default, rename = "moved")]
    pub sample: Sample,
    /// For where on the sample slides begin.
    pub seed: u32,
}

/// Slides of a texture.
#[derive(Debug)]
pub struct Recorded {
    /// Those that arrived whole, each with whether the sample was moved before it.
    pub slides: Vec<(Recording, Option<bool>)>,
    /// Reasons why others did not.
    pub lost: Vec<RecordError>,
    /// The status of the probe that made them.
    pub status: Status,
}

impl Recorded {
    /// The slides with what is known of each, beside what is known of all.
    pub(crate) fn labelled(&self, labels: &Labels) -> Vec<(Recording, Labels)> {
        let slides = self.slides.iter().map(|(slide, moved)| {
            let labels = Labels {
                finger: self.status.finger,
                calibrated: self.status.calibrated,
                moved: *moved,
                ..labels.clone()
            };
            (slide.clone(), labels)
        });
        slides.collect()
    }
}

/// Has the probe make slides, movements of its table in turn, and records them.
pub async fn record(probe: &Probe, wanted: &Wanted) -> Result<Recorded> {
    let (name, slides) = (&wanted.name[..], wanted.slides);
    let calibration = probe.get(Request::read_calibration()).await?;
    let status = probe.get(Request::status()).await?;
    // a slide of each movement, then the sample is moved
    let part = match wanted.sample {
        Sample::Asked => Table::read(&probe.table().await?)?.movements().len() as u8,
        Sample::Noted(_) => slides,
    };
    probe.get(Request::command(Command::Stream(true))).await?;
    let mut recorder = Recorder::new(calibration.pressure);
    let (mut lost, mut kept) = (Vec::new(), Vec::new());
    let (mut prompts, mut samples) = (Prompts::default(), Trials::default());
    let mut words = probe.words();
    for (trial, begin) in (0..slides).step_by(part.max(1).into()).enumerate() {
        if trial > 0 {
            samples.said(Some(ask_to_move(probe, name).await?));
        }
        let trial_wanted = Recorder::wanted(trial, part.min(slides - begin), wanted.seed);
        let each = |report: &Report| {
            match recorder.hear(wanted.index, report) {
                Some(Ok(slide)) => {
                    let (number, movement) = (slide.number, slide.movement);
                    writeln!(words, "{name}, slide {number} of {slides}: {movement}")?;
                    kept.push((trial, slide));
                }
                Some(Err(why)) => lost.push(why),
                None => prompts.show(report, &mut words)?,
            }
            io::Result::Ok(())
        };
        probe.run(Request::identify(trial_wanted), each).await?;
    }
    probe.get(Request::command(Command::Stream(false))).await?;
    for why in &lost {
        writeln!(words, "{name}: a slide is not recorded: {why}")?;
    }
    if kept.is_empty() {
        return Err(OperationError::said(format!(
            "{name}: no slide arrived whole; check the cable, then record again"
        )));
    }
    let slides = kept.into_iter().map(|(trial, slide)| {
        let moved = match wanted.sample {
            Sample::Asked => samples.before_trial(trial),
            Sample::Noted(moved) => moved,
        };
        (slide, moved)
    });
    Ok(Recorded {
        slides: slides.collect(),
        lost,
        status,
    })
}

/// Has the probe slide over every texture once at each movement, and moves its table, with somebody's consent.
pub async fn refresh(probe: &Probe, seed: impl Fn() -> u32) -> Result<()> {
    let bytes = probe.table().await?;
    let table = Table::read(&bytes)?;
    if !matches!(table.contents(), Contents::Fused(..)) {
        // it says why, before anybody has laid a sample there
        moved_table(table, &[]).map_err(OperationError::said)?;
    }
    let (mut slides, mut left_out, mut words) = (Vec::new(), Vec::new(), probe.words());
    for (texture, name) in (0..).zip(table.names()) {
        if !ask_to_lay(probe, name, QuestionKind::LaidOrLeftOut).await? {
            left_out.push(name.to_owned());
            continue;
        }
        let made = slides_of(probe, table, texture, seed()).await?;
        writeln!(words, "{name}: {}", count(made.len() as u64, "slide"))?;
        slides.extend(made);
    }
    let refreshed = moved_table(table, &slides).map_err(OperationError::said)?;
    print_refreshed(&refreshed, &left_out, &mut words)?;
    let lost = "The probe is to use the table that has moved.";
    operations::replace_table(probe, &refreshed.bytes, lost, "refresh again").await?;
    Ok(())
}

async fn slides_of(
    probe: &Probe,
    table: Table<'_>,
    texture: u16,
    seed: u32,
) -> Result<Vec<NewSlide>> {
    let Contents::Fused(set, length) = table.contents() else {
        return Ok(Vec::new());
    };
    // never sure: all slides are made
    let wanted = Identify {
        among: std::iter::once(texture).collect(),
        threshold: 1.0,
        max_slides: table.movements().len() as u8,
        strategy: Strategy::Cycling,
        open: false,
        seed,
        ..Identify::default()
    };
    let (mut made, mut prompts, mut words) = (Vec::new(), Prompts::default(), probe.words());
    let each = |report: &Report| match &report.event {
        Event::SlideReport {
            action, observed, ..
        } => {
            let features = observed.observation().vector(set, length.into());
            made.extend(features.map(|features| NewSlide {
                texture,
                movement: action.movement,
                features: features.to_vec(),
            }));
            Ok(())
        }
        _ => show_verifying(report, &mut prompts, &mut words),
    };
    probe.run(Request::identify(wanted), each).await?;
    Ok(made)
}

fn print_refreshed(
    refreshed: &Refreshed,
    left_out: &[String],
    out: &mut impl io::Write,
) -> io::Result<()> {
    let together = refreshed.together;
    writeln!(
        out,
        "All textures moved together by {together:.1} standard deviations of a slide."
    )?;
    let most = refreshed.moved.iter().take(NAMED);
    let most = most.map(|m| format!("{} ({:.1})", m.texture, m.moved));
    let most = most.collect::<Vec<_>>().join(", ");
    writeln!(out, "Beyond that moved most: {most}.")?;
    if !left_out.is_empty() {
        let all = left_out.join(", ");
        writeln!(
            out,
            "Moved with the others only, as they were left out: {all}."
        )?;
    }
    for pair in &refreshed.alike {
        let since = if pair.before { "as before" } else { "any more" };
        let (first, second) = (&pair.first, &pair.second);
        writeln!(out, "{first} and {second} cannot be told apart {since}.")?;
    }
    Ok(())
}
