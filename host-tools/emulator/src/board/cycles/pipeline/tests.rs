//! Sequences that were counted by hand from ARM 100166 (3.3) and RM0090 (3.5.2).

use super::*;

const BEGIN: u32 = 0x0800_1000;
const PREFETCH: u32 = 1 << 8;
const INSTRUCTIONS: u32 = 1 << 9;
const DATA: u32 = 1 << 10;
/// As the board has it: five wait states, prefetch and the cache of instructions, none of data.
const BOARD: u32 = 5 | PREFETCH | INSTRUCTIONS;

const ADDS: [u16; 2] = [0x1840, 0];
const ADD_W: [u16; 2] = [0xeb00, 0x0001];
const BNE: [u16; 2] = [0xd1fe, 0];
const BX_LR: [u16; 2] = [0x4770, 0];
const NOP: [u16; 2] = [0xbf00, 0];

/// Code that is executed from the beginning on, one instruction behind the other.
struct Run {
    core: Core,
    at: u32,
}

impl Run {
    fn new(acr: u32) -> Self {
        Self {
            core: Core::new(Accelerator::new(acr)),
            at: BEGIN,
        }
    }

    fn to(&mut self, code: [u16; 2], next: u32, data: Option<u32>) -> u64 {
        let at = std::mem::replace(&mut self.at, next);
        let executed = Executed {
            at,
            code,
            next,
            data,
        };
        self.core.execute(&executed)
    }

    fn one(&mut self, code: [u16; 2]) -> u64 {
        self.data(code, None)
    }

    fn data(&mut self, code: [u16; 2], data: Option<u32>) -> u64 {
        let next = self.at + Instruction::decode(code).length;
        self.to(code, next, data)
    }

    fn many(&mut self, code: [u16; 2], count: usize) -> u64 {
        (0..count).map(|_| self.one(code)).sum()
    }
}

/// Lines of four instructions of 32 bits: 5 waits for the first one; without prefetch as many for each other, with it
/// the two cycles that a line's read of 6 is longer than its four instructions. Without wait states, none.
#[test]
fn straight_code_of_32_bits() {
    for (acr, expected) in [(0, 16), (5, 4 * (5 + 4)), (BOARD, 5 + 4 + 3 * (2 + 4))] {
        assert_eq!(Run::new(acr).many(ADD_W, 16), expected, "{acr:#x}");
    }
}

/// Lines of eight instructions of 16 bits: with prefetch only the first one is waited for.
#[test]
fn straight_code_of_16_bits() {
    for (acr, expected) in [(0, 32), (5, 4 * (5 + 8)), (BOARD, 5 + 32)] {
        assert_eq!(Run::new(acr).many(ADDS, 32), expected, "{acr:#x}");
    }
}

/// Two lines, 16 instructions, the last one branches back: 1 + P with a P of 1 as the target is known early. In the
/// first turn 5 + 8 + 0 + 8 + 1. From then on line 0 is in the cache; line 1 is prefetched in time, or, without
/// prefetch, is there, too.
#[test]
fn a_loop_that_fits_in_the_cache() {
    for (acr, first, others) in [
        (BOARD, 5 + 16 + 1, 16 + 1),
        (5 | INSTRUCTIONS, 5 + 5 + 16 + 1, 16 + 1),
        (5 | PREFETCH, 5 + 16 + 1, 5 + 16 + 1),
        (5, 5 + 5 + 16 + 1, 5 + 5 + 16 + 1),
    ] {
        let mut run = Run::new(acr);
        let mut turn = || run.many(ADDS, 15) + run.to(BNE, BEGIN, None);
        let first_turn = turn();
        let turns = [turn(), turn(), turn()];
        assert_eq!(first_turn, first, "{acr:#x}");
        // a prefetch that was under way is brought to its end: line 2 from 14 to 19, the loop is back in cycle 22
        assert_eq!(turns, [others; 3], "{acr:#x}");
    }
}

/// The loop of `cortex_m::asm::delay`: SUBS and a BNE that is taken, three cycles a turn.
#[test]
fn a_delay_takes_three_cycles_a_turn() {
    let mut run = Run::new(BOARD);
    run.many(NOP, 8);
    let begin = run.at;
    let turn = |run: &mut Run| run.one([0x3801, 0]) + run.to(BNE, begin, None);
    turn(&mut run);
    assert_eq!(turn(&mut run), 3);
    assert_eq!(run.one([0x3801, 0]) + run.one(BNE), 2, "not taken");
}

/// BX to a line that is nowhere: 1 + P = 3. Line 0 arrived in cycle 5 and line 1 is prefetched from 6 to 11, BX is
/// issued in cycle 5 and done in 8, line 64 is read from 12 to 17: 9 waits. When it is back there later it finds it in
/// the cache.
#[test]
fn a_branch_to_a_cold_line() {
    let mut run = Run::new(BOARD);
    let far = BEGIN + 64 * 16;
    assert_eq!(run.to(BX_LR, far, None), 5 + 3);
    assert_eq!(run.one(NOP), 9 + 1);
    assert_eq!(run.to(BX_LR, BEGIN, None), 3);
    assert_eq!(run.to(BX_LR, far, None), 3);
    assert_eq!(run.one(NOP), 1);
    // without prefetch nothing is under way: 5 waits
    let mut run = Run::new(5);
    assert_eq!(run.to(BX_LR, far, None), 5 + 3);
    assert_eq!(run.one(NOP), 5 + 1);
}

/// A target of 32 bits across two words takes a cycle more.
#[test]
fn a_target_across_two_words() {
    for (target, cycles) in [(BEGIN + 4, 3), (BEGIN + 6, 4)] {
        let mut run = Run::new(0);
        let there = run.to(BX_LR, target, None);
        assert_eq!(there + run.one(ADD_W), cycles + 1, "{target:#x}");
    }
}

/// A literal: two cycles, and five waits without the cache of data, each time. With it the second one is there.
#[test]
fn literals() {
    const LDR: [u16; 2] = [0x4801, 0];
    for (acr, expected) in [
        (0, [2, 2]),
        (5, [5 + 2 + 5, 2 + 5]),
        (5 | DATA, [5 + 2 + 5, 2]),
    ] {
        let mut run = Run::new(acr);
        let first = run.one(LDR);
        run.one(NOP);
        assert_eq!([first, run.one(LDR)], expected, "{acr:#x}");
    }
    // with prefetch: the line arrives in cycle 5, the literal is wanted in 6, before line 1 that waits for its turn
    let mut run = Run::new(BOARD);
    assert_eq!(run.one(LDR), 5 + 2 + 5);
}

/// A table in flash that a register points to waits as a literal does; RAM does not, nor does it while it is stored to.
#[test]
fn data_elsewhere() {
    const LDM: [u16; 2] = [0xc907, 0];
    let cycles = |code, data| {
        let mut run = Run::new(5 | INSTRUCTIONS);
        // its line is there
        run.one(NOP);
        run.data(code, Some(data))
    };
    assert_eq!(cycles(LDR, 0x2000_0000), 2);
    assert_eq!(cycles(LDR, 0x1000_0000), 2);
    assert_eq!(cycles(LDR, 0x0810_0000), 2 + 5);
    assert_eq!(cycles(LDM, 0x2000_0000), 4);
    assert_eq!(cycles(LDM, 0x0810_0000), 4 + 3 * 5);
    // SPI1 on APB2, TIM2 on APB1, a port
    assert_eq!(cycles(LDR, 0x4001_300c), 2 + 6);
    assert_eq!(cycles(LDR, 0x4000_0010), 2 + 12);
    assert_eq!(cycles(LDR, 0x4002_0c18), 2 + 1);
}

const LDR: [u16; 2] = [0x6808, 0];
const STR: [u16; 2] = [0x6008, 0];
const STR_INDEXED: [u16; 2] = [0x5088, 0];
const PUSH: [u16; 2] = [0xb570, 0];
const DSB: [u16; 2] = [0xf3bf, 0x8f4f];
const RAM: u32 = 0x2000_0000;
const TIM2: u32 = 0x4000_0010;
const SPI1: u32 = 0x4001_300c;
const PORT: u32 = 0x4002_0c18;

/// "STR Rx, [Ry, #imm] is always one cycle": the data go out while the next instruction is executed, which waits only
/// if the buffer is full (100166 3.3.2). A store to APB1 is issued in cycle 0, has its data phase in 1 and 12 waits, so
/// that the next access goes out in cycle 13.
#[test]
fn a_store_waits_in_the_write_buffer() {
    let cycles = |codes: &[([u16; 2], Option<u32>)]| {
        let mut run = Run::new(0);
        let each: Vec<u64> = codes
            .iter()
            .map(|(code, at)| run.data(*code, *at))
            .collect();
        each
    };
    // instructions that do not use the bus continue
    assert_eq!(
        cycles(&[(STR, Some(TIM2)), (ADDS, None), (ADDS, None)]),
        [1; 3]
    );
    // the next access, to any memory, does not: 2 + 12, or 1 + 12
    for next in [RAM, TIM2, PORT] {
        let waits = if next == RAM {
            0
        } else {
            u64::from(next == PORT) + 12 * u64::from(next == TIM2)
        };
        assert_eq!(
            cycles(&[(STR, Some(TIM2)), (LDR, Some(next))]),
            [1, 12 + 2 + waits]
        );
        assert_eq!(cycles(&[(STR, Some(TIM2)), (STR, Some(next))]), [1, 12 + 1]);
    }
    // 6 waits of APB2 of which four are over, 1 of a port
    let adds = [(ADDS, None); 4];
    let four_later = [&[(STR, Some(SPI1))], &adds[..], &[(LDR, Some(RAM))]].concat();
    assert_eq!(cycles(&four_later), [1, 1, 1, 1, 1, 2 + 2]);
    assert_eq!(
        cycles(&[(STR, Some(PORT)), (STR, Some(PORT)), (ADDS, None)]),
        [1, 2, 1]
    );
    // RAM does not wait, so there is nothing to buffer
    assert_eq!(cycles(&[(STR, Some(RAM)), (LDR, Some(RAM))]), [1, 2]);
    // an index takes its cycle before the store is issued
    assert_eq!(
        cycles(&[(STR_INDEXED, Some(TIM2)), (STR, Some(RAM))]),
        [2, 12 + 1]
    );
    // the stack is on the bus, and a barrier waits until the buffer is empty (DDI 0337 3.5)
    assert_eq!(cycles(&[(STR, Some(TIM2)), (PUSH, None)]), [1, 12 + 5]);
    assert_eq!(cycles(&[(STR, Some(TIM2)), (DSB, None)]), [1, 12 + 4]);
}

/// A flag of TIM2 is cleared and its count read: LDR 2 + 12, STR 1, LDR 12 for the store and 2 + 12. In the model
/// without the buffer the store took 13, and so in all the same: the gain is the work of other instructions meanwhile.
#[test]
fn a_register_read_behind_a_store_waits_for_both() {
    let mut run = Run::new(0);
    let codes = [LDR, STR, LDR].map(|code| run.data(code, Some(TIM2)));
    assert_eq!(codes, [14, 1, 12 + 14]);
}

/// Registers go to the stack and come back by the bus of the store: 12 and 12, 6 and 10. Behind another exception
/// nothing does.
#[test]
fn an_exception_waits_for_the_write_buffer() {
    let vector = 0x0800_00b0;
    let mut run = Run::new(0);
    run.data(STR, Some(TIM2));
    assert_eq!(run.core.enter(vector, false), 12 + 12);
    run.data(STR, Some(SPI1));
    assert_eq!(run.core.leave(false), 6 + 10);
    run.core.enter(vector, false);
    run.data(STR, Some(SPI1));
    assert_eq!(run.core.leave(true) + run.core.enter(vector, true), 6);
}

/// LDR r0, [r1]; LDR r2, [r3]; STR r2, [r4]: 2 + 1 + 1. LDR r0, [r1]; LDR r2, [r0]: the second address is not there
/// yet.
#[test]
fn loads_one_behind_the_other() {
    let load = |to: u16, from: u16| [0x6800 | from << 3 | to, 0];
    let mut run = Run::new(0);
    assert_eq!(
        [load(0, 1), load(2, 3), [0x6022, 0]].map(|code| run.one(code)),
        [2, 1, 1]
    );
    assert_eq!([load(0, 1), load(2, 0)].map(|code| run.one(code)), [2, 2]);
}

/// VMUL s0, s1, s2 and VADD s3, s0, s0, which waits for it; VADD s6, s4, s5 does not.
#[test]
fn results_of_the_fpu_come_a_cycle_later() {
    let mut run = Run::new(0);
    let codes = [[0xee20, 0x0a81], [0xee70, 0x1a00], [0xee32, 0x3a22]];
    assert_eq!(codes.map(|code| run.one(code)), [1, 2, 1]);
}

/// An interrupt between two instructions: 12 into it, 10 back; a second one right behind it 6 more, and no return
/// between.
#[test]
fn exceptions() {
    let mut run = Run::new(0);
    run.one(NOP);
    assert_eq!(run.core.enter(0x0800_00b0, false), 12);
    assert_eq!(run.core.leave(true) + run.core.enter(0x0800_00b4, true), 6);
    assert_eq!(run.core.leave(false), 10);
    // with wait states its vector is a line of instructions: 6 + 5 beside the 9 of the stack, 2 too many
    let mut run = Run::new(5);
    assert_eq!(run.core.enter(0x0800_00b0, false), 12 + 2);
    // and behind another one there is no stack to hide it
    assert_eq!(
        run.core.leave(true) + run.core.enter(0x0800_01b0, true),
        6 + 5
    );
    // the FPU's registers are put aside when they are needed, and come back
    let mut run = Run::new(0);
    run.core.enter(0x0800_00b0, false);
    assert_eq!(run.many([0xee20, 0x0a81], 2), 17 + 1 + 1);
    assert_eq!(run.core.leave(false), 10 + 17);
}
