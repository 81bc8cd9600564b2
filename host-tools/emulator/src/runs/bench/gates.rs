//! What the kernels may cost.

/// Kernel, unit, and the most that it may take of it: instructions, where the unit is no other one.
pub(crate) const GATES: &[(&str, &str, f64)] = &[
    ("band-pass FIR with mean power", "sample", 52.5),
    ("window, FFT, power and bands", "512 points", 19_600.0),
    // far below what CMSIS-DSP takes, with the check of the signal and room for what compilers make of plain Rust
    ("all features of a slide", "slide of 3 s", 950_000.0),
    // 10 ms
    ("last sample to decision, paper", "decision", 1_680_000.0),
    ("last sample to decision, fused", "decision", 1_680_000.0),
    ("slot, not waiting", "slot", 500.0),
    ("core busy during a slide", "% at 168 MHz", 6.0),
    ("last sample to the verdict on the link", "ms", 10.0),
];

pub(super) fn gate(kernel: &str) -> Option<f64> {
    let of = |(name, _, gate): &(&str, _, f64)| (*name == kernel).then_some(*gate);
    GATES.iter().find_map(of)
}
