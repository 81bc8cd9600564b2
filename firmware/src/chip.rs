//! What only this chip can do: its flash, its timers' lever, its last acts, and the core's kernels in its assembly.
pub(crate) mod flash;
pub(crate) mod lever;
pub(crate) mod rescue;

pub(crate) use crate::kernels::Chip;
