//! Cycles instead of instructions: a model of the core's pipeline and of the flash that it waits for, fed with every
//! instruction that the emulated core executes.
//!
//! The longest time of a range in the manuals is counted, so that the model errs on the slow side:
//!
//! | what | counted as |
//! |---|---|
//! | divisions, 2 to 12 cycles | 12 |
//! | instructions of an IT block that are not executed | as if they were |
//! | an exception's first instructions, which may be read while registers are stacked | read afterwards |
//! | an exception that arrives while another one's registers are stacked | stacked again |
//! | a store in the write buffer, which a load from the flash may overtake | every load and store waits for it |
//! | a bridge to a peripheral's bus, whose cycles no manual gives | up to a cycle of that bus late, and takes two |
//! | code that was prefetched, though not in time | a miss: it goes to the cache |
//!
//! Not modelled: the bus that DMA takes now and then (a half-word of the motor's current every 3 us).

mod accelerator;
mod instruction;
mod pipeline;
mod tracer;

pub use accelerator::Accelerator;
pub use pipeline::{Core, Executed};
pub(crate) use tracer::Tracer;
pub use tracer::{CycleCount, CycleProfile, Load};
