//! What the kernels may cost.

/// Kernel, unit, and the most that it may take of it: instructions, where the unit is no other one.
pub(crate) const GATES: &[(&str, &str, f64)] = &[
    ("band-pass FIR with mean power", "sample", 52.5),
    ("window, FFT, power accumulated", "512 points", 16_500.0),
    ("all features of a slide", "slide of 3 s", 800_000.0),
    ("posterior, paper", "117 textures", 7200.0),
    ("first choice, paper", "choice", 2000.0),
    ("choice among 50 live textures, paper", "choice", 250_000.0),
    ("last sample to decision, paper", "decision", 300_000.0),
    // 1.2 times the 11,826 that it took before each two axes had a weight of their own
    ("posterior, fused", "117 textures", 14_200.0),
    ("first choice, fused", "choice", 2000.0),
    // pairs that can hardly be confused cost less, so these are of the bench's own table
    ("choice among 50 live textures, fused", "choice", 99_300.0),
    ("choice among 20 live textures, fused", "choice", 30_600.0),
    ("last sample to decision, fused", "decision", 152_000.0),
    // with what it takes to know the first part of slides of this movement, once an exploration
    ("a look at a slide, fused", "117 textures", 84_000.0),
    ("slot, not waiting", "slot", 500.0),
    ("core busy during a slide", "% at 168 MHz", 6.0),
    ("last sample to the verdict on the link", "ms", 5.0),
];

/// The gate of a kernel.
pub(super) fn gate(kernel: &str) -> Option<f64> {
    let of = |(name, _, gate): &(&str, _, f64)| (*name == kernel).then_some(*gate);
    GATES.iter().find_map(of)
}
