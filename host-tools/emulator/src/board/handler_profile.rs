//! Instructions that exception handlers take, without those of others that interrupt them.

use rigless::emulator::{Hit, Host, Watch};

use super::registers::{register, word};

/// Place of the return address in an exception frame (ARM DDI 0403, B1.5.6), bytes above the stack pointer.
const RETURN: u32 = 24;

struct Running {
    sp: u32,
    returns_to: u64,
    /// Instructions until it began, and those of handlers that interrupted it.
    began_at: u64,
    nested: u64,
}

pub(crate) struct HandlerProfiler {
    /// Of all runs that are over.
    pub(crate) instructions: u64,
    addresses: Vec<u64>,
    /// The latest last.
    running: Vec<Running>,
}

impl HandlerProfiler {
    pub(crate) fn new(addresses: Vec<u64>, host: &mut dyn Host) -> Self {
        for address in &addresses {
            assert!(
                host.watch(Watch::Instruction(*address)),
                "rigless cannot watch {address:#x}"
            );
        }
        Self {
            instructions: 0,
            addresses,
            running: Vec::new(),
        }
    }

    pub(crate) fn hit(&mut self, hit: &Hit, host: &mut dyn Host) {
        let Some(sp) = register(host, 13) else {
            return;
        };
        let (now, begins) = (hit.instruction_count, self.addresses.contains(&hit.address));
        while let Some(ended) = self.ended(hit.address, begins, sp, host) {
            let all = now - ended.began_at;
            self.instructions += all - ended.nested;
            if let Some(below) = self.running.last_mut() {
                below.nested += all;
            }
        }
        if begins {
            let returns_to = u64::from(word(sp + RETURN, host));
            host.watch(Watch::Instruction(returns_to));
            self.running.push(Running {
                sp,
                returns_to,
                began_at: now,
                nested: 0,
            });
        }
    }

    /// The latest handler that is over at an address, or `None`: its frame is gone, or another one begins upon the
    /// same.
    fn ended(&mut self, at: u64, begins: bool, sp: u32, host: &mut dyn Host) -> Option<Running> {
        let ended = self.running.pop_if(|running| {
            if begins {
                running.sp <= sp
            } else {
                running.sp < sp && running.returns_to == at
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
}
