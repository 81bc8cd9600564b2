//! The inner loops of a slide for this chip. Their plain twins are `tactus_core::dsp::Kernels::PLAIN`: `cargo xtask
//! bench` compares them, to the bit.

use core::arch::{asm, global_asm};
use core::mem::MaybeUninit;

use tactus_core::dsp::{
    Angles, Complex32, FRAME, Folded, HALVES, HalfFilters, Kernels, TAPS, Taps,
};

use super::transform_kernel;

const AT_ONCE: usize = 12;
const MOST: usize = 22;
/// Words of even samples, of sums and of odd ones that these take: the last ones are read, and do not count.
const WORDS: usize = (TAPS - 1 + MOST * AT_ONCE) / 4 + 4;

/// In RAM: the flash is slower, and what it caches of data is less.
#[unsafe(link_section = ".data.tactus_halves")]
static HALF_FILTERS: HalfFilters = HALVES;

// Two outputs by three filters of half the length instead of four ([`HALVES`]), six of each at once, two products an
// instruction: r2, r4 and r6 are those that begin with the first sample of a pair, r3, r5 and r7 those between them;
// r8 to r10 are pairs of samples, r11 and r12 pairs of coefficients. Six of the 18 steps make the loop: all has to fit
// into the flash accelerator's 1 KB, and an inline assembly block leaves too few registers.
global_asm!(
    // the assembler is not told of the FPU otherwise
    ".fpu fpv4-sp-d16",
    ".macro tactus_fir_step a, b, c",
    "ldrd r11, r12, [r0], #8",
    "smlad r2, \\a, r11, r2",
    "smlad r3, \\a, r12, r3",
    "ldr \\a, [r1], #12",
    "smlad r4, \\b, r11, r4",
    "smlad r5, \\b, r12, r5",
    "smlad r6, \\c, r11, r6",
    "smlad r7, \\c, r12, r7",
    ".endm",
    ".macro tactus_fir_square y",
    "asr \\y, \\y, #8",
    "smlal r11, r12, \\y, \\y",
    ".endm",
    // of two filters of even samples, then of sums less those, that begin here: `x` and `y` are those of odd samples
    ".macro tactus_fir_outputs x, y, at",
    "ldrd r8, r9, [sp, #\\at]",
    "ldrd r10, lr, [sp, #24 + \\at]",
    "add r8, r8, \\x",
    "add r9, r9, \\y",
    "sub r10, r10, \\x",
    "sub lr, lr, \\y",
    "tactus_fir_square r8",
    "tactus_fir_square r9",
    "tactus_fir_square r10",
    ".endm",
    ".section .text.tactus_band_energy,\"ax\",%progbits",
    ".global tactus_band_energy",
    ".type tactus_band_energy,%function",
    ".thumb_func",
    // r0: pairs of coefficients; r1: words of samples; r2: how many twelves, not 0. Sum of squares in r0 and r1.
    "tactus_band_energy:",
    "push {{r4-r11, lr}}",
    // 0: filters of even samples; 24: of sums, less those one later; 48: sum of squares; 56: an odd output without the
    // even samples one later; 60: twelves to go
    "sub sp, sp, #64",
    "mov r3, #0",
    "strd r3, r3, [sp, #48]",
    "str r2, [sp, #60]",
    "add r0, r0, #288",
    // half of what is shifted out, for the even outputs
    "mov r2, #128",
    "bl 8f",
    "strd r2, r3, [sp]",
    "strd r4, r5, [sp, #8]",
    "strd r6, r7, [sp, #16]",
    "1:",
    "sub r0, r0, #432",
    "sub r1, r1, #236",
    // for the odd ones, which are less that of even samples
    "mov r2, #256",
    "bl 8f",
    "add r8, sp, #4",
    "ldm r8, {{r8-r12}}",
    "sub r2, r2, r8",
    "sub r3, r3, r9",
    "sub r4, r4, r10",
    "sub r5, r5, r11",
    "sub r6, r6, r12",
    "strd r2, r3, [sp, #24]",
    "strd r4, r5, [sp, #32]",
    "strd r6, r7, [sp, #40]",
    "sub r1, r1, #236",
    "mov r2, #0",
    "bl 8f",
    "ldrd r11, r12, [sp, #48]",
    "tactus_fir_outputs r2, r3, 0",
    "tactus_fir_square lr",
    "tactus_fir_outputs r4, r5, 8",
    "tactus_fir_square lr",
    "tactus_fir_outputs r6, r7, 16",
    "str lr, [sp, #56]",
    "strd r11, r12, [sp, #48]",
    // even samples of the next twelve
    "sub r1, r1, #212",
    "mov r2, #128",
    "bl 8f",
    "strd r2, r3, [sp]",
    "strd r4, r5, [sp, #8]",
    "strd r6, r7, [sp, #16]",
    "ldrd r11, r12, [sp, #48]",
    "ldrd r8, r9, [sp, #56]",
    "sub r8, r8, r2",
    "tactus_fir_square r8",
    "strd r11, r12, [sp, #48]",
    "subs r9, r9, #1",
    "str r9, [sp, #60]",
    "bne 1b",
    "mov r0, r11",
    "mov r1, r12",
    "add sp, sp, #64",
    "pop {{r4-r11, pc}}",
    // Six outputs of one filter, from r2 on, and r2 added to each.
    "8:",
    "push {{lr}}",
    "ldr r8, [r1], #12",
    "ldr r9, [r1], #12",
    "ldr r10, [r1], #12",
    "ldrd r11, r12, [r0], #8",
    "smlad r3, r8, r12, r2",
    "smlad r4, r9, r11, r2",
    "smlad r5, r9, r12, r2",
    "smlad r6, r10, r11, r2",
    "smlad r7, r10, r12, r2",
    "smlad r2, r8, r11, r2",
    "ldr r8, [r1], #12",
    "mov lr, #2",
    "2:",
    "tactus_fir_step r9, r10, r8",
    "tactus_fir_step r10, r8, r9",
    "tactus_fir_step r8, r9, r10",
    "tactus_fir_step r9, r10, r8",
    "tactus_fir_step r10, r8, r9",
    "tactus_fir_step r8, r9, r10",
    "subs lr, lr, #1",
    "bne 2b",
    "tactus_fir_step r9, r10, r8",
    "tactus_fir_step r10, r8, r9",
    "tactus_fir_step r8, r9, r10",
    "tactus_fir_step r9, r10, r8",
    // the last coefficient of those between
    "ldrd r11, r12, [r0], #8",
    "smlad r3, r10, r12, r3",
    "smlad r5, r8, r12, r5",
    "smlad r7, r9, r12, r7",
    "pop {{pc}}",
    ".size tactus_band_energy, . - tactus_band_energy",
    ".section .text.tactus_halve,\"ax\",%progbits",
    ".global tactus_halve",
    ".type tactus_halve,%function",
    ".thumb_func",
    // r0: samples; r1: words; r2: how many fours of samples, and two follow them
    "tactus_halve:",
    "push {{r4-r6}}",
    "ldr r3, [r0], #4",
    "2:",
    "ldr r12, [r0], #4",
    "pkhbt r4, r3, r12, lsl #16",
    "pkhtb r6, r12, r3, asr #16",
    "ldr r3, [r0], #4",
    // odd ones and the even ones after them
    "pkhbt r5, r12, r3, lsl #16",
    "sadd16 r5, r5, r6",
    "stm r1!, {{r4-r6}}",
    "subs r2, r2, #1",
    "bne 2b",
    "uxth r4, r3",
    "lsr r5, r3, #16",
    "mov r6, r5",
    "stm r1, {{r4-r6}}",
    "pop {{r4-r6}}",
    "bx lr",
    ".size tactus_halve, . - tactus_halve",
    ".text",
);

unsafe extern "C" {
    /// `words` are those that `tactus_halve` made of [`TAPS`] - 1 and 12 `twelves` samples, 3 more, and at least one
    /// is to be computed.
    fn tactus_band_energy(
        filters: *const HalfFilters,
        words: *const [u32; 3],
        twelves: usize,
    ) -> u64;
    /// Makes `words` of 4 `fours` and 2 samples, one more than `fours`: even samples, sums of an odd one and the even
    /// one after it, and odd ones, two to a word. No sample is outside -16384..=16383.
    fn tactus_halve(samples: *const i16, words: *mut [u32; 3], fours: usize);
}

/// [`clip`] of a multiple of 4 samples, not 0.
///
/// # Safety
/// They are there, as many in both.
#[inline(never)]
unsafe fn clip_fours(samples: *const i16, clipped: *mut i16, many: usize) {
    // SAFETY: it reads and writes as many; words need not be aligned.
    unsafe {
        asm!(
            "2:",
            "ldr {a}, [{from}], #4",
            "ldr {b}, [{from}], #4",
            "ssat16 {a}, #13, {a}",
            "ssat16 {b}, #13, {b}",
            "str {a}, [{to}], #4",
            "str {b}, [{to}], #4",
            "cmp {from}, {end}",
            "bne 2b",
            from = inout(reg) samples => _,
            to = inout(reg) clipped => _,
            end = in(reg) samples.add(many),
            a = out(reg) _,
            b = out(reg) _,
            options(nostack),
        );
    }
}

/// [`Kernels::fold_frame`], two angles at a time: sums of two samples by one instruction, and then what the plain one
/// does, in its order (VMLA rounds the product).
#[inline(never)]
fn fold_frame<'r>(
    angles: &Angles,
    frame: &[i16; FRAME],
    buffer: &'r mut MaybeUninit<Folded>,
) -> &'r mut Folded {
    let begin: *mut Complex32 = buffer.as_mut_ptr().cast();
    // SAFETY: it reads all angles, an even number, and the whole frame, whose words need not be aligned; all of
    // `buffer` is written.
    unsafe {
        asm!(
            "2:",
            "ldr {c}, [{f}, #{half}]",
            "ldr {b}, [{f}, #{quarter}]",
            "ldr {d}, [{f}, #{three_quarters}]",
            "ldr {a}, [{f}], #4",
            "vldmia {angles}!, {{s16-s19}}",
            "sadd16 {x}, {a}, {c}",
            "ssub16 {a}, {a}, {c}",
            "sadd16 {c}, {b}, {d}",
            "ssub16 {b}, {b}, {d}",
            "vmov s8, s9, {x}, {c}",
            "asr {x}, {x}, #16",
            "asr {c}, {c}, #16",
            "vmov s10, s11, {x}, {c}",
            "vmov s0, s1, {a}, {b}",
            "asr {a}, {a}, #16",
            "asr {b}, {b}, #16",
            "vmov s2, s3, {a}, {b}",
            "vcvt.f32.s16 s8, s8, #0",
            "vcvt.f32.s16 s9, s9, #0",
            "vcvt.f32.s16 s0, s0, #0",
            "vcvt.f32.s16 s1, s1, #0",
            "vcvt.f32.s32 s10, s10",
            "vcvt.f32.s32 s11, s11",
            "vcvt.f32.s32 s2, s2",
            "vcvt.f32.s32 s3, s3",
            // even bins from s8 on, p and q of the odd ones from s0 on
            "vmul.f32 s4, s16, s8",
            "vmls.f32 s8, s16, s0",
            "vsub.f32 s0, s0, s4",
            "vmul.f32 s5, s17, s9",
            "vmla.f32 s9, s17, s1",
            "vadd.f32 s1, s1, s5",
            "vmul.f32 s4, s18, s10",
            "vmls.f32 s10, s18, s2",
            "vsub.f32 s2, s2, s4",
            "vmul.f32 s5, s19, s11",
            "vmla.f32 s11, s19, s3",
            "vadd.f32 s3, s3, s5",
            "vmul.f32 s12, s0, s16",
            "vmls.f32 s12, s1, s17",
            "vnmul.f32 s13, s0, s17",
            "vmls.f32 s13, s1, s16",
            "vmul.f32 s14, s2, s18",
            "vmls.f32 s14, s3, s19",
            "vnmul.f32 s15, s2, s19",
            "vmls.f32 s15, s3, s18",
            "vstmia {odd}!, {{s12-s15}}",
            "vstmia {even}!, {{s8-s11}}",
            "cmp {odd}, {end}",
            "bne 2b",
            quarter = const 2 * FRAME / 4,
            half = const 2 * FRAME / 2,
            three_quarters = const 2 * FRAME / 4 * 3,
            angles = inout(reg) angles.as_ptr() => _,
            f = inout(reg) frame.as_ptr() => _,
            odd = inout(reg) begin => _,
            even = inout(reg) begin.add(FRAME / 4) => _,
            end = in(reg) begin.add(FRAME / 4),
            a = out(reg) _, b = out(reg) _, c = out(reg) _, d = out(reg) _, x = out(reg) _,
            out("s0") _, out("s1") _, out("s2") _, out("s3") _, out("s4") _, out("s5") _, out("s6") _, out("s7") _,
            out("s8") _, out("s9") _, out("s10") _, out("s11") _, out("s12") _, out("s13") _, out("s14") _,
            out("s15") _,
            out("s16") _, out("s17") _, out("s18") _, out("s19") _,
            options(nostack),
        );
        buffer.assume_init_mut()
    }
}

/// [`fold`] of so many in both, a multiple of 4.
///
/// # Safety
/// They are there.
#[inline(never)]
unsafe fn fold_fours(
    angles: &Angles,
    reals: *const Complex32,
    folded: *mut Complex32,
    many: usize,
) {
    let half = many / 2;
    // SAFETY: it reads all of `reals`, writes all of `folded`, and takes as many angles as half of that, two at a time.
    unsafe {
        asm!(
            "2:",
            "vldmia {a}!, {{s0-s3}}",
            "vldmia {b}!, {{s4-s7}}",
            "vldr d8, [{angle}]",
            "add {angle}, {angle}, {step}",
            "vldr d9, [{angle}]",
            "add {angle}, {angle}, {step}",
            "vadd.f32 s8, s0, s1",
            "vadd.f32 s9, s4, s5",
            "vadd.f32 s10, s2, s3",
            "vadd.f32 s11, s6, s7",
            "vsub.f32 s0, s0, s1",
            "vsub.f32 s4, s4, s5",
            "vsub.f32 s2, s2, s3",
            "vsub.f32 s6, s6, s7",
            "vmul.f32 s12, s0, s16",
            "vmls.f32 s12, s4, s17",
            "vnmul.f32 s13, s0, s17",
            "vmls.f32 s13, s4, s16",
            "vmul.f32 s14, s2, s18",
            "vmls.f32 s14, s6, s19",
            "vnmul.f32 s15, s2, s19",
            "vmls.f32 s15, s6, s18",
            "vstmia {odd}!, {{s12-s15}}",
            "vstmia {even}!, {{s8-s11}}",
            "cmp {odd}, {end}",
            "bne 2b",
            angle = inout(reg) angles.as_ptr() => _,
            step = in(reg) size_of_val(angles).checked_div(half).unwrap_or(0),
            a = inout(reg) reals => _,
            b = inout(reg) reals.add(half) => _,
            odd = inout(reg) folded => _,
            even = inout(reg) folded.add(half) => _,
            end = in(reg) folded.add(half),
            out("s0") _, out("s1") _, out("s2") _, out("s3") _, out("s4") _, out("s5") _, out("s6") _, out("s7") _,
            out("s8") _, out("s9") _, out("s10") _, out("s11") _, out("s12") _, out("s13") _, out("s14") _,
            out("s15") _,
            out("s16") _, out("s17") _, out("s18") _, out("s19") _,
            options(nostack),
        );
    }
}

/// [`add_power`] of so many, a multiple of 8 and not 0.
///
/// # Safety
/// They are there.
#[inline(never)]
unsafe fn add_power_eights(bins: *const Complex32, powers: *mut f32, sums: *mut f32, many: usize) {
    // SAFETY: it reads and writes as many.
    unsafe {
        asm!(
            "2:",
            "vldmia {bins}!, {{s0-s15}}",
            "vmul.f32 s16, s0, s0",
            "vmul.f32 s17, s2, s2",
            "vmul.f32 s18, s4, s4",
            "vmul.f32 s19, s6, s6",
            "vmul.f32 s20, s8, s8",
            "vmul.f32 s21, s10, s10",
            "vmul.f32 s22, s12, s12",
            "vmul.f32 s23, s14, s14",
            "vmla.f32 s16, s1, s1",
            "vmla.f32 s17, s3, s3",
            "vmla.f32 s18, s5, s5",
            "vmla.f32 s19, s7, s7",
            "vmla.f32 s20, s9, s9",
            "vmla.f32 s21, s11, s11",
            "vmla.f32 s22, s13, s13",
            "vmla.f32 s23, s15, s15",
            "vldmia {sums}, {{s0-s7}}",
            "vstmia {powers}!, {{s16-s23}}",
            "vadd.f32 s0, s0, s16",
            "vadd.f32 s1, s1, s17",
            "vadd.f32 s2, s2, s18",
            "vadd.f32 s3, s3, s19",
            "vadd.f32 s4, s4, s20",
            "vadd.f32 s5, s5, s21",
            "vadd.f32 s6, s6, s22",
            "vadd.f32 s7, s7, s23",
            "vstmia {sums}!, {{s0-s7}}",
            "cmp {sums}, {end}",
            "bne 2b",
            bins = inout(reg) bins => _,
            powers = inout(reg) powers => _,
            sums = inout(reg) sums => _,
            end = in(reg) sums.add(many),
            out("s0") _, out("s1") _, out("s2") _, out("s3") _, out("s4") _, out("s5") _, out("s6") _, out("s7") _,
            out("s8") _, out("s9") _, out("s10") _, out("s11") _, out("s12") _, out("s13") _, out("s14") _,
            out("s15") _,
            out("s16") _, out("s17") _, out("s18") _, out("s19") _, out("s20") _, out("s21") _, out("s22") _,
            out("s23") _,
            options(nostack),
        );
    }
}

pub(crate) const KERNELS: Kernels = Kernels {
    clip,
    band_energy,
    fold_frame,
    fold,
    transform: transform_kernel::transform,
    transform_reals: transform_kernel::transform_reals,
    add_power,
};

fn clip(samples: &[i16], clipped: &mut [i16]) {
    let many = samples.len().min(clipped.len()) & !3;
    if many > 0 {
        // SAFETY: there are so many of both.
        unsafe { clip_fours(samples.as_ptr(), clipped.as_mut_ptr(), many) };
    }
    let rest = samples.get(many..).zip(clipped.get_mut(many..));
    let (samples, clipped) = rest.unwrap_or_default();
    (Kernels::PLAIN.clip)(samples, clipped);
}

fn band_energy(taps: &Taps, samples: &[i16]) -> u64 {
    let mut words = MaybeUninit::<[[u32; 3]; WORDS]>::uninit();
    let words: *mut [u32; 3] = words.as_mut_ptr().cast();
    let (mut sum, mut rest) = (0, samples);
    loop {
        let twelves = rest.len().saturating_sub(TAPS - 1) / AT_ONCE;
        let twelves = twelves.min(MOST);
        if twelves == 0 {
            return sum + (Kernels::PLAIN.band_energy)(taps, rest);
        }
        // SAFETY: as `twelves` was computed, no sample is read that is not there, and the words have room for them;
        // what of these was never written does not count.
        unsafe {
            tactus_halve(rest.as_ptr(), words, (TAPS - 1 + AT_ONCE * twelves) / 4);
            sum += tactus_band_energy(&raw const HALF_FILTERS, words, twelves);
        }
        rest = rest.get(AT_ONCE * twelves..).unwrap_or_default();
    }
}

fn fold(angles: &Angles, reals: &[Complex32], folded: &mut [Complex32]) {
    let many = reals.len();
    if many != folded.len() || many % 4 != 0 || many == 0 || many > FRAME / 4 {
        return (Kernels::PLAIN.fold)(angles, reals, folded);
    }
    // SAFETY: there are so many.
    unsafe { fold_fours(angles, reals.as_ptr(), folded.as_mut_ptr(), many) };
}

fn add_power(bins: &[Complex32], powers: &mut [f32], sums: &mut [f32]) {
    let many = bins.len();
    if many != powers.len() || many != sums.len() || many % 8 != 0 || many == 0 {
        return (Kernels::PLAIN.add_power)(bins, powers, sums);
    }
    // SAFETY: there are so many.
    unsafe { add_power_eights(bins.as_ptr(), powers.as_mut_ptr(), sums.as_mut_ptr(), many) };
}
