//! The bench image on the emulated chip: gives it work, and holds what it finds against the plain kernels on this PC.

use std::path::Path;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus::sim::world::Setup;
use tactus_core::dsp::{Plain, Plan};

use super::error::BenchError;
use super::workload::{self, Counter, Workload};
use crate::board::{Emulator, Options, cycles};

/// What the chip found.
pub(super) struct Counted {
    pub(super) instructions: u64,
    pub(super) cycles: Option<f64>,
    pub(super) equal: bool,
}

pub(super) struct Bench {
    emulator: Emulator,
    desk: u64,
    /// Where the chip says that it counts.
    counts: u64,
    plan: Plan,
    overhead: u64,
    /// Whether cycles are estimated.
    pub(super) model: bool,
}

/// Offsets in the bench image's `Desk`.
const STATE: u64 = 0;
const WORKLOAD: u64 = 4;
const INSTRUCTIONS: u64 = 16;
const INPUT: u64 = 24;
const INPUT_BYTES: u64 = 2 * 8192;
const TABLE_AT: u64 = 0x0812_0000;
const CHIPS_TURN: u32 = 1;
const DONE: u32 = 2;
/// Samples of what is running, of which the cycles are estimated: their error is 1 to 2 %.
const SAMPLES: usize = 2000;
/// Longest that a workload takes, virtual ns.
const PATIENCE_NS: u64 = 60_000_000_000;

/// The plain kernels on this PC are not counted.
struct Uncounted;

impl Counter for Uncounted {
    fn count<T>(&mut self, work: impl FnOnce() -> T) -> T {
        work()
    }
}

fn unsuitable(workload: Workload, what: &'static str) -> BenchError {
    BenchError::Unsuitable {
        kernel: format!("{workload:?}"),
        what,
    }
}

impl Bench {
    /// Boots the bench image. Cycles are estimated once `model` is set.
    pub(super) fn start(elf: &Path) -> Result<Self, BenchError> {
        let mut emulator = Emulator::start(elf, Setup::default(), Options::default())?;
        let (desk, _) = emulator.symbol("BENCH_DESK")?;
        let (counts, _) = emulator.symbol("BENCH_COUNTS")?;
        // the clocks are up by then
        emulator.run_ms(20)?;
        let mut bench = Self {
            emulator,
            desk,
            counts,
            plan: Plan::new(),
            overhead: 0,
            model: false,
        };
        bench.overhead = bench.send(Workload::Nothing, &[], &[])?.0;
        Ok(bench)
    }

    fn word(&mut self, offset: u64) -> Result<u32, BenchError> {
        self.word_at(self.desk + offset)
    }

    fn word_at(&mut self, address: u64) -> Result<u32, BenchError> {
        let bytes = self.emulator.read(address, 4)?;
        Ok(u32::from_le_bytes(bytes.try_into().unwrap_or_default()))
    }

    /// Lets the chip begin with a workload.
    fn begin(&mut self, workload: Workload, table: &[u8], words: &[i16]) -> Result<(), BenchError> {
        if 2 * words.len() as u64 > INPUT_BYTES {
            return Err(unsuitable(
                workload,
                "more samples than the chip has room for",
            ));
        }
        self.emulator.write(TABLE_AT, table)?;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.emulator.write(self.desk + INPUT, &bytes)?;
        let code = Workload::ALL.iter().position(|w| *w == workload);
        let code = code.ok_or_else(|| unsuitable(workload, "it has no code"))? as u32;
        let head = [code, table.len() as u32, words.len() as u32];
        let head: Vec<u8> = head.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.emulator.write(self.desk + WORKLOAD, &head)?;
        let turn = CHIPS_TURN.to_le_bytes();
        Ok(self.emulator.write(self.desk + STATE, &turn)?)
    }

    /// Runs the chip for so long; whether it is done with the workload.
    fn step(&mut self, workload: Workload, ns: u64) -> Result<bool, BenchError> {
        self.emulator.run_until(self.emulator.now_ns() + ns)?;
        match self.word(STATE)? {
            CHIPS_TURN => Ok(false),
            DONE => Ok(true),
            _ => Err(unsuitable(workload, "the chip does not understand it")),
        }
    }

    /// Instructions of a workload on the chip, and its results.
    fn send(
        &mut self,
        workload: Workload,
        table: &[u8],
        words: &[i16],
    ) -> Result<(u64, Vec<u8>), BenchError> {
        self.begin(workload, table, words)?;
        let until = self.emulator.now_ns() + PATIENCE_NS;
        while !self.step(workload, 200_000)? {
            if self.emulator.now_ns() >= until {
                return Err(unsuitable(workload, "the chip does not come to an end"));
            }
        }
        let instructions = self.word(INSTRUCTIONS)?;
        let results = self.word(INSTRUCTIONS + 4)?;
        let output = self.desk + INPUT + INPUT_BYTES;
        let results = self.emulator.read(output, results.into())?;
        Ok((instructions.into(), results))
    }

    /// Cycles that an instruction of a workload takes in the mean, by samples of what is running.
    fn cycles_per_instruction(
        &mut self,
        workload: Workload,
        table: &[u8],
        words: &[i16],
        instructions: u64,
    ) -> Result<f64, BenchError> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        // 6 ns an instruction
        let lasts_ns = 6 * instructions;
        let (mut samples, mut cycles) = (0, 0);
        while samples < SAMPLES {
            self.begin(workload, table, words)?;
            loop {
                let counts = self.word_at(self.counts)? != 0;
                let step = if counts {
                    if let Some(address) = self.emulator.program_counter()? {
                        let code = self.emulator.read(address.into(), 4)?;
                        let half = |at| u16::from_le_bytes([code[at], code[at + 1]]);
                        cycles += cycles::cycles(half(0), half(2));
                        samples += 1;
                    }
                    let mean = (lasts_ns / SAMPLES as u64).clamp(60, 20_000);
                    random.random_range(mean / 2..mean * 3 / 2)
                } else {
                    // not over it
                    (lasts_ns / 4).clamp(1000, 100_000)
                };
                if self.step(workload, step)? {
                    break;
                }
            }
        }
        Ok(f64::from(cycles) / samples as f64)
    }

    /// Counts a workload, and holds its results against the plain kernels'.
    pub(super) fn count(
        &mut self,
        workload: Workload,
        table: &[u8],
        words: &[i16],
    ) -> Result<Counted, BenchError> {
        let (instructions, results) = self.send(workload, table, words)?;
        let mut expected = Vec::new();
        let mut put = |bytes: &[u8]| expected.extend_from_slice(bytes);
        workload::run::<Plain>(workload, &self.plan, table, words, &mut Uncounted, &mut put)
            .ok_or_else(|| unsuitable(workload, "its words make no sense"))?;
        let instructions = instructions.saturating_sub(self.overhead);
        let cycles = if self.model {
            let each = self.cycles_per_instruction(workload, table, words, instructions)?;
            Some(each * instructions as f64)
        } else {
            None
        };
        Ok(Counted {
            instructions,
            cycles,
            equal: results == expected,
        })
    }
}
