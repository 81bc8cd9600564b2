//! Single requests, and which reports answer them.

use tactus_core::rig::calibration::{RigCalibration, RigCalibrationError};
use tactus_core::table::Name;
use tactus_core::wire::{Command, Event, Forget, Identify, Status, Train};

use super::session::LinkError;
use super::transaction::Transaction;

/// One request, and what of the reports is its answer.
#[derive(Clone, Debug)]
pub struct Request<T> {
    command: Option<Command>,
    answer: Option<T>,
    pick: fn(&Event, &mut Option<T>) -> Result<(), LinkError>,
}

impl<T> Transaction for Request<T> {
    type Outcome = T;

    fn next(&mut self) -> Result<Option<Command>, LinkError> {
        Ok(self.command.take())
    }

    fn hear(&mut self, event: &Event) -> Result<(), LinkError> {
        (self.pick)(event, &mut self.answer)
    }

    fn outcome(&mut self) -> Result<T, LinkError> {
        self.answer.take().ok_or(LinkError::NoAnswer)
    }
}

/// What an exploration found.
#[derive(Clone, PartialEq, Debug)]
pub struct Found {
    /// Index of the texture in the probe's table.
    pub texture: u16,
    /// Its name there.
    pub name: Name,
    /// Posterior probability.
    pub probability: f32,
    /// Whether it is over the threshold.
    pub sure: bool,
    /// Whether it is rather none of the textures known; the one named is the most alike.
    pub unknown: bool,
    /// Log-odds of that, where they can be computed.
    pub log_odds: Option<f32>,
    /// Slides that counted.
    pub slides: u8,
    /// Whether the probe would learn from [`Request::label`].
    pub wants_label: bool,
    /// Slides that the probe has learned from by itself.
    pub learned: u8,
}

/// What the probe has learned from a label.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Learned {
    /// Name of the texture.
    pub name: Name,
    /// How many slides.
    pub slides: u8,
}

impl<T> Request<T> {
    fn new(
        command: Command,
        answer: Option<T>,
        pick: fn(&Event, &mut Option<T>) -> Result<(), LinkError>,
    ) -> Self {
        Self {
            command: Some(command),
            answer,
            pick,
        }
    }
}

impl Request<()> {
    /// A request whose end is all there is to know: [`Command::Home`], [`Command::Stream`], ...
    pub fn command(command: Command) -> Self {
        Self::new(command, Some(()), |_, _| Ok(()))
    }

    /// Gives a texture another name.
    pub fn rename(from: Name, to: Name) -> Self {
        Self::command(Command::Rename { from, to })
    }

    /// Has the probe forget a texture, what it learned by itself, or a training.
    pub fn forget(what: Forget) -> Self {
        Self::command(Command::Forget(what))
    }

    /// Has the probe take and keep these constants.
    ///
    /// # Errors
    /// [`LinkError::Calibration`] for constants that cannot be.
    pub fn write_calibration(calibration: &RigCalibration) -> Result<Self, LinkError> {
        calibration.check()?;
        let bytes = calibration.to_bytes();
        // 60 bytes into 64
        Ok(Self::command(Command::WriteCalibration(
            bytes.into_iter().collect(),
        )))
    }
}

impl Request<Status> {
    /// How the probe is.
    pub fn status() -> Self {
        Self::new(Command::Status, None, |event, answer| {
            if let Event::Status(status) = event {
                *answer = Some(status.clone());
            }
            Ok(())
        })
    }
}

impl Request<RigCalibration> {
    /// The constants that the probe uses.
    pub fn read_calibration() -> Self {
        Self::new(Command::ReadCalibration, None, take_calibration)
    }

    /// Has the probe measure its motor's current without load; the constants that it then uses.
    pub fn calibrate() -> Self {
        Self::new(Command::Calibrate, None, take_calibration)
    }
}

fn take_calibration(event: &Event, answer: &mut Option<RigCalibration>) -> Result<(), LinkError> {
    if let Event::Calibration(bytes) = event {
        let bytes = bytes.as_slice().try_into();
        let bytes = bytes.map_err(|_| RigCalibrationError::Damaged)?;
        *answer = Some(RigCalibration::from_bytes(bytes)?);
    }
    Ok(())
}

impl Request<Found> {
    /// Has the probe find out what lies under its finger.
    pub fn identify(how: Identify) -> Self {
        Self::new(Command::Identify(how), None, |event, answer| {
            if let Some(found) = Found::of(event) {
                *answer = Some(found);
            }
            if let (
                Event::TextureLearned {
                    slides,
                    itself: true,
                    ..
                },
                Some(found),
            ) = (event, answer)
            {
                found.learned = *slides;
            }
            Ok(())
        })
    }
}

impl Found {
    /// What a verdict says.
    fn of(event: &Event) -> Option<Self> {
        let Event::Verdict {
            texture,
            ref name,
            probability,
            sure,
            unknown,
            log_odds,
            slides,
            wants_label,
        } = *event
        else {
            return None;
        };
        Some(Self {
            texture,
            name: name.clone(),
            probability,
            sure,
            unknown,
            log_odds,
            slides,
            wants_label,
            learned: 0,
        })
    }
}

impl Request<Learned> {
    /// Gives the probe the label of the last exploration; the outcome is what it has learned from that.
    pub fn label(name: Name) -> Self {
        Self::new(Command::Label(name), None, |event, answer| {
            if let Event::TextureLearned {
                name,
                slides,
                itself: false,
            } = event
            {
                *answer = Some(Learned {
                    name: name.clone(),
                    slides: *slides,
                });
            }
            Ok(())
        })
    }
}

impl Request<u32> {
    /// Has the probe learn what lies under its finger; how many slides it made for that.
    pub fn train(what: Train) -> Self {
        Self::new(Command::Train(what), Some(0), |event, answer| {
            if let Event::TrainingSlide { .. } = event {
                *answer.get_or_insert(0) += 1;
            }
            Ok(())
        })
    }
}
