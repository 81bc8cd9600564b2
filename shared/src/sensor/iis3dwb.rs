//! ST's IIS3DWB, an accelerometer of 16 bits that is flat to 6 kHz, along one axis.
//!
//! Sources, cited by these names:
//! - REG: ST's public register header iis3dwb_reg.h (STMicroelectronics/iis3dwb-pid), which has every address and bit
//!   used here;
//! - EX: ST's example beside it, iis3dwb_read_data_polling.c;
//! - DS: data sheet DS12569; AN: application note AN5444.
//!
//! A transfer is a byte of the address, its highest bit set to read, and bytes from there on (REG, EX).

use embedded_hal::spi::MODE_3;

use crate::sensor::slot::{Port, StartStep, Transaction};

/// The port: chip select, mode and clock.
pub(super) const PORT: Port = Port {
    name: "IIS3DWB accelerometer",
    // DS: clock idle high, sampled on the second edge
    mode: MODE_3,
    // DS: SPI up to 10 MHz
    clock_hz: 100_000..=10_000_000,
};

/// From power to the first transfer, ms (EX: BOOT_TIME; DS: boot).
pub(super) const POWER_UP_MS: u32 = 10;

const READ: u8 = 0x80;
/// Addresses (REG).
const WHO_AM_I: u8 = 0x0F;
const CTRL1_XL: u8 = 0x10;
const CTRL3_C: u8 = 0x12;
const CTRL4_C: u8 = 0x13;
const CTRL6_C: u8 = 0x15;
const CTRL8_XL: u8 = 0x17;
const OUTZ_L_A: u8 = 0x2C;

/// The identity register's value (REG: IIS3DWB_ID).
const IDENTITY: u8 = 0x7B;
/// CTRL3_C: software reset (REG: sw_reset).
const RESET: u8 = 0x01;
/// CTRL3_C: block data update and automatic increment (REG: bdu, if_inc).
const BLOCKS: u8 = 0x44;
/// CTRL1_XL: on at 26.7 kHz (REG: xl_en = 5), +-2 g (REG: fs_xl = 0), behind the second low-pass (REG: lpf2_xl_en).
const ON: u8 = 0xA2;
/// CTRL8_XL: that low-pass at a twentieth of the rate, 1333 Hz (REG: hpcf_xl = 2).
const LOW_PASS: u8 = 0x40;
/// CTRL6_C and CTRL4_C: Z alone, in all output registers (REG: xl_axis_sel = 3, _1ax_to_3regout); and I2C off
/// (REG: i2c_disable), for which it would take the ADS1220's transfers while it is not selected.
const Z_ALONE: u8 = 0x03;
const IN_ALL: u8 = 0x05;

/// The value of an LSB at +-2 g, g (REG: iis3dwb_from_fs2g_to_mg).
pub(super) const G_PER_LSB: f32 = 0.061e-3;

/// A transaction with the accelerometer, which is part 0 of its finger.
const fn access(out: &'static [u8], answer: u8) -> Transaction {
    // DS: no pause is asked for between transfers beyond chip select itself
    Transaction::first_port(out, answer, 1)
}

const fn write(out: &'static [u8], wait_us: u32) -> StartStep {
    StartStep::new(access(out, 0), &[], wait_us)
}

const fn read(out: &'static [u8], expect: &'static [(u8, u8)]) -> StartStep {
    StartStep::new(access(out, 1), expect, 0)
}

/// The step of [`START`] that shows whether it is there.
pub(super) const CHECK: [StartStep; 1] = {
    let [identity, ..] = START;
    [identity]
};

/// From power-up to the first slot.
pub(super) const START: [StartStep; 13] = [
    read(&[READ | WHO_AM_I, 0], &[(0xFF, IDENTITY)]),
    // EX waits until the bit falls; AN: 50 us, here 20 times as long
    write(&[CTRL3_C, RESET], 1000),
    read(&[READ | CTRL3_C, 0], &[(RESET, 0)]),
    write(&[CTRL3_C, BLOCKS], 0),
    write(&[CTRL4_C, IN_ALL], 0),
    write(&[CTRL6_C, Z_ALONE], 0),
    write(&[CTRL8_XL, LOW_PASS], 0),
    // the low-pass settles within a few of its periods, and AN discards samples after power-on
    write(&[CTRL1_XL, ON], 10_000),
    read(&[READ | CTRL3_C, 0], &[(BLOCKS, BLOCKS)]),
    read(&[READ | CTRL4_C, 0], &[(IN_ALL, IN_ALL)]),
    read(&[READ | CTRL6_C, 0], &[(Z_ALONE, Z_ALONE)]),
    read(&[READ | CTRL8_XL, 0], &[(0xE0, LOW_PASS)]),
    read(&[READ | CTRL1_XL, 0], &[(0xEE, ON)]),
];

/// Reads Z: two bytes, the lower first, and the reserved one behind them, so that the number of bytes is even.
pub(super) const READ_Z: Transaction = access(&[READ | OUTZ_L_A, 0, 0, 0], 3);

/// Asks whether it is on: after a brown-out it has its identity and is off.
pub(super) const READ_ON: Transaction = access(&[READ | CTRL1_XL, 0], 1);

/// Returns whether the answer to [`READ_ON`] says so, with the range and the filter as they were set.
pub(super) const fn is_on(ctrl1_xl: u8) -> bool {
    ctrl1_xl & 0xEE == ON & 0xEE
}
