//! What only this chip can do: its flash, its timers' lever, its last acts, and the core's kernels in its assembly.
mod confusion_kernel;
mod decision_kernels;
mod dsp_kernels;
pub(crate) mod flash;
pub(crate) mod lever;
pub(crate) mod rescue;

pub(crate) use dsp_kernels::Chip;
