//! The sensor's slots: SPI1 with its pins, the chip selects, and the timer TIM2, which this module owns wholly.
//!
//! The timer begins a slot every 227 us. What is done in it is the finger's data ([`PressureSensor::SLOTS`]): the timer's interrupts
//! begin a transaction, the bus's interrupt ends each of its frames, and nobody waits for either. What does not end in its time
//! is given up when the timer comes next. embassy's driver of the bus has no transfers by its interrupt: it spins for each
//! byte, or takes two DMA streams with an interrupt each for the two bytes of a word.
use core::cell::UnsafeCell;
use core::mem::ManuallyDrop;
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU32, Ordering::Relaxed};

use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::pac::spi::regs::Cr1;
use embassy_stm32::pac::spi::vals::{Br, Mstr};
use embassy_stm32::pac::{SPI1, TIM2};
use embassy_stm32::{Peri, peripherals, rcc};
use heapless::spsc::Producer;
use tactus_core::sensor::pressure::{Pressure, SLOTS_HZ};
use tactus_core::sensor::slot::{Answer, Port, Transaction, length_us};
use tactus_core::sensor::{BadWord, GRAVITY_PARTS, PressureSensor};

use crate::board::{self, Finger, held};
use crate::chip;
use crate::chip::family::spi;
use crate::chip::select::Select;

/// Why an answer of the finger is no sample.
pub(crate) type FingerError = <Finger as PressureSensor>::Error;

/// A sensor word; `None` is a damaged or missing one.
pub(crate) type Word = Option<Pressure>;
/// Words on their way to the servo: 29 ms.
pub(crate) const WORDS: usize = 128;

/// The timer's clock, and that of the bus before it is divided: both 84 MHz.
const TIMER_HZ: u32 = 84_000_000;
/// The bus: the fastest clock that all parts of the finger can be read with. It is divided by 2 to this power, and 2.
const DIVIDER: u8 = {
    let (mut divider, mut ports) = (0, Finger::PORTS);
    while let [port, others @ ..] = ports {
        while TIMER_HZ >> (divider + 1) > *port.clock_hz.end() {
            divider += 1;
        }
        ports = others;
    }
    divider
};
const SPI_HZ: u32 = TIMER_HZ >> (DIVIDER + 1);
/// Cycles of the core, 168 MHz, in a byte.
const BYTE_CYCLES: u32 = 8 * (2 * TIMER_HZ / SPI_HZ);
/// Ticks of the timer in a byte.
const BYTE_TICKS: u32 = BYTE_CYCLES / 2;
const US_TICKS: u32 = TIMER_HZ / 1_000_000;
/// 84 MHz / 19 091: 4399.98 slots a second.
const SLOT_TICKS: u32 = (TIMER_HZ + SLOTS_HZ / 2) / SLOTS_HZ;
/// A transaction may end so much later than its bytes take, us: by other interrupts, and while they are off. Later, it would
/// leave less than the gap before the next one, or its sample would not be where it should be in time.
const SLACK_US: u32 = 7;

/// Alternate function of SPI1's pins (data sheet, table 12).
const SPI1_FUNCTION: u8 = 5;
/// Chip selects: the board has two.
const SELECTS: usize = Finger::PORTS.len();
/// Whether all parts want the same mode of the bus: then it is set up once.
const ONE_MODE: bool = {
    let (mut one, mut ports) = (true, Finger::PORTS);
    while let [port, others @ ..] = ports {
        one &= port.mode_number() == Finger::PORTS[0].mode_number();
        assert!(*port.clock_hz.start() <= SPI_HZ && SPI_HZ <= *port.clock_hz.end());
        ports = others;
    }
    one
};
/// CPOL and CPHA are the number of the mode, at the low end of CR1 (RM0090 28.5.1).
const MODE: u32 = 0b11;

/// Whether all transactions have an even number of bytes, so that frames can be of two. One interrupt is then enough for two bytes.
const WIDE: bool = {
    let (mut even, mut slots) = (true, Finger::SLOTS);
    while let [slot, others @ ..] = slots {
        let mut rest = *slot;
        while let [transaction, others @ ..] = rest {
            even &= transaction.out.len().is_multiple_of(2) && !transaction.out.is_empty();
            assert!(
                (transaction.port as usize) < SELECTS,
                "there is no such chip select"
            );
            rest = others;
        }
        let byte_ns = 8 * 1_000_000_000_u64.div_ceil(SPI_HZ as u64) as u32;
        let us = length_us(slot, byte_ns, SLACK_US);
        assert!(us <= 1_000_000 / SLOTS_HZ, "a slot is too long");
        slots = others;
    }
    even
};
const FRAME_BYTES: usize = if WIDE { 2 } else { 1 };

/// A transaction as the interrupts do it. The board test `slots` plants mistakes in it, by this layout.
#[derive(Clone, Copy)]
#[repr(C)]
struct Step {
    /// Time for the bytes, with the slack, and for the gap behind them.
    ticks: u32,
    gap_ticks: u32,
    /// What goes out, in frames.
    out: [u16; FRAMES],
    port: u8,
    /// Bytes, and the index of the first one that comes in as the answer.
    bytes: u8,
    answer: u8,
    /// The part's mode of the bus, by its number.
    mode: u8,
}

impl Step {
    const fn of(transaction: &Transaction) -> Self {
        let (mut out, mut index, mut rest) = ([0; FRAMES], 0, transaction.out);
        while let [byte, others @ ..] = rest {
            out[index / FRAME_BYTES] = out[index / FRAME_BYTES] << 8 | *byte as u16;
            (index, rest) = (index + 1, others);
        }
        Self {
            ticks: index as u32 * BYTE_TICKS + SLACK_US * US_TICKS,
            gap_ticks: transaction.gap_us * US_TICKS,
            out,
            port: transaction.port,
            bytes: index as u8,
            answer: index as u8 - transaction.answer,
            mode: Finger::PORTS[transaction.port as usize].mode_number(),
        }
    }
}

/// Slots, the transactions of the longest one, and the frames of the longest of these.
const COUNT: usize = Finger::SLOTS.len();
const STEPS: usize = most().0;
const FRAMES: usize = most().1;

const fn most() -> (usize, usize) {
    let (mut steps, mut frames, mut slots) = (0, 0, Finger::SLOTS);
    while let [slot, others @ ..] = slots {
        if slot.len() > steps {
            steps = slot.len();
        }
        let mut rest = *slot;
        while let [transaction, others @ ..] = rest {
            let these = transaction.out.len().div_ceil(FRAME_BYTES);
            frames = if these > frames { these } else { frames };
            rest = others;
        }
        slots = others;
    }
    (steps, frames)
}

/// What is done in each slot, in RAM: without the data cache (see `board`) each constant that is read from flash takes six cycles
/// more, and a slot reads twenty of them.
#[unsafe(link_section = ".data.SLOT_PLAN")]
static SLOT_PLAN: [(usize, [Step; STEPS]); COUNT] = {
    let nothing = Step::of(&Transaction::first_port(&[], 0, 0));
    let (mut plan, mut at) = ([(0, [nothing; STEPS]); COUNT], 0);
    while at < COUNT {
        let slot = Finger::SLOTS[at];
        let mut step = 0;
        while step < slot.len() {
            plan[at].1[step] = Step::of(&slot[step]);
            step += 1;
        }
        plan[at].0 = step;
        at += 1;
    }
    plan
};

/// Slots since boot, those that came too late, and words by what was wrong with them.
pub(crate) static SLOTS: AtomicU32 = AtomicU32::new(0);
pub(crate) static LATE: AtomicU32 = AtomicU32::new(0);
pub(crate) static PARITY: AtomicU32 = AtomicU32::new(0);
pub(crate) static ERROR_FRAMES: AtomicU32 = AtomicU32::new(0);
pub(crate) static LOST: AtomicU32 = AtomicU32::new(0);

/// A frame did not end in three times its time; the bus was set up anew.
pub(crate) struct NoFrame;

/// The bus and its selects.
pub(crate) struct Bus {
    _spi: Peri<'static, peripherals::SPI1>,
    _pins: [ManuallyDrop<Flex<'static>>; 3],
    selects: [Select; SELECTS],
    control: Cr1,
    /// It was told to say when a frame is over.
    interrupts: bool,
}

/// Looks at a frame in its time.
const LOOKS: u32 = 32;

impl Bus {
    /// Takes the bus; no select is low.
    pub(crate) fn new(pins: board::Sensor) -> Self {
        #[cfg(not(feature = "finger-mems"))]
        let selects = [Select::new(pins.select.into())];
        #[cfg(feature = "finger-mems")]
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
        let mut control = Cr1(if let [port, ..] = Finger::PORTS {
            port.mode_number().into()
        } else {
            0
        });
        control.set_br(Br::from_bits(DIVIDER));
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
            interrupts: false,
        };
        bus.restart();
        bus
    }

    /// Sets the bus up anew: a disturbance may have switched it off, and what is left in its buffers belongs to no word.
    fn restart(&mut self) {
        for select in &self.selects {
            select.set(false);
        }
        rcc::enable_and_reset::<peripherals::SPI1>();
        SPI1.cr2()
            .write_value(spi::second_control(self.interrupts, self.is_wide()));
        SPI1.cr1().write_value(self.control);
    }

    #[inline(always)]
    fn select(&mut self, port: u8, low: bool) {
        if let Some(select) = self.selects.get(usize::from(port)) {
            select.set(low);
        }
    }

    /// Sets the bus to a mode, by its number, where the parts differ in it; no select is low, and no frame under way (RM0090 28.5.1).
    #[inline(always)]
    fn set_mode(&mut self, mode: u8) {
        if !ONE_MODE {
            SPI1.cr1()
                .write_value(Cr1(self.control.0 & !MODE | u32::from(mode)));
        }
    }

    /// Frames are bytes as long as nobody has begun the slots.
    fn is_wide(&self) -> bool {
        WIDE && self.interrupts
    }

    /// Sends a frame, see [`spi::send`].
    fn send(&mut self, frame: u16) {
        spi::send(SPI1, frame, self.is_wide());
    }

    /// The bytes of a frame that is over, in the last places.
    fn received(&mut self) -> [u8; 2] {
        spi::received(SPI1, self.is_wide()).to_be_bytes()
    }

    /// Does a transaction and waits for it, before the slots begin: for who has nothing else to do. What comes in takes the place of
    /// `bytes`.
    pub(crate) fn transact(
        &mut self,
        transaction: &Transaction,
        bytes: &mut [u8],
    ) -> Result<(), NoFrame> {
        let port = Finger::PORTS.get(usize::from(transaction.port));
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
        self.send((*byte).into());
        chip::wait_cycles(BYTE_CYCLES);
        for _ in 0..2 * LOOKS {
            if SPI1.sr().read().rxne() {
                [_, *byte] = self.received();
                return true;
            }
            chip::wait_cycles(BYTE_CYCLES / LOOKS);
        }
        false
    }
}

/// What the two interrupts do.
struct Slots {
    bus: Bus,
    _timer: Peri<'static, peripherals::TIM2>,
    finger: Finger,
    words: Producer<'static, Word>,
    /// Words were lost: who takes them sees where, as the next one is no good.
    gap: bool,
    /// Slots that have begun.
    begun: u32,
    /// What is left to do of the slot, the transaction under way first.
    left: &'static [Step],
    /// The bytes of that one which have been sent, or none: it has not begun.
    sent: usize,
    /// When it should begin, and have ended, ticks since the slot began.
    begins: u32,
    ends: u32,
    answer: Answer,
}

/// Where the two interrupts find it.
struct Shared(UnsafeCell<Option<Slots>>);

// SAFETY: written once, before either interrupt is enabled. Afterwards the handlers of the two alone use it, which have one
// priority: neither interrupts the other.
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

/// Gravity along the finger, see [`PressureSensor::gravity`]; beyond all of it before it is known.
static GRAVITY: AtomicI32 = AtomicI32::new(i32::MIN);

/// Gravity along the finger, counts of P_AC.
pub(crate) fn gravity() -> Option<f32> {
    let parts = GRAVITY.load(Relaxed);
    (Finger::FEELS_GRAVITY && parts > i32::MIN).then_some(parts as f32 / GRAVITY_PARTS)
}

/// Begins the slots; to be called once, when the sensor has started. `interrupt`s of SPI1 and TIM2 have one priority.
pub(crate) fn begin(mut bus: Bus, timer: board::Slots, words: Producer<'static, Word>) {
    bus.interrupts = true;
    spi::set_width(&mut bus.control, WIDE);
    bus.restart();
    rcc::enable_and_reset::<peripherals::TIM2>();
    let slots = Slots {
        bus,
        _timer: timer.timer,
        finger: Finger::default(),
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
    /// A slot begins.
    #[inline(always)]
    fn begin(&mut self) {
        if let [step, ..] = self.left {
            self.give_up(step);
        }
        if let Some((steps, all)) = SLOT_PLAN.get(self.begun as usize % COUNT) {
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

    /// What is under way has not ended in its time.
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
        self.bus.set_mode(step.mode);
        self.bus.select(step.port, true);
        self.bus.send(step.out.first().copied().unwrap_or_default());
        self.sent = FRAME_BYTES;
        self.ends = self.begins + step.ticks;
        if !left.is_empty() {
            self.begins = self.ends + step.gap_ticks;
            TIM2.ccr(0).write_value(self.begins);
        } else if self.begins > 0 {
            // the sample was taken before: there is time until the next slot
            self.ends = SLOT_TICKS - step.gap_ticks;
        }
    }

    /// A frame is over.
    #[inline(always)]
    fn frame(&mut self) {
        let came_in = self.bus.received();
        let [step, left @ ..] = self.left else {
            return;
        };
        // the answer begins with a frame, or in the middle of one
        let before = (usize::from(step.answer) + FRAME_BYTES).saturating_sub(self.sent);
        for byte in came_in.iter().skip(2 - FRAME_BYTES + before) {
            // there is room for the answers of a slot
            let _ = self.answer.push(*byte);
        }
        if self.sent < step.bytes.into() {
            let frame = step.out.get(self.sent / FRAME_BYTES);
            self.bus.send(frame.copied().unwrap_or_default());
            self.sent += FRAME_BYTES;
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

    /// The slot is over, and has its answer.
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
        if let Some(kind) = Finger::kind(why) {
            let counter = match kind {
                BadWord::Garbled => &PARITY,
                BadWord::Refused | BadWord::Silent => &ERROR_FRAMES,
            };
            counter.fetch_add(1, Relaxed);
        }
        self.lose();
    }

    /// The slot is over, without a word.
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
