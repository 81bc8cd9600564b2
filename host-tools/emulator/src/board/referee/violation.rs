//! The rules for a firmware, and its violations.

use std::fmt;

/// The rules: a firmware may not do this.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Rule {
    /// Use a peripheral whose clock is off.
    Clock,
    /// Use a peripheral that is held in reset.
    HeldInReset,
    /// Use an address of a peripheral where it has no register.
    NoRegister,
    /// Write a byte where the register takes half-words or words, or past its end.
    Width,
    /// Write a register that can only be read.
    ReadOnly,
    /// Read a register that can only be written.
    WriteOnly,
    /// Change a reserved bit from its reset value.
    ReservedBits,
    /// Give a pin an alternate function that it does not have.
    AlternateFunction,
    /// Start a peripheral none of whose pins is led to it.
    NoPin,
    /// Lead two pins to one input of a peripheral.
    TwoPins,
    /// Change an SPI's clock, frame or direction while it is on.
    SpiRunning,
    /// Convert a channel whose pin is not analog.
    NotAnalog,
    /// Start a converter that was switched on less than 3 us ago, or is off.
    Unsteady,
    /// Have a converter ask for DMA only up to the last place of a ring.
    RequestsEnd,
    /// Run a converter faster than it may.
    ConverterClock,
    /// Start a DMA stream for a request that is not wired to it.
    DmaRequest,
    /// Have DMA use memory that it does not reach.
    DmaMemory,
    /// Change a DMA stream that runs.
    DmaRunning,
    /// Take an interrupt that has no handler.
    NoHandler,
    /// Program flash by a width other than the one that is set, or while it is locked or busy.
    FlashProgram,
    /// Program a bit of flash back to 1.
    FlashBits,
    /// Program or erase flash with its data cache on.
    DataCache,
    /// Write the control register of the flash while it is busy: the core stands until it no longer is.
    FlashBusy,
    /// Run faster than the wait states of the flash allow.
    WaitStates,
    /// Run with wait states for a millisecond, and without the prefetch and the instruction cache that make up for
    /// them.
    Accelerator,
    /// Run a bus faster than it may.
    BusClock,
    /// Set the watchdog without its key.
    WatchdogKey,
    /// Unmask an edge of a pin that is no input.
    EdgeOfNoInput,
    /// Any error that the models report themselves: an empty address, an access that is refused, a wrong use.
    Model,
}

/// A violation of a rule.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Violation {
    /// The rule.
    pub rule: Rule,
    /// Its place and details.
    pub what: String,
    /// Time of the first, ns.
    pub at_ns: u64,
    /// The instruction that did it first.
    pub instruction: Option<u64>,
    /// Number of times.
    pub times: u64,
}

impl Violation {
    /// A report of rigless' models.
    pub(in super::super) fn of_models(what: String) -> Self {
        Self {
            rule: Rule::Model,
            what,
            at_ns: 0,
            instruction: None,
            times: 1,
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}: {}", self.rule, self.what)?;
        if let Some(instruction) = self.instruction {
            write!(f, ", by the instruction at {instruction:#x}")?;
        }
        write!(f, ", first at {:.6} s", self.at_ns as f64 * 1e-9)?;
        if self.times > 1 {
            write!(f, ", {} times", self.times)?;
        }
        Ok(())
    }
}
