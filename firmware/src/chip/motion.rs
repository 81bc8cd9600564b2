//! The bus of the handheld's sensor of motion: SPI4 with its pins and its chip select, which this module owns wholly.
//!
//! A reading takes 0.15 ms of each 10 ms, and the start-up list 2 ms at once: its task waits for the bytes, and
//! everything that is urgent interrupts it.
use core::mem::ManuallyDrop;

use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::pac::SPI4;
use embassy_stm32::pac::spi::regs::Cr1;
use embassy_stm32::pac::spi::vals::{Br, Cpha, Cpol, Mstr};
use embassy_stm32::{Peri, peripherals, rcc};
use embassy_time::{Duration, block_for};
use embedded_hal::spi::{ErrorKind, ErrorType, Operation, SpiDevice};
use tactus_core::sensor::paa5100je::CLOCK_HZ;

use crate::board::{self, held};
use crate::chip::{spi, wait_cycles};

const DIVIDER: Br = Br::DIV64;
const SPI_HZ: u32 = 84_000_000 / 64;
const _: () = assert!(SPI_HZ <= CLOCK_HZ);
/// Cycles of the core, 168 MHz, in a byte and in a us.
const BYTE_CYCLES: u32 = 8 * (168_000_000 / SPI_HZ);
const US_CYCLES: u32 = 168;
const LOOKS: u32 = 32;
/// Alternate function of SPI4's pins (data sheet, table 12).
const SPI4_FUNCTION: u8 = 5;

pub(crate) struct MotionBus {
    _spi: Peri<'static, peripherals::SPI4>,
    _pins: [ManuallyDrop<Flex<'static>>; 3],
    select: ManuallyDrop<Flex<'static>>,
}

impl MotionBus {
    pub(crate) fn new(pins: board::Motion) -> Self {
        let mut select = held(pins.select);
        select.set_high();
        select.set_as_output(Speed::Medium);
        let out = AfType::output(OutputType::PushPull, Speed::Medium);
        // nobody there then reads as FF
        let input = AfType::input(Pull::Up);
        let mut led = [held(pins.sck), held(pins.mosi), held(pins.miso)];
        for (pin, how) in led.iter_mut().zip([out, out, input]) {
            pin.set_as_af_unchecked(SPI4_FUNCTION, how);
        }
        restart();
        Self {
            _spi: pins.spi,
            _pins: led,
            select,
        }
    }
}

fn restart() {
    rcc::enable_and_reset::<peripherals::SPI4>();
    let mut control = Cr1::default();
    control.set_cpol(Cpol::IDLE_HIGH);
    control.set_cpha(Cpha::SECOND_EDGE);
    control.set_br(DIVIDER);
    control.set_mstr(Mstr::MASTER);
    // the select is by software: no mode fault
    control.set_ssm(true);
    control.set_ssi(true);
    control.set_spe(true);
    SPI4.cr1().write_value(control);
}

/// Sends a byte and gives what came in; `None`: it did not end in three times its time.
fn byte(out: u8) -> Option<u8> {
    spi::send(SPI4, out.into());
    wait_cycles(BYTE_CYCLES);
    for _ in 0..2 * LOOKS {
        if SPI4.sr().read().rxne() {
            return Some(spi::received(SPI4) as u8);
        }
        wait_cycles(BYTE_CYCLES / LOOKS);
    }
    None
}

/// Does a part of a transaction; `None` as in [`byte`].
fn operate(operation: &mut Operation<'_, u8>) -> Option<()> {
    match operation {
        Operation::Write(bytes) => {
            for out in *bytes {
                byte(*out)?;
            }
        }
        Operation::Read(bytes) => {
            for to in bytes.iter_mut() {
                *to = byte(0)?;
            }
        }
        Operation::Transfer(to, from) => {
            for (to, from) in to.iter_mut().zip(*from) {
                *to = byte(*from)?;
            }
        }
        Operation::TransferInPlace(bytes) => {
            for both in bytes.iter_mut() {
                *both = byte(*both)?;
            }
        }
        // whole us, and the part of one that has passed
        Operation::DelayNs(ns) => block_for(Duration::from_micros((*ns / 1000 + 2).into())),
    }
    Some(())
}

impl ErrorType for MotionBus {
    type Error = ErrorKind;
}

impl SpiDevice for MotionBus {
    fn transaction(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), ErrorKind> {
        self.select.set_low();
        // the sensor wants 120 ns to its first clock
        wait_cycles(US_CYCLES);
        let done = operations.iter_mut().all(|each| operate(each).is_some());
        self.select.set_high();
        if done {
            return Ok(());
        }
        restart();
        Err(ErrorKind::Other)
    }
}
