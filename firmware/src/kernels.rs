//! The core's inner loops for this chip. Their plain twins are `tactus_core::kernels::Plain`: `cargo xtask bench` compares
//! them, to the bit.

use core::arch::{asm, global_asm};
use core::mem::{MaybeUninit, offset_of};

use tactus_core::fir::{TAPS, Taps};
use tactus_core::fixed::{EXP2 as EXP2_PARTS, LN, LN_2, LOG2_E, PARTS};
use tactus_core::fused::MAX_FEATURES;
use tactus_core::kernels::{Candidate, EXP2, FAR, Kernels, Live, Plain, ROUND, Spread};
use tactus_core::spectrum::{Angles, Complex32, FRAME, Folded};
use tactus_core::table::{Gaussian, Gaussians};

/// Outputs of the band-pass that are computed at once.
const AT_ONCE: usize = 6;

// Six outputs at once, two products an instruction: r2, r4 and r6 are those that begin with the first sample of a pair, r3, r5
// and r7 those between them; r8 to r10 are pairs of samples, r11 and r12 pairs of coefficients. Six of the 34 steps make the
// loop: it has to fit into the flash accelerator's 1 KB, and an inline assembly block leaves too few registers.
global_asm!(
    // the assembler is not told of the FPU otherwise
    ".fpu fpv4-sp-d16",
    ".macro tactus_fir_step a, b, c",
    "ldrd r11, r12, [r0], #8",
    "smlad r2, \\a, r11, r2",
    "smlad r3, \\a, r12, r3",
    "ldr \\a, [r1], #4",
    "smlad r4, \\b, r11, r4",
    "smlad r5, \\b, r12, r5",
    "smlad r6, \\c, r11, r6",
    "smlad r7, \\c, r12, r7",
    ".endm",
    ".macro tactus_fir_square y",
    "asr \\y, \\y, #8",
    "smlal r8, r9, \\y, \\y",
    ".endm",
    ".section .text.tactus_band_energy,\"ax\",%progbits",
    ".global tactus_band_energy",
    ".type tactus_band_energy,%function",
    ".thumb_func",
    // r0: pairs of coefficients; r1: samples; r2: how many sixes, not 0. Sum of squares in r0 and r1.
    "tactus_band_energy:",
    "push {{r4-r11, lr}}",
    "mov r8, #0",
    "mov r9, #0",
    // 0: sum of squares; 8: sixes to go
    "push {{r2, r3}}",
    "push {{r8, r9}}",
    "1:",
    "ldr r8, [r1], #4",
    "ldr r9, [r1], #4",
    "ldr r10, [r1], #4",
    // half of what is shifted out: rounded
    "mov r2, #128",
    "mov r3, #128",
    "mov r4, #128",
    "mov r5, #128",
    "mov r6, #128",
    "mov r7, #128",
    "mov lr, #5",
    "2:",
    "tactus_fir_step r8, r9, r10",
    "tactus_fir_step r9, r10, r8",
    "tactus_fir_step r10, r8, r9",
    "tactus_fir_step r8, r9, r10",
    "tactus_fir_step r9, r10, r8",
    "tactus_fir_step r10, r8, r9",
    "subs lr, lr, #1",
    "bne 2b",
    "tactus_fir_step r8, r9, r10",
    "tactus_fir_step r9, r10, r8",
    "tactus_fir_step r10, r8, r9",
    // the last step, without the pair behind the samples
    "ldrd r11, r12, [r0], #-264",
    "smlad r2, r8, r11, r2",
    "smlad r3, r8, r12, r3",
    "smlad r4, r9, r11, r4",
    "smlad r5, r9, r12, r5",
    "smlad r6, r10, r11, r6",
    "smlad r7, r10, r12, r7",
    "ldrd r8, r9, [sp]",
    "tactus_fir_square r2",
    "tactus_fir_square r3",
    "tactus_fir_square r4",
    "tactus_fir_square r5",
    "tactus_fir_square r6",
    "tactus_fir_square r7",
    "ldr r2, [sp, #8]",
    "strd r8, r9, [sp]",
    // 36 pairs were read, the next six outputs begin with the fourth of them
    "sub r1, r1, #132",
    "subs r2, r2, #1",
    "str r2, [sp, #8]",
    "bne 1b",
    "pop {{r0, r1, r2, r3}}",
    "pop {{r4-r11, pc}}",
    ".size tactus_band_energy, . - tactus_band_energy",
    // One texture: r4 to r10 are the mean that the others are compared with, two numbers each, r1 where the next texture's begins,
    // r2 the next logarithm, r3 where they end.
    ".macro tactus_likelihood last",
    "2:",
    // the squared distance to r11 and r12
    "mov r12, #0",
    "ldr r0, [r1]",
    "qsub16 r0, r4, r0",
    "smuad r11, r0, r0",
    "tactus_square r5, 4",
    "tactus_square r6, 8",
    "tactus_square r7, 12",
    "tactus_square r8, 16",
    "tactus_square r9, 20",
    "\\last r0, [r1, #24]",
    "qsub16 r0, r10, r0",
    "smlald r11, r12, r0, r0",
    "ldr lr, [sp, #36]",
    "add r1, r1, lr",
    // the odds to r0, if they are below 2^30
    "ldr lr, [sp, #40]",
    "umull r0, lr, r11, lr",
    "orr r12, lr, r12, lsl #30",
    "cmp r12, #0x3f000000",
    "bhs 3f",
    "add r0, lr, #65536",
    // their logarithm: octaves in r11, the mantissa in r12
    "clz r11, r0",
    "lsl r12, r0, r11",
    "rsb r11, r11, #15",
    "lsr r0, r12, #26",
    "ldr lr, [sp, #44]",
    "add r0, lr, r0, lsl #3",
    "ldrd r0, lr, [r0]",
    "lsl r12, r12, #6",
    "umull r12, lr, r12, lr",
    "add r0, r0, lr",
    // ln 2, and half of what is shifted out
    "ldrd r12, lr, [sp, #48]",
    "umaal r0, lr, r11, r12",
    "lsr r0, r0, #16",
    "orr r0, r0, lr, lsl #16",
    // half of twice the norm and 1 less the weighted logarithm: the norm less its half, rounded down
    "ldrd r11, r12, [sp, #56]",
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
    ".macro tactus_square a, at",
    "ldr r0, [r1, #\\at]",
    "qsub16 r0, \\a, r0",
    "smlald r11, r12, r0, r0",
    ".endm",
    ".section .text.tactus_likelihoods,\"ax\",%progbits",
    ".global tactus_likelihoods",
    ".type tactus_likelihoods,%function",
    ".thumb_func",
    // r0: the mean; r1: the first texture's; r2: logarithms; r3: where they end. On the stack how far one mean is from the next
    // (36), narrowness in Q32 (40); [`LN`], as if it began 32 parts before (44); ln 2 in Q32 (48) and 2^15 (52); weight (56), twice
    // the norm and 1 (60), and whether there is a fourteenth number (64).
    "tactus_likelihoods:",
    "push {{r4-r11, lr}}",
    // a word at a time, which need not be aligned
    ".irp pair, 4, 5, 6, 7, 8, 9",
    "ldr r\\pair, [r0, #(\\pair - 4) * 4]",
    ".endr",
    "ldr r10, [sp, #64]",
    "cmp r10, #0",
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
    // s0: the property, in steps of the means; s1: what its distance is multiplied with; r0: cells, r3 from one to the next; r1:
    // logarithms, r2 where they end; on the stack [`LN`], as if it began 32 parts before, and ln 2 in Q32.
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
    // r0: logarithms, r3 the greatest; r1: parts of that one's probability, in whole numbers, r2 where they end, behind the first;
    // on the stack [`EXP2`] and 1 / ln 2 in Q31. The sum of the parts in r0 and r1.
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
    "umull lr, r12, r12, r11",
    "sub r10, r10, r12",
    "lsr \\x, \\x, #21",
    "lsr \\x, r10, \\x",
    "adds r6, r6, \\x",
    "adc r7, r7, #0",
    ".endm",
    "tactus_weigh:",
    "push {{r4-r11, lr}}",
    "ldrd r4, r5, [sp, #36]",
    "mov r6, #0",
    "mov r7, #0",
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
    // r0: whole numbers, a multiple of 8, which become floats; r1: where they end, behind the first; s0: what they are divided by
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
    ".section .text.tactus_forget,\"ax\",%progbits",
    ".global tactus_forget",
    ".type tactus_forget,%function",
    ".thumb_func",
    // r0: numbers, a multiple of 8; r1: where they end, behind the first
    "tactus_forget:",
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
    ".size tactus_forget, . - tactus_forget",
    ".section .text.tactus_candidates,\"ax\",%progbits",
    ".global tactus_candidates",
    ".type tactus_candidates,%function",
    ".thumb_func",
    // r0: the one mean, 14 numbers, and r2 and r3 its sum of squares; r1: the others, and the first behind them on the stack.
    // r1 is then where the distance is.
    "tactus_candidates:",
    "push {{r4-r11, lr}}",
    "push {{r2, r3}}",
    "ldr lr, [sp, #44]",
    "add lr, lr, #{distance}",
    "add r1, r1, #{distance}",
    "ldm r0, {{r4-r10}}",
    "2:",
    "mov r2, #0",
    "mov r3, #0",
    "ldrd r0, r11, [r1, #-{distance}]",
    "smlald r2, r3, r0, r4",
    "smlald r2, r3, r11, r5",
    "ldrd r0, r11, [r1, #8-{distance}]",
    "smlald r2, r3, r0, r6",
    "smlald r2, r3, r11, r7",
    "ldrd r0, r11, [r1, #16-{distance}]",
    "smlald r2, r3, r0, r8",
    "smlald r2, r3, r11, r9",
    "ldr r0, [r1, #24-{distance}]",
    "smlald r2, r3, r0, r10",
    "ldrd r11, r12, [r1, #{square}-{distance}]",
    "subs r11, r11, r2",
    "sbc r12, r12, r3",
    "subs r11, r11, r2",
    "sbc r12, r12, r3",
    "ldrd r2, r3, [sp]",
    "adds r11, r11, r2",
    "adc r12, r12, r3",
    "strd r11, r12, [r1], #{size}",
    "cmp r1, lr",
    "bne 2b",
    "pop {{r2, r3}}",
    "pop {{r4-r11, pc}}",
    ".size tactus_candidates, . - tactus_candidates",
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
    distance = const offset_of!(Candidate, distance),
    size = const size_of::<Candidate>(),
);

unsafe extern "C" {
    /// `samples` has [`TAPS`] - 1 and 6 `sixes` samples, of which none is outside -4096..=4095.
    fn tactus_band_energy(pairs: *const [u32; 2], samples: *const i16, sixes: usize) -> u64;
    /// `from` has 13 numbers, 14 if `even`, and so has each of the `means`, `stride` bytes after each other, of which there are
    /// as many as logarithms up to `end`, one at least; `ln` is 256 bytes before [`LN`].
    fn tactus_likelihoods(
        from: *const i16,
        means: *const u8,
        logs: *mut i32,
        end: *const i32,
        stride: usize,
        narrowness: u32,
        ln: *const u32,
        ln_2: u32,
        half: u32,
        weight: i32,
        norm: i32,
        even: bool,
    ) -> *mut i32;
    /// There are as many `cells`, 4 bytes, `stride` after each other, as logarithms up to `end`, one at least; `ln` is 256 bytes
    /// before [`LN`].
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
    fn tactus_forget(numbers: *mut i32, end: *const i32);
    /// `from` has 14 numbers and begins at a whole word, `square` is the sum of their squares; there is at least one of
    /// `others`, and `behind` is where the last of them ends.
    fn tactus_candidates(
        from: *const i16,
        others: *mut Candidate,
        square: u64,
        behind: *const Candidate,
    );
    safe fn tactus_sqrt(x: f32) -> f32;
}

/// [`Kernels::fold_frame`], two angles at a time: sums of two samples by one instruction, and then what `Plain` does, in its
/// order (VMLA rounds the product).
#[inline(never)]
fn fold_frame<'r>(
    angles: &Angles,
    frame: &[i16; FRAME],
    room: &'r mut MaybeUninit<Folded>,
) -> &'r mut Folded {
    let begin: *mut Complex32 = room.as_mut_ptr().cast();
    // SAFETY: it reads all angles, an even number, and the whole frame, whose words need not be aligned; all of `room` is
    // written.
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
            a = out(reg) _,
            b = out(reg) _,
            c = out(reg) _,
            d = out(reg) _,
            x = out(reg) _,
            out("s0") _, out("s1") _, out("s2") _, out("s3") _, out("s4") _, out("s5") _, out("s6") _, out("s7") _,
            out("s8") _, out("s9") _, out("s10") _, out("s11") _, out("s12") _, out("s13") _, out("s14") _, out("s15") _,
            out("s16") _, out("s17") _, out("s18") _, out("s19") _,
            options(nostack),
        );
        room.assume_init_mut()
    }
}

/// [`Kernels::fold`] of so many in both, a multiple of 4.
///
/// # Safety
/// They are there.
#[inline(never)]
unsafe fn fold(angles: &Angles, reals: *const Complex32, folded: *mut Complex32, many: usize) {
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
            step = in(reg) size_of_val(angles) / half,
            a = inout(reg) reals => _,
            b = inout(reg) reals.add(half) => _,
            odd = inout(reg) folded => _,
            even = inout(reg) folded.add(half) => _,
            end = in(reg) folded.add(half),
            out("s0") _, out("s1") _, out("s2") _, out("s3") _, out("s4") _, out("s5") _, out("s6") _, out("s7") _,
            out("s8") _, out("s9") _, out("s10") _, out("s11") _, out("s12") _, out("s13") _, out("s14") _, out("s15") _,
            out("s16") _, out("s17") _, out("s18") _, out("s19") _,
            options(nostack),
        );
    }
}

/// [`Kernels::add_power`] of so many, a multiple of 8 and not 0.
///
/// # Safety
/// They are there.
#[inline(never)]
unsafe fn add_power(bins: *const Complex32, sums: *mut f32, many: usize) {
    // SAFETY: it reads and writes as many.
    unsafe {
        asm!(
            "2:",
            "vldmia {bins}!, {{s0-s15}}",
            "vldmia {sums}, {{s16-s23}}",
            "vmla.f32 s16, s0, s0",
            "vmla.f32 s17, s2, s2",
            "vmla.f32 s18, s4, s4",
            "vmla.f32 s19, s6, s6",
            "vmla.f32 s20, s8, s8",
            "vmla.f32 s21, s10, s10",
            "vmla.f32 s22, s12, s12",
            "vmla.f32 s23, s14, s14",
            "vmla.f32 s16, s1, s1",
            "vmla.f32 s17, s3, s3",
            "vmla.f32 s18, s5, s5",
            "vmla.f32 s19, s7, s7",
            "vmla.f32 s20, s9, s9",
            "vmla.f32 s21, s11, s11",
            "vmla.f32 s22, s13, s13",
            "vmla.f32 s23, s15, s15",
            "vstmia {sums}!, {{s16-s23}}",
            "cmp {sums}, {end}",
            "bne 2b",
            bins = inout(reg) bins => _,
            sums = inout(reg) sums => _,
            end = in(reg) sums.add(many),
            out("s0") _, out("s1") _, out("s2") _, out("s3") _, out("s4") _, out("s5") _, out("s6") _, out("s7") _,
            out("s8") _, out("s9") _, out("s10") _, out("s11") _, out("s12") _, out("s13") _, out("s14") _, out("s15") _,
            out("s16") _, out("s17") _, out("s18") _, out("s19") _, out("s20") _, out("s21") _, out("s22") _, out("s23") _,
            options(nostack),
        );
    }
}

/// What [`confuse`] keeps in registers, from s16 on.
static CONFUSE: [f32; 11] = {
    let [c0, c1, c2, c3, c4, c5] = EXP2;
    let octave = -core::f32::consts::LOG2_E;
    [FAR, octave, ROUND, c0, c1, c2, c3, c4, c5, 1.0, 0.25]
};

// one load for all of a texture
const _: () = assert!(
    offset_of!(Live, probability) == 0
        && offset_of!(Live, confused) == 4
        && offset_of!(Live, expected) == 8
        && offset_of!(Gaussian, mean) == 0
        && offset_of!(Gaussian, sd) == 4
);

/// [`Kernels::confuse`] of one texture at least, up to `behind`. The same operations in the same order as
/// `tactus_core::kernels::confused` and `exp_neg` have them (VMLA rounds the product), but for the comparison of the confusion
/// with 0: adding that changes nothing.
///
/// # Safety
/// `others` begin and end there.
#[inline(never)]
unsafe fn confuse(a: &mut Live, others: *mut Live, behind: *const Live) {
    // SAFETY: it reads and writes `a`, the others and nothing else.
    unsafe {
        asm!(
            "vldmia {constants}, {{s16-s26}}",
            // its probability, what it is confused with, mean and standard deviation
            "vldmia {a}, {{s0-s3}}",
            "vmul.f32 s4, s3, s3",
            "vadd.f32 s5, s3, s3",
            "2:",
            "vldmia {b}, {{s8-s11}}",
            "vmul.f32 s12, s11, s11",
            "vadd.f32 s12, s4, s12",
            "vdiv.f32 s12, s25, s12",
            "vsub.f32 s13, s2, s10",
            "vmul.f32 s13, s13, s13",
            "vmul.f32 s14, s26, s12",
            "vmul.f32 s13, s13, s14",
            "vcmp.f32 s13, s16",
            "vmrs APSR_nzcv, fpscr",
            "bgt 3f",
            "vmul.f32 s14, s5, s11",
            "vmul.f32 s14, s14, s12",
            "vsqrt.f32 s14, s14",
            "vmul.f32 s13, s13, s17",
            "vadd.f32 s12, s13, s18",
            "vsub.f32 s15, s12, s18",
            "vsub.f32 s13, s13, s15",
            "vmul.f32 s15, s19, s13",
            "vadd.f32 s15, s15, s20",
            "vmul.f32 s15, s15, s13",
            "vadd.f32 s15, s15, s21",
            "vmul.f32 s15, s15, s13",
            "vadd.f32 s15, s15, s22",
            "vmul.f32 s15, s15, s13",
            "vadd.f32 s15, s15, s23",
            "vmul.f32 s15, s15, s13",
            "vadd.f32 s15, s15, s24",
            "vmul.f32 s15, s15, s13",
            "vadd.f32 s15, s15, s25",
            "vmov {x}, s12",
            "vmov {y}, s15",
            "add {y}, {y}, {x}, lsl #23",
            "vmov s15, {y}",
            "vmul.f32 s14, s14, s15",
            "vmla.f32 s1, s14, s8",
            "vmla.f32 s9, s14, s0",
            "vstr s9, [{b}, #4]",
            "3:",
            "add {b}, {b}, #{size}",
            "cmp {b}, {behind}",
            "bne 2b",
            "vstr s1, [{a}, #4]",
            constants = in(reg) &raw const CONFUSE,
            a = in(reg) a,
            b = inout(reg) others => _,
            behind = in(reg) behind,
            x = out(reg) _,
            y = out(reg) _,
            size = const size_of::<Live>(),
            out("s0") _, out("s1") _, out("s2") _, out("s3") _, out("s4") _, out("s5") _, out("s8") _, out("s9") _,
            out("s10") _, out("s11") _, out("s12") _, out("s13") _, out("s14") _, out("s15") _, out("s16") _, out("s17") _,
            out("s18") _, out("s19") _, out("s20") _, out("s21") _, out("s22") _, out("s23") _, out("s24") _, out("s25") _,
            out("s26") _,
            options(nostack),
        );
    }
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

/// Cortex-M4F.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Chip;

impl Kernels for Chip {
    fn band_energy(taps: &Taps, samples: &[i16]) -> u64 {
        let sixes = samples.len().saturating_sub(TAPS - 1) / AT_ONCE;
        let rest = samples.get(sixes * AT_ONCE..).unwrap_or_default();
        let rest = Plain::band_energy(taps, rest);
        if sixes == 0 {
            return rest;
        }
        // SAFETY: it reads all pairs and, as `sixes` was computed, no sample that is not there; words need not be aligned.
        rest + unsafe { tactus_band_energy(taps.pairs().as_ptr(), samples.as_ptr(), sixes) }
    }

    fn fold_frame<'r>(
        angles: &Angles,
        frame: &[i16; FRAME],
        room: &'r mut MaybeUninit<Folded>,
    ) -> &'r mut Folded {
        fold_frame(angles, frame, room)
    }

    fn fold(angles: &Angles, reals: &[Complex32], folded: &mut [Complex32]) {
        let many = reals.len();
        if many != folded.len() || many % 4 != 0 || many == 0 || many > FRAME / 4 {
            return Plain::fold(angles, reals, folded);
        }
        // SAFETY: there are so many.
        unsafe { fold(angles, reals.as_ptr(), folded.as_mut_ptr(), many) };
    }

    fn add_power(bins: &[Complex32], sums: &mut [f32]) {
        let many = bins.len();
        if many != sums.len() || many % 8 != 0 || many == 0 {
            return Plain::add_power(bins, sums);
        }
        // SAFETY: there are so many.
        unsafe { add_power(bins.as_ptr(), sums.as_mut_ptr(), many) };
    }

    fn forget(logs: &mut [i32]) {
        let (eights, rest) = logs.as_chunks_mut::<8>();
        let eights = eights.as_flattened_mut().as_mut_ptr_range();
        if !eights.is_empty() {
            // SAFETY: they are whole eights.
            unsafe { tactus_forget(eights.start, eights.end) };
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
        if many == 0 || !even && from.len() != MAX_FEATURES - 1 || spread.narrowness >= 1 << 16 {
            return Plain::add_likelihoods(from, means, stride, spread, logs);
        }
        let logs = logs.as_mut_ptr();
        // SAFETY: `many` means were found to be there, and as many logarithms; words need not be aligned.
        unsafe {
            let done = tactus_likelihoods(
                from.as_ptr(),
                means.as_ptr(),
                logs,
                logs.add(many),
                stride,
                spread.narrowness << 16,
                before_ln(),
                LN_2,
                1 << 15,
                spread.weight,
                2 * spread.norm + 1,
                even,
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
            tactus_weigh(
                logs.as_ptr(),
                begin,
                end,
                top,
                EXP2_PARTS.as_ptr(),
                2 * LOG2_E,
            )
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

    fn candidate_distances(from: &Candidate, others: &mut [Candidate]) {
        let range = others.as_mut_ptr_range();
        if !range.is_empty() {
            // SAFETY: there is one at least, and the others end where it is said.
            unsafe {
                tactus_candidates(from.mean.as_ptr(), range.start, from.square, range.end);
            }
        }
    }

    fn confuse(a: &mut Live, others: &mut [Live]) {
        let others = others.as_mut_ptr_range();
        if !others.is_empty() {
            // SAFETY: there is one at least, and the others end where it is said.
            unsafe { confuse(a, others.start, others.end) };
        }
    }

    fn sqrt(x: f32) -> f32 {
        tactus_sqrt(x)
    }
}
