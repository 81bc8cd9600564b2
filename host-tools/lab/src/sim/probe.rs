//! A whole probe in software: the simulated rig and a store in RAM under the core's own [`Probe`], in virtual time.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::time::Duration;

use embassy_futures::{block_on, yield_now};
use tactus_core::dsp::Plan;
use tactus_core::probe::seams::{Events, StoredBytes};
use tactus_core::probe::servo_rig::{LOOK_MS, RigCommand, Samples, Servo, ServoRig};
use tactus_core::probe::{self, Memory, Probe, RigState, TableInUse};
use tactus_core::rig::pins::Outputs;
use tactus_core::rig::{Ended, Refused};
use tactus_core::sensor::FingerCode;
use tactus_core::store::{Store, StoreError};
use tactus_core::wire::Event;

use super::flash::RamFlash;
use super::over_link::{ArmRig, Mover};
use super::rig::SimRig;

/// The other end of a simulated probe.
pub trait Host {
    /// Takes an event of the probe.
    fn tell(&mut self, event: Event);

    /// Takes the table that is in force now.
    fn table(&mut self, _table: TableInUse) {}

    /// Takes the level of the go / no-go output.
    fn go(&mut self, _on: bool) {}

    /// Takes the time by the rig's clock, and its state: called a thousand times a second.
    fn tick(&mut self, _now: Duration, _rig: &RigState) {}

    /// Our rig before each millisecond, for a host that looks at its world or changes it.
    fn look(&mut self, _rig: &mut SimRig) {}

    /// Returns true if time stands still: tasks that wait for the rig keep waiting until a later poll finds false.
    fn pauses(&self) -> bool {
        false
    }

    /// Returns true if the rig is to be stopped in this millisecond.
    fn stops(&mut self) -> bool {
        false
    }

    /// Returns true if no further part of the request may begin.
    fn is_stopped(&self) -> bool {
        false
    }

    /// Returns true if raw samples are wanted.
    fn streams(&self) -> bool {
        false
    }
}

/// A simulated rig that a servo drives: ours, or one that an arm moves.
pub trait Driven {
    /// See [`Servo::has_stage`].
    const HAS_STAGE: bool;

    /// Its finger.
    fn finger(&self) -> FingerCode {
        FingerCode::BIOTAC
    }

    /// A millisecond passes.
    fn tick(&mut self) -> &Outputs;

    /// Takes the end of the last movement; `None` the second time.
    fn take_ended(&mut self) -> Option<Ended>;

    /// Its state, as a probe shows it.
    fn state(&mut self, ended: Option<Ended>) -> RigState;

    /// Virtual time since power-up.
    fn now(&self) -> Duration;

    /// Gives it a command, which it may refuse.
    fn command(&mut self, command: RigCommand) -> Result<(), Refused>;

    /// Stops the command.
    fn stop(&mut self);

    /// Ends the slide early.
    fn end_slide(&mut self) {}

    /// See [`Servo::gravity`].
    fn gravity(&self) -> Option<f32> {
        None
    }

    /// Lets the host look at it before each millisecond, if it is what [`Host::look`] is for.
    fn show(&mut self, _host: &mut impl Host) {}
}

impl Driven for SimRig {
    const HAS_STAGE: bool = true;

    fn tick(&mut self) -> &Outputs {
        Self::tick(self)
    }

    fn take_ended(&mut self) -> Option<Ended> {
        self.control().take_ended()
    }

    fn state(&mut self, ended: Option<Ended>) -> RigState {
        Self::state(self, ended)
    }

    fn now(&self) -> Duration {
        Self::now(self)
    }

    fn command(&mut self, command: RigCommand) -> Result<(), Refused> {
        command.apply(self.control())
    }

    fn stop(&mut self) {
        self.control().stop();
    }

    fn end_slide(&mut self) {
        self.control().end_slide();
    }

    fn gravity(&self) -> Option<f32> {
        Self::gravity(self)
    }

    fn show(&mut self, host: &mut impl Host) {
        host.look(self);
    }
}

impl<M: Mover> Driven for ArmRig<M> {
    const HAS_STAGE: bool = false;

    fn finger(&self) -> FingerCode {
        Self::finger(self)
    }

    fn tick(&mut self) -> &Outputs {
        Self::tick(self)
    }

    fn take_ended(&mut self) -> Option<Ended> {
        self.rig().take_ended()
    }

    fn state(&mut self, ended: Option<Ended>) -> RigState {
        Self::state(self, ended)
    }

    fn now(&self) -> Duration {
        Self::now(self)
    }

    fn command(&mut self, command: RigCommand) -> Result<(), Refused> {
        command.apply_over_link(self.rig())
    }

    fn stop(&mut self) {
        self.rig().stop();
    }
}

/// The servo of a simulated rig: virtual time passes while a task waits for it.
pub struct SimServo<'p, H, R = SimRig> {
    rig: R,
    host: &'p RefCell<H>,
    ended: Option<Ended>,
    state: RigState,
    samples: VecDeque<Samples>,
}

impl<'p, H: Host, R: Driven> SimServo<'p, H, R> {
    fn new(mut rig: R, host: &'p RefCell<H>) -> Self {
        Self {
            state: rig.state(None),
            rig,
            host,
            ended: None,
            samples: VecDeque::new(),
        }
    }

    /// The rig: its world, its clock.
    pub fn rig(&mut self) -> &mut R {
        &mut self.rig
    }

    /// A millisecond passes.
    pub fn tick(&mut self) {
        self.rig.show(&mut *self.host.borrow_mut());
        if self.host.borrow_mut().stops() {
            self.rig.stop();
        }
        let samples = &mut self.samples;
        Samples::of(self.rig.tick(), |part| samples.push_back(part));
        if let Some(ended) = self.rig.take_ended() {
            self.ended = Some(ended);
        }
        self.state = self.rig.state(self.ended);
        self.host.borrow_mut().tick(self.rig.now(), &self.state);
    }
}

impl<H: Host, R: Driven> Servo for SimServo<'_, H, R> {
    fn has_stage(&self) -> bool {
        R::HAS_STAGE
    }

    async fn command(&mut self, command: RigCommand) -> Result<(), Refused> {
        self.ended = None;
        let answer = self.rig.command(command);
        self.tick();
        answer
    }

    async fn wait(&mut self) {
        let before = self.ended;
        for _ in 0..LOOK_MS {
            while self.host.borrow().pauses() {
                yield_now().await;
            }
            self.tick();
            if self.ended != before {
                return;
            }
        }
    }

    fn state(&self) -> RigState {
        self.state
    }

    fn samples(&mut self) -> Option<Samples> {
        self.samples.pop_front()
    }

    fn gravity(&self) -> Option<f32> {
        self.rig.gravity()
    }

    fn lost(&self) -> u32 {
        0
    }

    fn stop(&mut self) {
        self.rig.stop();
    }

    fn end_slide(&mut self) {
        self.rig.end_slide();
    }

    fn is_stopped(&self) -> bool {
        self.host.borrow().is_stopped()
    }

    fn streams(&self) -> bool {
        self.host.borrow().streams()
    }

    fn tell(&mut self, event: Event) {
        self.host.borrow_mut().tell(event);
    }
}

/// The stored table, copied out of the flash.
#[derive(Debug, Default)]
pub struct TableCopy(Vec<u8>, FingerCode);

impl<const S: usize> StoredBytes<RamFlash<S>> for TableCopy {
    fn finger(&self) -> FingerCode {
        self.1
    }

    fn bytes(&mut self, store: &mut Store<RamFlash<S>>) -> Option<&[u8]> {
        self.0.resize(Store::<RamFlash<S>>::MAX_TABLE, 0);
        let table = block_on(store.read_table(&mut self.0)).ok()??;
        Some(table.as_bytes())
    }
}

/// Passes events to the host.
pub struct HostSink<'p, H>(&'p RefCell<H>);

impl<H: Host> Events for HostSink<'_, H> {
    fn tell(&mut self, event: Event) {
        self.0.borrow_mut().tell(event);
    }

    fn table(&mut self, table: TableInUse) {
        self.0.borrow_mut().table(table);
    }

    fn go(&mut self, on: bool) {
        self.0.borrow_mut().go(on);
    }
}

/// A simulated probe.
pub type SimProbe<'p, H, R = SimRig> =
    Probe<'p, ServoRig<SimServo<'p, H, R>>, RamFlash, TableCopy, HostSink<'p, H>>;

/// Switches a probe on: `rig` has found its switches, `flash` is as an earlier life left it, `factory` is the table
/// that comes with the firmware. `buffer` takes the longest table.
/// Errors: the flash is too small for a store. Other faults in it are reported to the host, as by the firmware.
pub fn switch_on<'p, H: Host, R: Driven>(
    rig: R,
    flash: RamFlash,
    factory: &'p [u8],
    buffer: &'p mut [u8],
    plan: &'p Plan,
    host: &'p RefCell<H>,
) -> Result<SimProbe<'p, H, R>, StoreError> {
    let copy = TableCopy(Vec::new(), rig.finger());
    let mut rig = ServoRig::new(SimServo::new(rig, host));
    let mut store = block_on(Store::open(flash))?;
    for done in [
        block_on(store.mend()),
        block_on(probe::restore(&mut store, &mut rig)),
    ] {
        if let Err(why) = done {
            host.borrow_mut().tell(Event::Trouble(why.into()));
        }
    }
    let mut probe = Probe {
        rig,
        memory: Memory::new(Ok(store), copy, factory, buffer),
        events: HostSink(host),
        plan,
    };
    block_on(probe.memory.reload(&mut probe.events));
    Ok(probe)
}

/// Takes the power from a probe for a moment: it keeps the contents of its flash only. Its rig stays as it is.
pub fn switch_off_and_on<H: Host, R: Driven>(
    probe: SimProbe<'_, H, R>,
) -> Result<SimProbe<'_, H, R>, StoreError> {
    switch_off_changed_and_on(probe, &[])
}

/// The same, and these bits of its flash change meanwhile.
pub(crate) fn switch_off_changed_and_on<'p, H: Host, R: Driven>(
    probe: SimProbe<'p, H, R>,
    bits: &[usize],
) -> Result<SimProbe<'p, H, R>, StoreError> {
    let Probe {
        rig, memory, plan, ..
    } = probe;
    let (store, factory, buffer) = memory.close();
    let mut flash = store.map_or_else(|_| RamFlash::blank(), Store::close);
    for bit in bits {
        if let Some(byte) = flash.bytes.get_mut(bit / 8) {
            *byte ^= 1 << (bit % 8);
        }
    }
    let SimServo { rig, host, .. } = rig.servo;
    switch_on(rig, flash, factory, buffer, plan, host)
}
