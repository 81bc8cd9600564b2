//! How many cycles an instruction takes on a Cortex-M4F, as a model: its manual's numbers (ARM DDI 0439, 3.3.1 and 7.2.3)
//! without wait states. Where it depends on what comes before or on the data, a number in between.

/// A pipeline that is filled anew.
const REFILL: u32 = 2;
/// Half of the branches with a condition are taken.
const BRANCH: u32 = 1 + REFILL / 2;
/// Integer divisions take 2 to 12.
const DIVIDE: u32 = 7;
const FLOAT_DIVIDE: u32 = 14;
const FLOAT_MULTIPLY_ADD: u32 = 3;

/// Whether an instruction that begins with `first` has a second half.
fn is_long(first: u16) -> bool {
    first >> 11 >= 0b11101
}

/// Cycles of the instruction with these halves; a short one has only the first.
pub fn cycles(first: u16, second: u16) -> u32 {
    if is_long(first) {
        long(first, second)
    } else {
        short(first)
    }
}

fn short(code: u16) -> u32 {
    match code >> 12 {
        // by register, with 7 bits at once: BX, BLX
        0b0100 if code >> 8 == 0b0100_0111 => 1 + REFILL,
        // from the literal pool
        0b0100 if code >> 11 == 0b01001 => 2,
        0b0101 if (code >> 9) & 0b111 >= 3 => 2,
        0b0110..=0b1001 if code & 1 << 11 != 0 => 2,
        0b1011 => match code >> 8 {
            0b1011_0100 | 0b1011_0101 => 1 + (code & 0x1ff).count_ones(),
            0b1011_1100 => 1 + (code & 0xff).count_ones(),
            0b1011_1101 => 2 + (code & 0xff).count_ones() + REFILL,
            // CBZ, CBNZ
            0b1011_0001 | 0b1011_0011 | 0b1011_1001 | 0b1011_1011 => BRANCH,
            _ => 1,
        },
        0b1100 => 1 + (code & 0xff).count_ones(),
        0b1101 => BRANCH,
        0b1110 => 1 + REFILL,
        _ => 1,
    }
}

fn long(first: u16, second: u16) -> u32 {
    let is_load = first & 1 << 4 != 0;
    match first >> 8 {
        // LDM, STM, and those of two words, exclusive and by a table
        0b1110_1000 | 0b1110_1001 if first & 1 << 6 == 0 => {
            let goes = if is_load && second & 1 << 15 != 0 {
                REFILL
            } else {
                0
            };
            1 + second.count_ones() + goes
        }
        0b1110_1000 | 0b1110_1001 => {
            if first & 0xfff0 == 0xe8d0 && second >> 4 & 0xe == 0 {
                2 + REFILL
            } else {
                3
            }
        }
        // coprocessors 10 and 11 are the FPU
        0b1110_1100 | 0b1110_1101 if second >> 9 & 0b111 == 0b101 => {
            let words = u32::from(second & 0xff);
            match first >> 5 & 0b1111 {
                // VMOV of two registers
                0b0010 => 2,
                // offset without writing back: VLDR, VSTR
                _ if first & 1 << 8 != 0 && first & 1 << 5 == 0 => {
                    if is_load {
                        2
                    } else {
                        1
                    }
                }
                _ => 1 + words,
            }
        }
        0b1110_1110 if second >> 9 & 0b111 == 0b101 && second & 1 << 4 == 0 => {
            // opc1 without the bit of a register's number, opc2 and its lowest two bits
            match (first >> 4 & 0b1011, first & 0xf, second >> 6 & 0b11) {
                (0b0000 | 0b0001 | 0b1010 | 0b1001, ..) => FLOAT_MULTIPLY_ADD,
                (0b1000, ..) => FLOAT_DIVIDE,
                (0b1011, 0b0001, 0b11) => FLOAT_DIVIDE,
                _ => 1,
            }
        }
        // B and BL; the rest there works with constants
        0b1111_0000..=0b1111_0111 if second & 1 << 15 != 0 => {
            if second & 0b0101_0000_0000_0000 == 0 {
                BRANCH
            } else {
                1 + REFILL
            }
        }
        0b1111_1000 | 0b1111_1001 if is_load => 2,
        0b1111_1011 if first & 0xffd0 == 0xfb90 && second & 0xf0 == 0xf0 => DIVIDE,
        _ => 1,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_take_what_the_manual_says() {
        for (code, expected, what) in [
            ([0x4770, 0], 3, "bx lr"),
            ([0x6808, 0], 2, "ldr r0, [r1]"),
            ([0x6008, 0], 1, "str r0, [r1]"),
            ([0xb5f0, 0], 6, "push {r4-r7, lr}"),
            ([0xbdf0, 0], 8, "pop {r4-r7, pc}"),
            ([0xd1fe, 0], 2, "bne"),
            ([0x1840, 0], 1, "adds r0, r0, r1"),
            ([0xf000, 0xf800], 3, "bl"),
            ([0xfb20, 0x2301], 1, "smlad"),
            ([0xfbc8, 0x89cc], 1, "smlald"),
            ([0xfbb0, 0xf0f1], 7, "udiv r0, r0, r1"),
            ([0xe8f0, 0xbc02], 3, "ldrd r11, r12, [r0], #8"),
            ([0xe92d, 0x4ff0], 10, "push {r4-r11, lr}"),
            ([0xe8bd, 0x8ff0], 12, "pop {r4-r11, pc}"),
            ([0xf851, 0x8b04], 2, "ldr r8, [r1], #4"),
            ([0xed90, 0x0a00], 2, "vldr s0, [r0]"),
            ([0xed80, 0x0a00], 1, "vstr s0, [r0]"),
            ([0xed2d, 0x8b02], 3, "vpush {d8}"),
            ([0xee30, 0x0a20], 1, "vadd.f32 s0, s0, s1"),
            ([0xee20, 0x0a20], 1, "vmul.f32 s0, s0, s1"),
            ([0xee00, 0x0a20], 3, "vmla.f32 s0, s0, s1"),
            ([0xee80, 0x0a20], 14, "vdiv.f32 s0, s0, s1"),
            ([0xeeb1, 0x0ac0], 14, "vsqrt.f32 s0, s0"),
            ([0xeef1, 0xfa10], 1, "vmrs apsr_nzcv, fpscr"),
        ] {
            assert_eq!(cycles(code[0], code[1]), expected, "{what}");
        }
    }
}
