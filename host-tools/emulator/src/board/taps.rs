//! The rig's part at models whose pins it needs to the nanosecond: TIM1, TIM3, TIM4 and ADC1.

use rigless::device::{Device, DeviceContext, ErasedDevice, Level, RegisterFile, RequestChange};
use rigless::soc::RegisterSpec;
use rigless::soc::stm32f427::generated::{tim2, tim3::Register as TimRegister};
use rigless::soc::stm32f427::peripherals::adc::{self, Adc};
use rigless::soc::stm32f427::peripherals::tim::{Advanced, Channel, General, Tim};
use rigless::time::{EventId, VirtualNanos};

use super::rig::{SharedRig, lock};
use super::wave::Wave;

/// The rig's part at a model.
pub(super) trait Tap<M> {
    /// Before the model is read, written or woken: brings the inputs at its pins up to now.
    fn before(&mut self, _: &mut M, _: &mut RegisterFile, _: &mut DeviceContext<'_>) {}
    /// Something was written, or its clock has changed: before [`Tap::after`].
    fn touched(&mut self, _: VirtualNanos) {}
    /// Its clock is so fast from now on, Hz: before [`Tap::touched`].
    fn clocked(&mut self, _: u64) {}
    /// Returns true if it has to act on its own event now: a timer that does not catches up at the next access.
    fn heeds(&mut self, _: &RegisterFile, _: VirtualNanos) -> bool {
        true
    }
    /// After it: passes on the levels at its pins.
    fn after(&mut self, _: &mut M, _: &RegisterFile, _: VirtualNanos) {}
}

/// A model with the rig on its pins.
#[derive(Debug)]
pub(super) struct Tapped<M, T> {
    pub(super) model: M,
    pub(super) tap: T,
}

impl<M, T: Tap<M>> Tapped<M, T> {
    fn touched(&mut self, registers: &RegisterFile, now: VirtualNanos) {
        self.tap.touched(now);
        self.tap.after(&mut self.model, registers, now);
    }
}

impl<M: ErasedDevice, T: Tap<M>> ErasedDevice for Tapped<M, T> {
    fn layout(&self) -> &'static [RegisterSpec] {
        self.model.layout()
    }

    fn read(
        &mut self,
        row: usize,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        self.tap.before(&mut self.model, registers, context);
        self.model.read(row, registers, context)
    }

    fn peek(&self, row: usize, registers: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        self.model.peek(row, registers, now)
    }

    fn write(
        &mut self,
        row: usize,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.tap.before(&mut self.model, registers, context);
        self.model.write(row, value, registers, context);
        self.touched(registers, context.now());
    }

    fn on_event(
        &mut self,
        event: EventId,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        if !self.tap.heeds(registers, context.now()) {
            return;
        }
        self.tap.before(&mut self.model, registers, context);
        self.model.on_event(event, registers, context);
        self.tap.after(&mut self.model, registers, context.now());
    }

    fn on_request(
        &mut self,
        request: RequestChange,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.model.on_request(request, registers, context);
        self.touched(registers, context.now());
    }

    fn on_clock(&mut self, hz: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.model.on_clock(hz, registers, context);
        self.touched(registers, context.now());
    }

    fn on_clock_input(
        &mut self,
        input: usize,
        hz: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.model.on_clock_input(input, hz, registers, context);
        // timers have one input, and by it rigless drives them
        self.tap.clocked(hz);
        self.touched(registers, context.now());
    }

    fn poll(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.model.poll(registers, context);
    }

    fn reset(&mut self) {
        self.model.reset();
    }

    fn reset_line(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.model.reset_line(registers, context);
        self.touched(registers, context.now());
    }

    fn on_access(
        &mut self,
        token: u64,
        value: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.model.on_access(token, value, registers, context);
    }

    fn on_refused(
        &mut self,
        token: u64,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        self.model.on_refused(token, registers, context);
    }
}

pub(super) fn channel(number: u8) -> Channel {
    Channel::new(number).expect("timers have channels 1 to 4")
}

/// TIM1's channel 1: the lever's STEP.
#[derive(Debug)]
pub(super) struct Step(pub(super) SharedRig);

impl Tap<Tim<Advanced>> for Step {
    fn after(&mut self, tim: &mut Tim<Advanced>, registers: &RegisterFile, now: VirtualNanos) {
        let high = tim.output(channel(1), registers) == Some(Level::High);
        lock(&self.0).step_timer(now.0, high);
    }
}

/// TIM3's channel 1: the stage's PWM. Its duty is that of the shadow registers, which hold for a whole period.
#[derive(Debug)]
pub(super) struct Pwm {
    rig: SharedRig,
    touched: Option<VirtualNanos>,
    period: u64,
    /// Time by which the written values are in force, ns.
    settled: u64,
    /// Of the timer, Hz.
    clock: u64,
}

impl Pwm {
    /// Of a timer as after a reset, which runs by such a clock, Hz.
    pub(super) fn new(rig: SharedRig, clock: u64) -> Self {
        Self {
            rig,
            touched: None,
            period: 0,
            settled: u64::MAX,
            clock,
        }
    }

    /// The timer was reset.
    pub(super) fn restart(&mut self, clock: u64) {
        *self = Self::new(self.rig.clone(), clock);
    }
}

impl Tap<Tim<General>> for Pwm {
    fn touched(&mut self, now: VirtualNanos) {
        self.touched = Some(now);
    }

    fn clocked(&mut self, hz: u64) {
        self.clock = hz;
    }

    /// Its edges would stop the core 40 000 times a second. The firmware waits for them only by DIER, and the duty
    /// changes only at the begin of a period after a write.
    fn heeds(&mut self, registers: &RegisterFile, now: VirtualNanos) -> bool {
        now.0 <= self.settled || registers.get(TimRegister::Dier) != 0
    }

    fn after(&mut self, tim: &mut Tim<General>, registers: &RegisterFile, now: VirtualNanos) {
        let pulse = tim.pulse(channel(1), registers);
        let duty = match &pulse {
            Some(pulse) if pulse.period.0 > 0 => pulse.width.0 as f64 / pulse.period.0 as f64,
            _ => f64::from(u8::from(
                tim.output(channel(1), registers) == Some(Level::High),
            )),
        };
        if let Some(at) = self.touched.take() {
            // the period under way and the next, by the longer of the old and the new; without a pulse every event
            // counts
            let period = pulse.as_ref().map_or(u64::MAX, |pulse| pulse.period.0);
            let longest = period.max(self.period);
            self.settled = at.0.saturating_add(longest.saturating_mul(2));
            self.period = period;
        }
        let wave = pulse.filter(|pulse| pulse.period.0 > 0).map(|_| Wave {
            at_ns: now.0,
            // the model is up to date here: the count is within its period
            count: Device::peek(tim, tim2::Register::Cnt, registers, now).unwrap_or_default(),
            counts: registers.get(TimRegister::Arr) + 1,
            hz: self.clock / (registers.get(TimRegister::Psc) + 1),
        });
        let mut rig = lock(&self.rig);
        rig.stage_duty(now.0, duty);
        rig.stage_wave(wave);
    }
}

/// A time, and the encoder's lines where they change then.
type PinEvent = (u64, Option<(bool, bool)>);

/// TIM4's channels 1 and 2: the stage's encoder. Its edges up to now are counted before every read, each behind the
/// filter of its input: the model's own filter would take edges that are shown late for spikes.
#[derive(Debug)]
pub(super) struct Encoder {
    rig: SharedRig,
    /// Of the timer, Hz.
    clock: u64,
    /// The encoder's lines, the levels at the pins with the time since when, and those behind the filters.
    lines: (bool, bool),
    pins: [(bool, u64); 2],
    shown: [bool; 2],
    now_ns: u64,
}

/// Divider of the timer's clock and number of samples, by ICxF (RM0090 18.4.7).
const FILTERS: [(u64, u64); 16] = [
    (1, 0),
    (1, 2),
    (1, 4),
    (1, 8),
    (2, 6),
    (2, 8),
    (4, 6),
    (4, 8),
    (8, 6),
    (8, 8),
    (16, 5),
    (16, 6),
    (16, 8),
    (32, 5),
    (32, 6),
    (32, 8),
];
/// IC1F and IC2F in CCMR1.
const IC_FILTERS: u64 = 0xF0F0;

impl Encoder {
    pub(super) fn new(rig: SharedRig, clock: u64) -> Self {
        Self {
            rig,
            clock,
            lines: (false, false),
            pins: [(false, 0); 2],
            shown: [false; 2],
            now_ns: 0,
        }
    }

    /// The timer was reset: it believes both lines low, until the next read.
    pub(super) fn restart(&mut self, clock: u64) {
        let now_ns = self.now_ns;
        *self = Self::new(self.rig.clone(), clock);
        self.now_ns = now_ns;
    }

    /// What the pins come to up to now: times, and the encoder's lines where these change.
    fn events(&mut self, now_ns: u64) -> (Vec<PinEvent>, Option<Coupled>) {
        let mut rig = lock(&self.rig);
        rig.advance_to(now_ns);
        let mut events: Vec<_> = std::iter::from_fn(|| rig.next_encoder_lines())
            .map(|(at_ns, lines)| (at_ns.max(self.now_ns), Some(lines)))
            .collect();
        let coupled = rig.coupled();
        if let Some(coupled) = coupled {
            events.extend(
                coupled
                    .edges(self.now_ns, now_ns)
                    .map(|at_ns| (at_ns, None)),
            );
            events.sort_by_key(|(at_ns, _)| *at_ns);
        }
        events.push((now_ns, Some(rig.encoder_lines())));
        (events, coupled)
    }
}

impl Tap<Tim<General>> for Encoder {
    fn clocked(&mut self, hz: u64) {
        self.clock = hz;
    }

    fn before(
        &mut self,
        tim: &mut Tim<General>,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) {
        let now_ns = context.now().0;
        let (events, coupled) = self.events(now_ns);
        let inputs = registers.get(TimRegister::Ccmr1Input);
        let dts = registers.get(TimRegister::Cr1) >> 8 & 3;
        let delays = [4, 12].map(|bit| {
            let (divider, samples) = FILTERS[(inputs >> bit & 15) as usize];
            ((samples * divider) << dts) * 1_000_000_000 / self.clock
        });
        registers.set(TimRegister::Ccmr1Input, inputs & !IC_FILTERS);
        for (at_ns, lines) in events.into_iter().chain([(now_ns, None)]) {
            let mut order = [0, 1];
            order.sort_by_key(|line| self.pins[*line].1 + delays[*line]);
            for line in order {
                let (level, since_ns) = self.pins[line];
                if level != self.shown[line] && since_ns + delays[line] <= at_ns {
                    self.shown[line] = level;
                    tim.drive_input(channel(line as u8 + 1), level.into(), registers, context);
                }
            }
            self.lines = lines.unwrap_or(self.lines);
            let turned = coupled.map_or((false, false), |coupled| coupled.at(at_ns));
            let levels = [self.lines.0 ^ turned.0, self.lines.1 ^ turned.1];
            for (pin, level) in self.pins.iter_mut().zip(levels) {
                if pin.0 != level {
                    *pin = (level, at_ns);
                }
            }
        }
        registers.set(TimRegister::Ccmr1Input, inputs);
        self.now_ns = now_ns;
    }
}

/// Spikes of the stage's bridge on the encoder's lines: each edge of its PWM turns line A for so long, ns, and line B
/// a third of that later, as their wires run side by side.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coupled(pub(super) u64);

impl Coupled {
    /// From one edge of the PWM to the next (chosen: half a period).
    const EVERY_NS: u64 = 24_405;

    fn edges(self, after_ns: u64, until_ns: u64) -> impl Iterator<Item = u64> {
        let periods = after_ns / Self::EVERY_NS..=until_ns / Self::EVERY_NS;
        let offsets = [0, self.0 / 3, self.0, self.0 + self.0 / 3];
        let all = periods.flat_map(move |n| offsets.map(|offset| n * Self::EVERY_NS + offset));
        all.filter(move |at_ns| (after_ns + 1..=until_ns).contains(at_ns))
    }

    /// The lines that are turned.
    fn at(self, ns: u64) -> (bool, bool) {
        let (since, third) = (ns % Self::EVERY_NS, self.0 / 3);
        (since < self.0, (third..third + self.0).contains(&since))
    }
}

/// ADC1's channel 3: the motor's current, at the end of each conversion.
#[derive(Debug)]
pub(super) struct Current(pub(super) SharedRig);

impl Current {
    /// rigless makes code = input x 4095 / reference, both in whole mV: with this reference the input is the code.
    pub(super) const REFERENCE: u32 = 4095;
}

impl Tap<Adc> for Current {
    fn before(&mut self, adc: &mut Adc, _: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let code = lock(&self.0).motor_adc(context.now().0);
        let pa3 = adc::Channel::new(3).expect("the converter has channels 0 to 15");
        adc.set_input(pa3, code.into());
    }
}
