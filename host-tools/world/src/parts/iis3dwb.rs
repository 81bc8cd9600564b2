//! ST's IIS3DWB: its registers as the public header iis3dwb_reg.h lists them, its bus and its signal chain as the data
//! sheet DS12569 and the application note AN5444 describe them; what I could not read there is marked "chosen".

use super::bus::{ClockMode, FLOATING};
use crate::conditions::{TICK_S, TICKS_PER_S};
use crate::maths::tan;
use crate::noise::Noise;

/// From power-up to the first register that can be read, ns (ST's examples wait 10 ms).
pub(crate) const BOOT_NS: u64 = 10_000_000;
/// Duration of a software reset, ns (AN5444: 50 us).
const RESET_NS: u64 = 50_000;
/// From power-on of the measurement to data, ns (chosen: 10 ms, AN5444 speaks of samples to discard).
const TURN_ON_NS: u64 = 8_000_000;

/// Samples in a second inside it (DS12569: 26.667 kHz).
const RATE_HZ: f64 = 26_667.0;
/// Noise of one axis, g/sqrt(Hz) (DS12569: 60 ug in single-axis mode, 75 in three-axis mode).
const NOISE: (f64, f64) = (60e-6, 75e-6);
/// An LSB at +-2 g, g (DS12569: 0.061 mg); other ranges are 2, 4 and 8 times as much.
const LSB_G: f64 = 0.061e-3;
/// Ranges by the code in CTRL1_XL, in units of the smallest (header: 0 is 2 g, 1 is 16, 2 is 4, 3 is 8).
const RANGES: [f64; 4] = [1.0, 8.0, 2.0, 4.0];
/// Corners of the second low-pass as parts of the rate, by the code in CTRL8_XL (header: LP_ODR_DIV_4 ...).
const CORNERS: [f64; 8] = [4.0, 10.0, 20.0, 45.0, 100.0, 200.0, 400.0, 800.0];
/// Without it, the corner, Hz (DS12569: flat to 6.3 kHz).
const WIDE_HZ: f64 = 6_300.0;

/// Bits of the registers that can be written (header; those it calls "not_used" stay 0).
const WRITABLE: [(u8, u8); 12] = [
    (0x02, 0x40),
    (0x07, 0xFF),
    (0x0D, 0x7D),
    (0x0E, 0x7D),
    (0x10, 0xEE),
    (0x12, 0xFD),
    (0x13, 0x2F),
    (0x14, 0x63),
    (0x15, 0x0B),
    (0x17, 0xFC),
    (0x18, 0x02),
    (0x19, 0x20),
];
const WHO_AM_I: (u8, u8) = (0x0F, 0x7B);
/// CTRL3_C after a reset: automatic increment (DS12569).
const CTRL3_RESET: u8 = 0x04;

/// The accelerometer, of which Z is what counts here.
#[derive(Clone, Debug)]
pub(crate) struct Iis3dwb {
    registers: [u8; 128],
    noise: Noise,
    clock: f64,
    /// Error of its scale, as a share, and its reading at 0, g: pieces differ (how far could not be read in DS12569).
    pub(super) scale: (f64, f64),
    powered_ns: u64,
    on_since_ns: Option<u64>,
    resets_until_ns: u64,
    /// The signal chain: a low-pass of second order and its corner, Hz; g at the last two ticks, and when the last one
    /// was.
    corner_hz: f64,
    low_pass: LowPass,
    chain: [f64; 2],
    tick_ns: u64,
    /// Latched value of OUTZ, LSB.
    out: i16,
    /// Of this select: bits come late, the address once it is known, and whether it is written.
    heard: bool,
    address: Option<(u8, bool)>,
    /// Writes to bits that must not change, and transfers of others that it takes for its own.
    pub(super) complaints: u64,
}

#[derive(Clone, Debug, Default)]
struct LowPass {
    b: f64,
    a: [f64; 2],
    z: [f64; 2],
}

impl LowPass {
    /// Butterworth (chosen).
    fn tune(&mut self, hz: f64) {
        let k = tan(std::f64::consts::PI * (hz / f64::from(TICKS_PER_S)).min(0.48));
        let norm = 1.0 / (1.0 + k * std::f64::consts::SQRT_2 + k * k);
        self.b = k * k * norm;
        self.a = [
            2.0 * (k * k - 1.0) * norm,
            (1.0 - k * std::f64::consts::SQRT_2 + k * k) * norm,
        ];
    }

    fn tick(&mut self, x: f64) -> f64 {
        let y = self.b * x + self.z[0];
        self.z[0] = 2.0 * self.b * x - self.a[0] * y + self.z[1];
        self.z[1] = self.b * x - self.a[1] * y;
        y
    }
}

impl Iis3dwb {
    /// One that gets its power at time 0.
    pub(super) fn new(seed: u64) -> Self {
        let mut part = Self {
            registers: [0; 128],
            noise: Noise::new(seed, 610),
            clock: 0.0,
            scale: (0.0, 0.0),
            powered_ns: 0,
            on_since_ns: None,
            resets_until_ns: 0,
            corner_hz: 0.0,
            low_pass: LowPass::default(),
            chain: [0.0; 2],
            tick_ns: 0,
            out: 0,
            heard: false,
            address: None,
            complaints: 0,
        };
        part.reset();
        part
    }

    fn reset(&mut self) {
        self.registers = [0; 128];
        self.registers[usize::from(WHO_AM_I.0)] = WHO_AM_I.1;
        self.registers[0x12] = CTRL3_RESET;
        self.on_since_ns = None;
        self.configure(0);
    }

    /// Its supply dips.
    pub(super) fn brown_out(&mut self, now_ns: u64) {
        self.reset();
        self.powered_ns = now_ns;
    }

    /// Its clock is off by this share.
    pub(super) fn set_clock(&mut self, share: f64) {
        self.clock = share;
        let corner = self.corner_hz;
        self.low_pass.tune(corner * (1.0 + share));
    }

    fn configure(&mut self, now_ns: u64) {
        let ctrl1 = self.registers[0x10];
        // header: xl_en is 5 or it is off
        let on = ctrl1 >> 5 == 5;
        self.on_since_ns = match self.on_since_ns {
            since if on => since.or(Some(now_ns)),
            _ => None,
        };
        let ctrl8 = self.registers[0x17];
        let second = ctrl1 & 2 != 0 && ctrl8 & 4 == 0;
        let corner_hz = if second {
            RATE_HZ / CORNERS[usize::from(ctrl8 >> 5)]
        } else {
            WIDE_HZ
        };
        if corner_hz != self.corner_hz {
            self.corner_hz = corner_hz;
            self.low_pass.tune(corner_hz * (1.0 + self.clock));
        }
    }

    /// A tick of the world, at whose end Z feels this, g.
    pub(super) fn tick(&mut self, now_ns: u64, g: f64) {
        let one_axis = self.registers[0x15] & 3 != 0;
        let density = if one_axis { NOISE.0 } else { NOISE.1 };
        // white up to half of the tick rate
        let noise = density * (f64::from(TICKS_PER_S) / 2.0).sqrt() * self.noise.white()[0];
        let (share, zero_g) = self.scale;
        let felt = g * (1.0 + share) + zero_g + noise;
        self.chain = [self.chain[1], self.low_pass.tick(felt)];
        self.tick_ns = now_ns;
    }

    /// Its output at a time, LSB; held from one of its own samples to the next.
    fn sample(&self, now_ns: u64) -> i16 {
        let rate = RATE_HZ * (1.0 + self.clock);
        let now_s = now_ns as f64 * 1e-9;
        let sampled_s = (now_s * rate).floor() / rate;
        let into = (sampled_s - self.tick_ns as f64 * 1e-9) / TICK_S + 1.0;
        let g = self.chain[0] + (self.chain[1] - self.chain[0]) * into.clamp(0.0, 1.0);
        let range = RANGES[usize::from(self.registers[0x10] >> 2 & 3)];
        (g / (LSB_G * range)).round().clamp(-32_768.0, 32_767.0) as i16
    }

    /// Chip select falls. SDI is taken as the clock rises, in modes 0 and 3 (chosen: DS12569 draws mode 3 only); in the
    /// others it changes just then, and the address is nonsense (chosen: nothing is answered, nothing written).
    pub(super) fn select(&mut self, now_ns: u64, mode: ClockMode) {
        self.heard = mode.on_rising()
            && now_ns >= self.powered_ns + BOOT_NS
            && now_ns >= self.resets_until_ns;
        self.address = None;
    }

    /// Chip select rises.
    pub(super) fn deselect(&mut self) {
        self.heard = false;
    }

    /// The bus begins a transfer with another part. Without a select of its own the part takes the lines for I2C
    /// (header: i2c_disable), where data that change as the clock rises are a START; complained of while it measures.
    pub(super) fn overhear(&mut self, mode: ClockMode) {
        let listens = self.registers[0x13] & 4 == 0 && self.on_since_ns.is_some();
        self.complaints += u64::from(listens && !mode.on_rising());
    }

    /// A byte: the address, or data.
    pub(super) fn byte(&mut self, now_ns: u64, mosi: u8) -> u8 {
        if !self.heard {
            return FLOATING;
        }
        let Some((address, reads)) = self.address else {
            self.address = Some((mosi & 0x7F, mosi & 0x80 != 0));
            return FLOATING;
        };
        // automatic increment (header: if_inc)
        let next = address + u8::from(self.registers[0x12] & 4 != 0);
        self.address = Some((next & 0x7F, reads));
        if reads {
            return self.read(now_ns, address);
        }
        self.write(now_ns, address, mosi);
        FLOATING
    }

    fn read(&mut self, now_ns: u64, address: u8) -> u8 {
        let has_data = self
            .on_since_ns
            .is_some_and(|since| now_ns >= since + TURN_ON_NS);
        match address {
            // STATUS_REG: data are there
            0x1E => u8::from(has_data),
            0x28 | 0x2A | 0x2C => {
                // its own axis alone is in all registers, else only Z is played
                if has_data && (address == 0x2C || self.registers[0x13] & 1 != 0) {
                    self.out = self.sample(now_ns);
                }
                self.out as u8
            }
            0x29 | 0x2B | 0x2D => (self.out >> 8) as u8,
            _ => self.registers[usize::from(address)],
        }
    }

    fn write(&mut self, now_ns: u64, address: u8, value: u8) {
        let writable = WRITABLE
            .iter()
            .find(|(at, _)| *at == address)
            .map_or(0, |(_, bits)| *bits);
        if value & !writable != 0 {
            self.complaints += 1;
        }
        if address == 0x12 && value & 1 != 0 {
            self.reset();
            self.resets_until_ns = now_ns + RESET_NS;
            return;
        }
        if writable != 0 {
            self.registers[usize::from(address)] = value & writable;
            self.configure(now_ns);
        }
    }
}
