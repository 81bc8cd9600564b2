//! The view of a probe: its host in the simulation.

use std::cell::Cell;
use std::time::Duration;

use tactus_core::probe::RigState;
use tactus_core::rig::{Phase, RigError};
use tactus_core::wire::Event;

use super::message::{Frame, Happening};
use super::monitor::{ProbeMonitor, Received};
use crate::sim::probe::Host;
use crate::sim::rig::SimRig;
use tactus_world::world::Truth;

const PDC_MS: u64 = 10;

#[derive(Default)]
pub(super) struct Scene {
    /// The time at which it stands still; `None`: it does not.
    pub(super) until: Option<Duration>,
    pub(super) waits: Cell<bool>,
    texture: Option<u8>,
    pub(super) wear: Option<f64>,
    pub(super) stop: bool,
    pub(super) monitor: ProbeMonitor,
    now: Duration,
    phase: Phase,
    truth: Truth,
    pdc: Vec<u16>,
    pub(super) busy: bool,
}

impl Scene {
    pub(super) fn now(&self) -> Duration {
        self.now
    }

    pub(super) fn texture(&self) -> u8 {
        self.truth.texture
    }

    /// Another texture is to be put under the finger, which was `lifted` for that.
    pub(super) fn place(&mut self, texture: u8, lifted: Result<(), RigError>) {
        match lifted {
            Ok(()) => self.texture = Some(texture),
            Err(why) => self.monitor.happens(Happening::Refused {
                why: why.to_string(),
            }),
        }
    }

    pub(super) fn frame(&mut self) -> Frame {
        let Truth {
            tip_mm,
            indentation_mm,
            stage_mm,
            speed_mm_s,
            force_n,
            shear_n,
            texture,
            wear,
            ..
        } = self.truth;
        let Received {
            pac,
            spectra,
            happened,
        } = self.monitor.take();
        Frame {
            at_ms: self.now.as_millis() as u64,
            busy: self.busy,
            phase: self.phase.into(),
            tip_mm,
            indentation_mm,
            stage_mm,
            speed_mm_s,
            force_n,
            shear_n,
            texture,
            wear: self.wear.unwrap_or(wear),
            pac,
            pdc: std::mem::take(&mut self.pdc),
            spectra,
            happened,
        }
    }
}

impl Host for Scene {
    fn tell(&mut self, event: Event) {
        self.monitor.hear(event);
    }

    fn tick(&mut self, now: Duration, rig: &RigState) {
        self.now = now;
        if let (Phase::Faulted(fault), true) = (rig.phase, rig.phase != self.phase) {
            self.monitor.happens(Happening::Refused {
                why: fault.to_string(),
            });
        }
        self.phase = rig.phase;
    }

    fn look(&mut self, rig: &mut SimRig) {
        if let Some(texture) = self.texture.take()
            && let Err(why) = rig.place(texture)
        {
            let why = why.to_string();
            self.monitor.happens(Happening::Refused { why });
        }
        if let Some(wear) = self.wear
            && rig.world().put_on_skin(wear).is_ok()
        {
            self.wear = None;
        }
        if (self.now.as_millis() as u64).is_multiple_of(PDC_MS) {
            self.pdc.extend(rig.pdc().last());
        }
        self.truth = rig.world().truth();
    }

    fn pauses(&self) -> bool {
        let pauses = self.until.is_some_and(|until| self.now >= until);
        if pauses {
            self.waits.set(true);
        }
        pauses
    }

    fn stops(&mut self) -> bool {
        self.stop
    }

    fn is_stopped(&self) -> bool {
        self.stop
    }

    fn streams(&self) -> bool {
        true
    }
}
