//! The optical sensor of motion in the simulated world: a PAA5100JE as its data sheet and its users describe it, byte
//! by byte on the bus. It knows nothing of the driver.
//!
//! It counts the surface that passes under it, 228 counts per mm and mm of height, frame by frame, 242 a second. Too
//! near, too far, in the air, and over a surface without features it sees nothing. An access that comes too soon after
//! the one before is lost. After long stillness it stops until it is reset (users report it; the time is chosen).
//!
//! Four points are not confirmed by a document that I could read: registers of the maker's list read back as written,
//! its error from frame to frame, its report of the surface while it sees it, and its speed limit.

use std::collections::BTreeMap;

use super::maths::exp;
use super::noise::Noise;

/// Stream of the seed that it draws from.
const STREAM: u64 = 0xf10;
/// Height of the part over what the finger touches, mm: that of Pimoroni's board for its lens.
pub const HEIGHT_MM: f64 = 25.0;
/// Counts per mm, times the height in mm.
const SCALE: f64 = 228.0;
/// Range of height in which it sees, mm.
const SEES_MM: std::ops::RangeInclusive<f64> = 15.0..=35.0;
/// Time of a frame, ns.
const FRAME_NS: u64 = 1_000_000_000 / 242;
/// Counts of a frame are off by this share: rms (chosen; 0.4 % is the error of a whole way).
const FRAME_NOISE: f64 = 0.03;
/// Of one movement the scale is off by this: rms (data sheet: repeat error 0.4 % up to 254 mm/s).
const REPEAT: f64 = 0.004;
/// Beyond this it loses counts, mm/s at 25 mm: it compares frames (chosen: twice the speed of the data sheet).
const FASTEST_MM_S: f64 = 500.0;
/// Shortest pauses, ns: after a write to the next write, to the next read; after a read; from the address to the data.
const AFTER_WRITE_NS: (u64, u64) = (10_500, 6_000);
const AFTER_READ_NS: u64 = 1_500;
const TO_DATA_NS: u64 = 2_000;
/// Shortest time of a byte, ns: 2 MHz.
pub(crate) const BYTE_NS: u64 = 4_000;
/// From a reset until it answers (chosen: drivers wait 0 to 20 ms).
const RESET_NS: u64 = 15_000_000;
/// Stillness after which it stops, ns (chosen).
const STOPS_NS: u64 = 600_000_000_000;
const FLOATING: u8 = 0xFF;

/// The surface under it.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub enum Ground {
    /// A surface with features, so many mm below.
    Seen(f64),
    /// A mirror or clear glass.
    #[default]
    Glass,
}

/// The part.
#[derive(Clone, Debug, Default)]
pub struct Flow {
    noise: Noise,
    registers: BTreeMap<(u8, u8), u8>,
    bank: u8,
    ground: Ground,
    unplugged: bool,
    /// what is written does not read back
    write_only: bool,
    /// ln of by how much the scale of this movement is off
    repeat: f64,
    /// counts that were not read, and the time and place up to which they are
    counts: f64,
    frame_ns: u64,
    frame_x_mm: f64,
    at_ns: u64,
    x_mm: f64,
    moved_ns: u64,
    ready_ns: u64,
    /// the bus: bytes of the access so far, its address, when the last byte was over
    access: Vec<u8>,
    latched: [u8; 12],
    spoiled: bool,
    last_ns: u64,
    last_wrote: Option<bool>,
    refused: u32,
}

impl Flow {
    /// One that has just got its power.
    pub fn new(seed: u64, ground: Ground) -> Self {
        let mut noise = Noise::new(seed, STREAM);
        let repeat = REPEAT * noise.normal();
        Self {
            noise,
            ground,
            repeat,
            ..Self::default()
        }
    }

    /// Puts something else under it: another movement.
    pub fn over(&mut self, ground: Ground) {
        self.ground = ground;
        self.repeat = REPEAT * self.noise.normal();
    }

    /// Its connector is pulled, or plugged in again: then it has just got its power.
    pub fn unplug(&mut self, unplugged: bool) {
        if unplugged {
            self.restart();
        }
        self.unplugged = unplugged;
    }

    /// From now on what was written to it does not read back: no public driver shows that it does.
    pub fn write_only(&mut self) {
        self.write_only = true;
    }

    /// Accesses that broke its timing.
    pub fn refused(&self) -> u32 {
        self.refused
    }

    /// Returns true if it was set up after the last reset: its lamp is on, and the last write of the maker's list was
    /// made.
    pub fn is_set_up(&self) -> bool {
        let is = |bank, register, value| self.registers.get(&(bank, register)) == Some(&value);
        is(0x14, 0x6F, 0x1C) && is(0x00, 0x73, 0x00) && is(0x00, 0x5A, 0x90)
    }

    /// The world's time has come here, and the place of the probe: it went there at one speed.
    pub fn moves(&mut self, now_ns: u64, x_mm: f64) {
        let speed = match now_ns.saturating_sub(self.at_ns) {
            0 => 0.0,
            ns => (x_mm - self.x_mm) / ns as f64,
        };
        while self.frame_ns + FRAME_NS <= now_ns {
            self.frame_ns += FRAME_NS;
            let since_ns = self.frame_ns.saturating_sub(self.at_ns) as f64;
            let place_mm = self.x_mm + speed * since_ns;
            let way_mm = place_mm - self.frame_x_mm;
            self.frame_x_mm = place_mm;
            if way_mm != 0.0 {
                self.moved_ns = self.frame_ns;
            }
            let too_fast = way_mm.abs() > FASTEST_MM_S * FRAME_NS as f64 * 1e-9;
            if let (Some(height_mm), false) = (self.height_mm(), too_fast) {
                let noise = 1.0 + FRAME_NOISE * self.noise.normal();
                self.counts += SCALE / height_mm * way_mm * exp(self.repeat) * noise;
            }
        }
        (self.at_ns, self.x_mm) = (now_ns, x_mm);
    }

    /// Height over the surface; `None` if it sees none.
    fn height_mm(&self) -> Option<f64> {
        let stopped = self.frame_ns.saturating_sub(self.moved_ns) > STOPS_NS;
        match self.ground {
            Ground::Seen(mm) if SEES_MM.contains(&mm) && self.is_set_up() && !stopped => Some(mm),
            _ => None,
        }
    }

    /// Chip select has fallen.
    pub fn select(&mut self) {
        self.access.clear();
        self.spoiled = false;
    }

    /// A byte goes over the bus in mode 3, from and until then; returns its answer.
    pub fn byte(&mut self, begins_ns: u64, ends_ns: u64, mosi: u8) -> u8 {
        if self.unplugged {
            return FLOATING;
        }
        let since = begins_ns.saturating_sub(self.last_ns);
        let soon = match self.access.first() {
            None => {
                let write = mosi & 0x80 != 0;
                let pause = match self.last_wrote {
                    Some(true) if write => AFTER_WRITE_NS.0,
                    Some(true) => AFTER_WRITE_NS.1,
                    Some(false) => AFTER_READ_NS,
                    None => 0,
                };
                self.last_wrote = Some(write);
                since < pause || begins_ns < self.ready_ns
            }
            Some(address) => address & 0x80 == 0 && self.access.len() == 1 && since < TO_DATA_NS,
        };
        let soon = soon || ends_ns - begins_ns < BYTE_NS;
        if soon && !self.spoiled {
            self.spoiled = true;
            self.refused += 1;
        }
        self.last_ns = ends_ns;
        let at = self.access.len();
        let answer = match self.access.first() {
            _ if self.spoiled => FLOATING,
            Some(0x16) => {
                if at == 1 {
                    self.latched = self.latch();
                }
                self.latched.get(at - 1).copied().unwrap_or(0)
            }
            Some(&address) if address & 0x80 == 0 => self.read(address),
            _ => 0,
        };
        self.access.push(mosi);
        answer
    }

    /// Chip select has risen.
    pub fn deselect(&mut self) {
        if let (&[address, value], false) = (&self.access[..], self.spoiled)
            && address & 0x80 != 0
        {
            self.write(address & 0x7F, value);
        }
    }

    fn restart(&mut self) {
        self.registers.clear();
        self.bank = 0;
        self.counts = 0.0;
        self.moved_ns = self.frame_ns;
    }

    fn write(&mut self, register: u8, value: u8) {
        match (register, value) {
            (0x3A, 0x5A) => {
                self.restart();
                self.ready_ns = self.last_ns + RESET_NS;
            }
            (0x7F, bank) => self.bank = bank,
            // what lies below is the same in all banks, and the identity cannot be written
            (0x00..=0x3F, value) if register > 0x01 => {
                self.registers.insert((0, register), value);
            }
            (0x00 | 0x01 | 0x5F, _) if self.bank == 0 => {}
            (register, value) => {
                self.registers.insert((self.bank, register), value);
            }
        }
    }

    fn read(&self, register: u8) -> u8 {
        let bank = if register < 0x40 { 0 } else { self.bank };
        match (bank, register) {
            (0, 0x00) => 0x49,
            (0, 0x5F) => 0xB6,
            _ if self.write_only => 0,
            _ => self.registers.get(&(bank, register)).copied().unwrap_or(0),
        }
    }

    /// The bytes of a burst; it resets the counts.
    fn latch(&mut self) -> [u8; 12] {
        let sees = self.height_mm().is_some();
        let counts = self.counts.trunc();
        self.counts -= counts;
        let counts = counts.clamp(i16::MIN.into(), i16::MAX.into()) as i16;
        let [x0, x1] = counts.to_le_bytes();
        let motion = if counts != 0 { 0x80 } else { 0 };
        let quality = if sees { 0x38 } else { 0x0A };
        let shutter = if sees { 0x04 } else { 0x1F };
        [
            motion, 0, x0, x1, 0, 0, quality, 0x50, 0x70, 0x20, shutter, 0x80,
        ]
    }
}
