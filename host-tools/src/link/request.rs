//! Single requests, and which reports answer them.

use tactus_core::rig::calibration::{RigCalibration, RigCalibrationError};
use tactus_core::table::Name;
use tactus_core::wire::{Ask, Forget, Identify, Status, Tell, Train};

use super::session::LinkError;
use super::transaction::Errand;

/// One request, and what of the reports is its answer.
#[derive(Clone, Debug)]
pub struct Question<T> {
    ask: Option<Ask>,
    answer: Option<T>,
    pick: fn(&Tell, &mut Option<T>) -> Result<(), LinkError>,
}

impl<T> Errand for Question<T> {
    type Outcome = T;

    fn next(&mut self) -> Result<Option<Ask>, LinkError> {
        Ok(self.ask.take())
    }

    fn hear(&mut self, tell: &Tell) -> Result<(), LinkError> {
        (self.pick)(tell, &mut self.answer)
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
    /// Log-odds of that, where they can be told.
    pub log_odds: Option<f32>,
    /// Slides that counted.
    pub slides: u8,
    /// Whether the probe would learn from [`Question::answer`].
    pub asks: bool,
    /// Slides that the probe has learned from by itself.
    pub learned: u8,
}

/// What the probe has learned from an answer.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Taught {
    /// Name of the texture.
    pub name: Name,
    /// How many slides.
    pub slides: u8,
}

impl<T> Question<T> {
    fn new(
        ask: Ask,
        answer: Option<T>,
        pick: fn(&Tell, &mut Option<T>) -> Result<(), LinkError>,
    ) -> Self {
        Self {
            ask: Some(ask),
            answer,
            pick,
        }
    }
}

impl Question<()> {
    /// A request whose end is all there is to know: [`Ask::Home`], [`Ask::Stream`], ...
    pub fn command(ask: Ask) -> Self {
        Self::new(ask, Some(()), |_, _| Ok(()))
    }

    /// Gives a texture another name.
    pub fn rename(from: Name, to: Name) -> Self {
        Self::command(Ask::Rename { from, to })
    }

    /// Has the probe forget a texture, what it taught itself, or a training.
    pub fn forget(what: Forget) -> Self {
        Self::command(Ask::Forget(what))
    }

    /// Has the probe take and keep these constants.
    ///
    /// # Errors
    /// [`LinkError::Calibration`] for constants that cannot be.
    pub fn write_calibration(calibration: &RigCalibration) -> Result<Self, LinkError> {
        calibration.check()?;
        let bytes = calibration.to_bytes();
        // 60 bytes into 64
        Ok(Self::command(Ask::WriteCalibration(
            bytes.into_iter().collect(),
        )))
    }
}

impl Question<Status> {
    /// How the probe is.
    pub fn status() -> Self {
        Self::new(Ask::Status, None, |tell, answer| {
            if let Tell::Status(status) = tell {
                *answer = Some(status.clone());
            }
            Ok(())
        })
    }
}

impl Question<RigCalibration> {
    /// The constants that the probe uses.
    pub fn read_calibration() -> Self {
        Self::new(Ask::ReadCalibration, None, take_calibration)
    }

    /// Has the probe measure its motor's current without load; the constants that it then uses.
    pub fn calibrate() -> Self {
        Self::new(Ask::Calibrate, None, take_calibration)
    }
}

fn take_calibration(tell: &Tell, answer: &mut Option<RigCalibration>) -> Result<(), LinkError> {
    if let Tell::Calibration(bytes) = tell {
        let bytes = bytes.as_slice().try_into();
        let bytes = bytes.map_err(|_| RigCalibrationError::Damaged)?;
        *answer = Some(RigCalibration::from_bytes(bytes)?);
    }
    Ok(())
}

impl Question<Found> {
    /// Has the probe find out what lies under its finger.
    pub fn identify(how: Identify) -> Self {
        Self::new(Ask::Identify(how), None, |tell, answer| {
            if let Some(found) = Found::of(tell) {
                *answer = Some(found);
            }
            if let (
                Tell::Taught {
                    slides,
                    itself: true,
                    ..
                },
                Some(found),
            ) = (tell, answer)
            {
                found.learned = *slides;
            }
            Ok(())
        })
    }
}

impl Found {
    /// What a verdict says.
    fn of(tell: &Tell) -> Option<Self> {
        let Tell::Verdict {
            texture,
            ref name,
            probability,
            sure,
            unknown,
            log_odds,
            slides,
            asks,
        } = *tell
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
            asks,
            learned: 0,
        })
    }
}

impl Question<Taught> {
    /// Tells the probe what lay under its finger in the last exploration; what it has learned from that.
    pub fn answer(name: Name) -> Self {
        Self::new(Ask::Answer(name), None, |tell, answer| {
            if let Tell::Taught {
                name,
                slides,
                itself: false,
            } = tell
            {
                *answer = Some(Taught {
                    name: name.clone(),
                    slides: *slides,
                });
            }
            Ok(())
        })
    }
}

impl Question<u32> {
    /// Has the probe learn what lies under its finger; how many slides it made for that.
    pub fn train(what: Train) -> Self {
        Self::new(Ask::Train(what), Some(0), |tell, answer| {
            if let Tell::Learned { .. } = tell {
                *answer.get_or_insert(0) += 1;
            }
            Ok(())
        })
    }
}
