//! The confusion of textures (eq. 7) for this chip.

use core::arch::asm;
use core::mem::offset_of;

use tactus_core::explorer::kernels::{EXP2, FAR, LiveTexture, ROUND};
use tactus_core::table::Gaussian;

/// What [`confuse`] keeps in registers, from s16 on.
static CONFUSE: [f32; 11] = {
    let [c0, c1, c2, c3, c4, c5] = EXP2;
    let octave = -core::f32::consts::LOG2_E;
    [FAR, octave, ROUND, c0, c1, c2, c3, c4, c5, 1.0, 0.25]
};

// one load for all of a texture
const _: () = assert!(
    offset_of!(LiveTexture, probability) == 0
        && offset_of!(LiveTexture, confused) == 4
        && offset_of!(LiveTexture, expected) == 8
        && offset_of!(Gaussian, mean) == 0
        && offset_of!(Gaussian, sd) == 4
);

/// `Kernels::confuse` of one texture at least, up to `behind`. The same operations in the same order as
/// `tactus_core::explorer::kernels::confused` and `exp_neg` have them (VMLA rounds the product), but for the comparison of
/// the confusion with 0: adding that changes nothing.
///
/// # Safety
/// `others` begin and end there.
#[inline(never)]
pub(super) unsafe fn confuse(
    a: &mut LiveTexture,
    others: *mut LiveTexture,
    behind: *const LiveTexture,
) {
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
            size = const size_of::<LiveTexture>(),
            out("s0") _, out("s1") _, out("s2") _, out("s3") _, out("s4") _, out("s5") _, out("s8") _, out("s9") _,
            out("s10") _, out("s11") _, out("s12") _, out("s13") _, out("s14") _, out("s15") _, out("s16") _, out("s17") _,
            out("s18") _, out("s19") _, out("s20") _, out("s21") _, out("s22") _, out("s23") _, out("s24") _, out("s25") _,
            out("s26") _,
            options(nostack),
        );
    }
}
