//! The inner loops of a decision for this chip. Their plain twins are `tactus_core::dsp::Plain`: `cargo xtask bench`
//! compares them, to the bit.

use core::arch::global_asm;
use core::mem::offset_of;

use tactus_core::dsp::Plain;
use tactus_core::dsp::fixed::{EXP2, LN, LN_2, LOG2_E, PARTS};
use tactus_core::explorer::kernels::{Candidate, Kernels, Likeness, LiveGaussian, Spread};
use tactus_core::features::MAX_FEATURES;
use tactus_core::table::{Gaussians, PAIRS, Row, Words};

use super::confusion_kernel::confuse;
use super::dsp_kernels::Chip;

// loads of two or three fields at once
const _: () = assert!(
    offset_of!(Candidate, mean) == 0
        && offset_of!(Candidate, square) == 28
        && offset_of!(Candidate, confused) == offset_of!(Candidate, probability) + 4
);

global_asm!(
    // the assembler is not told of the FPU otherwise
    ".fpu fpv4-sp-d16",
    // One texture: r4 to r10 are the mean that the others are compared with, two numbers each, r1 where the next texture's
    // begins, r2 the next logarithm.
    ".macro tactus_likelihood last",
    "2:",
    // the odds to r11 and r12, Q32: pairs of squares, each with its weight
    "ldr r0, [r1]",
    "qsub16 r0, r4, r0",
    "smuad r0, r0, r0",
    "ldrd r3, lr, [sp, #60]",
    "umull r11, r12, r0, r3",
    "tactus_square r5, lr, 4",
    "ldrd r3, lr, [sp, #68]",
    "tactus_square r6, r3, 8",
    "tactus_square r7, lr, 12",
    "ldrd r3, lr, [sp, #76]",
    "tactus_square r8, r3, 16",
    "tactus_square r9, lr, 20",
    // the last weight, and how far it is to the next mean
    "ldrd r3, lr, [sp, #84]",
    "tactus_square r10, r3, 24, \\last",
    "add r1, r1, lr",
    // to r0, Q16, if they are below 2^30
    "cmp r12, #0x3f00",
    "bhs 3f",
    "lsr r0, r11, #16",
    "orr r0, r0, r12, lsl #16",
    "add r0, r0, #65536",
    // their logarithm: octaves in r11, the mantissa in r12
    "clz r11, r0",
    "lsl r12, r0, r11",
    "rsb r11, r11, #15",
    "lsr r0, r12, #26",
    "ldrd lr, r3, [sp, #36]",
    "add r0, lr, r0, lsl #3",
    "ldrd r0, lr, [r0]",
    "lsl r12, r12, #6",
    "umull r12, lr, r12, lr",
    "add r0, r0, lr",
    // ln 2, and half of what is shifted out
    "ldrd r12, lr, [sp, #44]",
    "umaal r0, lr, r11, r12",
    "lsr r0, r0, #16",
    "orr r0, r0, lr, lsl #16",
    // half of twice the norm and 1 less the weighted logarithm: the norm less its half, rounded down
    "ldrd r11, r12, [sp, #52]",
    "mls r0, r0, r11, r12",
    "ldr lr, [r2]",
    "add lr, lr, r0, asr #1",
    "str lr, [r2], #4",
    "cmp r2, r3",
    "bne 2b",
    "3:",
    "mov r0, r2",
    "pop {{r4-r11, pc}}",
    ".endm",
    ".macro tactus_square a, weight, at, load=ldr",
    "\\load r0, [r1, #\\at]",
    "qsub16 r0, \\a, r0",
    // 2^31 at most
    "smuad r0, r0, r0",
    "umlal r11, r12, r0, \\weight",
    ".endm",
    ".section .text.tactus_likelihoods,\"ax\",%progbits",
    ".global tactus_likelihoods",
    ".type tactus_likelihoods,%function",
    ".thumb_func",
    // r0: the mean; r1: the first texture's; r2: logarithms; r3: whether there is a fourteenth number. On the stack [`LN`],
    // as if it began 32 parts before (36); where the logarithms end (40); ln 2 in Q32 (44) and 2^15 (48); weight (52), twice
    // the norm and 1 (56); the narrowness of each pair of axes in Q16 (60), and how far one mean is from the next (88).
    "tactus_likelihoods:",
    "push {{r4-r11, lr}}",
    // a word at a time, which need not be aligned
    ".irp pair, 4, 5, 6, 7, 8, 9",
    "ldr r\\pair, [r0, #(\\pair - 4) * 4]",
    ".endr",
    "cmp r3, #0",
    "beq 1f",
    "ldr r10, [r0, #24]",
    "tactus_likelihood ldr",
    "1:",
    "ldrh r10, [r0, #24]",
    "tactus_likelihood ldrh",
    ".size tactus_likelihoods, . - tactus_likelihoods",
    ".section .text.tactus_gaussians,\"ax\",%progbits",
    ".global tactus_gaussians",
    ".type tactus_gaussians,%function",
    ".thumb_func",
    // s0: the property, in steps of the means; s1: what its distance is multiplied with; r0: cells, r3 from one to the next;
    // r1: logarithms, r2 where they end; on the stack [`LN`], as if it began 32 parts before, and ln 2 in Q32.
    "tactus_gaussians:",
    "push {{r4-r11, lr}}",
    "ldrd r4, r5, [sp, #36]",
    "2:",
    "ldr r6, [r0]",
    "add r0, r0, r3",
    "lsrs r7, r6, #16",
    "beq 3f",
    "vmov s2, s3, r6, r7",
    "vcvt.f32.s16 s2, s2, #0",
    "vcvt.f32.u16 s3, s3, #0",
    "vsub.f32 s2, s0, s2",
    "vdiv.f32 s2, s2, s3",
    // while that goes on: the logarithm of the standard deviation, as of the odds above
    "clz r8, r6",
    "bfc r6, #0, #16",
    "lsl r6, r6, r8",
    "rsb r8, r8, #15",
    "lsr r10, r6, #26",
    "add r10, r4, r10, lsl #3",
    "ldrd r10, r11, [r10]",
    "lsl r6, r6, #6",
    "umull r6, r11, r6, r11",
    "add r10, r10, r11",
    "mov r11, #32768",
    "umaal r10, r11, r8, r5",
    "lsr r10, r10, #16",
    "orr r10, r10, r11, lsl #16",
    "ldr r6, [r1]",
    "sub r6, r6, r10",
    "vmul.f32 s2, s2, s1",
    "vmul.f32 s2, s2, s2",
    "vcvt.s32.f32 s2, s2",
    "vmov r9, s2",
    "usat r9, #26, r9",
    "sub r6, r6, r9",
    "str r6, [r1], #4",
    "cmp r1, r2",
    "bne 2b",
    "pop {{r4-r11, pc}}",
    "3:",
    "add r1, r1, #4",
    "cmp r1, r2",
    "bne 2b",
    "pop {{r4-r11, pc}}",
    ".size tactus_gaussians, . - tactus_gaussians",
    ".section .text.tactus_top,\"ax\",%progbits",
    ".global tactus_top",
    ".type tactus_top,%function",
    ".thumb_func",
    // r0: numbers, a multiple of 4; r1: where they end, behind the first; r2: the least that it is
    "tactus_top:",
    "push {{r4-r6, lr}}",
    "2:",
    "ldm r0!, {{r3-r6}}",
    ".irp next, r3, r4, r5, r6",
    "cmp \\next, r2",
    "it gt",
    "movgt r2, \\next",
    ".endr",
    "cmp r0, r1",
    "bne 2b",
    "mov r0, r2",
    "pop {{r4-r6, pc}}",
    ".size tactus_top, . - tactus_top",
    ".section .text.tactus_weigh,\"ax\",%progbits",
    ".global tactus_weigh",
    ".type tactus_weigh,%function",
    ".thumb_func",
    // r0: logarithms, r3 the greatest; r1: parts of that one's probability, in whole numbers, r2 where they end, behind the
    // first; on the stack [`EXP2`] and 1 / ln 2 in Q31. The sum of the parts in r0 and r1.
    ".macro tactus_weigh_one x",
    "sub \\x, r3, \\x",
    // 2^-46 at the least, which is 0
    "usat \\x, #21, \\x",
    // octaves in Q21: whole ones, 5 bits of a part, 16 between
    "lsl \\x, \\x, #6",
    "umull r10, \\x, \\x, r5",
    "ubfx r10, \\x, #16, #5",
    "add r10, r4, r10, lsl #3",
    "ldrd r10, r11, [r10]",
    "lsl r12, \\x, #16",
    "umull r11, r12, r12, r11",
    "sub r10, r10, r12",
    "lsr \\x, \\x, #21",
    "lsr \\x, r10, \\x",
    // as it is, to 64 bits
    "umlal r6, r7, \\x, lr",
    ".endm",
    "tactus_weigh:",
    "push {{r4-r11, lr}}",
    "ldrd r4, r5, [sp, #36]",
    "mov r6, #0",
    "mov r7, #0",
    "mov lr, #1",
    // an odd one first
    "sub r8, r2, r1",
    "tst r8, #4",
    "beq 2f",
    "ldr r8, [r0], #4",
    "tactus_weigh_one r8",
    "str r8, [r1], #4",
    "cmp r1, r2",
    "beq 3f",
    "2:",
    "ldrd r8, r9, [r0], #8",
    "tactus_weigh_one r8",
    "tactus_weigh_one r9",
    "strd r8, r9, [r1], #8",
    "cmp r1, r2",
    "bne 2b",
    "3:",
    "mov r0, r6",
    "mov r1, r7",
    "pop {{r4-r11, pc}}",
    ".size tactus_weigh, . - tactus_weigh",
    ".section .text.tactus_divide,\"ax\",%progbits",
    ".global tactus_divide",
    ".type tactus_divide,%function",
    ".thumb_func",
    // r0: whole numbers, a multiple of 8, which become floats; r1: where they end, behind the first; s0: what they are
    // divided by
    "tactus_divide:",
    "vmov.f32 s8, s0",
    "2:",
    "vldmia r0, {{s0-s7}}",
    ".irp next, s0, s1, s2, s3, s4, s5, s6, s7",
    "vcvt.f32.u32 \\next, \\next",
    "vdiv.f32 \\next, \\next, s8",
    ".endr",
    "vstmia r0!, {{s0-s7}}",
    "cmp r0, r1",
    "bne 2b",
    "bx lr",
    ".size tactus_divide, . - tactus_divide",
    ".section .text.tactus_reset_to_prior,\"ax\",%progbits",
    ".global tactus_reset_to_prior",
    ".type tactus_reset_to_prior,%function",
    ".thumb_func",
    // r0: numbers, a multiple of 8; r1: where they end, behind the first
    "tactus_reset_to_prior:",
    "push {{r4-r9}}",
    ".irp next, r2, r3, r4, r5, r6, r7, r8, r9",
    "mov \\next, #0",
    ".endr",
    "2:",
    "stm r0!, {{r2-r9}}",
    "cmp r0, r1",
    "bne 2b",
    "pop {{r4-r9}}",
    "bx lr",
    ".size tactus_reset_to_prior, . - tactus_reset_to_prior",
    ".section .text.tactus_confuse_whitened,\"ax\",%progbits",
    ".global tactus_confuse_whitened",
    ".type tactus_confuse_whitened,%function",
    ".thumb_func",
    // r0: the one texture; r1: the others, r2 where they end, behind the first; r3: [`EXP2`]; on the stack a `Likeness`. Half
    // of what is far, less half of the one's square, is where the sum of the products begins: twice that less the other's
    // square is below 0 where they are not far.
    "tactus_confuse_whitened:",
    "push {{r4-r11, lr}}",
    "mov lr, r2",
    "ldrd r4, r5, [sp, #36]",
    "push {{r0}}",
    "push {{r3-r5}}",
    "vldr d0, [r0, #{probability}]",
    "ldr r12, [r0, #{square}]",
    "add r12, r12, #1",
    "lsr r12, r12, #1",
    "rsb r12, r12, r5, lsr #1",
    "ldm r0, {{r4-r10}}",
    "2:",
    "ldm r1!, {{r0, r2, r3}}",
    "smlad r11, r4, r0, r12",
    "smlad r11, r5, r2, r11",
    "smlad r11, r6, r3, r11",
    "ldm r1!, {{r0, r2, r3}}",
    "smlad r11, r7, r0, r11",
    "smlad r11, r8, r2, r11",
    "smlad r11, r9, r3, r11",
    "ldrd r0, r2, [r1], #{size} - 24",
    "smlad r11, r10, r0, r11",
    "subs r2, r2, r11, lsl #1",
    "bpl 3f",
    "ldm sp, {{r0, r3, r11}}",
    "add r2, r2, r11",
    // octaves in Q18: whole ones, 5 bits of a part, 13 between
    "umull r11, r2, r2, r3",
    "ubfx r3, r2, #13, #5",
    "add r0, r0, r3, lsl #3",
    "ldrd r0, r3, [r0]",
    "lsl r11, r2, #19",
    "umull r3, r11, r11, r3",
    "sub r0, r0, r11",
    "lsr r2, r2, #18",
    "lsr r0, r0, r2",
    "vmov s4, r0",
    "vcvt.f32.u32 s4, s4, #30",
    // probability, and what it is confused with
    "vldr d3, [r1, #{probability} - {size}]",
    "vmla.f32 s1, s4, s6",
    "vmla.f32 s7, s4, s0",
    "vstr s7, [r1, #{probability} + 4 - {size}]",
    "3:",
    "cmp r1, lr",
    "bne 2b",
    "pop {{r0-r3}}",
    "vstr s1, [r3, #{probability} + 4]",
    "pop {{r4-r11, pc}}",
    ".size tactus_confuse_whitened, . - tactus_confuse_whitened",
    ".section .text.tactus_products,\"ax\",%progbits",
    ".global tactus_products",
    ".type tactus_products,%function",
    ".thumb_func",
    // r0: the row, which need not be aligned; r1: the others. The sum in r0 and r1.
    "tactus_products:",
    "push {{r4-r11, lr}}",
    "ldm r1, {{r4-r10}}",
    "mov r2, #0",
    "mov r3, #0",
    ".irp other, 4, 5, 6, 7, 8, 9, 10",
    "ldr r11, [r0, #(\\other - 4) * 4]",
    "smlald r2, r3, r11, r\\other",
    ".endr",
    "mov r0, r2",
    "mov r1, r3",
    "pop {{r4-r11, pc}}",
    ".size tactus_products, . - tactus_products",
    ".section .text.tactus_sqrt,\"ax\",%progbits",
    ".global tactus_sqrt",
    ".type tactus_sqrt,%function",
    ".thumb_func",
    // as `extern "C"` has it on a target with floating-point registers: s0 to s0
    "tactus_sqrt:",
    "vsqrt.f32 s0, s0",
    "bx lr",
    ".size tactus_sqrt, . - tactus_sqrt",
    ".text",
    square = const offset_of!(Candidate, square),
    probability = const offset_of!(Candidate, probability),
    size = const size_of::<Candidate>(),
);

/// [`Spread::narrowness`] on the stack, one after the other.
#[repr(C)]
struct Narrowness([u32; PAIRS]);

unsafe extern "C" {
    /// `from` has 13 numbers, 14 if `even`, and so has each of the `means`, `stride` bytes after each other, of which there
    /// are as many as logarithms up to `end`, one at least; `ln` is 256 bytes before [`LN`].
    fn tactus_likelihoods(
        from: *const i16,
        means: *const u8,
        logs: *mut i32,
        even: bool,
        ln: *const u32,
        end: *const i32,
        ln_2: u32,
        half: u32,
        weight: i32,
        norm: i32,
        narrowness: Narrowness,
        stride: usize,
    ) -> *mut i32;
    /// There are as many `cells`, 4 bytes, `stride` after each other, as logarithms up to `end`, one at least; `ln` is 256
    /// bytes before [`LN`].
    fn tactus_gaussians(
        cells: *const u8,
        logs: *mut i32,
        end: *const i32,
        stride: usize,
        ln: *const u32,
        ln_2: u32,
        x: f32,
        scale: f32,
    );
    /// There are 4, 8, 12... numbers up to `end`.
    fn tactus_top(numbers: *const i32, end: *const i32, least: i32) -> i32;
    /// There are as many logarithms as parts up to `end`, one at least.
    fn tactus_weigh(
        logs: *const i32,
        parts: *mut u32,
        end: *const u32,
        top: i32,
        exp2: *const [u32; 2],
        log2_e: u32,
    ) -> u64;
    /// There are 8, 16, 24... numbers up to `end`, the bits of whole ones.
    fn tactus_divide(numbers: *mut f32, end: *const f32, by: f32);
    /// There are 8, 16, 24... numbers up to `end`.
    fn tactus_reset_to_prior(numbers: *mut i32, end: *const i32);
    /// There is at least one of `others`, and `behind` is where the last of them ends.
    fn tactus_confuse_whitened(
        a: *mut Candidate,
        others: *mut Candidate,
        behind: *const Candidate,
        exp2: *const [u32; 2],
        octaves: u32,
        far: u32,
    );
    safe fn tactus_products(row: &Row, others: &Words) -> i64;
    safe fn tactus_sqrt(x: f32) -> f32;
}

/// How many parts of a column there are, each so many bytes and so far from the next.
fn there(column: &[u8], stride: usize, bytes: usize) -> usize {
    match column.len().checked_sub(bytes) {
        Some(rest) if stride >= bytes => rest.checked_div(stride).map_or(0, |others| others + 1),
        _ => 0,
    }
}

/// [`LN`] as if it began 32 parts before: the first bit of a mantissa is the one.
fn before_ln() -> *const u32 {
    LN.as_ptr().cast::<u32>().wrapping_sub(2 * PARTS)
}

impl Kernels for Chip {
    fn reset_to_prior(logs: &mut [i32]) {
        let (eights, rest) = logs.as_chunks_mut::<8>();
        let eights = eights.as_flattened_mut().as_mut_ptr_range();
        if !eights.is_empty() {
            // SAFETY: they are whole eights.
            unsafe { tactus_reset_to_prior(eights.start, eights.end) };
        }
        for log in rest {
            *log = 0;
        }
    }

    fn add_likelihoods(
        from: &[i16],
        means: &[u8],
        stride: usize,
        spread: &Spread,
        logs: &mut [i32],
    ) -> usize {
        let many = logs.len().min(there(means, stride, 2 * from.len()));
        let even = from.len() == MAX_FEATURES;
        if many == 0 || !even && from.len() != MAX_FEATURES - 1 {
            return Plain::add_likelihoods(from, means, stride, spread, logs);
        }
        let logs = logs.as_mut_ptr();
        // SAFETY: `many` means were found to be there, and as many logarithms; words need not be aligned.
        unsafe {
            let done = tactus_likelihoods(
                from.as_ptr(),
                means.as_ptr(),
                logs,
                even,
                before_ln(),
                logs.add(many),
                LN_2,
                1 << 15,
                spread.weight,
                2 * spread.norm + 1,
                Narrowness(spread.narrowness),
                stride,
            );
            done.offset_from_unsigned(logs)
        }
    }

    fn add_gaussians(x: f32, known: &Gaussians<'_>, logs: &mut [i32]) {
        let (cells, stride) = known.bytes();
        let many = logs.len().min(there(cells, stride, 4));
        if many > 0 {
            let logs = logs.as_mut_ptr();
            // SAFETY: `many` cells were found to be there, and as many logarithms; words need not be aligned.
            unsafe {
                let (cells, end) = (cells.as_ptr(), logs.add(many));
                tactus_gaussians(
                    cells,
                    logs,
                    end,
                    stride,
                    before_ln(),
                    LN_2,
                    x,
                    known.scale(),
                );
            }
        }
    }

    fn posterior(logs: &[i32], posterior: &mut [f32]) -> (i32, f32) {
        let many = logs.len().min(posterior.len());
        if many == 0 {
            return (0, 0.0);
        }
        let (fours, rest) = logs.as_chunks::<4>();
        let mut top = rest.iter().copied().max().unwrap_or(i32::MIN);
        let fours = fours.as_flattened().as_ptr_range();
        if !fours.is_empty() {
            // SAFETY: they are whole fours.
            top = unsafe { tactus_top(fours.start, fours.end, top) };
        }
        let begin = posterior.as_mut_ptr().cast::<u32>();
        // SAFETY: there are `many` of both.
        let sum = unsafe {
            let end = begin.add(many);
            tactus_weigh(logs.as_ptr(), begin, end, top, EXP2.as_ptr(), 2 * LOG2_E)
        };
        let total = sum as f32;
        let (eights, rest) = posterior.as_chunks_mut::<8>();
        let eights = eights.as_flattened_mut().as_mut_ptr_range();
        if !eights.is_empty() {
            // SAFETY: they are whole eights.
            unsafe { tactus_divide(eights.start, eights.end, total) };
        }
        for p in rest {
            *p = p.to_bits() as f32 / total;
        }
        (top, total)
    }

    fn products(row: &Row, others: &Words) -> i64 {
        tactus_products(row, others)
    }

    fn confuse_whitened(a: &mut Candidate, others: &mut [Candidate], fewer: u8) {
        let Likeness { octaves, far } = Likeness::new(fewer);
        let others = others.as_mut_ptr_range();
        if !others.is_empty() {
            // SAFETY: there is one at least, and the others end where it is said.
            unsafe {
                tactus_confuse_whitened(a, others.start, others.end, EXP2.as_ptr(), octaves, far);
            }
        }
    }

    fn confuse(a: &mut LiveGaussian, others: &mut [LiveGaussian]) {
        confuse(a, others);
    }

    fn sqrt(x: f32) -> f32 {
        tactus_sqrt(x)
    }
}
