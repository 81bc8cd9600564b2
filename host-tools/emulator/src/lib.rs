//! The NUCLEO-F429ZI in software, with the simulated rig on its pins: runs the firmware's ELF, unmodified.
//!
//! Chip and core are rigless' (STM32F427, Cortex-M4F); the rig is [`tactus_world`]. Everything goes by virtual time and
//! by seeds: the same ELF, [`Setup`](tactus_world::world::Setup) and calls give the same run.
//!
//! What passes here says much for logic and use of the drivers and nothing for silicon: instructions take 1/168 us
//! each, whatever they are, and no wire has a length.
//!
//! The rooms, each of which knows those before it: [`board`], [`host`], then [`runs`].

pub mod board;
pub mod host;
pub mod runs;
