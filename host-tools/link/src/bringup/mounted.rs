//! The last steps of a first evening: the rig's firmware runs, and the finger is on its mount.

use tactus_core::explorer::Strategy;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::wire::{Command, Event, Identify, Live, Phase, Report};

use super::judge::Finding;
use super::judge::mounted::{self as judge, SlideSeen};
use super::seams::{Person, Probe, Trouble};
use super::weights;

/// The probe, the person at it, and what is known from earlier steps.
pub struct Mounted<'b> {
    pub(super) probe: &'b mut dyn Probe,
    pub(super) person: &'b mut dyn Person,
    /// Counts and weights in mN of the step `scale`.
    pub(super) weighed: Vec<[f64; 2]>,
    /// Today, as 20261124.
    pub(super) today: u32,
    /// It is a rig's; else a printer moves the finger.
    pub(super) has_motors: bool,
}

impl Mounted<'_> {
    fn answer<T>(
        &mut self,
        command: Command,
        mut pick: impl FnMut(&Report) -> Option<T>,
    ) -> Result<Result<T, String>, Trouble> {
        let mut answer = None;
        let done = self.probe.ask(command, &mut |report| {
            if let Some(picked) = pick(report) {
                answer = Some(picked);
            }
        })?;
        Ok(match (done, answer) {
            (Err(why), _) => Err(why),
            (Ok(()), Some(answer)) => Ok(answer),
            (Ok(()), None) => Err("it says nothing of what it was asked for".to_owned()),
        })
    }

    fn constants(&mut self, command: Command) -> Result<Result<RigCalibration, String>, Trouble> {
        let said = self.answer(command, |report| match &report.event {
            Event::Calibration(bytes) => Some(bytes.clone()),
            _ => None,
        })?;
        Ok(
            said.and_then(|bytes| {
                RigCalibration::from_bytes(&bytes).map_err(|why| why.to_string())
            }),
        )
    }

    pub(super) fn zero(&mut self) -> Result<Finding, Trouble> {
        self.person.done(match self.has_motors {
            true => "Put the finger on its mount and computer paper under it, on the stage; nothing else is near",
            false => "Fix computer paper on the sample's place. The finger hangs lifted, and nothing touches it",
        })?;
        let first = self.constants(Command::Calibrate)?;
        let second = match &first {
            Ok(_) => self.constants(Command::Calibrate)?,
            Err(why) => Err(why.clone()),
        };
        let mut kept = None;
        let points: Vec<(f32, f32)> = self
            .weighed
            .iter()
            .map(|[counts, mn]| (*counts as f32, *mn as f32))
            .collect();
        if let (Ok(mut constants), Ok((mn_per_count, _))) = (second.clone(), weights::line(&points))
        {
            constants.pressure.force_mn_per_count = mn_per_count;
            constants.date = self.today;
            let bytes = constants.to_bytes().as_slice().try_into();
            let bytes = bytes.map_err(|_| Trouble::Unexpected("long constants".to_owned()))?;
            let written = self
                .probe
                .ask(Command::WriteCalibration(bytes), &mut |_| ())?;
            let read = self.constants(Command::ReadCalibration)?;
            kept = Some(
                written
                    .and(read)
                    .map(|read| (mn_per_count, read == constants)),
            );
        }
        Ok(judge::zero(&first, &second, kept.as_ref()))
    }

    pub(super) fn speed(&mut self) -> Result<Finding, Trouble> {
        let mut places: Vec<(u32, Live)> = Vec::new();
        // a phase that goes on from the step before is not told again
        let mut unloaded = true;
        let done = self
            .probe
            .ask(Command::Calibrate, &mut |report| match &report.event {
                Event::Phase(phase) => unloaded = *phase == Phase::Unloaded,
                Event::Live(live) if unloaded => places.push((report.at_ms, *live)),
                _ => {}
            })?;
        Ok(judge::speed(done.err().as_deref(), &places))
    }

    pub(super) fn slide(&mut self) -> Result<Finding, Trouble> {
        let stop = match self.has_motors {
            true => "Press the emergency stop",
            false => "Switch the printer off",
        };
        self.person.watch(&format!(
            "The finger comes down and slides over the paper once. {stop} if it does anything else."
        ))?;
        let mut seen = SlideSeen::default();
        let mut first_ms = None;
        let one = Identify {
            // never sure: the slide is made
            threshold: 1.0,
            max_slides: 1,
            strategy: Strategy::Cycling,
            open: false,
            ..Identify::default()
        };
        let done = self
            .probe
            .ask(Command::Identify(one), &mut |report| match &report.event {
                Event::Chosen { movement, .. } => seen.movement = Some(*movement),
                Event::Live(live) => {
                    let since = report
                        .at_ms
                        .wrapping_sub(*first_ms.get_or_insert(report.at_ms));
                    seen.force.push([f64::from(since), live.force_mn.into()]);
                }
                Event::SlideReport { observed, .. } => seen.observed = Some(observed.clone()),
                Event::Rejected { why, .. } => seen.failed = Some(why.to_string()),
                Event::Fault(fault) => seen.failed = Some(fault.to_string()),
                _ => {}
            })?;
        if let Err(why) = done {
            seen.failed.get_or_insert(why);
        }
        let status = self.answer(Command::Status, |report| match &report.event {
            Event::Status(status) => Some(status.counts),
            _ => None,
        })?;
        match status {
            Ok(counts) => seen.counts = counts,
            Err(why) => seen.failed = Some(why),
        }
        Ok(judge::slide(&seen, self.has_motors))
    }
}
