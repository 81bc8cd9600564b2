//! A core that waits for its flash.

/// The fastest core that needs no wait state, MHz (RM0090, table 11, 2.7 to 3.6 V).
const NO_WAIT_MHZ: u32 = 30;
/// Longest time that the core may wait for its flash, ns: prefetch and cache are turned on once the clocks are set.
const SLOW_NS: u64 = 1_000_000;

/// The check of a fast core that waits for each line of its flash (RM0090 3.5.2). The data cache is not required, since
/// it may not be on while flash is written.
#[derive(Debug, Default)]
pub(super) struct Accelerator {
    /// Since when it waits, ns.
    slow_since_ns: Option<u64>,
}

impl Accelerator {
    /// Clocks, prefetch or cache have changed.
    pub(super) fn changed(&mut self, at_ns: u64, core_mhz: u32, quick: bool) {
        self.slow_since_ns = match self.slow_since_ns {
            _ if quick || core_mhz <= NO_WAIT_MHZ => None,
            since => since.or(Some(at_ns)),
        };
    }

    /// Returns true once if it has lasted too long.
    pub(super) fn is_missed(&mut self, at_ns: u64) -> bool {
        let missed = |since_ns: &mut u64| at_ns > *since_ns + SLOW_NS;
        self.slow_since_ns.take_if(missed).is_some()
    }
}
