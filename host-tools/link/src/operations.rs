//! Operations on a probe, each once: the command line, the page, Python and the emulator call them. Each says what
//! people read in the
//! probe's [`words`](Probe::words), and returns what programs read.

mod calibrate;
mod tables;

use std::io::{self, Write as _};
use std::ops::ControlFlow;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use tactus_core::probe::training::pilot_movements;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::most_mn;
use tactus_core::table::{Name, Table};
use tactus_core::wire::{self, Command, Event, Identify, Report, Status};

use super::error::OperationError;
use super::lifting::Stopped;
use super::person::{Question, QuestionKind};
use super::probe::Probe;
use super::request::{Identified, Request};
use super::samples::{Noting, Trials, fewest, noting};
use super::say;
use super::table::PushTable;

pub use calibrate::{Calibrating, calibrate, keep_calibration, show_calibration, turn_over};
pub use tables::{Settings, factory, forget, push, rename, replace_table};
pub use tables::{set_false_alarm, set_high_force, settings};

type Result<T> = std::result::Result<T, OperationError>;

/// Shows how a probe is, once it has come up.
pub async fn status(probe: &Probe) -> Result<(Status, RigCalibration)> {
    let status = probe.hello().await?;
    let calibration = probe.get(Request::read_calibration()).await?;
    let rows = say::status_rows(&probe.name(), &status, &calibration, probe.losses());
    say::show_rows(&rows, &mut probe.words())?;
    Ok((status, calibration))
}

/// Ends a fault, and has the rig find its limit switches.
pub async fn home(probe: &Probe) -> Result<()> {
    probe.perform(Request::command(Command::Home)).await?;
    writeln!(
        probe.words(),
        "Ready: lever and stage have found their limit switches."
    )?;
    Ok(())
}

/// Stops whatever is done, and waits until the finger is lifted and the stage stands.
pub async fn stop(probe: &Probe) -> Result<()> {
    match probe.lift().await? {
        Stopped::Lifted => {}
        came => return Err(came.into()),
    }
    writeln!(
        probe.words(),
        "Stopped: the finger is lifted and the stage stands."
    )?;
    Ok(())
}

/// Has the probe explore, and stream its samples meanwhile: with them every slide can be measured again from a log.
pub async fn identify(
    probe: &Probe,
    wanted: Identify,
    each: impl FnMut(&Report) -> io::Result<()>,
) -> Result<Identified> {
    probe.get(Request::command(Command::Stream(true))).await?;
    let identified = probe.run(Request::identify(wanted), each).await?;
    probe.get(Request::command(Command::Stream(false))).await?;
    say::show_identified(&identified, probe.losses(), probe.words())?;
    Ok(identified)
}

/// A texture that the probe has learned.
#[derive(Clone, Debug, Serialize)]
pub struct Learned {
    /// Its name.
    pub name: String,
    /// The probe did not know it before.
    pub is_new: bool,
    /// Slides that were made for it, or that it was taught from.
    pub slides: u32,
    /// Its sample was moved or turned between trials, as the table says it.
    pub sample_moved: Option<bool>,
    /// The reason why the table does not say so, in a sentence.
    #[serde(skip)]
    pub not_noted: Option<String>,
    /// The table in use now.
    #[serde(skip)]
    pub table: Arc<[u8]>,
}

fn name_of(name: &str) -> Result<Name> {
    say::name_of(name).map_err(OperationError::said)
}

/// Names the texture of the last exploration; the probe learns it.
pub async fn teach(probe: &Probe, name: &str) -> Result<Learned> {
    let name = name_of(name)?;
    let before = probe.table().await?;
    let taught = probe.get(Request::label(name)).await?;
    let slides = say::count(taught.slides, "slide");
    let name = taught.name;
    writeln!(probe.words(), "The probe has learned {name} from {slides}.")?;
    learned(probe, &name, taught.slides.into(), &before).await
}

async fn learned(probe: &Probe, name: &str, slides: u32, before: &[u8]) -> Result<Learned> {
    let table = probe.table().await?;
    let read = Table::read(&table)?;
    let texture = read.find(name);
    Ok(Learned {
        is_new: Table::read(before)?.find(name).is_none(),
        slides,
        sample_moved: texture.and_then(|texture| read.moved(texture)),
        not_noted: None,
        name: name.to_string(),
        table,
    })
}

/// Knowledge of a sample between trials.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Deserialize)]
#[serde(from = "Option<bool>")]
pub enum Sample {
    /// Whoever is there is asked to move it.
    #[default]
    Asked,
    /// It is moved, or stays where it is; or nobody knows.
    Noted(Option<bool>),
}

impl From<Option<bool>> for Sample {
    fn from(moved: Option<bool>) -> Self {
        moved.map_or(Self::Asked, |moved| Self::Noted(Some(moved)))
    }
}

/// A training.
#[derive(Clone, PartialEq, Debug, Deserialize)]
pub struct Training {
    /// The texture.
    pub name: String,
    /// Trials of each movement, those of an unfinished training included.
    pub trials: u8,
    /// Make all movements of the grid instead of the table's.
    #[serde(default)]
    pub pilot: bool,
    /// For where on the sample slides begin.
    pub seed: u32,
    /// Knowledge of the sample.
    #[serde(default, rename = "moved")]
    pub sample: Sample,
}

/// Has somebody move the sample before the next trial; true if it was moved.
pub async fn ask_to_move(probe: &Probe, name: &str) -> Result<bool> {
    let question = Question {
        said: String::new(),
        asked: say::move_sample(name),
        kind: QuestionKind::Moved,
    };
    probe.ask(question).await
}

/// Has somebody lay a sample under the finger.
pub async fn ask_to_lay(probe: &Probe, name: &str, kind: QuestionKind) -> Result<bool> {
    let question = Question {
        said: String::new(),
        asked: format!("Lay {name} under the finger"),
        kind,
    };
    probe.ask(question).await
}

/// Has the probe make slides of a texture and learn it.
pub async fn train(probe: &Probe, training: &Training) -> Result<Learned> {
    let (name, trials) = (&name_of(&training.name)?, &training.trials);
    let before = probe.table().await?;
    let table = Table::read(&before)?;
    let movements = match training.pilot {
        true => {
            let status = probe.get(Request::status()).await?;
            pilot_movements(most_mn(status.high_force)).count()
        }
        false => table.movements().len(),
    };
    let asks = training.sample == Sample::Asked;
    let mut samples = Trials::default();
    // trials of before, and somebody who knows whether the sample lies as it did
    if asks && !training.pilot && fewest(table, name).is_some_and(|there| there < *trials) {
        samples.said(Some(ask_to_move(probe, name).await?));
    }
    let noted = table.find(name).and_then(|texture| table.moved(texture));
    let (mut prompts, mut words, mut slides) = (say::Prompts::default(), probe.words(), 0);
    for part in 0.. {
        let wanted = wire::Train {
            name: name.clone(),
            trials: *trials,
            pilot: training.pilot,
            // slides of the next part begin elsewhere, too
            seed: training.seed.wrapping_add(part),
        };
        let each = |report: &Report| {
            say::show_training(report, &mut prompts, &mut words)?;
            let Event::TrainingSlide { left, .. } = report.event else {
                return Ok(ControlFlow::Continue(()));
            };
            let left = usize::from(left);
            if slides == 0 && left + 1 < usize::from(*trials) * movements {
                samples.said(noted);
            }
            slides += 1;
            let ends_trial = left > 0 && left.is_multiple_of(movements);
            Ok(match ends_trial && asks {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            })
        };
        let trained = probe.run_until(Request::train(wanted), each).await?;
        if trained.is_some() {
            break;
        }
        samples.said(Some(ask_to_move(probe, name).await?));
    }
    writeln!(words, "{name}: {} made.", say::count(slides, "slide"))?;
    let mut not_noted = None;
    if slides > 0 {
        if let Sample::Noted(moved) = training.sample {
            samples.said(moved);
        }
        // one trial is moved from nowhere
        let moved = samples.moved().filter(|_| *trials > 1);
        not_noted = note_in_table(probe, name, moved).await?;
        if let Some(why) = &not_noted {
            writeln!(words, "{}", say::not_noted(why))?;
        }
    }
    let learned = Learned {
        not_noted,
        ..learned(probe, name, slides, &before).await?
    };
    if slides > 0 && !training.pilot {
        writeln!(words, "{}", say::of_sample(learned.sample_moved))?;
    }
    Ok(learned)
}

/// Notes in the probe's table how the trials of a texture were made; why that is impossible, in a sentence.
async fn note_in_table(probe: &Probe, name: &str, moved: Option<bool>) -> Result<Option<String>> {
    let noted = noting(&probe.table().await?, name, moved).map_err(OperationError::said)?;
    let noted = match noted {
        Noting::Nothing => return Ok(None),
        Noting::Impossible(why) => return Ok(Some(why.to_owned())),
        Noting::Table(noted) => noted,
    };
    let push = match PushTable::new(&noted) {
        Ok(push) => push,
        Err(why) => return Ok(Some(why.to_string())),
    };
    match probe.get(push).await {
        Ok(()) => Ok(None),
        Err(why) => why.refusal().map(Some).ok_or(why),
    }
}
