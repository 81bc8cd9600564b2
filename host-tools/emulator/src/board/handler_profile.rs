//! Instructions that exception handlers take, without those of others that interrupt them.

use rigless::emulator::{Hit, Host};

use super::handlers::Handlers;
use super::registers::register;

/// The instructions of a handler.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct HandlerProfile {
    /// Its address.
    pub address: u64,
    /// Number of its completed runs.
    pub runs: u64,
    /// Instructions of all runs.
    pub instructions: u64,
    /// Of every other one, from the first and from the second on: an interrupt comes for two things by turns.
    pub by_turns: [u64; 2],
}

/// Instructions until a handler began, and those of handlers that interrupted it.
struct Begun {
    at: u64,
    nested: u64,
}

/// Watches handlers.
pub(crate) struct HandlerProfiler {
    pub(crate) handlers: Vec<HandlerProfile>,
    watched: Handlers<Begun>,
}

impl HandlerProfiler {
    pub(crate) fn new(addresses: Vec<u64>, host: &mut dyn Host) -> Self {
        let handlers = addresses.iter().map(|&address| HandlerProfile {
            address,
            runs: 0,
            instructions: 0,
            by_turns: [0; 2],
        });
        Self {
            handlers: handlers.collect(),
            watched: Handlers::watch(addresses, host),
        }
    }

    pub(crate) fn hit(&mut self, hit: &Hit, host: &mut dyn Host) {
        let Some(sp) = register(host, 13) else {
            return;
        };
        let now = hit.instruction_count;
        while let Some(ended) = self.watched.ended(hit, sp, host) {
            let all = now - ended.kept.at;
            let handler = &mut self.handlers[ended.handler];
            let own = all - ended.kept.nested;
            handler.by_turns[(handler.runs % 2) as usize] += own;
            handler.runs += 1;
            handler.instructions += own;
            if let Some(below) = self.watched.latest() {
                below.kept.nested += all;
            }
        }
        if let Some(handler) = self.watched.begun(hit) {
            let begun = Begun { at: now, nested: 0 };
            self.watched.begin(handler, sp, begun, host);
        }
    }
}
