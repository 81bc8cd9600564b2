//! The confusion of textures (eq. 7) for this chip.

use core::arch::global_asm;
use core::mem::offset_of;

use tactus_core::explorer::kernels::LiveGaussian;
use tactus_core::explorer::overlap::OVERLAP;

/// One of 16 bytes for each step, found by a shift. In RAM: the flash is slower.
#[unsafe(link_section = ".data.tactus_overlap")]
static STEPS: [[f32; 4]; 64] = OVERLAP;

// one load for all of a texture
const _: () = assert!(
    offset_of!(LiveGaussian, weight) == 0
        && offset_of!(LiveGaussian, confused) == 4
        && offset_of!(LiveGaussian, mean) == 8
        && offset_of!(LiveGaussian, variance) == 12
        && size_of::<LiveGaussian>() == 20
);

global_asm!(
    // the assembler is not told of the FPU otherwise
    ".fpu fpv4-sp-d16",
    ".macro tactus_confuse_one",
    "vldmia r1!, {{s4-s8}}",
    "vadd.f32 s7, s3, s7",
    "vsqrt.f32 s7, s7",
    "vsub.f32 s6, s2, s6",
    "vdiv.f32 s7, s15, s7",
    "vmul.f32 s6, s6, s7",
    "vcvt.s32.f32 s8, s6",
    "vmov r12, s8",
    "ssat r12, #6, r12",
    "add r12, r3, r12, lsl #4",
    "vldmia r12, {{s9-s11}}",
    "vmla.f32 s10, s11, s6",
    "vmla.f32 s9, s10, s6",
    "vmul.f32 s9, s9, s7",
    "vmla.f32 s1, s9, s4",
    "vmla.f32 s5, s9, s0",
    "vstr s5, [r1, #-16]",
    ".endm",
    ".section .text.tactus_confuse,\"ax\",%progbits",
    ".global tactus_confuse",
    ".type tactus_confuse,%function",
    ".thumb_func",
    // r0: the one texture; r1: the others, 20 bytes each, r2 where they end, behind the first; r3: the middle of the steps
    "tactus_confuse:",
    "vldmia r0, {{s0-s3}}",
    "vmov.f32 s15, #1.0",
    // an odd one first
    "sub r12, r2, r1",
    "tst r12, #4",
    "bne 3f",
    "2:",
    "tactus_confuse_one",
    "3:",
    "tactus_confuse_one",
    "cmp r1, r2",
    "bne 2b",
    "vstr s1, [r0, #4]",
    "bx lr",
    ".size tactus_confuse, . - tactus_confuse",
    ".text",
);

unsafe extern "C" {
    fn tactus_confuse(
        a: *mut LiveGaussian,
        others: *mut LiveGaussian,
        behind: *const LiveGaussian,
        steps: *const [f32; 4],
    );
}

/// `Kernels::confuse`: the same operations in the same order as `tactus_core::dsp::Plain` has them (VMLA rounds the product).
pub(super) fn confuse(a: &mut LiveGaussian, others: &mut [LiveGaussian]) {
    let others = others.as_mut_ptr_range();
    if !others.is_empty() {
        // SAFETY: there is one at least, and the others end where it is said; a step is one of -32..=31.
        unsafe { tactus_confuse(a, others.start, others.end, STEPS.as_ptr().add(32)) };
    }
}
