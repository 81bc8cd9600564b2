//! Instructions that exception handlers take, without those of others that interrupt them.

use rigless::emulator::{Hit, Host};

use super::handlers::Handlers;
use super::registers::register;

/// Instructions until a handler began, and those of handlers that interrupted it.
struct Begun {
    at: u64,
    nested: u64,
}

/// Watches handlers.
pub(crate) struct HandlerProfiler {
    /// Of all runs that are over.
    pub(crate) instructions: u64,
    watched: Handlers<Begun>,
}

impl HandlerProfiler {
    pub(crate) fn new(addresses: Vec<u64>, host: &mut dyn Host) -> Self {
        Self {
            instructions: 0,
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
            self.instructions += all - ended.kept.nested;
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
