//! The core's pipeline: cycles of one instruction after the other.

use super::accelerator::Accelerator;
use super::instruction::{Access, Address, Branch, Instruction};

/// Cycles in which the pipeline is filled anew, of the manual's 1 to 3: the target is fetched early if the instruction
/// has it, and takes a cycle more if it is of 32 bits across two words.
const REFILL_DIRECT: u64 = 1;
const REFILL_INDIRECT: u64 = 2;
/// Into an exception's handler, back from it, and from one to the next.
const ENTRY: u64 = 12;
const RETURN: u64 = 10;
const TAIL_CHAIN: u64 = 6;
/// Of the entry, nine cycles put registers on the stack; meanwhile the vector is read and the handler's first
/// instruction fetched, which take six and their waits (ARM's article 103489845 on interrupt latency).
const ENTRY_HIDES: u64 = 9 - 6;
/// S0 to S15 and FPSCR, put aside at the first instruction of a handler for the FPU, and brought back at its end.
const FLOATS: u64 = 17;

/// The flash, and where it is seen after a boot from it.
const FLASH: std::ops::Range<u32> = 0x0800_0000..0x0820_0000;
const ALIAS: std::ops::Range<u32> = 0..0x0020_0000;
/// The buses of peripherals at 42 and at 84 MHz, and those at the core's clock.
const APB1: std::ops::Range<u32> = 0x4000_0000..0x4001_0000;
const APB2: std::ops::Range<u32> = 0x4001_0000..0x4002_0000;
const AHB: std::ops::Range<u32> = 0x4002_0000..0x6000_0000;
/// Waits for an access there: two cycles of the bus, and up to one until it begins. On the core's own clock, one.
const APB1_WAIT: u64 = 3 * 4;
const APB2_WAIT: u64 = 3 * 2;
const AHB_WAIT: u64 = 1;

fn is_flash(address: u32) -> bool {
    FLASH.contains(&address) || ALIAS.contains(&address)
}

/// An instruction that was executed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Executed {
    /// Its address.
    pub at: u32,
    /// Its halves; of a short one, with the next half behind it.
    pub code: [u16; 2],
    /// The address of the next one.
    pub next: u32,
    /// The address that it read or wrote, if known. The address of a literal may be left out.
    pub data: Option<u32>,
}

/// The effects of the last instruction on the next one.
#[derive(Clone, Copy, Default, Debug)]
struct Before {
    /// It loaded this register of the core.
    loads: Option<u8>,
    /// It computed this one of the FPU.
    float: Option<u8>,
    /// It branched.
    branched: bool,
}

/// A core that has executed instructions so far.
#[derive(Clone, Debug)]
pub struct Core {
    flash: Accelerator,
    cycles: u64,
    before: Before,
    /// The first cycle in which the store under way lets another access of the data buses begin.
    drained: u64,
    /// For each handler that runs, whether it has used the FPU.
    handlers: Vec<bool>,
}

impl Core {
    /// In thread mode, with such a flash.
    pub fn new(flash: Accelerator) -> Self {
        Self {
            flash,
            cycles: 0,
            before: Before::default(),
            drained: 0,
            handlers: Vec::new(),
        }
    }

    /// Cycles of all that it executed.
    pub fn cycles(&self) -> u64 {
        self.cycles
    }

    fn fetch(&mut self, address: u32) {
        if is_flash(address) {
            self.cycles += self.flash.fetch(address, self.cycles);
        }
    }

    /// Executes an instruction; its cycles.
    pub fn execute(&mut self, executed: &Executed) -> u64 {
        self.run(executed, Instruction::decode(executed.code))
    }

    /// Executes an instruction that is decoded already.
    pub(super) fn run(&mut self, executed: &Executed, instruction: Instruction) -> u64 {
        let began = self.cycles;
        self.fetch(executed.at);
        self.fetch(executed.at + instruction.length - 2);
        if self.before.branched && instruction.length == 4 && !executed.at.is_multiple_of(4) {
            self.cycles += 1;
        }
        if let Some(float) = instruction.float {
            let is_awaited = |source: &Option<u8>| source.is_some() && *source == self.before.float;
            if float.sources.iter().any(is_awaited) {
                self.cycles += 1;
            }
            if let Some(used @ false) = self.handlers.last_mut() {
                *used = true;
                self.cycles += FLOATS;
            }
        }
        if instruction.drains {
            self.drain();
        }
        let access = instruction.access.as_ref();
        let follows_load = access.is_some_and(|access| self.is_pipelined(access, &instruction));
        // the address goes out in the first cycle, the data come in the next
        let issued = self.cycles + 1;
        self.cycles += u64::from(instruction.cycles) - u64::from(follows_load);
        if let Some(access) = access {
            let waits = self.wait(executed, access, issued);
            if access.is_load {
                self.cycles += waits;
            } else {
                // the last word waits in the write buffer
                let last = waits / u64::from(access.words.max(1));
                self.cycles += waits - last;
                self.drained = self.cycles + last;
            }
        }
        let branched = executed.next != executed.at + instruction.length;
        if branched {
            self.cycles += match instruction.branch {
                Branch::Direct => REFILL_DIRECT,
                Branch::Indirect => REFILL_INDIRECT,
                Branch::No => 0,
            };
        }
        self.before = Before {
            branched,
            loads: instruction.loads,
            float: instruction.float.and_then(|float| float.result),
        };
        self.cycles - began
    }

    /// Waits until the write buffer is empty.
    fn drain(&mut self) {
        self.cycles = self.cycles.max(self.drained);
    }

    /// Returns true if it shares a cycle with the load before it: its address does not depend on that load's value.
    fn is_pipelined(&self, access: &Access, instruction: &Instruction) -> bool {
        let Some(loaded) = self.before.loads else {
            return false;
        };
        let depends = match access.address {
            Address::Literal(_) => false,
            Address::Based { base, .. } => base == loaded,
            Address::Indexed { base, index, .. } => base == loaded || index == loaded,
        };
        let is_single = access.words == 1 && instruction.branch == Branch::No;
        is_single && instruction.cycles > 1 && !depends
    }

    /// Cycles that a load or store waits for memory. A store's last word does so in the write buffer (one entry, for
    /// the data buses of code and system, ARM DDI 0337 3.5 and 100166 3.3.2): peripherals are device memory, which is
    /// buffered (ARM DDI 0403 B3.1).
    fn wait(&mut self, executed: &Executed, access: &Access, issued: u64) -> u64 {
        let address = match access.address {
            Address::Literal(offset) => Some(literal(executed.at, offset)),
            _ => executed.data,
        };
        let Some(address) = address else { return 0 };
        let one = |wait| wait * u64::from(access.words);
        if APB1.contains(&address) {
            one(APB1_WAIT)
        } else if APB2.contains(&address) {
            one(APB2_WAIT)
        } else if AHB.contains(&address) {
            one(AHB_WAIT)
        } else if is_flash(address) && access.is_load {
            let words = (0..access.words).map(|word| address.wrapping_add(4 * word));
            let mut waited = 0;
            for (address, word) in words.zip(0u64..) {
                waited += self.flash.load(address, issued + word + waited);
            }
            waited
        } else {
            0
        }
    }

    /// A handler begins, by the vector at an address; after the return from another one it is `chained`. Its cycles.
    pub fn enter(&mut self, vector: u32, chained: bool) -> u64 {
        let began = self.cycles;
        if chained {
            self.fetch(vector);
            self.cycles += TAIL_CHAIN;
        } else {
            // registers go to the stack
            self.drain();
            let before = self.cycles;
            self.fetch(vector);
            self.cycles = before + ENTRY + (self.cycles - before).saturating_sub(ENTRY_HIDES);
        }
        self.handlers.push(false);
        self.before = Before::default();
        self.cycles - began
    }

    /// A handler ends; returns the cycles until the interrupted code continues, none if another handler is next.
    pub fn leave(&mut self, chained: bool) -> u64 {
        let began = self.cycles;
        let used = self.handlers.pop() == Some(true);
        if used || !chained {
            self.drain();
        }
        self.cycles += if chained { 0 } else { RETURN };
        self.cycles += if used { FLOATS } else { 0 };
        self.before = Before::default();
        self.cycles - began
    }
}

/// Address of a literal, from an instruction and its offset.
fn literal(at: u32, offset: i32) -> u32 {
    ((at + 4) & !3).wrapping_add_signed(offset)
}

#[cfg(test)]
mod tests;
