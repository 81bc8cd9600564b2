//! The host's end of USART3.

use rigless::chip::{Timeline, uart};
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

use crate::rig::{SharedRig, lock};

/// The far end of the line: bytes are queued in the rig, with their time.
#[derive(Debug)]
pub(crate) struct Serial {
    rig: SharedRig,
}

impl Serial {
    pub(crate) fn new(rig: SharedRig) -> Self {
        Self { rig }
    }
}

impl Store for Serial {}

impl uart::Peer for Serial {
    fn receive(&mut self, word: u16, context: &mut Timeline<'_, '_>) {
        lock(&self.rig).heard.push((context.now().0, word as u8));
    }

    fn transmit(&mut self, _now: VirtualNanos) -> Option<u16> {
        lock(&self.rig).to_say.pop_front().map(u16::from)
    }
}
