//! The far ends of the chip's buses: the host on USART3, the sensor on SPI1, the handheld's sensor of motion on SPI4,
//! the display on I2C1.

use rigless::chip::{Timeline, i2c, spi, uart};
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

use super::rig::{SharedRig, lock};

/// The host's end of USART3: bytes are queued in the rig, with their time.
#[derive(Debug)]
pub(crate) struct Serial(pub(crate) SharedRig);

impl Store for Serial {}

impl uart::Peer for Serial {
    fn receive(&mut self, word: u16, context: &mut Timeline<'_, '_>) {
        lock(&self.0).heard.push((context.now().0, word as u8));
    }

    fn transmit(&mut self, _now: VirtualNanos) -> Option<u16> {
        lock(&self.0).to_say.pop_front().map(u16::from)
    }
}

/// The sensor's end of SPI1.
#[derive(Debug)]
pub(crate) struct SensorPins(pub(crate) SharedRig);

impl Store for SensorPins {}

impl spi::Peer for SensorPins {
    fn transfer(&mut self, mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        let mut rig = lock(&self.0);
        let now = context.now().0;
        if bits == 8 {
            rig.spi_byte(now, mosi as u8).into()
        } else {
            // its first byte was over half way
            let half = rig.byte_ns.max(rig.selected_ns).midpoint(now);
            let first = rig.spi_byte(half, (mosi >> 8) as u8);
            let second = rig.spi_byte(now, mosi as u8);
            u16::from_be_bytes([first, second]).into()
        }
    }
}

/// The motion sensor's end of SPI4.
#[derive(Debug)]
pub(crate) struct MotionPins(pub(crate) SharedRig);

impl Store for MotionPins {}

impl spi::Peer for MotionPins {
    fn transfer(&mut self, mosi: u32, bits: u8, context: &mut Timeline<'_, '_>) -> u32 {
        lock(&self.0)
            .motion_byte(context.now().0, mosi as u8, bits)
            .into()
    }
}

/// The display's end of I2C1.
#[derive(Debug)]
pub(crate) struct DisplayPins(pub(crate) SharedRig);

impl Store for DisplayPins {}

impl i2c::Peer for DisplayPins {
    fn start(&mut self, address: u8, read: bool, _: &mut Timeline<'_, '_>) -> bool {
        lock(&self.0).display_mut().start(address, read)
    }

    fn write(&mut self, byte: u8, context: &mut Timeline<'_, '_>) -> bool {
        let now_ns = context.now().0;
        lock(&self.0).display_mut().byte(now_ns, byte);
        true
    }

    fn read(&mut self, _: bool, _: &mut Timeline<'_, '_>) -> u8 {
        0xFF
    }

    fn stop(&mut self, _: &mut Timeline<'_, '_>) {}
}
