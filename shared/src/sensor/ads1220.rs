//! TI's ADS1220, a converter of 24 bits, with a load cell of a full bridge on AIN0 and AIN1, whose supply is its
//! reference.
//!
//! Sources: DS is the data sheet SBAS501 by its sections; DRV are public drivers that name the same registers
//! (Protocentral_ADS1220, jrleeman/ADS1220_Arduino).

use embedded_hal::spi::MODE_1;

use crate::sensor::slot::{Port, StartStep, Transaction};

/// The port: chip select, mode and clock.
pub(super) const PORT: Port = Port {
    name: "ADS1220 of the load cell",
    // DS 8.5.1: mode 1 only
    mode: MODE_1,
    // DS 6.6: a period of 150 ns or more
    clock_hz: 10_000..=6_600_000,
};

/// Part 1 of its finger.
const PART: u8 = 1;

/// Commands (DS 8.5.3).
const RESET: u8 = 0x06;
const START_SYNC: u8 = 0x08;
const RDATA: u8 = 0x10;
/// From register 0, four of them: 0010 rrnn, 0100 rrnn.
const RREG_ALL: u8 = 0x23;
const WREG_ALL: u8 = 0x43;

/// CONFIG0: AIN0 - AIN1, gain 128 (DS 8.6, MUX = 0, GAIN = 7).
const CONFIG0: u8 = 0x0E;
/// CONFIG1: 1000 samples a second in normal mode, continuous conversion (DS 8.6, DR = 6, CM = 1).
const CONFIG1: u8 = 0xC4;
/// CONFIG2: the analog supply is the reference (DS 8.6, VREF = 3): it feeds the bridge, too, so that it drops out.
const CONFIG2: u8 = 0xC0;
/// CONFIG3: DRDY has its own pin alone (DS 8.6).
const CONFIG3: u8 = 0x00;

/// LSBs of the whole range: +-1/128 of the reference is +-2^23 (DS 8.5.2).
pub(super) const LSB_PER_UNIT: f32 = 128.0 * 8_388_608.0;

const fn access(out: &'static [u8], answer: u8) -> Transaction {
    Transaction {
        port: PART,
        out,
        answer,
        // DS 6.6: chip select is high for 50 ns or more
        gap_us: 1,
    }
}

/// The steps of [`START`] that show whether it is there.
pub(super) const CHECK: [StartStep; 3] = {
    let [reset, write, read, _] = START;
    [reset, write, read]
};

/// From power-up to the first slot.
pub(super) const START: [StartStep; 4] = [
    // DS 8.5.3.1: 50 us and 32 clocks, here twice as long
    StartStep::new(access(&[RESET], 0), &[], 120),
    StartStep::new(
        access(&[WREG_ALL, CONFIG0, CONFIG1, CONFIG2, CONFIG3], 0),
        &[],
        0,
    ),
    StartStep::new(
        access(&[RREG_ALL, 0, 0, 0, 0], 4),
        &[
            (0xFF, CONFIG0),
            (0xFF, CONFIG1),
            (0xFF, CONFIG2),
            (0xFE, CONFIG3),
        ],
        0,
    ),
    // DS 8.4.2.2: the first conversion begins 210 clocks later, and takes a millisecond
    StartStep::new(access(&[START_SYNC], 0), &[], 2500),
];

/// Reads the last whole conversion, whenever that was (DS 8.5.4: RDATA needs no DRDY).
pub(super) const READ: Transaction = access(&[RDATA, 0, 0, 0], 3);

/// The conversion in an answer, LSB.
pub(super) const fn code(answer: [u8; 3]) -> i32 {
    let [upper, middle, lower] = answer;
    // the sign comes down with the shift
    i32::from_be_bytes([upper, middle, lower, 0]) >> 8
}

/// Returns whether a conversion is at an end of the range: an input that nothing drives.
pub(super) const fn is_clipped(code: i32) -> bool {
    code == 0x7F_FFFF || code == -0x80_0000
}
