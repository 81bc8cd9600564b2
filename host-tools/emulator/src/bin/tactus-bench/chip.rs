//! The bench image on the emulated chip: gives it work, and holds what it finds against the plain kernels on this PC.

use std::collections::HashMap;

use anyhow::{Context as _, bail, ensure};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::features::Plan;
use tactus_core::kernels::Plain;
use tactus_emulator::{Emulator, Options, Setup, cycles};

use crate::workload::{self, Counter, Workload};
use crate::{Cli, Format};

/// What the chip found.
pub(crate) struct Counted {
    pub(crate) instructions: u64,
    pub(crate) cycles: Option<f64>,
    pub(crate) equal: bool,
}

pub(crate) struct Bench {
    emulator: Emulator,
    desk: u64,
    /// Where the chip says that it counts.
    counts: u64,
    /// Functions that samples of what was running fell into.
    running: HashMap<String, usize>,
    plan: Plan,
    overhead: u64,
    pub(crate) source: &'static str,
    /// Whether cycles are estimated, and for whom the functions are told where the time goes.
    pub(crate) model: bool,
    pub(crate) profile: bool,
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

impl Bench {
    pub(crate) fn start(cli: &Cli) -> anyhow::Result<Self> {
        let mut emulator = Emulator::start(&cli.elf, Setup::default(), Options::default())?;
        let (desk, _) = emulator.symbol("BENCH_DESK")?;
        let (counts, _) = emulator.symbol("BENCH_COUNTS")?;
        // the clocks are up by then
        emulator.run_ms(20)?;
        let mut bench = Self {
            emulator,
            desk,
            counts,
            running: HashMap::new(),
            plan: Plan::new(),
            overhead: 0,
            source: "",
            model: false,
            profile: cli.profile,
        };
        bench.overhead = bench.ask(Workload::Nothing, &[], &[])?.0;
        bench.model = cli.format == Format::Text;
        Ok(bench)
    }

    fn word(&mut self, offset: u64) -> anyhow::Result<u32> {
        self.word_at(self.desk + offset)
    }

    fn word_at(&mut self, address: u64) -> anyhow::Result<u32> {
        let bytes = self.emulator.read(address, 4)?;
        Ok(u32::from_le_bytes(bytes.try_into().unwrap_or_default()))
    }

    /// Lets the chip begin with a workload.
    fn begin(&mut self, workload: Workload, table: &[u8], words: &[i16]) -> anyhow::Result<()> {
        ensure!(
            2 * words.len() as u64 <= INPUT_BYTES,
            "more samples than the chip has room for"
        );
        self.emulator.write(TABLE_AT, table)?;
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.emulator.write(self.desk + INPUT, &bytes)?;
        let code = Workload::ALL.iter().position(|w| *w == workload);
        let code = code.context("a workload without a code")? as u32;
        let head = [code, table.len() as u32, words.len() as u32];
        let head: Vec<u8> = head.iter().flat_map(|word| word.to_le_bytes()).collect();
        self.emulator.write(self.desk + WORKLOAD, &head)?;
        let turn = CHIPS_TURN.to_le_bytes();
        Ok(self.emulator.write(self.desk + STATE, &turn)?)
    }

    /// Runs the chip for so long; whether it is done.
    fn step(&mut self, ns: u64) -> anyhow::Result<bool> {
        self.emulator.run_until(self.emulator.now_ns() + ns)?;
        match self.word(STATE)? {
            CHIPS_TURN => Ok(false),
            DONE => Ok(true),
            _ => bail!("the chip does not understand it"),
        }
    }

    /// Instructions of a workload on the chip, and its results.
    fn ask(
        &mut self,
        workload: Workload,
        table: &[u8],
        words: &[i16],
    ) -> anyhow::Result<(u64, Vec<u8>)> {
        self.begin(workload, table, words)?;
        let until = self.emulator.now_ns() + PATIENCE_NS;
        while !self.step(200_000)? {
            ensure!(
                self.emulator.now_ns() < until,
                "the chip does not come to an end"
            );
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
    ) -> anyhow::Result<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(3);
        // 6 ns an instruction
        let lasts_ns = 6 * instructions;
        let (mut samples, mut cycles) = (0, 0);
        self.running.clear();
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
                        let function = self.emulator.function_at(address.into());
                        let function = function.unwrap_or("?").to_owned();
                        *self.running.entry(function).or_default() += 1;
                    }
                    let mean = (lasts_ns / SAMPLES as u64).clamp(60, 20_000);
                    random.random_range(mean / 2..mean * 3 / 2)
                } else {
                    // not over it
                    (lasts_ns / 4).clamp(1000, 100_000)
                };
                if self.step(step)? {
                    break;
                }
            }
        }
        Ok(f64::from(cycles) / samples as f64)
    }

    pub(crate) fn tell_profile(&self, kernel: &str) {
        let mut running: Vec<_> = self.running.iter().collect();
        running.sort_by(|a, b| b.1.cmp(a.1));
        let all: usize = self.running.values().sum();
        eprintln!("{kernel}");
        for (function, samples) in running.iter().take(8) {
            let percent = 100.0 * **samples as f64 / all.max(1) as f64;
            eprintln!("{percent:6.1} %  {function}");
        }
    }

    pub(crate) fn count(
        &mut self,
        workload: Workload,
        table: &[u8],
        words: &[i16],
    ) -> anyhow::Result<Counted> {
        let (instructions, results) = self.ask(workload, table, words)?;
        let mut expected = Vec::new();
        let mut put = |bytes: &[u8]| expected.extend_from_slice(bytes);
        workload::run::<Plain>(workload, &self.plan, table, words, &mut Uncounted, &mut put)
            .context("the workload makes no sense")?;
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
