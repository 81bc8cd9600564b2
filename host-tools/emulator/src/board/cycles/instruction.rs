//! Cycles of an instruction on a Cortex-M4F, by its manual's numbers without wait states (ARM 100166, tables 3-1 and
//! 7-1, and 3.3.2 on pairs of loads), and its properties that make it wait: the address that it reads or writes, and
//! its branch.

/// Cycles of a division, 2 to 12.
const DIVIDE: u32 = 12;
const FLOAT_DIVIDE: u32 = 14;
const FLOAT_MULTIPLY_ADD: u32 = 3;
/// Barriers, and writes to the core's special registers.
const BARRIER: u32 = 4;

/// The target of an instruction's branch.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Branch {
    No,
    /// The target is in the instruction: the core fetches it early.
    Direct,
    /// It comes from a register or from memory, or leaves a return address.
    Indirect,
}

/// The address of a load or a store.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Address {
    /// This far from the instruction's own, aligned address + 4.
    Literal(i32),
    /// A register's, with an offset.
    Based { base: u8, offset: i32 },
    /// A register's, with another one that is shifted left.
    Indexed { base: u8, index: u8, shift: u8 },
}

/// A load or a store.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Access {
    pub(super) address: Address,
    pub(super) words: u32,
    pub(super) is_load: bool,
}

/// Registers of the FPU that an instruction reads, and the one that an operation of it writes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct Float {
    pub(super) result: Option<u8>,
    pub(super) sources: [Option<u8>; 3],
}

/// An instruction.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct Instruction {
    /// Bytes.
    pub(super) length: u32,
    /// Cycles if it does not branch, follows nothing that delays it, and waits for no memory.
    pub(super) cycles: u32,
    pub(super) branch: Branch,
    pub(super) access: Option<Access>,
    /// It begins when the write buffer is empty: loads, stores and barriers.
    pub(super) drains: bool,
    /// A load of one register of the core: this one. Loads behind it may be a cycle shorter.
    pub(super) loads: Option<u8>,
    /// Its use of the FPU.
    pub(super) float: Option<Float>,
}

impl Instruction {
    const fn of(length: u32, cycles: u32) -> Self {
        Self {
            length,
            cycles,
            branch: Branch::No,
            access: None,
            drains: false,
            loads: None,
            float: None,
        }
    }

    fn branches(self, branch: Branch) -> Self {
        Self { branch, ..self }
    }

    fn accesses(self, address: Address, words: u32, is_load: bool) -> Self {
        let access = Some(Access {
            address,
            words,
            is_load,
        });
        Self { access, ..self }.drains()
    }

    fn drains(self) -> Self {
        Self {
            drains: true,
            ..self
        }
    }

    fn loads(self, register: u16) -> Self {
        let loads = Some(register as u8);
        Self { loads, ..self }
    }

    /// A load or store of one register of the core.
    fn single(length: u32, register: u16, address: Address, is_load: bool) -> Self {
        let is_indexed = matches!(address, Address::Indexed { .. });
        let cycles = if is_load || is_indexed { 2 } else { 1 };
        let instruction = Self::of(length, cycles).accesses(address, 1, is_load);
        match (is_load, register) {
            (true, 15) => instruction.branches(Branch::Indirect),
            (true, _) => instruction.loads(register),
            (false, _) => instruction,
        }
    }

    /// The instruction with these halves; a short one has only the first.
    pub(super) fn decode([first, second]: [u16; 2]) -> Self {
        if first >> 11 >= 0b11101 {
            long(first, second)
        } else {
            short(first)
        }
    }
}

/// A register in three bits.
fn low(code: u16, at: u32) -> u8 {
    (code >> at & 0b111) as u8
}

fn based(base: u8, offset: u16) -> Address {
    let offset = i32::from(offset);
    Address::Based { base, offset }
}

fn short(code: u16) -> Instruction {
    let plain = Instruction::of(2, 1);
    let single = |register, address, is_load| Instruction::single(2, register, address, is_load);
    let immediate = code >> 6 & 0x1f;
    let registers = u32::from(code & 0xff);
    let is_load = code & 1 << 11 != 0;
    match code >> 12 {
        // by register, with 7 bits at once: BX, BLX
        0b0100 if code >> 8 == 0b0100_0111 => plain.branches(Branch::Indirect),
        // ADD and MOV to the program counter
        0b0100 if matches!(code >> 8, 0b0100_0100 | 0b0100_0110) && code & 0x87 == 0x87 => {
            plain.branches(Branch::Indirect)
        }
        // from the literal pool
        0b0100 if code >> 11 == 0b01001 => {
            let address = Address::Literal(4 * i32::from(code & 0xff));
            single(code >> 8 & 0b111, address, true)
        }
        0b0101 => {
            let (base, index) = (low(code, 3), low(code, 6));
            let shift = 0;
            let address = Address::Indexed { base, index, shift };
            single(code & 0b111, address, code >> 9 & 0b111 >= 3)
        }
        0b0110 => single(code & 0b111, based(low(code, 3), 4 * immediate), is_load),
        0b0111 => single(code & 0b111, based(low(code, 3), immediate), is_load),
        0b1000 => single(code & 0b111, based(low(code, 3), 2 * immediate), is_load),
        0b1001 => {
            let address = based(13, 4 * (code & 0xff));
            single(code >> 8 & 0b111, address, is_load)
        }
        0b1011 => match code >> 8 {
            // PUSH and POP: the stack is in RAM
            0b1011_0100 | 0b1011_0101 => {
                Instruction::of(2, 1 + (code & 0x1ff).count_ones()).drains()
            }
            0b1011_1100 => Instruction::of(2, 1 + registers.count_ones()).drains(),
            0b1011_1101 => {
                let pop = Instruction::of(2, 2 + registers.count_ones());
                pop.drains().branches(Branch::Indirect)
            }
            // CBZ, CBNZ
            0b1011_0001 | 0b1011_0011 | 0b1011_1001 | 0b1011_1011 => plain.branches(Branch::Direct),
            // CPS
            0b1011_0110 => Instruction::of(2, 2),
            _ => plain,
        },
        0b1100 => {
            let words = registers.count_ones();
            let many = Instruction::of(2, 1 + words);
            many.accesses(based(low(code, 8), 0), words, is_load)
        }
        0b1101 if code >> 8 & 0xf < 0xe => plain.branches(Branch::Direct),
        0b1110 => plain.branches(Branch::Direct),
        _ => plain,
    }
}

fn long(first: u16, second: u16) -> Instruction {
    let base = (first & 0xf) as u8;
    let is_load = first & 1 << 4 != 0;
    let plain = Instruction::of(4, 1);
    // of an address with 8 or 12 bits
    let signed = |offset: u16, up: bool| {
        let offset = if up {
            i32::from(offset)
        } else {
            -i32::from(offset)
        };
        match base {
            15 => Address::Literal(offset),
            _ => Address::Based { base, offset },
        }
    };
    let is_up = first & 1 << 7 != 0;
    match first >> 8 {
        // LDM, STM, and those of two words, exclusive and by a table
        0b1110_1000 | 0b1110_1001 if first & 1 << 6 == 0 => {
            let words = second.count_ones();
            let is_below = first & 1 << 8 != 0;
            let offset = if is_below { -4 * words as i32 } else { 0 };
            let many = Instruction::of(4, 1 + words);
            let many = many.accesses(Address::Based { base, offset }, words, is_load);
            if is_load && second & 1 << 15 != 0 {
                many.branches(Branch::Indirect)
            } else {
                many
            }
        }
        0b1110_1000 if first & 0xfff0 == 0xe8d0 && second >> 4 & 0xe == 0 => {
            let shift = (second >> 4 & 1) as u8;
            let index = (second & 0xf) as u8;
            let address = match base {
                15 => Address::Literal(0),
                _ => Address::Indexed { base, index, shift },
            };
            let table = Instruction::of(4, 2).accesses(address, 1, true);
            table.branches(Branch::Indirect)
        }
        // exclusive
        0b1110_1000 if first & 0xffe0 == 0xe840 || first & 0xffe0 == 0xe8c0 => {
            Instruction::of(4, 2).accesses(signed(0, true), 1, is_load)
        }
        0b1110_1000 | 0b1110_1001 => {
            let is_before = first & 1 << 8 != 0;
            let offset = if is_before { 4 * (second & 0xff) } else { 0 };
            Instruction::of(4, 3).accesses(signed(offset, is_up), 2, is_load)
        }
        // coprocessors 10 and 11 are the FPU
        0b1110_1100..=0b1110_1110 if second >> 9 & 0b111 == 0b101 => float(first, second),
        // B and BL; the rest there works with constants
        0b1111_0000..=0b1111_0111 if second & 1 << 15 != 0 => {
            if second & 0b0101_0000_0000_0000 == 0 {
                let is_special = first >> 7 & 0b111 == 0b111;
                if is_special {
                    // MSR, MRS, barriers, hints
                    Instruction::of(4, BARRIER).drains()
                } else {
                    plain.branches(Branch::Direct)
                }
            } else if second & 1 << 14 != 0 {
                plain.branches(Branch::Indirect)
            } else {
                plain.branches(Branch::Direct)
            }
        }
        0b1111_1000 | 0b1111_1001 => {
            let register = second >> 12;
            let address = if is_up || base == 15 {
                signed(second & 0xfff, is_up)
            } else if second & 1 << 11 == 0 {
                let (index, shift) = ((second & 0xf) as u8, (second >> 4 & 0b11) as u8);
                Address::Indexed { base, index, shift }
            } else {
                let is_before = second & 1 << 10 != 0;
                let offset = if is_before { second & 0xff } else { 0 };
                signed(offset, second & 1 << 9 != 0)
            };
            // to the program counter only a word is loaded; the rest are hints
            if is_load && register == 15 && first >> 5 & 0b11 != 0b10 {
                return plain;
            }
            Instruction::single(4, register, address, is_load)
        }
        0b1111_1011 if first & 0xffd0 == 0xfb90 && second & 0xf0 == 0xf0 => {
            Instruction::of(4, DIVIDE)
        }
        _ => plain,
    }
}

fn float(first: u16, second: u16) -> Instruction {
    let is_load = first & 1 << 4 != 0;
    // a register's four bits and its lowest one
    let register = |high: u16, low: u16| Some(((high & 0xf) << 1 | low & 1) as u8);
    let d = register(second >> 12, first >> 6);
    let n = register(first, second >> 7);
    let m = register(second, second >> 5);
    let with = |cycles, result, sources| Instruction {
        float: Some(Float { result, sources }),
        ..Instruction::of(4, cycles)
    };
    let base = (first & 0xf) as u8;
    if first >> 8 != 0b1110_1110 {
        let words = u32::from(second & 0xff);
        // VMOV of two registers
        if first >> 5 & 0b111_1111 == 0b110_0010 {
            return with(2, None, [m, None, None]);
        }
        // offset without writing back: VLDR, VSTR
        if first & 1 << 8 != 0 && first & 1 << 5 == 0 {
            let double = u32::from(second >> 8 & 1);
            let offset = 4 * i32::from(second & 0xff);
            let offset = if first & 1 << 7 != 0 { offset } else { -offset };
            let address = match base {
                15 => Address::Literal(offset),
                _ => Address::Based { base, offset },
            };
            let stored = if is_load { None } else { d };
            let one = with(2 + double, None, [stored, None, None]);
            return one.accesses(address, 1 + double, is_load);
        }
        let is_below = first & 1 << 8 != 0;
        let offset = if is_below { -4 * words as i32 } else { 0 };
        let many = with(1 + words, None, [None; 3]);
        return many.accesses(Address::Based { base, offset }, words, is_load);
    }
    if second & 1 << 4 != 0 {
        // to the core, or from it
        let read = if is_load { n } else { None };
        return with(1, None, [read, None, None]);
    }
    // opc1 without the bit of a register's number, opc2 and its lowest two bits
    match (first >> 4 & 0b1011, first & 0xf, second >> 6 & 0b11) {
        (0b0000 | 0b0001 | 0b1010 | 0b1001, ..) => with(FLOAT_MULTIPLY_ADD, d, [n, m, d]),
        (0b1000, ..) => with(FLOAT_DIVIDE, d, [n, m, None]),
        (0b1011, 0b0001, 0b11) => with(FLOAT_DIVIDE, d, [m, None, None]),
        // comparisons
        (0b1011, 0b0100 | 0b0101, _) => with(1, None, [d, m, None]),
        (0b1011, ..) => with(1, d, [m, None, None]),
        _ => with(1, d, [n, m, None]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instructions_take_what_the_manual_says() {
        for (code, expected, what) in [
            ([0x4770, 0], 1, "bx lr"),
            ([0x6808, 0], 2, "ldr r0, [r1]"),
            ([0x6008, 0], 1, "str r0, [r1]"),
            ([0x5088, 0], 2, "str r0, [r1, r2]"),
            ([0xb5f0, 0], 6, "push {r4-r7, lr}"),
            ([0xbdf0, 0], 6, "pop {r4-r7, pc}"),
            ([0xd1fe, 0], 1, "bne"),
            ([0x1840, 0], 1, "adds r0, r0, r1"),
            ([0xf000, 0xf800], 1, "bl"),
            ([0xfb20, 0x2301], 1, "smlad"),
            ([0xfbc8, 0x89cc], 1, "smlald"),
            ([0xfbb0, 0xf0f1], 12, "udiv r0, r0, r1"),
            ([0xe8f0, 0xbc02], 3, "ldrd r11, r12, [r0], #8"),
            ([0xe92d, 0x4ff0], 10, "push {r4-r11, lr}"),
            ([0xe8bd, 0x8ff0], 10, "pop {r4-r11, pc}"),
            ([0xf851, 0x8b04], 2, "ldr r8, [r1], #4"),
            ([0xed90, 0x0a00], 2, "vldr s0, [r0]"),
            ([0xed80, 0x0a00], 2, "vstr s0, [r0]"),
            ([0xed90, 0x0b00], 3, "vldr d0, [r0]"),
            ([0xed2d, 0x8b02], 3, "vpush {d8}"),
            ([0xee30, 0x0a20], 1, "vadd.f32 s0, s0, s1"),
            ([0xee20, 0x0a20], 1, "vmul.f32 s0, s0, s1"),
            ([0xee00, 0x0a20], 3, "vmla.f32 s0, s0, s1"),
            ([0xee80, 0x0a20], 14, "vdiv.f32 s0, s0, s1"),
            ([0xeeb1, 0x0ac0], 14, "vsqrt.f32 s0, s0"),
            ([0xeef1, 0xfa10], 1, "vmrs apsr_nzcv, fpscr"),
            ([0xf3bf, 0x8f4f], 4, "dsb sy"),
            ([0xbf20, 0], 1, "wfe"),
        ] {
            assert_eq!(Instruction::decode(code).cycles, expected, "{what}");
        }
    }

    #[test]
    fn branches_are_known() {
        for (code, expected, what) in [
            ([0x4770, 0], Branch::Indirect, "bx lr"),
            ([0x4687, 0], Branch::Indirect, "mov pc, r0"),
            ([0x4680, 0], Branch::No, "mov r8, r0"),
            ([0xbdf0, 0], Branch::Indirect, "pop {r4-r7, pc}"),
            ([0xd1fe, 0], Branch::Direct, "bne"),
            ([0xe7fe, 0], Branch::Direct, "b"),
            ([0xb108, 0], Branch::Direct, "cbz r0"),
            ([0xf000, 0xf800], Branch::Indirect, "bl"),
            ([0xf43f, 0xaffe], Branch::Direct, "beq.w"),
            ([0xf7ff, 0xbffe], Branch::Direct, "b.w"),
            ([0xe8df, 0xf001], Branch::Indirect, "tbb [pc, r1]"),
            ([0xf8df, 0xf004], Branch::Indirect, "ldr.w pc, [pc, #4]"),
            ([0xe8bd, 0x8ff0], Branch::Indirect, "pop {r4-r11, pc}"),
            ([0xf3bf, 0x8f4f], Branch::No, "dsb sy"),
            ([0xf240, 0x1000], Branch::No, "movw"),
        ] {
            assert_eq!(Instruction::decode(code).branch, expected, "{what}");
        }
    }

    #[test]
    fn addresses_are_known() {
        let based = |base, offset| Address::Based { base, offset };
        let indexed = |base, index, shift| Address::Indexed { base, index, shift };
        for (code, address, words, what) in [
            ([0x4801, 0], Address::Literal(4), 1, "ldr r0, [pc, #4]"),
            ([0x6848, 0], based(1, 4), 1, "ldr r0, [r1, #4]"),
            ([0x5888, 0], indexed(1, 2, 0), 1, "ldr r0, [r1, r2]"),
            ([0x9801, 0], based(13, 4), 1, "ldr r0, [sp, #4]"),
            ([0xc907, 0], based(1, 0), 3, "ldmia r1!, {r0-r2}"),
            (
                [0xf8df, 0x0010],
                Address::Literal(16),
                1,
                "ldr.w r0, [pc, #16]",
            ),
            (
                [0xf85f, 0x0010],
                Address::Literal(-16),
                1,
                "ldr.w r0, [pc, #-16]",
            ),
            (
                [0xf851, 0x0022],
                indexed(1, 2, 2),
                1,
                "ldr.w r0, [r1, r2, lsl #2]",
            ),
            ([0xf851, 0x8b04], based(1, 0), 1, "ldr r8, [r1], #4"),
            ([0xf851, 0x0d04], based(1, -4), 1, "ldr r0, [r1, #-4]!"),
            ([0xe8f0, 0xbc02], based(0, 0), 2, "ldrd r11, r12, [r0], #8"),
            ([0xe9d0, 0x1202], based(0, 8), 2, "ldrd r1, r2, [r0, #8]"),
            (
                [0xed9f, 0x0a04],
                Address::Literal(16),
                1,
                "vldr s0, [pc, #16]",
            ),
        ] {
            let access = Instruction::decode(code).access.unwrap();
            assert_eq!((access.address, access.words), (address, words), "{what}");
            assert!(access.is_load, "{what}");
        }
        let store = Instruction::decode([0xf8c1, 0x0004]).access.unwrap();
        assert_eq!((store.address, store.is_load), (based(1, 4), false));
        assert_eq!(Instruction::decode([0x1840, 0]).access, None);
    }
}
