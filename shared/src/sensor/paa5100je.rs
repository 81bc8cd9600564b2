//! PixArt PAA5100JE: an optical sensor of motion over a surface, for the speed of a hand. It sits on a bus of its own.
//!
//! It looks at the surface from 15 to 35 mm and counts how far that has moved, 228 counts per mm and mm of height. What
//! it cannot see, a mirror or clear glass, it reports as such.
//!
//! SPI mode 3, at most 2 MHz. Registers, identity, waits and the rule for readings that do not count are those of the
//! data sheet as public drivers have them. What is written after a reset has no public meaning: values and order are
//! those of Pimoroni's pmw3901-python (161fe3e, class `PAA5100`); RIOT's `drivers/paa5100je` (fb4e183) writes the same
//! list with longer waits, and does not divide the second number of the trim by 100.

use embedded_hal::spi::{Operation, SpiDevice};

/// Fastest clock, Hz.
pub const CLOCK_HZ: u32 = 2_000_000;
/// Counts of a way of one mm at the 25 mm of Pimoroni's board. A mm of height is 4 % of it: as far as all slides of a
/// table are made with the same probe, that cancels.
pub const COUNTS_PER_MM: f32 = 228.0 / 25.0;

const WRITE: u8 = 0x80;
const IDENTITY: u8 = 0x00;
const MOTION: u8 = 0x02;
const BURST: u8 = 0x16;
const RESET: u8 = 0x3A;
const ORIENTATION: u8 = 0x5B;
const INVERSE_IDENTITY: u8 = 0x5F;
/// Selects the bank of the registers from 0x40 on.
const BANK: u8 = 0x7F;
/// The identity, and its complement.
const IS: [u8; 2] = [0x49, 0xB6];
/// The register's value that turns the axes. That it reads back is not known.
const TURNED: u8 = 0xA0;

/// From the address to the data of a read (tSRAD), ns.
const ADDRESS_TO_DATA_NS: u32 = 2_000;
/// After a write to the next write (tSWW), longer than to the next read (tSWR), ns.
const AFTER_WRITE_NS: u32 = 10_500;
/// After a read (tSRR, tSRW), ns.
const AFTER_READ_NS: u32 = 1_500;
/// From the reset to the first access, and of the pauses in the list, ms. Drivers wait 0 to 20, and 10 to 100.
const RESET_MS: u32 = 20;
const PAUSE_MS: u32 = 10;
/// It is started again when it has seen nothing move for so long, after which it may stop, ...
const STILL_MS: u32 = 60_000;
/// ... and so long after it has failed, ms.
const AGAIN_MS: u32 = 1_000;

/// Surface quality and shutter of a reading that does not count: fewer features than this, and the longest exposure.
const LEAST_QUALITY: u8 = 0x19;
const LONGEST_SHUTTER: u8 = 0x1F;

/// A list of register writes: address and value.
type Writes = &'static [[u8; 2]];

/// Before the part's own trim is read, between its two looks, and before the second one is written.
const BEFORE_TRIM: Writes = &[
    [BANK, 0x00],
    [0x55, 0x01],
    [0x50, 0x07],
    [BANK, 0x0E],
    [0x43, 0x10],
];
const BETWEEN_TRIMS: Writes = &[
    [BANK, 0x00],
    [0x51, 0x7B],
    [0x50, 0x00],
    [0x55, 0x00],
    [BANK, 0x0E],
];
const BEFORE_SECOND_TRIM: Writes = &[[BANK, 0x00], [0x61, 0xAD], [0x51, 0x70], [BANK, 0x0E]];

/// After the trim, with a pause after each part.
#[rustfmt::skip]
const LIST: [Writes; 3] = [
    &[
        [BANK, 0x00], [0x61, 0xAD],
        [BANK, 0x03], [0x40, 0x00],
        [BANK, 0x05], [0x41, 0xB3], [0x43, 0xF1], [0x45, 0x14], [0x5F, 0x34], [0x7B, 0x08], [0x5E, 0x34], [0x5B, 0x11],
        [0x6D, 0x11], [0x45, 0x17], [0x70, 0xE5], [0x71, 0xE5],
        [BANK, 0x06], [0x44, 0x1B], [0x40, 0xBF], [0x4E, 0x3F],
        [BANK, 0x08], [0x66, 0x44], [0x65, 0x20], [0x6A, 0x3A], [0x61, 0x05], [0x62, 0x05],
        [BANK, 0x09], [0x4F, 0xAF], [0x5F, 0x40], [0x48, 0x80], [0x49, 0x80], [0x57, 0x77], [0x60, 0x78], [0x61, 0x78],
        [0x62, 0x08], [0x63, 0x50],
        [BANK, 0x0A], [0x45, 0x60],
        [BANK, 0x00], [0x4D, 0x11], [0x55, 0x80], [0x74, 0x21], [0x75, 0x1F], [0x4A, 0x78], [0x4B, 0x78], [0x44, 0x08],
        [0x45, 0x50], [0x64, 0xFF], [0x65, 0x1F],
        [BANK, 0x14], [0x65, 0x67], [0x66, 0x08], [0x63, 0x70], [0x6F, 0x1C],
        [BANK, 0x15], [0x48, 0x48],
        [BANK, 0x07], [0x41, 0x0D], [0x43, 0x14], [0x4B, 0x0E], [0x45, 0x0F], [0x44, 0x42], [0x4C, 0x80],
        [BANK, 0x10], [0x5B, 0x02],
        [BANK, 0x07], [0x40, 0x41],
    ],
    &[
        [BANK, 0x00], [0x32, 0x00],
        [BANK, 0x07], [0x40, 0x40],
        [BANK, 0x06], [0x68, 0xF0], [0x69, 0x00],
        [BANK, 0x0D], [0x48, 0xC0], [0x6F, 0xD5],
        [BANK, 0x00], [ORIENTATION, TURNED], [0x4E, 0xA8], [0x5A, 0x90], [0x40, 0x80], [0x73, 0x1F],
    ],
    &[[0x73, 0x00]],
];

/// The distance moved since the last reading, counts along both axes, in the twelve bytes of a burst; `None` where it
/// does not see the surface.
const fn moved(burst: [u8; 12]) -> Option<[i16; 2]> {
    // quality: features of the surface that it sees; shutter: upper five bits of the exposure
    let [motion, _, x0, x1, y0, y1, quality, _, _, _, shutter, _] = burst;
    if quality < LEAST_QUALITY && shutter & 0x1F == LONGEST_SHUTTER {
        None
    } else if motion & 0x80 != 0 {
        Some([i16::from_le_bytes([x0, x1]), i16::from_le_bytes([y0, y1])])
    } else {
        Some([0, 0])
    }
}

/// The reasons why it cannot be used.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[allow(missing_docs)] // their texts say it
pub enum MotionFault {
    #[error("the motion sensor's bus failed")]
    Bus,
    #[error(
        "no PAA5100JE answers: it says 0x{:02x} and 0x{:02x}; check power, cable, chip select and SPI mode \
         3", .0[0], .0[1]
    )]
    Identity([u8; 2]),
    #[error("the motion sensor has forgotten its settings: check its power")]
    Forgot,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum State {
    /// To be reset.
    Reset,
    /// The reset is over: to be looked at and trimmed.
    Trim,
    /// So much of the list is written.
    Written(usize),
    /// It measures.
    Ready,
}

/// The sensor on its bus.
#[derive(Debug)]
pub struct Paa5100je<SPI> {
    spi: SPI,
    state: State,
    /// Nothing is done before this time, ms.
    until_ms: Option<u32>,
    moved_ms: u32,
    fault: Option<MotionFault>,
    found: bool,
    /// [`ORIENTATION`] as it reads once the list is written: another value later says that the part lost its power.
    orientation: u8,
}

impl<SPI: SpiDevice> Paa5100je<SPI> {
    /// Takes the bus, and does not touch it.
    pub const fn new(spi: SPI) -> Self {
        Self {
            spi,
            state: State::Reset,
            until_ms: None,
            moved_ms: 0,
            fault: None,
            found: false,
            orientation: 0,
        }
    }

    /// The bus.
    pub fn bus(&mut self) -> &mut SPI {
        &mut self.spi
    }

    /// Returns why it does not measure; `None` while it starts, and while it measures.
    pub fn fault(&self) -> Option<MotionFault> {
        self.fault
    }

    /// Returns whether there is one: it has said who it is since this was made.
    pub fn is_found(&self) -> bool {
        self.found
    }

    /// To be called every 10 ms or so with a clock of ms that may turn over: starts it, waiting between the calls, and
    /// reads it. Counts along both axes since the last reading; `None` while it does not see the surface or does not
    /// work.
    ///
    /// A call takes at most 84 writes and some reads, 2 ms with the fastest clock; one that reads takes 0.1 ms.
    pub fn poll(&mut self, now_ms: u32) -> Option<[i16; 2]> {
        let waits = |until: u32| until.wrapping_sub(now_ms) as i32 > 0;
        if self.until_ms.is_some_and(waits) {
            return None;
        }
        self.until_ms = None;
        match self.advance(now_ms) {
            Ok(moved) => {
                if let Some([x, y]) = moved
                    && (x, y) != (0, 0)
                {
                    self.moved_ms = now_ms;
                }
                if self.state == State::Ready {
                    self.fault = None;
                    if now_ms.wrapping_sub(self.moved_ms) > STILL_MS {
                        self.state = State::Reset;
                    }
                }
                moved
            }
            Err(why) => {
                self.fault = Some(why);
                self.state = State::Reset;
                self.until_ms = Some(now_ms.wrapping_add(AGAIN_MS));
                None
            }
        }
    }

    fn advance(&mut self, now_ms: u32) -> Result<Option<[i16; 2]>, MotionFault> {
        let (next, pause_ms) = match self.state {
            State::Reset => {
                self.write(RESET, 0x5A)?;
                (State::Trim, RESET_MS)
            }
            State::Trim => {
                self.identify()?;
                self.trim()?;
                (State::Written(0), 0)
            }
            State::Written(parts) => match LIST.get(parts) {
                Some(writes) => {
                    self.write_all(writes)?;
                    (State::Written(parts + 1), PAUSE_MS)
                }
                None => {
                    self.identify()?;
                    self.orientation = self.read(ORIENTATION)?;
                    // of the way since the reset nothing is known
                    self.read_motion()?;
                    self.moved_ms = now_ms;
                    (State::Ready, 0)
                }
            },
            State::Ready => {
                let burst = self.read_motion()?;
                // a line that floats gives readings, too
                self.check()?;
                return Ok(moved(burst));
            }
        };
        self.state = next;
        self.until_ms = Some(now_ms.wrapping_add(pause_ms));
        Ok(None)
    }

    fn identify(&mut self) -> Result<(), MotionFault> {
        let is = [self.read(IDENTITY)?, self.read(INVERSE_IDENTITY)?];
        if is == IS {
            self.found = true;
            Ok(())
        } else {
            Err(MotionFault::Identity(is))
        }
    }

    fn check(&mut self) -> Result<(), MotionFault> {
        self.identify()?;
        if self.read(ORIENTATION)? == self.orientation {
            Ok(())
        } else {
            Err(MotionFault::Forgot)
        }
    }

    fn trim(&mut self) -> Result<(), MotionFault> {
        for register in MOTION..MOTION + 5 {
            self.read(register)?;
        }
        self.write_all(BEFORE_TRIM)?;
        let fine = self.read(0x67)? & 0x80 != 0;
        self.write(0x48, if fine { 0x04 } else { 0x02 })?;
        self.write_all(BETWEEN_TRIMS)?;
        if self.read(0x73)? == 0 {
            let (first, second) = trimmed(self.read(0x70)?, self.read(0x71)?);
            self.write_all(BEFORE_SECOND_TRIM)?;
            self.write(0x70, first)?;
            self.write(0x71, second)?;
        }
        Ok(())
    }

    fn read_motion(&mut self) -> Result<[u8; 12], MotionFault> {
        let mut burst = [0; 12];
        self.transfer(BURST, &mut burst)?;
        Ok(burst)
    }

    fn write_all(&mut self, writes: &[[u8; 2]]) -> Result<(), MotionFault> {
        for [register, value] in writes {
            self.write(*register, *value)?;
        }
        Ok(())
    }

    fn write(&mut self, register: u8, value: u8) -> Result<(), MotionFault> {
        let bytes = [register | WRITE, value];
        let mut operations = [Operation::Write(&bytes), Operation::DelayNs(AFTER_WRITE_NS)];
        self.transact(&mut operations)
    }

    fn read(&mut self, register: u8) -> Result<u8, MotionFault> {
        let mut value = [0];
        self.transfer(register, &mut value)?;
        let [value] = value;
        Ok(value)
    }

    fn transfer(&mut self, register: u8, values: &mut [u8]) -> Result<(), MotionFault> {
        let address = [register];
        let mut operations = [
            Operation::Write(&address),
            Operation::DelayNs(ADDRESS_TO_DATA_NS),
            Operation::Read(values),
            Operation::DelayNs(AFTER_READ_NS),
        ];
        self.transact(&mut operations)
    }

    fn transact(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), MotionFault> {
        let done = self.spi.transaction(operations);
        done.map_err(|_| MotionFault::Bus)
    }
}

/// Returns the value to write back for the part's two trim numbers.
const fn trimmed(first: u8, second: u8) -> (u8, u8) {
    // 14 is added up to 28, and then 11 to what is above 28
    let first = if first <= 28 { first + 14 } else { first };
    let first = if first > 28 {
        first.saturating_add(11)
    } else {
        first
    };
    let first = if first > 0x3F { 0x3F } else { first };
    // 255 * 45 / 100 is 114
    (first, (second as u16 * 45 / 100) as u8)
}

#[cfg(test)]
mod tests;
