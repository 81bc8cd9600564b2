//! What only silicon can answer: whether the kernels in assembly give what their plain twins give, how many cycles
//! they take, how long the flash takes to write and to erase, how often the ring of the motor's current turns and a
//! slot begins.
//!
//! It has a runner of its own. The host of `embedded-test` names each test by a semihosting call (SYS_GET_CMDLINE)
//! that the emulated board does not answer, and `defmt-test` ends with the first test that fails, by a panic, which
//! here lifts a lever and starts again. This image makes all checks, prints a line for each over defmt, and leaves by
//! semihosting's exit, which probe-rs hands on. No motor moves.
use core::arch::asm;
use core::fmt::Display;

use cortex_m::peripheral::{DCB, DWT};
use defmt::Display2Format;
use embassy_stm32::flash::Flash;
use embassy_stm32::pac::TIM2;
use embassy_stm32::{peripherals, rcc};
use embassy_time::Timer;
use heapless::Vec;
use static_cell::{ConstStaticCell, StaticCell};
use tactus_core::dsp::Plan;
use tactus_core::sensor::pressure::{RATE_HZ, SLOTS_HZ};

use super::workload::{Counter, Workload, run};
use super::{Cycles, bench, is_wanted};
use crate::board;
use crate::chip::KERNELS;
use crate::chip::current::{CONVERSIONS, Current};

const CORE_HZ: u32 = 168_000_000;

const SAMPLES: usize = 3 * RATE_HZ as usize;
type Words = Vec<i16, SAMPLES>;
const RESULTS: usize = 4096;

/// The work, and the cycles that it takes by the emulator's model (the test `silicon_image` of the emulated board
/// keeps it true).
const CASES: [(&str, Workload, u32); 3] = [
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

#[derive(Default)]
struct Results {
    passed: u32,
    failed: u32,
}

impl Results {
    fn check(&mut self, good: bool, name: &str, measured: impl Display) {
        let measured = Display2Format(&measured);
        if good {
            self.passed += 1;
            defmt::info!("PASS {=str}: {}", name, measured);
        } else {
            self.failed += 1;
            defmt::error!("FAIL {=str}: {}", name, measured);
        }
    }
}

/// Makes all checks, says how they went, and leaves if a debugger is there. To be called once, from thread mode.
pub async fn silicon() {
    if is_wanted() {
        bench();
    }
    let r = board::start();
    // a probe attaches
    Timer::after_millis(20).await;
    defmt::info!("tactus-silicon {=str}", env!("CARGO_PKG_VERSION"));
    // SAFETY: the cycle counter is nobody else's.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    let mut results = Results::default();
    kernels(&mut results);
    slots(&mut results);
    ring(r.current, &mut results);
    flash(r.store, &mut results).await;
    let good = results.failed == 0;
    if good {
        defmt::info!("SILICON PASSED: {=u32} checks", results.passed);
    } else {
        defmt::error!(
            "SILICON FAILED: {=u32} passed, {=u32} failed",
            results.passed,
            results.failed
        );
    }
    // for the probe to read the log
    Timer::after_millis(100).await;
    leave(good);
    core::future::pending().await
}

/// Ends the run of a debugger, with whether all is well; without one it comes back.
fn leave(good: bool) {
    /// SYS_EXIT, and its reasons: the application's end, an error at run time.
    const EXIT: u32 = 0x18;
    let reason: u32 = if good { 0x2_0026 } else { 0x2_0023 };
    if DCB::is_debugger_attached() {
        // SAFETY: a debugger is there to answer; without one it would be a fault.
        unsafe { asm!("bkpt #0xAB", inout("r0") EXIT => _, in("r1") reason) }
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

/// Each workload by the chip's kernels and by the plain ones: the same bytes, in no more cycles than the model allows.
fn kernels(results: &mut Results) {
    static PLANS: StaticCell<[Plan; 2]> = StaticCell::new();
    static WORDS: ConstStaticCell<Words> = ConstStaticCell::new(Words::new());
    static OUTPUTS: ConstStaticCell<[Output; 2]> =
        ConstStaticCell::new([const { Output::new() }; 2]);
    let [plan, plain_plan] = PLANS.init_with(|| [Plan::with(KERNELS), Plan::new()]);
    let words = WORDS.take();
    slide(words);
    let [chips, plains] = OUTPUTS.take();
    for (name, workload, modelled) in CASES {
        let mut cycles = Cycles(0);
        let chip = cortex_m::interrupt::free(|_| chips.run(workload, plan, words, &mut cycles));
        let plain = plains.run(workload, plain_plan, words, &mut Uncounted);
        let is_equal = chip.is_some() && chip == plain;
        let bytes = chip.map_or(0, <[u8]>::len);
        let whose = if is_equal { "as" } else { "other than" };
        results.check(
            is_equal,
            name,
            format_args!("{bytes} bytes, {whose} the plain kernels'"),
        );
        results.check(
            cycles.0 <= modelled / 100 * MODEL_PERCENT,
            "cycles",
            format_args!("{} of {name}, {modelled} by the model", cycles.0),
        );
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

fn judge(results: &mut Results, name: &str, found: Option<u32>, times: u32, each: u32) {
    let Some(found) = found else {
        results.check(false, name, "it does not come");
        return;
    };
    let expected = times * each;
    let off = u64::from(found.abs_diff(expected)) * 1_000_000 / u64::from(expected);
    results.check(
        off <= u64::from(OFF_PPM),
        name,
        format_args!("{found} cycles for {times}, {each} for one are right: {off} ppm off"),
    );
}

/// The timer that starts the slots, as the rig sets it. In this image it is nobody's but this function's.
fn slots(results: &mut Results) {
    rcc::enable_and_reset::<peripherals::TIM2>();
    TIM2.arr().write_value(SLOT_TICKS - 1);
    TIM2.cr1().write(|w| w.set_cen(true));
    let found = cycles_of(SLOTS, || {
        let is_over = TIM2.sr().read().uif();
        if is_over {
            // a flag is cleared by writing 0; 1 leaves it
            TIM2.sr().write(|w| w.0 = !1);
        }
        is_over
    });
    TIM2.cr1().write(|w| w.set_cen(false));
    judge(results, "slot timer", found, SLOTS, SLOT_CYCLES);
}

/// The converter and the DMA of the motor's current.
fn ring(pins: board::Current, results: &mut Results) {
    let mut current = Current::new(pins);
    let found = cycles_of(TURNS, || current.turns());
    judge(results, "current's ring", found, TURNS, RING_CYCLES);
}

/// Writes to a sector that nobody uses, and erases it. What somebody has put there stays.
async fn flash(storage: board::Storage, results: &mut Results) {
    // SAFETY: it is flash, which this function alone writes, and not while it looks at it.
    let words =
        || unsafe { core::slice::from_raw_parts(SECTOR_AT as *const u32, SECTOR as usize / 4) };
    let is_blank = || words().iter().all(|word| *word == u32::MAX);
    if !is_blank() {
        results.check(
            false,
            "flash",
            "sector 23 is not blank, and stays as it is: erase it (81E0000 to 8200000) and try again",
        );
        return;
    }
    let mut region = Flash::new(storage.flash, board::Irqs)
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
    results.check(
        !failed && is_there && longest_us <= WORD_US * WRITE as u32 / 4,
        "flash write",
        format_args!("{each_us} us a word, {longest_us} us for {WRITE} bytes at most; a word may take {WORD_US}"),
    );
    let began = DWT::cycle_count();
    let erased = region.erase(SECTOR_OFFSET, SECTOR_OFFSET + SECTOR).await;
    let took_us = us(began);
    results.check(
        erased.is_ok() && is_blank() && took_us <= ERASE_US,
        "flash erase",
        format_args!("{took_us} us for 128 KB, it may take {ERASE_US}"),
    );
}
