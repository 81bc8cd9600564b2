//! How many instructions exception handlers take, without those of others that interrupt them.

use rigless::emulator::{Hit, Host, Watch};

use crate::stack::{is_over, register, word};

/// Where an exception frame holds the address to return to (ARM DDI 0403, B1.5.6), bytes above the stack pointer.
const RETURN: u32 = 24;

/// What a handler took.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Spent {
    /// Its address.
    pub address: u64,
    /// How often it ran to its end.
    pub runs: u64,
    /// Instructions of all runs.
    pub instructions: u64,
}

struct Running {
    handler: usize,
    sp: u32,
    returns_to: u64,
    /// instructions until it began, and those of handlers that interrupted it
    begun: u64,
    nested: u64,
}

/// Watches handlers.
pub(crate) struct Spending {
    pub(crate) handlers: Vec<Spent>,
    running: Vec<Running>,
}

impl Spending {
    pub(crate) fn new(addresses: &[u64], host: &mut dyn Host) -> Self {
        for address in addresses {
            assert!(
                host.watch(Watch::Instruction(*address)),
                "rigless cannot watch {address:#x}"
            );
        }
        let handlers = addresses.iter().map(|&address| Spent {
            address,
            runs: 0,
            instructions: 0,
        });
        Self {
            handlers: handlers.collect(),
            running: Vec::new(),
        }
    }

    pub(crate) fn hit(&mut self, hit: &Hit, host: &mut dyn Host) {
        let Some(sp) = register(host, 13) else {
            return;
        };
        let of = |handler: &Spent| handler.address == hit.address;
        let begins = self.handlers.iter().position(of);
        let over = |running: &mut Running| {
            is_over((running.sp, running.returns_to), begins.is_some(), sp, hit)
        };
        while let Some(ended) = self.running.pop_if(over) {
            let all = hit.instruction_count - ended.begun;
            let handler = &mut self.handlers[ended.handler];
            handler.runs += 1;
            handler.instructions += all - ended.nested;
            if let Some(below) = self.running.last_mut() {
                below.nested += all;
            }
            let others = self.running.iter().map(|running| running.returns_to);
            let begins = self.handlers.iter().map(|handler| handler.address);
            if !others.chain(begins).any(|a| a == ended.returns_to) {
                host.unwatch(Watch::Instruction(ended.returns_to));
            }
        }
        if let Some(handler) = begins {
            let returns_to = u64::from(word(sp + RETURN, host));
            host.watch(Watch::Instruction(returns_to));
            self.running.push(Running {
                handler,
                sp,
                returns_to,
                begun: hit.instruction_count,
                nested: 0,
            });
        }
    }
}
