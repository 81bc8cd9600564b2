//! The bench inside the silicon image on the emulated chip: gives it work, and holds what it finds against the plain
//! kernels on this PC.

use std::path::Path;

use anyhow::anyhow;
use tactus_core::dsp::Plan;
use tactus_world::world::Setup;

use super::workload::{self, Counter, Workload};
use crate::board::{Emulator, Options};

pub(super) struct Counted {
    pub(super) instructions: u64,
    pub(super) equal: bool,
}

pub(super) struct Bench {
    emulator: Emulator,
    desk: u64,
    plan: Plan,
    overhead: u64,
}

/// The word that has the silicon image serve the bench.
const WANTED: u32 = 0x7ac7_be7c;
/// Offsets in the silicon image's `Desk`.
const STATE: u64 = 0;
const WORKLOAD: u64 = 4;
const INSTRUCTIONS: u64 = 16;
const INPUT: u64 = 24;
const INPUT_BYTES: u64 = 2 * 8192;
const TABLE_AT: u64 = 0x0812_0000;
const CHIPS_TURN: u32 = 1;
const DONE: u32 = 2;
/// Longest that a workload takes, virtual ns.
const PATIENCE_NS: u64 = 60_000_000_000;

/// The plain kernels on this PC are not counted.
struct Uncounted;

impl Counter for Uncounted {
    fn count<T>(&mut self, work: impl FnOnce() -> T) -> T {
        work()
    }
}

fn unsuitable(workload: Workload, what: &str) -> anyhow::Error {
    anyhow!("{workload:?}: {what}")
}

impl Bench {
    pub(super) fn start(elf: &Path) -> anyhow::Result<Self> {
        let mut emulator = Emulator::start(elf, Setup::default(), Options::default())?;
        let (wanted, _) = emulator.symbol("BENCH_WANTED")?;
        emulator.write(wanted, &WANTED.to_le_bytes())?;
        let (desk, _) = emulator.symbol("BENCH_DESK")?;
        // the clocks are up by then
        emulator.run_ms(20)?;
        let mut bench = Self {
            emulator,
            desk,
            plan: Plan::new(),
            overhead: 0,
        };
        bench.overhead = bench.send(Workload::Nothing, &[], &[])?.0;
        Ok(bench)
    }

    fn word(&mut self, offset: u64) -> anyhow::Result<u32> {
        let bytes = self.emulator.read(self.desk + offset, 4)?;
        Ok(u32::from_le_bytes(bytes.try_into().unwrap_or_default()))
    }

    fn begin(&mut self, workload: Workload, table: &[u8], words: &[i16]) -> anyhow::Result<()> {
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
    fn step(&mut self, workload: Workload, ns: u64) -> anyhow::Result<bool> {
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
    ) -> anyhow::Result<(u64, Vec<u8>)> {
        self.begin(workload, table, words)?;
        let until = self.emulator.now_ns() + PATIENCE_NS;
        while !self.step(workload, 200_000)? {
            if self.emulator.now_ns() >= until {
                return Err(unsuitable(workload, "the chip does not come to an end"));
            }
        }
        let instructions = self.word(INSTRUCTIONS)?;
        // even to look twice at the counter takes some
        if instructions == 0 {
            return Err(unsuitable(workload, "the chip's counter stands"));
        }
        let results = self.word(INSTRUCTIONS + 4)?;
        let output = self.desk + INPUT + INPUT_BYTES;
        let results = self.emulator.read(output, results.into())?;
        Ok((instructions.into(), results))
    }

    /// Counts a workload, and holds its results against the plain kernels'.
    pub(super) fn count(
        &mut self,
        workload: Workload,
        table: &[u8],
        words: &[i16],
    ) -> anyhow::Result<Counted> {
        let (instructions, results) = self.send(workload, table, words)?;
        let mut expected = Vec::new();
        let mut put = |bytes: &[u8]| expected.extend_from_slice(bytes);
        workload::run(workload, &self.plan, table, words, &mut Uncounted, &mut put)
            .ok_or_else(|| unsuitable(workload, "its words make no sense"))?;
        let instructions = instructions.saturating_sub(self.overhead);
        Ok(Counted {
            instructions,
            equal: results == expected,
        })
    }
}
