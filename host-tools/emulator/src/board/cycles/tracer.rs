//! Every instruction that the emulated core executes, through the model of its cycles.

use std::collections::BTreeMap;
use std::iter::Sum;
use std::ops::{AddAssign, Range};

use rigless::emulator::{Access, Hit, HitKind, Host, Watch};
use rustc_hash::FxHashMap;

use super::accelerator::Accelerator;
use super::instruction::{Address, Instruction};
use super::pipeline::{Core, Executed};
use crate::board::handlers::Handlers;
use crate::board::registers::{register, word};

/// Length of a bin of the profile, ns.
const BIN_NS: u64 = 250_000;
/// Windows are of 1 ms and begin at any of these.
const BINS: u64 = 4;
/// Vectors of the core and of the chip (RM0090, table 62).
const VECTORS: u32 = 16 + 91;
const VECTOR_TABLE: u32 = 0x0800_0000;
/// Behind an exception frame's R0 to R3, R12 and LR: the address to return to.
const RETURN: u32 = 24;

/// Instructions, and the cycles that they take by the model.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct CycleCount {
    /// Instructions.
    pub instructions: u64,
    /// Cycles, with those of exceptions that are entered and left.
    pub cycles: u64,
}

impl CycleCount {
    /// Cycles per instruction; 0 of none.
    pub fn ratio(self) -> f64 {
        match self.instructions {
            0 => 0.0,
            instructions => self.cycles as f64 / instructions as f64,
        }
    }
}

impl AddAssign for CycleCount {
    fn add_assign(&mut self, other: Self) {
        self.instructions += other.instructions;
        self.cycles += other.cycles;
    }
}

impl Sum for CycleCount {
    fn sum<I: Iterator<Item = Self>>(parts: I) -> Self {
        let mut sum = Self::default();
        parts.for_each(|part| sum += part);
        sum
    }
}

/// The cycles of one millisecond.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Load {
    /// Its beginning, ns of virtual time.
    pub at_ns: u64,
    /// The cycles.
    pub spent: CycleCount,
}

/// Cycles in parts of a millisecond and by groups of handlers; the last group is all the rest.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct CycleProfile {
    bins: BTreeMap<u64, Vec<CycleCount>>,
    /// Instructions that were executed outside of the image's code, which are not modelled.
    pub unseen: u64,
}

impl CycleProfile {
    fn add(&mut self, at_ns: u64, groups: usize, group: usize, spent: CycleCount) {
        let bin = self.bins.entry(at_ns / BIN_NS);
        let bin = bin.or_insert_with(|| vec![CycleCount::default(); groups]);
        if let Some(so_far) = bin.get_mut(group) {
            *so_far += spent;
        }
    }

    /// Adds a later, or an earlier, profile.
    pub fn extend(&mut self, other: Self) {
        for (bin, spent) in other.bins {
            let here = self
                .bins
                .entry(bin)
                .or_insert_with(|| vec![CycleCount::default(); spent.len()]);
            here.iter_mut()
                .zip(spent)
                .for_each(|(here, spent)| *here += spent);
        }
        self.unseen += other.unseen;
    }

    /// The sum of some groups.
    pub fn total(&self, groups: Range<usize>) -> CycleCount {
        let bins = self.bins.values();
        bins.flat_map(|bin| bin.get(groups.clone()))
            .flatten()
            .copied()
            .sum()
    }

    /// The millisecond in which some groups spent most by a measure, of those in which they did something all the time.
    pub fn worst(&self, groups: Range<usize>, measure: fn(CycleCount) -> f64) -> Load {
        let mut worst = Load::default();
        for first in self.bins.keys() {
            let bins = self.bins.range(first..&(first + BINS));
            let bins = bins.map(|(_, bin)| bin.get(groups.clone()).unwrap_or_default());
            let bins: Vec<CycleCount> = bins.map(|bin| bin.iter().copied().sum()).collect();
            let is_whole = bins.len() as u64 == BINS;
            let spent = bins.into_iter().sum();
            if is_whole && measure(spent) > measure(worst.spent) {
                let at_ns = first * BIN_NS;
                worst = Load { at_ns, spent };
            }
        }
        worst
    }
}

/// An instruction that the core has arrived at, and its effects until the core arrives at the next one.
struct Pending {
    at: u32,
    at_ns: u64,
    count: u64,
    group: usize,
    code: [u16; 2],
    instruction: Instruction,
    data: Option<u32>,
}

/// Follows the core.
pub(crate) struct Tracer {
    code: Vec<Range<u64>>,
    core: Core,
    handlers: Handlers<()>,
    /// of each handler: its vector and its group
    of_handlers: Vec<(u32, usize)>,
    groups: usize,
    decoded: FxHashMap<u32, ([u16; 2], Instruction)>,
    pending: Option<Pending>,
    /// Instructions count while this is not 0.
    switch: Option<u32>,
    counts: bool,
    pub(crate) profile: CycleProfile,
}

impl Tracer {
    /// Follows all code there from now on. Handlers are distinguished by their groups. With a switch, instructions
    /// count while the word at that address is not 0.
    pub(crate) fn new(
        code: Vec<Range<u64>>,
        groups: &[Vec<u64>],
        acr: u32,
        switch: Option<u32>,
        host: &mut dyn Host,
    ) -> Self {
        let (mut addresses, mut of_handlers) = (Vec::new(), Vec::new());
        // behind the stack pointer and the reset vector
        for vector in (2..VECTORS).map(|number| VECTOR_TABLE + 4 * number) {
            let address = u64::from(word(vector, host) & !1);
            if address != 0 && !addresses.contains(&address) {
                addresses.push(address);
                let is_in = |group: &Vec<u64>| group.iter().any(|handler| handler & !1 == address);
                let group = groups.iter().position(is_in);
                of_handlers.push((vector, group.unwrap_or(groups.len())));
            }
        }
        let counts = switch.is_none_or(|at| word(at, host) != 0);
        let tracer = Self {
            code,
            core: Core::new(Accelerator::new(acr)),
            handlers: Handlers::among_watched(addresses),
            of_handlers,
            groups: groups.len() + 1,
            decoded: FxHashMap::default(),
            pending: None,
            switch,
            counts,
            profile: CycleProfile::default(),
        };
        if let Some(watch) = tracer.watched_switch() {
            assert!(host.watch(watch), "rigless cannot watch {watch:?}");
        }
        if counts {
            tracer.follow(true, host);
        }
        tracer
    }

    fn watched_switch(&self) -> Option<Watch> {
        let (address, length) = (self.switch?.into(), 4);
        Some(Watch::Writes { address, length })
    }

    /// Sets whether each instruction is traced, which costs most of the speed.
    fn follow(&self, follows: bool, host: &mut dyn Host) {
        for address in self.code.iter().flat_map(|range| range.clone().step_by(2)) {
            let watch = Watch::Instruction(address);
            if follows {
                assert!(host.watch(watch), "rigless cannot watch {watch:?}");
            } else {
                host.unwatch(watch);
            }
        }
    }

    /// Follows the code no more.
    pub(crate) fn stop(self, host: &mut dyn Host) -> CycleProfile {
        self.follow(false, host);
        if let Some(watch) = self.watched_switch() {
            host.unwatch(watch);
        }
        self.profile
    }

    /// Takes the profile since the last call.
    pub(crate) fn take(&mut self) -> CycleProfile {
        std::mem::take(&mut self.profile)
    }

    fn group(&self) -> usize {
        let running = self.handlers.running();
        let of_handler = running.and_then(|handler| self.of_handlers.get(handler));
        of_handler.map_or(self.groups - 1, |(_, group)| *group)
    }

    fn spend(&mut self, at_ns: u64, group: usize, instructions: u64, cycles: u64) {
        let spent = CycleCount {
            instructions,
            cycles,
        };
        self.profile.add(at_ns, self.groups, group, spent);
    }

    /// A peripheral was accessed.
    pub(crate) fn access(&mut self, access: &Access) {
        if let Some(pending) = &mut self.pending
            && access.program_counter == Some(pending.at.into())
        {
            pending.data.get_or_insert(access.address as u32);
        }
    }

    pub(crate) fn hit(&mut self, hit: &Hit, host: &mut dyn Host) {
        if hit.kind == HitKind::Write {
            let counts = self.switch.is_some_and(|switch| word(switch, host) != 0);
            if counts != self.counts {
                self.counts = counts;
                self.pending = None;
                self.follow(counts, host);
            }
            return;
        }
        let (mut begun, mut left, mut returns_to) = (None, 0, None);
        if self.handlers.concerns(hit)
            && let Some(sp) = register(host, 13)
        {
            begun = self.handlers.begun(hit);
            let group = self.group();
            while self.handlers.ended(hit, sp, host).is_some() {
                left += 1;
                let cycles = self.core.leave(begun.is_some());
                self.spend(hit.at.0, group, 0, cycles);
            }
            if begun.is_some() && left == 0 {
                returns_to = Some(word(sp + RETURN, host));
            }
        }
        if let Some(pending) = self.pending.take() {
            let length = pending.instruction.length;
            let next = match returns_to {
                Some(next) => next,
                // the cycles of the return are the exception's
                None if left > 0 => pending.at + length,
                None => hit.address as u32,
            };
            let executed = Executed {
                at: pending.at,
                code: pending.code,
                next,
                data: pending.data,
            };
            let cycles = self.core.run(&executed, pending.instruction);
            self.spend(pending.at_ns, pending.group, 1, cycles);
            self.profile.unseen += hit.instruction_count.saturating_sub(pending.count + 1);
        }
        if let Some(handler) = begun
            && let Some(sp) = register(host, 13)
        {
            self.handlers.begin(handler, sp, (), host);
            let vector = self
                .of_handlers
                .get(handler)
                .map_or(0, |(vector, _)| *vector);
            let cycles = self.core.enter(vector, left > 0);
            self.spend(hit.at.0, self.group(), 0, cycles);
        }
        self.arrive(hit, host);
    }

    fn arrive(&mut self, hit: &Hit, host: &mut dyn Host) {
        let at = hit.address as u32;
        let (code, instruction) = *self.decoded.entry(at).or_insert_with(|| {
            let word = word_at(at, host);
            let code = [word as u16, (word >> 16) as u16];
            (code, Instruction::decode(code))
        });
        let address = instruction.access.filter(|access| access.is_load);
        let data = address.and_then(|access| resolve(access.address, host));
        self.pending = Some(Pending {
            at,
            at_ns: hit.at.0,
            count: hit.instruction_count,
            group: self.group(),
            code,
            instruction,
            data,
        });
    }
}

/// A word of code, which may be across two words.
fn word_at(at: u32, host: &mut dyn Host) -> u32 {
    let low = word(at & !3, host);
    if at.is_multiple_of(4) {
        return low;
    }
    low >> 16 | word((at & !3) + 4, host) << 16
}

/// The address of a load, by the registers as they are before it; the stack is in RAM.
fn resolve(address: Address, host: &mut dyn Host) -> Option<u32> {
    let mut value = |number: u8| register(host, number.into());
    match address {
        Address::Literal(_) => None,
        Address::Based { base: 13, .. } => None,
        Address::Based { base, offset } => Some(value(base)?.wrapping_add_signed(offset)),
        Address::Indexed { base, index, shift } => {
            Some(value(base)?.wrapping_add(value(index)? << shift))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn spent(instructions: u64, cycles: u64) -> CycleCount {
        CycleCount {
            instructions,
            cycles,
        }
    }

    #[test]
    fn the_worst_millisecond_begins_anywhere_and_is_whole() {
        let mut profile = CycleProfile::default();
        for bin in 0..10 {
            // slow from 1.25 to 2 ms
            let cycles = if (5..8).contains(&bin) { 300 } else { 100 };
            profile.add(bin * BIN_NS, 2, 0, spent(100, cycles));
            profile.add(bin * BIN_NS + 1, 2, 1, spent(50, 50));
        }
        // a single one is no millisecond
        profile.add(100 * BIN_NS, 2, 0, spent(1, 1000));
        let worst = profile.worst(0..1, CycleCount::ratio);
        assert_eq!(worst.spent, spent(400, 1000));
        assert_eq!(worst.at_ns, 4 * BIN_NS);
        assert_eq!(
            profile.worst(0..2, CycleCount::ratio).spent,
            spent(600, 1200)
        );
        assert_eq!(profile.total(1..2), spent(500, 500));
        assert_eq!(profile.total(0..2).instructions, 1501);
    }
}
