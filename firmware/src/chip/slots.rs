//! The sensor's slots: SPI1 with its pins, the chip selects, and the timer TIM2, which this module owns wholly.
//!
//! The timer begins a slot every 227 us. What is done in it is the finger's data ([`FingerParts::slots`]): the timer's
//! interrupts begin a transaction, the bus's interrupt ends each of its frames, and nobody waits for either. What does
//! not end in its time is given up when the timer comes next. embassy's driver of the bus has no transfers by its
//! interrupt: it spins for each byte, or takes two DMA streams with an interrupt each for the two bytes of a word.
use core::cell::UnsafeCell;
use core::mem::ManuallyDrop;
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering::Relaxed};

use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::pac::spi::regs::Cr1;
use embassy_stm32::pac::spi::vals::{Br, Dff, Mstr};
use embassy_stm32::pac::{SPI1, TIM2};
use embassy_stm32::{Peri, peripherals, rcc};
use heapless::spsc::Producer;
use tactus_core::sensor::pressure::{Pressure, SLOTS_HZ};
use tactus_core::sensor::slot::{self, Answer, Port, Transaction};
use tactus_core::sensor::{AnyFinger, BadWord, FingerError, FingerParts, GRAVITY_PARTS};

use crate::board::{self, held};
use crate::chip::select::Select;
use crate::chip::slot_plan::{Clock, Plan, SELECTS, SLOT_PLAN, START_CLOCK, Step, TIMER_HZ};
use crate::chip::{self, finger, spi};

/// A sensor word; `None` is a damaged or missing one.
pub(crate) type Word = Option<Pressure>;
pub(crate) const WORDS: usize = 128;

/// 84 MHz / 19 091: 4399.98 slots a second.
const SLOT_TICKS: u32 = (TIMER_HZ + SLOTS_HZ / 2) / SLOTS_HZ;
/// Alternate function of SPI1's pins (data sheet, table 12).
const SPI1_FUNCTION: u8 = 5;
/// CPOL and CPHA are the number of the mode, at the low end of CR1 (RM0090 28.5.1).
const MODE: u32 = 0b11;

/// Slots since boot, those that came too late, and words by what was wrong with them.
pub(crate) static SLOTS: AtomicU32 = AtomicU32::new(0);
pub(crate) static LATE: AtomicU32 = AtomicU32::new(0);
pub(crate) static PARITY: AtomicU32 = AtomicU32::new(0);
pub(crate) static ERROR_FRAMES: AtomicU32 = AtomicU32::new(0);
pub(crate) static LOST: AtomicU32 = AtomicU32::new(0);

/// A frame did not end in three times its time; the bus was set up anew.
pub(crate) struct NoFrame;

pub(crate) struct Bus {
    _spi: Peri<'static, peripherals::SPI1>,
    _pins: [ManuallyDrop<Flex<'static>>; 3],
    selects: [Select; SELECTS],
    /// With the mode of the transaction under way, or of the last one.
    control: Cr1,
    clock: Clock,
    interrupts: bool,
}

/// Cycles for a us of a gap: twice as many, since the emulated core makes a loop of so many in fewer instructions.
const GAP_CYCLES: u32 = 2 * 168;
/// Looks at a frame in its time.
const LOOKS: u32 = 32;

impl Bus {
    /// Takes the bus; no select is low. It is slow enough for all parts, and its frames are bytes.
    pub(crate) fn new(pins: board::Sensor) -> Self {
        let selects = [
            Select::new(pins.select.into()),
            Select::new(pins.select_2.into()),
        ];
        let out = AfType::output(OutputType::PushPull, Speed::VeryHigh);
        // nobody there then reads as FF FF
        let input = AfType::input(Pull::Up);
        let mut led = [held(pins.sck), held(pins.mosi), held(pins.miso)];
        for (pin, how) in led.iter_mut().zip([out, out, input]) {
            pin.set_as_af_unchecked(SPI1_FUNCTION, how);
        }
        let mut control = Cr1::default();
        control.set_mstr(Mstr::MASTER);
        // selects are by software: no mode fault
        control.set_ssm(true);
        control.set_ssi(true);
        control.set_spe(true);
        let mut bus = Self {
            _spi: pins.spi,
            _pins: led,
            selects,
            control,
            clock: START_CLOCK,
            interrupts: false,
        };
        bus.set_clock(START_CLOCK);
        bus
    }

    /// As fast as the finger's parts can be read, for who reads its slots without interrupts.
    pub(crate) fn speed_up(&mut self, parts: &FingerParts) {
        self.set_clock(Clock::of(parts));
    }

    fn set_clock(&mut self, clock: Clock) {
        self.clock = clock;
        self.control.set_br(Br::from_bits(clock.0));
        self.restart();
    }

    fn begin(&mut self, plan: &Plan) {
        self.interrupts = true;
        self.control
            .set_dff(if plan.wide { Dff::BITS16 } else { Dff::BITS8 });
        let [(_, [step, ..]), ..] = &plan.slots;
        self.control.0 = self.control.0 & !MODE | u32::from(step.mode);
        self.set_clock(plan.clock);
    }

    /// Frames are bytes again, and nobody is interrupted by them.
    fn end_slots(&mut self) {
        if core::mem::take(&mut self.interrupts) {
            self.control.set_dff(Dff::BITS8);
            self.restart();
        }
    }

    /// Sets the bus up anew: a disturbance may have switched it off, and what is left in its buffers belongs to no
    /// word.
    fn restart(&mut self) {
        for select in &self.selects {
            select.set(false);
        }
        rcc::enable_and_reset::<peripherals::SPI1>();
        SPI1.cr2().write(|w| w.set_rxneie(self.interrupts));
        SPI1.cr1().write_value(self.control);
    }

    #[inline(always)]
    fn mode(&self) -> u8 {
        (self.control.0 & MODE) as u8
    }

    #[inline(always)]
    fn select(&mut self, port: u8, low: bool) {
        if let Some(select) = self.selects.get(usize::from(port)) {
            select.set(low);
        }
    }

    /// Sets the bus to a mode, by its number; no select is low, and no frame under way. It is off meanwhile (RM0090
    /// 28.3.1).
    #[inline(always)]
    fn set_mode(&mut self, mode: u8) {
        let next = Cr1(self.control.0 & !MODE | u32::from(mode));
        for (control, on) in [(self.control, false), (next, false), (next, true)] {
            let mut control = control;
            control.set_spe(on);
            SPI1.cr1().write_value(control);
        }
        self.control = next;
    }

    /// Does a transaction and waits for it, before the slots begin: for who has nothing else to do. What comes in takes
    /// the place of `bytes`.
    pub(crate) fn transact(
        &mut self,
        port: Option<&Port>,
        transaction: &Transaction,
        bytes: &mut [u8],
    ) -> Result<(), NoFrame> {
        self.set_mode(port.map_or(0, Port::mode_number));
        self.select(transaction.port, true);
        let done = bytes.iter_mut().all(|byte| self.wait_for_byte(byte));
        self.select(transaction.port, false);
        if done {
            return Ok(());
        }
        self.restart();
        Err(NoFrame)
    }

    fn wait_for_byte(&mut self, byte: &mut u8) -> bool {
        let byte_cycles = 2 * self.clock.byte_ticks();
        spi::send(SPI1, (*byte).into());
        chip::wait_cycles(byte_cycles);
        for _ in 0..2 * LOOKS {
            if SPI1.sr().read().rxne() {
                [_, *byte] = spi::received(SPI1).to_be_bytes();
                return true;
            }
            chip::wait_cycles(byte_cycles / LOOKS);
        }
        false
    }
}

struct Slots {
    bus: Bus,
    _timer: Peri<'static, peripherals::TIM2>,
    finger: AnyFinger,
    plan: &'static Plan,
    words: Producer<'static, Word>,
    /// Words were lost: who takes them sees where, as the next one is no good.
    gap: bool,
    begun: u32,
    /// The steps of the slot that are left, the transaction under way first.
    left: &'static [Step],
    /// The bytes of that one which have been sent, or none: it has not begun.
    sent: usize,
    /// When it should begin, and have ended, ticks since the slot began.
    begins: u32,
    ends: u32,
    answer: Answer,
}

struct Shared(UnsafeCell<Option<Slots>>);

// SAFETY: written once, before either interrupt is enabled. Afterwards the handlers of the two alone use it, which have
// one priority: neither interrupts the other.
unsafe impl Sync for Shared {}

static SHARED: Shared = Shared(UnsafeCell::new(None));
/// Whether words are wanted, and whether the timer is set up.
static WANTED: AtomicBool = AtomicBool::new(true);
static SET_UP: AtomicBool = AtomicBool::new(false);

/// Stops the slots, or lets them go on where they stopped. Before they have begun it is heard, too.
pub(crate) fn listen(on: bool) {
    WANTED.store(on, Relaxed);
    pause(false);
}

/// Stops the slots though they are wanted, or lets them go on if they are.
pub(crate) fn pause(on: bool) {
    if SET_UP.load(Relaxed) {
        TIM2.cr1()
            .modify(|w| w.set_cen(!on && WANTED.load(Relaxed)));
    }
}

/// Answers since boot that were no sample, of those that are counted by kind.
pub(crate) fn unreadable() -> u32 {
    let parity = PARITY.load(Relaxed);
    parity.wrapping_add(ERROR_FRAMES.load(Relaxed))
}

/// Gravity along the finger, see [`AnyFinger::gravity`]; beyond all of it before it is known.
static GRAVITY: AtomicI32 = AtomicI32::new(i32::MIN);

pub(crate) fn gravity() -> Option<f32> {
    let parts = GRAVITY.load(Relaxed);
    (parts > i32::MIN).then_some(parts as f32 / GRAVITY_PARTS)
}

/// Begins the slots; to be called once, when the sensor has started. `interrupt`s of SPI1 and TIM2 have one priority.
pub(crate) fn begin(mut bus: Bus, timer: board::Slots, words: Producer<'static, Word>) {
    let name = finger::name();
    let Some(plan) = SLOT_PLAN.get(name as usize) else {
        return;
    };
    bus.begin(plan);
    rcc::enable_and_reset::<peripherals::TIM2>();
    let slots = Slots {
        bus,
        _timer: timer.timer,
        finger: AnyFinger::new(name),
        plan,
        words,
        gap: false,
        begun: 0,
        left: &[],
        sent: 0,
        begins: 0,
        ends: 0,
        answer: Answer::new(),
    };
    // SAFETY: the interrupts are off, and this is called once: `bus` exists once.
    unsafe { *SHARED.0.get() = Some(slots) };
    TIM2.arr().write_value(SLOT_TICKS - 1);
    TIM2.dier().write(|w| {
        w.set_uie(true);
        w.set_ccie(0, true);
    });
    // SAFETY: the handlers are below, their state is ready.
    unsafe {
        interrupt::InterruptExt::enable(interrupt::SPI1);
        interrupt::InterruptExt::enable(interrupt::TIM2);
    }
    // nobody who listens runs before this does
    SET_UP.store(true, Relaxed);
    pause(false);
}

/// P_DC, read without interrupts, which are off for good: for when nothing else works any more. `None`: no finger
/// answers.
pub(crate) fn pdc_by_hand() -> Option<u16> {
    /// A slot of P_DC, of each finger.
    const PDC: u32 = 1;
    // SAFETY: nothing else runs any more.
    let slots = unsafe { &mut *SHARED.0.get() }.as_mut()?;
    slots.bus.end_slots();
    let parts = finger::parts();
    let answer = slot::perform(parts.slot(PDC), |transaction, bytes| {
        let port = parts.ports.get(usize::from(transaction.port));
        let done = slots.bus.transact(port, transaction, bytes);
        chip::wait_cycles(GAP_CYCLES * transaction.gap_us);
        done
    });
    let pressure = slots.finger.decode(PDC, &answer.ok()?).ok()?;
    Some(pressure.counts.get())
}

#[interrupt]
fn TIM2() {
    let flags = TIM2.sr().read();
    // a flag is cleared by writing 0; 1 leaves it
    TIM2.sr().write(|w| w.0 = !flags.0);
    // SAFETY: see `Shared`.
    let Some(slots) = (unsafe { &mut *SHARED.0.get() }) else {
        return;
    };
    let due = if flags.uif() {
        slots.begin();
        true
    } else {
        // a slot may have a single transaction
        flags.ccif(0) && slots.begins > 0 && TIM2.cnt().read() >= slots.begins && slots.next()
    };
    if due {
        slots.transact();
    }
}

#[interrupt]
fn SPI1() {
    // SAFETY: see `Shared`.
    let Some(slots) = (unsafe { &mut *SHARED.0.get() }) else {
        return;
    };
    if SPI1.sr().read().rxne() {
        slots.frame();
    }
}

impl Slots {
    #[inline(always)]
    fn frame_bytes(&self) -> usize {
        1 << u32::from(self.plan.wide)
    }

    #[inline(always)]
    fn begin(&mut self) {
        if let [step, ..] = self.left {
            self.give_up(step);
        }
        let slot = self.begun as usize & self.plan.mask;
        if let Some((steps, all)) = self.plan.slots.get(slot) {
            self.left = all.get(..*steps).unwrap_or_default();
        }
        self.begun = self.begun.wrapping_add(1);
        SLOTS.store(self.begun, Relaxed);
        self.answer.clear();
        self.begins = 0;
    }

    /// The time of the next transaction has come; whether it can begin.
    #[inline(always)]
    fn next(&mut self) -> bool {
        match self.left {
            [step, ..] if self.sent > 0 => {
                self.give_up(step);
                false
            }
            _ => true,
        }
    }

    /// Gives up a transaction that has not ended in its time.
    #[cold]
    fn give_up(&mut self, step: &Step) {
        if self.sent > 0 {
            self.bus.restart();
        }
        if step.answer < step.bytes && self.sent > 0 {
            // an answer that does not come
            match self.finger.decode(self.begun.wrapping_sub(1), &[]) {
                Err(why) => self.damaged(&why),
                Ok(_) => self.lose(),
            }
        } else {
            self.late();
        }
    }

    #[inline(always)]
    fn transact(&mut self) {
        let [step, left @ ..] = self.left else {
            return;
        };
        if self.plan.modes && self.bus.mode() != step.mode {
            self.bus.set_mode(step.mode);
        }
        self.bus.select(step.port, true);
        let [first, ..] = step.out;
        spi::send(SPI1, first);
        self.sent = self.frame_bytes();
        self.ends = self.begins + step.ticks;
        if !left.is_empty() {
            self.begins = self.ends + step.gap_ticks;
            TIM2.ccr(0).write_value(self.begins);
        } else if self.begins > 0 {
            // the sample was taken before: there is time until the next slot
            self.ends = SLOT_TICKS - step.gap_ticks;
        }
    }

    #[inline(always)]
    fn frame(&mut self) {
        let came_in = spi::received(SPI1).to_be_bytes();
        let frame_bytes = self.frame_bytes();
        let [step, left @ ..] = self.left else {
            return;
        };
        // the answer begins with a frame, or in the middle of one
        let before = (usize::from(step.answer) + frame_bytes).saturating_sub(self.sent);
        for byte in came_in.iter().skip(2 - frame_bytes + before) {
            // there is room for the answers of a slot
            let _ = self.answer.push(*byte);
        }
        if self.sent < step.bytes.into() {
            let frame = step.out.get(self.sent >> u32::from(self.plan.wide));
            spi::send(SPI1, frame.copied().unwrap_or_default());
            self.sent += frame_bytes;
            return;
        }
        self.bus.select(step.port, false);
        self.sent = 0;
        self.left = left;
        if TIM2.cnt().read() > self.ends {
            self.late();
        } else if left.is_empty() {
            self.word();
        }
    }

    /// The slot's sample is not where it should be in time: the rest of the slot is left out.
    #[cold]
    fn late(&mut self) {
        LATE.fetch_add(1, Relaxed);
        self.lose();
    }

    #[inline(always)]
    fn word(&mut self) {
        let word = self.finger.decode(self.begun.wrapping_sub(1), &self.answer);
        match word {
            Ok(word) => {
                if let Some(gravity) = self.finger.gravity() {
                    GRAVITY.store(gravity, Relaxed);
                }
                self.put(Some(word));
            }
            Err(why) => self.damaged(&why),
        }
    }

    #[cold]
    fn damaged(&mut self, why: &FingerError) {
        if let Some(kind) = why.kind() {
            let counter = match kind {
                BadWord::Garbled => &PARITY,
                BadWord::Refused | BadWord::Silent => &ERROR_FRAMES,
            };
            counter.fetch_add(1, Relaxed);
        }
        self.lose();
    }

    fn lose(&mut self) {
        self.left = &[];
        self.sent = 0;
        self.put(None);
    }

    #[inline(always)]
    fn put(&mut self, word: Word) {
        self.gap = self
            .words
            .enqueue(if self.gap { None } else { word })
            .is_err();
        if self.gap {
            LOST.fetch_add(1, Relaxed);
        }
    }
}
