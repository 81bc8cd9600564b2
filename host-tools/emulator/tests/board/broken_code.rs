//! Functions of the firmware that do something else instead.

use tactus_emulator::board::Emulator;

/// Unused flash.
pub(crate) const NOWHERE: u64 = 0x080F_FF00;

/// What a function does instead of its work, once: its code is whole again 10 ms later, as after a disturbance that
/// left no trace.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Instead {
    /// It never returns.
    Hangs,
    /// It runs into an undefined instruction.
    Crashes,
    /// It panics.
    Panics,
    /// It raises the NMI of the clock security system, and goes no further.
    Nmi,
}

/// Code for [`NOWHERE`] that calls `core::panicking::panic`.
fn panicking(panic: u64) -> Vec<u8> {
    // ldr r3 from the word behind, blx r3
    let code = [0x4B00_u16, 0x4798];
    let mut bytes: Vec<u8> = code.iter().flat_map(|c| c.to_le_bytes()).collect();
    bytes.extend((panic as u32 | 1).to_le_bytes());
    bytes
}

/// Thumb's `b.w` from one address to another (ARMv7-M manual, B, encoding T4).
fn branch(from: u64, to: u64) -> [u8; 4] {
    let offset = (to as i64 - (from as i64 + 4)) as u32;
    let bit = |n: u32| offset >> n & 1;
    let s = bit(24);
    let high = 0xF000 | s << 10 | offset >> 12 & 0x3FF;
    let (j1, j2) = (!(bit(23) ^ s) & 1, !(bit(22) ^ s) & 1);
    let low = 0x9000 | j1 << 13 | j2 << 11 | offset >> 1 & 0x7FF;
    let [a, b] = (high as u16).to_le_bytes();
    let [c, d] = (low as u16).to_le_bytes();
    [a, b, c, d]
}

/// Breaks a function; what to put back, and where.
pub(crate) fn break_code(board: &mut Emulator, name: &str, instead: Instead) -> (u64, Vec<u8>) {
    let (address, _) = board.symbol(name).unwrap();
    let address = address & !1;
    let code = board.read(address, 4).unwrap();
    match instead {
        Instead::Hangs => {
            // a branch to itself
            board.write(NOWHERE, &[0xFE, 0xE7]).unwrap();
            board.write(address, &branch(address, NOWHERE)).unwrap();
        }
        Instead::Panics => {
            let (panic, _) = board.symbol("rust_begin_unwind").unwrap();
            board.write(NOWHERE, &panicking(panic)).unwrap();
            board.write(address, &branch(address, NOWHERE)).unwrap();
        }
        Instead::Nmi => {
            // ldr r0, [pc, #8]; movs r1, #1; lsls r1, #31; str r1, [r0]; a branch to itself; nop; ICSR
            let code = [
                0x4802_u16, 0x2101, 0x07C9, 0x6001, 0xE7FE, 0xBF00, 0xED04, 0xE000,
            ];
            let bytes: Vec<u8> = code.iter().flat_map(|c| c.to_le_bytes()).collect();
            board.write(NOWHERE, &bytes).unwrap();
            board.write(address, &branch(address, NOWHERE)).unwrap();
        }
        // udf
        Instead::Crashes => board.write(address, &[0x00, 0xDE]).unwrap(),
    }
    (address, code)
}
