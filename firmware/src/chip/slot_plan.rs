//! The transactions of each finger's slots, prepared while compiling for the interrupts of [`super::slots`].
use tactus_core::sensor::pressure::SLOTS_HZ;
use tactus_core::sensor::slot::{Transaction, length_us};
use tactus_core::sensor::{FingerName, FingerParts, SLOWEST_HZ};

/// The timer's clock, and that of the bus before it is divided: both 84 MHz.
pub(super) const TIMER_HZ: u32 = 84_000_000;
/// Ticks of the timer in a us; the core makes two cycles in each.
const US_TICKS: u32 = TIMER_HZ / 1_000_000;
/// A transaction may end so much later than its bytes take, us: by other interrupts, and while they are off. Later, it
/// would leave less than the gap before the next one, or its sample would not be where it should be in time.
const SLACK_US: u32 = 7;
pub(super) const SELECTS: usize = 2;

/// The clock of a bus, by the power of two that it is divided by, less one.
#[derive(Clone, Copy)]
pub(super) struct Clock(pub(super) u8);

impl Clock {
    pub(super) const fn up_to(hz: u32) -> Self {
        let mut divider = 0;
        while TIMER_HZ >> (divider + 1) > hz {
            divider += 1;
        }
        Self(divider)
    }

    /// The fastest one that all parts of a finger can be read with.
    pub(super) const fn of(parts: &FingerParts) -> Self {
        let (mut fastest, mut ports) = (u32::MAX, parts.ports);
        while let [port, others @ ..] = ports {
            let most = *port.clock_hz.end();
            fastest = if most < fastest { most } else { fastest };
            ports = others;
        }
        let clock = Self::up_to(fastest);
        let mut ports = parts.ports;
        while let [port, others @ ..] = ports {
            assert!(*port.clock_hz.start() <= clock.hz());
            ports = others;
        }
        clock
    }

    pub(super) const fn hz(self) -> u32 {
        TIMER_HZ >> (self.0 + 1)
    }

    pub(super) const fn byte_ticks(self) -> u32 {
        8 << (self.0 + 1)
    }
}

/// The clock while the finger is looked for and started: all parts of all fingers can be read with it.
pub(super) const START_CLOCK: Clock = Clock::up_to(SLOWEST_HZ);

/// A transaction as the interrupts do it. The board test `slots` plants mistakes in it, by this layout.
#[derive(Clone, Copy)]
#[repr(C)]
pub(super) struct Step {
    /// Time for the bytes, with the slack, and for the gap behind them.
    pub(super) ticks: u32,
    pub(super) gap_ticks: u32,
    pub(super) out: [u16; FRAMES],
    pub(super) port: u8,
    /// Bytes, and the index of the first one that comes in as the answer.
    pub(super) bytes: u8,
    pub(super) answer: u8,
    /// The part's mode of the bus, by its number.
    pub(super) mode: u8,
}

/// Slots until all begins again, transactions of a slot, and frames of a transaction, of any finger.
const SLOTS_AT_MOST: usize = 4;
const STEPS: usize = 2;
pub(super) const FRAMES: usize = 3;

impl Step {
    const NOTHING: Self = Self {
        ticks: 0,
        gap_ticks: 0,
        out: [0; FRAMES],
        port: 0,
        bytes: 0,
        answer: 0,
        mode: 0,
    };

    const fn of(transaction: &Transaction, parts: &FingerParts, clock: Clock, wide: bool) -> Self {
        let (mut out, mut index, mut rest) = ([0; FRAMES], 0, transaction.out);
        while let [byte, others @ ..] = rest {
            let frame = if wide { index / 2 } else { index };
            out[frame] = out[frame] << 8 | *byte as u16;
            (index, rest) = (index + 1, others);
        }
        assert!(
            (transaction.port as usize) < SELECTS,
            "there is no such chip select"
        );
        Self {
            ticks: index as u32 * clock.byte_ticks() + SLACK_US * US_TICKS,
            gap_ticks: transaction.gap_us * US_TICKS,
            out,
            port: transaction.port,
            bytes: index as u8,
            answer: index as u8 - transaction.answer,
            mode: parts.ports[transaction.port as usize].mode_number(),
        }
    }
}

#[repr(C)]
pub(super) struct Plan {
    /// Each slot: its transactions, and how many of them there are.
    pub(super) slots: [(usize, [Step; STEPS]); SLOTS_AT_MOST],
    /// The slots that there are, less one: their number is a power of two.
    pub(super) mask: usize,
    /// True if all transactions have an even number of bytes, so that frames are of two. One interrupt is then enough
    /// for two bytes.
    pub(super) wide: bool,
    /// True if the parts want different modes of the bus: otherwise it is set up once.
    pub(super) modes: bool,
    pub(super) clock: Clock,
}

impl Plan {
    const fn of(parts: &FingerParts) -> Self {
        let clock = Clock::of(parts);
        let (mut wide, mut slots) = (true, parts.slots);
        while let [slot, others @ ..] = slots {
            let mut rest = *slot;
            while let [transaction, others @ ..] = rest {
                assert!(!transaction.out.is_empty());
                wide &= transaction.out.len().is_multiple_of(2);
                rest = others;
            }
            let byte_ns = 8 * 1_000_000_000_u64.div_ceil(clock.hz() as u64) as u32;
            let us = length_us(slot, byte_ns, SLACK_US);
            assert!(us <= 1_000_000 / SLOTS_HZ, "a slot is too long");
            slots = others;
        }
        let mut plan = Self {
            slots: [(0, [Step::NOTHING; STEPS]); SLOTS_AT_MOST],
            mask: parts.slots.len() - 1,
            wide,
            modes: false,
            clock,
        };
        assert!(parts.slots.len().is_power_of_two());
        let mut at = 0;
        while at < parts.slots.len() {
            let slot = parts.slots[at];
            let mut step = 0;
            while step < slot.len() {
                plan.slots[at].1[step] = Step::of(&slot[step], parts, clock, wide);
                plan.modes |= plan.slots[at].1[step].mode != plan.slots[0].1[0].mode;
                step += 1;
            }
            plan.slots[at].0 = step;
            at += 1;
        }
        plan
    }
}

/// The transactions of each slot of each finger, in RAM: without the data cache (see `board`) each constant that is
/// read from flash takes six cycles more, and a slot reads twenty of them. Board tests look for this name.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".data.SLOT_PLAN")]
pub(super) static SLOT_PLAN: [Plan; FingerName::ALL.len()] = [
    Plan::of(FingerName::ALL[0].parts()),
    Plan::of(FingerName::ALL[1].parts()),
    Plan::of(FingerName::ALL[2].parts()),
];
