//! How deep the firmware's stack gets, for each exception handler and for the rest of the code.
//!
//! The stack is painted before the first instruction. When a handler begins, what is below its stack pointer is put aside and
//! painted anew; when it ends, how far the paint is gone is its depth, and what was put aside comes back. So no one counts
//! what another used.

use std::path::Path;

use object::{Object as _, ObjectSection as _, ObjectSymbol as _};
use rigless::emulator::{Hit, Host, Watch};
use rigless::soc::Width;

use crate::board::Error;

const PAINT: u32 = 0x7ac7_5afe;
/// Where an exception frame holds the address to return to (ARM DDI 0403, B1.5.6), bytes above the stack pointer.
const RETURN: u32 = 24;
/// The longest exception frame, with floating-point state and alignment.
const FRAME: u32 = 0x68 + 4;
/// How much is looked at first, bytes; it doubles when that is too little. The servo's tick takes 1.4 KB.
const WINDOW: u32 = 2048;

/// How deep a handler went.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct StackLevel {
    /// Its name in the ELF.
    pub name: String,
    /// Where it begins.
    pub address: u64,
    /// How often it ran.
    pub runs: u64,
    /// Most bytes below the stack pointer it began with: without its exception frame and without what interrupted it.
    pub deepest: u32,
    window: u32,
}

impl StackLevel {
    /// A handler of which nothing is known yet.
    pub fn new(name: String, address: u64) -> Self {
        Self {
            name,
            address,
            runs: 0,
            deepest: 0,
            window: WINDOW,
        }
    }
}

/// Where an image has its stack, and its handlers.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct StackLayout {
    /// The end of the variables.
    pub bottom: u32,
    /// The stack pointer before the first instruction.
    pub top: u32,
    /// Every handler of the vector table but the one that all unused vectors share.
    pub levels: Vec<StackLevel>,
}

impl StackLayout {
    /// That of an ELF that cortex-m-rt was linked into.
    ///
    /// # Errors
    /// [`Error::Read`], [`Error::Elf`], and [`Error::Symbol`] if it was not.
    pub fn of(path: &Path) -> Result<Self, Error> {
        let elf = std::fs::read(path).map_err(|source| Error::Read {
            path: path.into(),
            source,
        })?;
        let bad = |source| Error::Elf {
            path: path.into(),
            source,
        };
        let file = object::File::parse(&*elf).map_err(bad)?;
        let named = |name: &str| {
            let found = file.symbols().find(|symbol| symbol.name() == Ok(name));
            let found = found.ok_or_else(|| Error::Symbol {
                name: name.into(),
                count: 0,
                examples: String::new(),
            });
            found.map(|symbol| symbol.address() as u32)
        };
        let unused = named("DefaultHandler_")? | 1;
        let table = file.section_by_name(".vector_table");
        let table = table
            .map_or(Ok(&[][..]), |table| table.data())
            .map_err(bad)?;
        let (vectors, _) = table.as_chunks();
        let mut levels: Vec<StackLevel> = Vec::new();
        // behind the stack pointer and the reset vector
        for vector in vectors
            .iter()
            .skip(2)
            .map(|vector| u32::from_le_bytes(*vector))
        {
            let address = u64::from(vector & !1);
            let known = levels.iter().any(|level| level.address == address);
            if vector == 0 || vector == unused || known {
                continue;
            }
            let is_it = |symbol: &object::Symbol<'_, '_>| {
                symbol.address() & !1 == address && symbol.kind() == object::SymbolKind::Text
            };
            let symbol = file.symbols().find(is_it);
            let name = symbol.and_then(|symbol| symbol.name().ok());
            levels.push(StackLevel::new(name.unwrap_or("?").into(), address));
        }
        Ok(Self {
            bottom: named("__euninit")?,
            top: named("_stack_start")?,
            levels,
        })
    }
}

/// What was found.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct StackUse {
    /// The handlers.
    pub levels: Vec<StackLevel>,
    /// Most bytes that were ever in use.
    pub used: u32,
    /// Most bytes of thread mode, with the exception frame of what interrupted it.
    pub thread: u32,
    /// A handler went deeper than was looked at: measure anew, with these levels.
    pub incomplete: bool,
}

impl StackUse {
    /// Bytes that are in use if every handler interrupts every other where that is deepest.
    pub fn bound(&self) -> u32 {
        let levels = self.levels.iter().filter(|level| level.runs > 0);
        self.thread + levels.map(|level| level.deepest + FRAME).sum::<u32>()
    }
}

struct Running {
    level: usize,
    sp: u32,
    /// the instruction that it interrupted
    returns_to: u64,
    /// what was below, the lowest first
    aside: Vec<u32>,
}

pub(crate) struct Stack {
    /// end of the variables, and the stack pointer at the beginning
    bottom: u32,
    top: u32,
    found: StackUse,
    running: Vec<Running>,
}

impl Stack {
    /// Paints the stack and watches the handlers. To be called before the first instruction.
    pub(crate) fn new(layout: StackLayout, host: &mut dyn Host) -> Self {
        let StackLayout {
            bottom,
            top,
            levels,
        } = layout;
        for address in (bottom..top).step_by(4) {
            // it is RAM
            let _ = host.write(address.into(), Width::W32, PAINT.into());
        }
        for address in levels.iter().map(|level| level.address) {
            assert!(
                host.watch(Watch::Instruction(address)),
                "rigless cannot watch {address:#x}"
            );
        }
        let levels = levels
            .into_iter()
            .map(|level| StackLevel {
                runs: 0,
                deepest: 0,
                ..level
            })
            .collect();
        Self {
            bottom,
            top,
            found: StackUse {
                levels,
                used: 0,
                thread: 0,
                incomplete: false,
            },
            running: Vec::new(),
        }
    }

    pub(crate) fn hit(&mut self, hit: &Hit, host: &mut dyn Host) {
        let Some(sp) = stack_pointer(host) else {
            return;
        };
        let of = |level: &StackLevel| level.address == hit.address;
        let begins = self.found.levels.iter().position(of);
        let over = |running: &mut Running| {
            is_over((running.sp, running.returns_to), begins.is_some(), sp, hit)
        };
        while let Some(running) = self.running.pop_if(over) {
            self.end(&running, host);
        }
        if let Some(level) = begins {
            self.begin(level, sp, host);
        }
    }

    fn begin(&mut self, level: usize, sp: u32, host: &mut dyn Host) {
        let from = sp
            .saturating_sub(self.found.levels[level].window)
            .max(self.bottom);
        let aside = (from..sp).step_by(4).map(|address| {
            let was = word(address, host);
            let _ = host.write(address.into(), Width::W32, PAINT.into());
            was
        });
        let aside = aside.collect();
        let returns_to = u64::from(word(sp + RETURN, host));
        host.watch(Watch::Instruction(returns_to));
        self.running.push(Running {
            level,
            sp,
            returns_to,
            aside,
        });
    }

    fn end(&mut self, running: &Running, host: &mut dyn Host) {
        let length = 4 * running.aside.len() as u32;
        let from = running.sp - length;
        let painted = painted(from, running.sp, host);
        let level = &mut self.found.levels[running.level];
        level.runs += 1;
        level.deepest = level.deepest.max(length - painted);
        self.found.used = self
            .found
            .used
            .max(self.top - running.sp + length - painted);
        // a frame may have a gap that nothing was written to
        if painted < length / 4 {
            self.found.incomplete = true;
            level.window = (2 * length).max(level.window);
        }
        for (address, word) in (from..).step_by(4).zip(&running.aside) {
            let _ = host.write(address.into(), Width::W32, u64::from(*word));
        }
        let others = self.running.iter().map(|running| running.returns_to);
        let begins = self.found.levels.iter().map(|level| level.address);
        if !others
            .chain(begins)
            .any(|address| address == running.returns_to)
        {
            host.unwatch(Watch::Instruction(running.returns_to));
        }
    }

    /// What was found so far.
    pub(crate) fn found(&mut self, host: &mut dyn Host) -> StackUse {
        let painted = painted(self.bottom, self.top, host);
        let thread = self.top - self.bottom - painted;
        self.found.thread = thread;
        self.found.used = self.found.used.max(thread);
        self.found.clone()
    }
}

pub(crate) fn word(address: u32, host: &mut dyn Host) -> u32 {
    host.read(address.into(), Width::W32).unwrap_or_default() as u32
}

/// Whether a handler, which began at this stack pointer and returns to this address, is over at a hit: its frame is gone, or
/// another handler `begins` upon the same one.
pub(crate) fn is_over(
    (began_at, returns_to): (u32, u64),
    begins: bool,
    sp: u32,
    hit: &Hit,
) -> bool {
    if begins {
        began_at <= sp
    } else {
        began_at < sp && returns_to == hit.address
    }
}

/// Bytes of paint from an address on.
fn painted(from: u32, to: u32, host: &mut dyn Host) -> u32 {
    let gone = (from..to)
        .step_by(4)
        .find(|address| word(*address, host) != PAINT);
    gone.unwrap_or(to) - from
}

fn stack_pointer(host: &mut dyn Host) -> Option<u32> {
    register(host, 13)
}

/// A register of the core, R0 to R15. rigless shows none, but its saved state, of which the exact version in Cargo.toml has
/// this form: postcard's, the length of the core's part and R0 to R15 first.
pub(crate) fn register(host: &mut dyn Host, number: usize) -> Option<u32> {
    let state = host.save_state().ok()?;
    let mut numbers = Numbers(&state);
    numbers.nth(1 + number)
}

/// Numbers as postcard writes them: 7 bits a byte, the lowest first.
struct Numbers<'a>(&'a [u8]);

impl Iterator for Numbers<'_> {
    type Item = u32;

    fn next(&mut self) -> Option<u32> {
        let end = self.0.iter().position(|byte| byte & 0x80 == 0)?;
        let (number, rest) = self.0.split_at(end + 1);
        self.0 = rest;
        let digits = number.iter().rev().map(|byte| u32::from(byte & 0x7F));
        Some(digits.fold(0, |number, digit| number << 7 | digit))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_postcards() {
        let bytes = [0x05, 0x80, 0x01, 0xFF, 0xFF, 0xFF, 0xFF, 0x0F, 0x80];
        assert_eq!(Numbers(&bytes).collect::<Vec<_>>(), [5, 128, u32::MAX]);
    }

    #[test]
    fn the_bound_has_every_handler_that_ran_with_its_frame() {
        let level = |runs, deepest| StackLevel {
            runs,
            deepest,
            ..StackLevel::new("x".into(), 0)
        };
        let found = StackUse {
            levels: vec![level(3, 200), level(0, 0), level(1, 8)],
            used: 0,
            thread: 1000,
            incomplete: false,
        };
        assert_eq!(found.bound(), 1000 + 200 + 108 + 8 + 108);
    }
}
