//! Single requests, and which reports answer them.

use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::turning::Turned;
use tactus_core::table::Name;
use tactus_core::wire::{Command, Event, Forget, Identify, Status, TextureLearned, Train, Verdict};

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

/// The result of an exploration.
#[derive(Clone, PartialEq, Debug)]
pub struct Identified {
    /// The verdict.
    pub verdict: Verdict,
    /// Slides that the probe has learned from by itself.
    pub learned: u8,
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
    pub fn write_calibration(calibration: &RigCalibration) -> Result<Self, LinkError> {
        calibration.check()?;
        Ok(Self::command(Command::WriteCalibration(
            calibration.to_bytes(),
        )))
    }
}

impl Request<Status> {
    /// Asks for the status of the probe.
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

impl Request<f32> {
    /// Has a probe measure P_DC under a weight of so many mN: counts above that of the lifted finger.
    pub fn weigh(mn: u16) -> Self {
        Self::new(Command::Weigh(mn), None, |event, answer| {
            if let Event::Weighed { counts, .. } = event {
                *answer = Some(*counts);
            }
            Ok(())
        })
    }
}

impl Request<Turned> {
    /// Has a probe measure gravity along its finger, which a person turns over.
    pub fn turn_over() -> Self {
        Self::new(Command::TurnOver, None, |event, answer| {
            if let Event::Turned {
                g_counts,
                offset_counts,
            } = *event
            {
                *answer = Some(Turned {
                    g_counts,
                    offset_counts,
                });
            }
            Ok(())
        })
    }
}

fn take_calibration(event: &Event, answer: &mut Option<RigCalibration>) -> Result<(), LinkError> {
    if let Event::Calibration(bytes) = event {
        *answer = Some(RigCalibration::from_bytes(bytes)?);
    }
    Ok(())
}

impl Request<Identified> {
    /// Has the probe find out what lies under its finger.
    pub fn identify(how: Identify) -> Self {
        Self::new(Command::Identify(how), None, |event, answer| {
            match (event, answer) {
                (Event::Verdict(verdict), answer) => {
                    *answer = Some(Identified {
                        verdict: verdict.clone(),
                        learned: 0,
                    });
                }
                (Event::TextureLearned(learned), Some(identified)) if learned.itself => {
                    identified.learned = learned.slides;
                }
                _ => {}
            }
            Ok(())
        })
    }
}

impl Request<TextureLearned> {
    /// Gives the probe the label of the last exploration; the outcome is what it has learned from that.
    pub fn label(name: Name) -> Self {
        Self::new(Command::Label(name), None, |event, answer| {
            if let Event::TextureLearned(learned) = event
                && !learned.itself
            {
                *answer = Some(learned.clone());
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
