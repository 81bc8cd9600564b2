//! Exception handlers that are watched: begin and end of each, under any nesting.

use rigless::emulator::{Hit, Host, Watch};

use super::registers::word;

/// Place of the return address in an exception frame (ARM DDI 0403, B1.5.6), bytes above the stack pointer.
const RETURN: u32 = 24;

/// A handler that runs.
pub(super) struct Running<T> {
    /// Its index among those that are watched.
    pub(super) handler: usize,
    /// The stack pointer that it began with.
    pub(super) sp: u32,
    /// The instruction that it interrupted.
    returns_to: u64,
    /// Its watcher's data from its begin.
    pub(super) kept: T,
}

/// Handlers by their addresses, and those that run, the latest last.
pub(super) struct Handlers<T> {
    addresses: Vec<u64>,
    running: Vec<Running<T>>,
}

impl<T> Handlers<T> {
    pub(super) fn watch(addresses: Vec<u64>, host: &mut dyn Host) -> Self {
        for address in &addresses {
            assert!(
                host.watch(Watch::Instruction(*address)),
                "rigless cannot watch {address:#x}"
            );
        }
        Self {
            addresses,
            running: Vec::new(),
        }
    }

    /// The handler that begins at a hit.
    pub(super) fn begun(&self, hit: &Hit) -> Option<usize> {
        self.addresses.iter().position(|at| *at == hit.address)
    }

    pub(super) fn begin(&mut self, handler: usize, sp: u32, kept: T, host: &mut dyn Host) {
        let returns_to = u64::from(word(sp + RETURN, host));
        host.watch(Watch::Instruction(returns_to));
        self.running.push(Running {
            handler,
            sp,
            returns_to,
            kept,
        });
    }

    /// The latest handler that is over at a hit, or `None`: its frame is gone, or another one begins upon the same.
    pub(super) fn ended(&mut self, hit: &Hit, sp: u32, host: &mut dyn Host) -> Option<Running<T>> {
        let begins = self.begun(hit).is_some();
        let ended = self.running.pop_if(|running| {
            if begins {
                running.sp <= sp
            } else {
                running.sp < sp && running.returns_to == hit.address
            }
        })?;
        let returns_to = ended.returns_to;
        let mut others = self.running.iter().map(|running| running.returns_to);
        let is_wanted = others.any(|at| at == returns_to);
        if !is_wanted && !self.addresses.contains(&returns_to) {
            host.unwatch(Watch::Instruction(returns_to));
        }
        Some(ended)
    }

    /// The handler that runs.
    pub(super) fn latest(&mut self) -> Option<&mut Running<T>> {
        self.running.last_mut()
    }
}
