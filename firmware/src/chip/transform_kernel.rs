//! The transforms of a frame for this chip, with microfft's bits: `cargo xtask bench` compares them.

use core::arch::global_asm;

use tactus_core::dsp::{Angles, Complex32, FRAME, Reals};

// microfft's transform (decimation in time), two of its stages at a time and the first two or three together: the same
// products and sums, each rounded, with half of the loads and stores.
global_asm!(
    ".fpu fpv4-sp-d16",
    // b, turned by an angle, added to a and subtracted from it
    ".macro tactus_butterfly ar, ai, br, bi, cos, sin",
    "vmul.f32 s24, \\br, \\cos",
    "vmul.f32 s25, \\bi, \\cos",
    "vmla.f32 s24, \\bi, \\sin",
    "vmls.f32 s25, \\br, \\sin",
    "vsub.f32 \\br, \\ar, s24",
    "vsub.f32 \\bi, \\ai, s25",
    "vadd.f32 \\ar, \\ar, s24",
    "vadd.f32 \\ai, \\ai, s25",
    ".endm",
    // the same, a quarter of a turn further
    ".macro tactus_further ar, ai, br, bi, cos, sin",
    "vmul.f32 s24, \\bi, \\cos",
    "vmul.f32 s25, \\bi, \\sin",
    "vmls.f32 s24, \\br, \\sin",
    "vmla.f32 s25, \\br, \\cos",
    "vsub.f32 \\br, \\ar, s24",
    "vadd.f32 \\bi, \\ai, s25",
    "vadd.f32 \\ar, \\ar, s24",
    "vsub.f32 \\ai, \\ai, s25",
    ".endm",
    // two of each quarter, and the angles of the first stage (s16 to s19) and the second one
    ".macro tactus_load_quarters",
    "vldmia r3, {{s0-s3}}",
    "vldmia r7, {{s4-s7}}",
    "vldmia r8, {{s8-s11}}",
    "vldmia r9, {{s12-s15}}",
    "vldr d8, [r10]",
    "add r10, r10, lr",
    "vldr d9, [r10]",
    "add r10, r10, lr",
    "vldr d10, [r11]",
    "add r11, r11, r6",
    "vldr d11, [r11]",
    "add r11, r11, r6",
    ".endm",
    ".macro tactus_second_stage",
    "tactus_butterfly s0, s1, s8, s9, s20, s21",
    "tactus_butterfly s2, s3, s10, s11, s22, s23",
    "tactus_further s4, s5, s12, s13, s20, s21",
    "tactus_further s6, s7, s14, s15, s22, s23",
    "vstmia r3!, {{s0-s3}}",
    "vstmia r7!, {{s4-s7}}",
    "vstmia r8!, {{s8-s11}}",
    "vstmia r9!, {{s12-s15}}",
    "cmp r3, r12",
    ".endm",
    ".macro tactus_swap",
    "ldrb r7, [r3], #1",
    "ldrb r8, [r3], #1",
    "add r7, r0, r7, lsl #3",
    "add r8, r0, r8, lsl #3",
    "vldr d0, [r7]",
    "vldr d1, [r8]",
    "vstr d1, [r7]",
    "vstr d0, [r8]",
    ".endm",
    ".section .text.tactus_transform,\"ax\",%progbits",
    ".global tactus_transform",
    ".type tactus_transform,%function",
    ".thumb_func",
    // r0: values; r1: how many, 32, 64 or 128; r2: angles; r3: places
    "tactus_transform:",
    "push {{r4-r11, lr}}",
    "vpush {{d8-d15}}",
    // values that are swapped: after the registers that were pushed, how many pairs
    "ldr r4, [sp, #100]",
    "1:",
    "tactus_swap",
    "tactus_swap",
    "tactus_swap",
    "tactus_swap",
    "subs r4, r4, #4",
    "bne 1b",
    "clz r5, r1",
    "add r1, r0, r1, lsl #3",
    "mov r3, r0",
    // cosine of an eighth of a turn
    "movw r12, #0x04f3",
    "movt r12, #0x3f35",
    // bytes of what the first stages make: fours, or eights of 2 to an odd power (r5 is even then)
    "mov r4, #32",
    "lsls r6, r5, #31",
    "it pl",
    "lslpl r4, r4, #1",
    "3:",
    "vldmia r3, {{s0-s15}}",
    "vadd.f32 s16, s0, s2",
    "vadd.f32 s17, s1, s3",
    "vsub.f32 s18, s0, s2",
    "vsub.f32 s19, s1, s3",
    "vadd.f32 s20, s4, s6",
    "vadd.f32 s21, s5, s7",
    "vsub.f32 s22, s4, s6",
    "vsub.f32 s23, s5, s7",
    "vadd.f32 s24, s8, s10",
    "vadd.f32 s25, s9, s11",
    "vsub.f32 s26, s8, s10",
    "vsub.f32 s27, s9, s11",
    "vadd.f32 s28, s12, s14",
    "vadd.f32 s29, s13, s15",
    "vsub.f32 s30, s12, s14",
    "vsub.f32 s31, s13, s15",
    "vadd.f32 s0, s16, s20",
    "vadd.f32 s1, s17, s21",
    "vadd.f32 s2, s18, s23",
    "vsub.f32 s3, s19, s22",
    "vsub.f32 s4, s16, s20",
    "vsub.f32 s5, s17, s21",
    "vsub.f32 s6, s18, s23",
    "vadd.f32 s7, s19, s22",
    "vadd.f32 s8, s24, s28",
    "vadd.f32 s9, s25, s29",
    "vadd.f32 s10, s26, s31",
    "vsub.f32 s11, s27, s30",
    "vsub.f32 s12, s24, s28",
    "vsub.f32 s13, s25, s29",
    "vsub.f32 s14, s26, s31",
    "vadd.f32 s15, s27, s30",
    "cmp r4, #32",
    "bne 9f",
    "vstmia r3!, {{s0-s15}}",
    "b 4f",
    "9:",
    "vmov s24, r12",
    "vmul.f32 s16, s10, s24",
    "vmul.f32 s17, s11, s24",
    "vadd.f32 s20, s16, s17",
    "vsub.f32 s21, s17, s16",
    "vadd.f32 s18, s2, s20",
    "vadd.f32 s19, s3, s21",
    "vsub.f32 s26, s2, s20",
    "vsub.f32 s27, s3, s21",
    "vmul.f32 s16, s14, s24",
    "vmul.f32 s17, s15, s24",
    "vsub.f32 s20, s17, s16",
    "vadd.f32 s21, s16, s17",
    "vadd.f32 s22, s6, s20",
    "vsub.f32 s23, s7, s21",
    "vsub.f32 s30, s6, s20",
    "vadd.f32 s31, s7, s21",
    "vadd.f32 s20, s4, s13",
    "vsub.f32 s21, s5, s12",
    "vsub.f32 s28, s4, s13",
    "vadd.f32 s29, s5, s12",
    "vadd.f32 s16, s0, s8",
    "vadd.f32 s17, s1, s9",
    "vsub.f32 s24, s0, s8",
    "vsub.f32 s25, s1, s9",
    "vstmia r3!, {{s16-s31}}",
    "4:",
    "cmp r3, r1",
    "bne 3b",
    // r4: bytes of a quarter; r6 and lr: bytes from an angle of the second stage and of the first one to the next
    "5:",
    "mov r6, #{quarters}",
    "udiv r6, r6, r4",
    "lsl lr, r6, #1",
    "mov r9, r0",
    "6:",
    "mov r3, r9",
    "add r7, r3, r4",
    "add r8, r7, r4",
    "add r9, r8, r4",
    "mov r10, r2",
    "mov r11, r2",
    "add r12, r3, r4, lsr #1",
    "7:",
    "tactus_load_quarters",
    "tactus_butterfly s0, s1, s4, s5, s16, s17",
    "tactus_butterfly s2, s3, s6, s7, s18, s19",
    "tactus_butterfly s8, s9, s12, s13, s16, s17",
    "tactus_butterfly s10, s11, s14, s15, s18, s19",
    "tactus_second_stage",
    "bne 7b",
    "mov r10, r2",
    "add r12, r12, r4, lsr #1",
    "8:",
    "tactus_load_quarters",
    "tactus_further s0, s1, s4, s5, s16, s17",
    "tactus_further s2, s3, s6, s7, s18, s19",
    "tactus_further s8, s9, s12, s13, s16, s17",
    "tactus_further s10, s11, s14, s15, s18, s19",
    "tactus_second_stage",
    "bne 8b",
    "cmp r9, r1",
    "bne 6b",
    "lsl r4, r4, #2",
    "add r3, r0, r4",
    "cmp r3, r1",
    "blo 5b",
    "vpop {{d8-d15}}",
    "pop {{r4-r11, pc}}",
    ".size tactus_transform, . - tactus_transform",
    ".text",
    quarters = const size_of::<Angles>() * 8,
);

unsafe extern "C" {
    /// Transforms so many `values`, 32, 64 or 128, after it has swapped those at so many pairs of `places`, a
    /// multiple of 4.
    fn tactus_transform(
        values: *mut Complex32,
        many: usize,
        angles: &Angles,
        places: *const [u8; 2],
        pairs: usize,
    );
}

/// The places of `N` values, a power of 2, whose bits are another's when reversed: pairs that a transform begins by
/// swapping.
#[expect(
    clippy::indexing_slicing,
    reason = "the compiler runs it, and has no iterators"
)]
const fn swapped<const N: usize, const PAIRS: usize>() -> [[u8; 2]; PAIRS] {
    let mut pairs = [[0; 2]; PAIRS];
    let (mut n, mut place) = (0, 0);
    while place < N {
        let other = place.reverse_bits() >> (N.leading_zeros() + 1);
        if place < other {
            pairs[n] = [place as u8, other as u8];
            n += 1;
        }
        place += 1;
    }
    assert!(n == PAIRS);
    pairs
}

/// The transform of reals from that of pairs of them, as microfft makes it.
fn recombine(angles: &Angles, values: &mut [Complex32; FRAME / 16]) {
    let [ends, values @ ..] = values;
    *ends = Complex32::new(ends.re + ends.im, ends.re - ends.im);
    let angles = angles.iter().step_by(8).skip(1);
    let mut rest = &mut values[..];
    for [cos, sin] in angles {
        let [early, middle @ .., late] = rest else {
            break;
        };
        let sum = (*early + *late) / 2.0;
        let apart = (*early - *late) / 2.0;
        *early = Complex32::new(
            sum.re + cos * sum.im - sin * apart.re,
            apart.im - sin * sum.im - cos * apart.re,
        );
        *late = Complex32::new(
            sum.re - cos * sum.im + sin * apart.re,
            -apart.im - sin * sum.im - cos * apart.re,
        );
        rest = middle;
    }
    if let [middle] = rest {
        middle.im = -middle.im;
    }
}

pub(super) fn transform(angles: &Angles, values: &mut [Complex32]) {
    let many = values.len();
    let places: &[[u8; 2]] = match many {
        128 => const { &swapped::<128, 56>() },
        64 => const { &swapped::<64, 28>() },
        32 => const { &swapped::<32, 12>() },
        _ => return,
    };
    // SAFETY: there are so many, and all places are below that.
    unsafe {
        tactus_transform(
            values.as_mut_ptr(),
            many,
            angles,
            places.as_ptr(),
            places.len(),
        );
    };
}

pub(super) fn transform_reals<'r>(
    angles: &Angles,
    reals: &'r mut Reals,
) -> &'r mut [Complex32; FRAME / 16] {
    // SAFETY: a complex number is two floats, and as well aligned.
    let values = unsafe { &mut *(&raw mut *reals).cast::<[Complex32; FRAME / 16]>() };
    transform(angles, values);
    recombine(angles, values);
    values
}
