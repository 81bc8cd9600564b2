//! Depth of the firmware's stack, for each exception handler and for the rest of the code.
//!
//! The stack is painted before the first instruction. When a handler begins, the stack below its stack pointer is put
//! aside and painted anew; when it ends, its depth is the part of the paint that is gone, and the old contents come
//! back. So no handler counts the stack of another.

use std::path::Path;

use object::{Object as _, ObjectSection as _, ObjectSymbol as _};
use rigless::emulator::{Hit, Host};
use rigless::soc::Width;

use super::error::Error;
use super::handlers::{Handlers, Running};
use super::registers::{register, word};

const PAINT: u32 = 0x7ac7_5afe;
/// The longest exception frame, with floating-point state and alignment.
const FRAME: u32 = 0x68 + 4;
/// Length of the first look, bytes; it doubles when that is too little. The servo's tick takes 1.4 KB.
const WINDOW: u32 = 2048;

/// The depth of a handler.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct StackLevel {
    /// Its name in the ELF.
    pub name: String,
    /// Its address.
    pub address: u64,
    /// Number of its runs.
    pub runs: u64,
    /// Most bytes below the stack pointer it began with: without its exception frame and without what interrupted it.
    pub deepest: u32,
    window: u32,
}

impl StackLevel {
    /// A handler of which nothing is known yet.
    pub(crate) fn new(name: String, address: u64) -> Self {
        Self {
            name,
            address,
            runs: 0,
            deepest: 0,
            window: WINDOW,
        }
    }
}

/// The stack of an image, and its handlers.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct StackLayout {
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
    pub(crate) fn of(path: &Path) -> Result<Self, Error> {
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

/// The use of the stack.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct StackUse {
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
    pub(crate) fn bound(&self) -> u32 {
        let levels = self.levels.iter().filter(|level| level.runs > 0);
        self.thread + levels.map(|level| level.deepest + FRAME).sum::<u32>()
    }
}

pub(crate) struct Stack {
    /// end of the variables, and the stack pointer at the beginning
    bottom: u32,
    top: u32,
    found: StackUse,
    /// with the stack below each, the lowest word first
    handlers: Handlers<Vec<u32>>,
}

impl Stack {
    /// Paints the stack and watches the handlers. To be called before the first instruction.
    pub(crate) fn new(layout: StackLayout, host: &mut dyn Host) -> Self {
        let StackLayout {
            bottom,
            top,
            mut levels,
        } = layout;
        for address in (bottom..top).step_by(4) {
            // it is RAM
            let _ = host.write(address.into(), Width::W32, PAINT.into());
        }
        for level in &mut levels {
            (level.runs, level.deepest) = (0, 0);
        }
        let addresses = levels.iter().map(|level| level.address).collect();
        Self {
            bottom,
            top,
            found: StackUse {
                levels,
                used: 0,
                thread: 0,
                incomplete: false,
            },
            handlers: Handlers::watch(addresses, host),
        }
    }

    pub(crate) fn hit(&mut self, hit: &Hit, host: &mut dyn Host) {
        let Some(sp) = register(host, 13) else {
            return;
        };
        while let Some(running) = self.handlers.ended(hit, sp, host) {
            self.end(&running, host);
        }
        if let Some(level) = self.handlers.begun(hit) {
            let aside = self.put_aside(level, sp, host);
            self.handlers.begin(level, sp, aside, host);
        }
    }

    /// Paints the stack below the stack pointer, and returns its old contents.
    fn put_aside(&self, level: usize, sp: u32, host: &mut dyn Host) -> Vec<u32> {
        let from = sp
            .saturating_sub(self.found.levels[level].window)
            .max(self.bottom);
        let aside = (from..sp).step_by(4).map(|address| {
            let was = word(address, host);
            let _ = host.write(address.into(), Width::W32, PAINT.into());
            was
        });
        aside.collect()
    }

    fn end(&mut self, running: &Running<Vec<u32>>, host: &mut dyn Host) {
        let length = 4 * running.kept.len() as u32;
        let from = running.sp - length;
        let painted = painted(from, running.sp, host);
        let found = &mut self.found;
        let level = &mut found.levels[running.handler];
        level.runs += 1;
        level.deepest = level.deepest.max(length - painted);
        found.used = found.used.max(self.top - running.sp + length - painted);
        // a frame may have a gap that nothing was written to
        if painted < length / 4 {
            found.incomplete = true;
            level.window = (2 * length).max(level.window);
        }
        for (address, word) in (from..).step_by(4).zip(&running.kept) {
            let _ = host.write(address.into(), Width::W32, u64::from(*word));
        }
    }

    /// The use so far.
    pub(crate) fn found(&mut self, host: &mut dyn Host) -> StackUse {
        let painted = painted(self.bottom, self.top, host);
        let thread = self.top - self.bottom - painted;
        self.found.thread = thread;
        self.found.used = self.found.used.max(thread);
        self.found.clone()
    }
}

/// Bytes of paint from an address on.
fn painted(from: u32, to: u32, host: &mut dyn Host) -> u32 {
    let gone = (from..to)
        .step_by(4)
        .find(|address| word(*address, host) != PAINT);
    gone.unwrap_or(to) - from
}

#[cfg(test)]
mod tests {
    use super::*;

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
