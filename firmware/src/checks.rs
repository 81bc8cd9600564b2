//! Checks of the chip alone, for the image that prints them by defmt and for the one that answers over the link:
//! kernels in assembly against their plain twins, timers, flash. No motor moves.
use core::sync::atomic::AtomicU32;
use core::sync::atomic::Ordering::Relaxed;

use cortex_m::peripheral::DWT;
use embassy_stm32::flash::Flash;
use embassy_stm32::pac::TIM2;
use embassy_stm32::{peripherals, rcc};
use heapless::Vec;
use static_cell::{ConstStaticCell, StaticCell};
use tactus_core::dsp::Plan;
use tactus_core::sensor::pressure::{RATE_HZ, SLOTS_HZ};
use tactus_core::wire::bringup::{self, Checked};

use crate::board;
use crate::chip::KERNELS;
use crate::chip::current::{CONVERSIONS, Current};
use crate::workload::{Counter, Workload, run};

const CORE_HZ: u32 = 168_000_000;

const SAMPLES: usize = 3 * RATE_HZ as usize;
type Words = Vec<i16, SAMPLES>;
const RESULTS: usize = 4096;

/// The work, and the cycles that it takes by the emulator's model (the test `silicon_image` of the emulated board
/// keeps it true).
const CASES: [(&str, Workload, u32); bringup::KERNELS as usize] = [
    ("band power", Workload::BandPower, 503_092),
    ("frame", Workload::Frame, 32_178),
    ("slide", Workload::Slide, 1_439_013),
];
/// A kernel may take so many per cent of what the model says: what the model lacks is to be seen, not to be judged.
const MODEL_PERCENT: u32 = 130;

/// Bank 2's last sector, 128 KB that nobody uses, and where it is in its region of seven such.
const SECTOR_AT: u32 = 0x081E_0000;
const SECTOR: u32 = 128 * 1024;
const SECTOR_OFFSET: u32 = 6 * SECTOR;
/// Writes of as many bytes as the driver programs at a time, by words.
const WRITES: u32 = 64;
const WRITE: usize = 16;
/// The data sheet's limits with 32 bits at a time (table 48: 16 us and 1 s are typical), and 1 % of the driver's for
/// the erase.
const WORD_US: u32 = 100;
const ERASE_US: u32 = 2_020_000;

/// A slot of the sensor, and a ring of conversions, 492 cycles of 84 MHz / 8 each; in cycles of the core.
const SLOT_TICKS: u32 = (84_000_000 + SLOTS_HZ / 2) / SLOTS_HZ;
const SLOT_CYCLES: u32 = 2 * SLOT_TICKS;
const RING_CYCLES: u32 = CONVERSIONS as u32 * 492 * 16;
/// Slots and turns of the ring that are measured, and how far their mean may be off, which is looked for in a loop.
const SLOTS: u32 = 64;
const TURNS: u32 = 8;
const OFF_PPM: u32 = 200;
/// None of them takes longer.
const PATIENCE_CYCLES: u32 = CORE_HZ / 100;

/// Not 0 while something is counted: the emulator's bench looks then what is running.
#[unsafe(no_mangle)]
static BENCH_COUNTS: AtomicU32 = AtomicU32::new(0);

pub(crate) struct Cycles(pub(crate) u32);

impl Counter for Cycles {
    fn count<T>(&mut self, work: impl FnOnce() -> T) -> T {
        BENCH_COUNTS.store(1, Relaxed);
        let begin = DWT::cycle_count();
        let done = work();
        self.0 = DWT::cycle_count().wrapping_sub(begin);
        BENCH_COUNTS.store(0, Relaxed);
        done
    }
}

struct Uncounted;

impl Counter for Uncounted {
    fn count<T>(&mut self, work: impl FnOnce() -> T) -> T {
        work()
    }
}

struct Output {
    bytes: [u8; RESULTS],
    length: usize,
}

impl Output {
    const fn new() -> Self {
        Self {
            bytes: [0; RESULTS],
            length: 0,
        }
    }

    fn run(
        &mut self,
        workload: Workload,
        plan: &Plan,
        words: &[i16],
        counter: &mut impl Counter,
    ) -> Option<&[u8]> {
        self.length = 0;
        let (buffer, length) = (&mut self.bytes, &mut self.length);
        let mut put = |bytes: &[u8]| {
            if let Some(room) = buffer.get_mut(*length..*length + bytes.len()) {
                room.copy_from_slice(bytes);
            }
            *length += bytes.len();
        };
        run(workload, plan, &[], words, counter, &mut put)?;
        self.bytes
            .get(..self.length)
            .filter(|bytes| !bytes.is_empty())
    }
}

/// The kernels, with the memory of their runs.
pub(crate) struct Kernels {
    plans: &'static [Plan; 2],
    words: &'static Words,
    outputs: &'static mut [Output; 2],
}

impl Kernels {
    /// To be called once.
    pub(crate) fn new() -> Self {
        static PLANS: StaticCell<[Plan; 2]> = StaticCell::new();
        static WORDS: ConstStaticCell<Words> = ConstStaticCell::new(Words::new());
        static OUTPUTS: ConstStaticCell<[Output; 2]> =
            ConstStaticCell::new([const { Output::new() }; 2]);
        let words = WORDS.take();
        slide(words);
        Self {
            plans: PLANS.init_with(|| [Plan::with(KERNELS), Plan::new()]),
            words,
            outputs: OUTPUTS.take(),
        }
    }

    /// A workload by the chip's kernels and by the plain ones: the same bytes, in no more cycles than the model allows.
    pub(crate) fn check(&mut self, number: u8) -> Vec<Checked, 2> {
        let Some(&(name, workload, modelled)) = CASES.get(usize::from(number)) else {
            return Vec::new();
        };
        let ([plan, plain_plan], [chips, plains]) = (self.plans, &mut *self.outputs);
        let (mut cycles, words) = (Cycles(0), self.words);
        let chip = cortex_m::interrupt::free(|_| chips.run(workload, plan, words, &mut cycles));
        let plain = plains.run(workload, plain_plan, words, &mut Uncounted);
        let is_equal = chip.is_some() && chip == plain;
        let bytes = chip.map_or(0, <[u8]>::len);
        let whose = if is_equal { "as" } else { "other than" };
        let same = format_args!("{bytes} bytes, {whose} the plain kernels'");
        let counted = format_args!("{} of {name}, {modelled} by the model", cycles.0);
        let quick = cycles.0 <= modelled / 100 * MODEL_PERCENT;
        Vec::from([
            Checked::new(name, is_equal, same),
            Checked::new("cycles", quick, counted),
        ])
    }
}

struct Noise(u32);

impl Noise {
    fn next(&mut self, reach: i16) -> i16 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        ((i32::from(reach) * ((self.0 >> 16) as i32 - 32_768)) >> 15) as i16
    }
}

fn slide(words: &mut Words) {
    let mut noise = Noise(1);
    for at in 0..SAMPLES as i16 {
        let phase = at % 20;
        let triangle = 40 * phase.min(20 - phase) - 200;
        // there is room for all
        let _ = words.push(triangle + noise.next(60));
    }
}

/// Cycles of the core until something has happened so many times; `None` if it takes too long.
fn cycles_of(times: u32, mut happens: impl FnMut() -> bool) -> Option<u32> {
    let mut wait = || {
        let began = DWT::cycle_count();
        while !happens() {
            if DWT::cycle_count().wrapping_sub(began) > PATIENCE_CYCLES {
                return None;
            }
        }
        Some(DWT::cycle_count())
    };
    let began = wait()?;
    let mut ended = began;
    for _ in 0..times {
        ended = wait()?;
    }
    Some(ended.wrapping_sub(began))
}

fn judge(name: &str, found: Option<u32>, times: u32, each: u32) -> Checked {
    let Some(found) = found else {
        return Checked::new(name, false, "it does not come");
    };
    let expected = times * each;
    let off = u64::from(found.abs_diff(expected)) * 1_000_000 / u64::from(expected);
    let good = off <= u64::from(OFF_PPM);
    Checked::new(
        name,
        good,
        format_args!("{found} cycles for {times}, {each} for one are right: {off} ppm off"),
    )
}

/// The timer that starts the slots, as the rig sets it: it is nobody's in these images. Then the converter and the DMA
/// of the motor's current.
pub(crate) fn timers(current: &mut Current) -> Vec<Checked, 2> {
    rcc::enable_and_reset::<peripherals::TIM2>();
    TIM2.arr().write_value(SLOT_TICKS - 1);
    TIM2.cr1().write(|w| w.set_cen(true));
    let is_over = || {
        let is_over = TIM2.sr().read().uif();
        if is_over {
            // a flag is cleared by writing 0; 1 leaves it
            TIM2.sr().write(|w| w.0 = !1);
        }
        is_over
    };
    let slots = cortex_m::interrupt::free(|_| cycles_of(SLOTS, is_over));
    TIM2.cr1().write(|w| w.set_cen(false));
    // it has turned meanwhile
    current.turns();
    let turns = cortex_m::interrupt::free(|_| cycles_of(TURNS, || current.turns()));
    Vec::from([
        judge("slot timer", slots, SLOTS, SLOT_CYCLES),
        judge("current's ring", turns, TURNS, RING_CYCLES),
    ])
}

/// Writes to a sector that nobody uses, and erases it. What somebody has put there stays.
pub(crate) async fn flash(storage: &mut board::Storage) -> Vec<Checked, 2> {
    // SAFETY: it is flash, which this function alone writes, and not while it looks at it.
    let words =
        || unsafe { core::slice::from_raw_parts(SECTOR_AT as *const u32, SECTOR as usize / 4) };
    let is_blank = || words().iter().all(|word| *word == u32::MAX);
    if !is_blank() {
        return Vec::from([Checked::new(
            "flash",
            false,
            "sector 23 is not blank, and stays as it is: erase it (81E0000 to 8200000) and try again",
        )]);
    }
    let mut region = Flash::new(storage.flash.reborrow(), board::Irqs)
        .into_regions()
        .bank2_region3;
    let us = |began: u32| DWT::cycle_count().wrapping_sub(began) / (CORE_HZ / 1_000_000);
    let (mut longest_us, mut all_us, mut failed) = (0, 0, false);
    for write in 0..WRITES {
        let bytes = [write as u8; WRITE];
        let began = DWT::cycle_count();
        let written = region
            .write(SECTOR_OFFSET + write * WRITE as u32, &bytes)
            .await;
        failed |= written.is_err();
        let took_us = us(began);
        longest_us = longest_us.max(took_us);
        all_us += took_us;
    }
    let written = (0..WRITES).flat_map(|write| [[write as u8; 4]; WRITE / 4]);
    let is_there = words()
        .iter()
        .zip(written)
        .all(|(word, bytes)| word.to_le_bytes() == bytes);
    let each_us = all_us / (WRITES * WRITE as u32 / 4);
    let write = Checked::new(
        "flash write",
        !failed && is_there && longest_us <= WORD_US * WRITE as u32 / 4,
        format_args!(
            "{each_us} us a word, {longest_us} us for {WRITE} bytes at most; a word may take {WORD_US}"
        ),
    );
    let began = DWT::cycle_count();
    let erased = region.erase(SECTOR_OFFSET, SECTOR_OFFSET + SECTOR).await;
    let took_us = us(began);
    let erase = Checked::new(
        "flash erase",
        erased.is_ok() && is_blank() && took_us <= ERASE_US,
        format_args!("{took_us} us for 128 KB, it may take {ERASE_US}"),
    );
    Vec::from([write, erase])
}
