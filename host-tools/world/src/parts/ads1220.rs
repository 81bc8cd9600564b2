//! TI's ADS1220 by its data sheet SBAS501: commands and registers of 8.5 and 8.6, timing of 6.6, conversion modes of
//! 8.4.2. What I could not read there is marked "chosen".

use super::bus::{ClockMode, FLOATING, Late};
use crate::noise::Noise;

/// From power-up to the first command, ns (8.4.1: 50 us).
pub(crate) const POWER_UP_NS: u64 = 50_000;
/// A period of its clock, ns (4.096 MHz).
const CLOCK_NS: f64 = 1e9 / 4.096e6;
/// Conversions in a second by the code in CONFIG1, normal mode; twice as many in turbo mode (8.6).
const RATES_HZ: [f64; 8] = [20.0, 45.0, 90.0, 175.0, 330.0, 600.0, 1000.0, 1000.0];
/// Its clock is off by no more (6.5).
pub(crate) const CLOCK_SHARE: f64 = 0.02;
/// Noise at gain 128 and 1000 conversions a second, V rms (7.1 has some 0.9 uV; the root of the rate below: chosen).
const NOISE_V: f64 = 0.9e-6;
/// Supply and, with VREF = 3, reference, V.
const SUPPLY_V: f64 = 3.3;
/// Its own reference, V.
const INTERNAL_V: f64 = 2.048;
const FULL: f64 = 8_388_607.0;

#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
enum Says {
    #[default]
    Command,
    Data(u8),
    Read {
        register: u8,
        left: u8,
    },
    Write {
        register: u8,
        left: u8,
    },
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Ads1220 {
    registers: [u8; 4],
    noise: Noise,
    pub(super) clock: f64,
    ready_ns: u64,
    /// a signal wire is broken: the input drifts to an end of the range (chosen: the bias current of the amplifier)
    pub(super) wire_cut: bool,
    /// A conversion under way: its begin and end; its sum so far, and the time of that.
    converts: Option<(u64, u64)>,
    sum: (f64, f64),
    tick_ns: u64,
    /// The last whole one.
    code: i32,
    ratio: f64,
    /// Of this select.
    heard: bool,
    wrong_phase: Option<Late>,
    says: Says,
    shown: [u8; 3],
    /// commands that do not exist, and reserved bits that were written, so far
    pub(super) complaints: u64,
}

impl Ads1220 {
    /// One that gets its power at time 0, its clock within what the data sheet promises.
    pub(super) fn new(seed: u64) -> Self {
        let mut noise = Noise::new(seed, 611);
        let clock = noise.between(-CLOCK_SHARE, CLOCK_SHARE);
        Self {
            noise,
            clock,
            ready_ns: POWER_UP_NS,
            ..Self::default()
        }
    }

    /// Its supply dips: all registers are 0, and it waits for a command (8.4.1).
    pub(super) fn brown_out(&mut self, now_ns: u64) {
        self.registers = [0; 4];
        self.converts = None;
        self.code = 0;
        self.ready_ns = now_ns + POWER_UP_NS;
    }

    fn is_continuous(&self) -> bool {
        self.registers[1] & 0x04 != 0
    }

    fn begin(&mut self, now_ns: u64, delay_clocks: f64) {
        let code = usize::from(self.registers[1] >> 5);
        let turbo = self.registers[1] >> 3 & 3 == 2;
        let rate = RATES_HZ[code] * if turbo { 2.0 } else { 1.0 } * (1.0 + self.clock);
        let begins = now_ns + (delay_clocks * CLOCK_NS) as u64;
        self.converts = Some((begins, begins + (1e9 / rate) as u64));
        self.sum = (0.0, 0.0);
    }

    /// A tick of the world, at whose end the cell's output is this share of its supply.
    pub(super) fn tick(&mut self, now_ns: u64, ratio: f64) {
        self.ratio = ratio;
        let seconds = now_ns.saturating_sub(self.tick_ns) as f64 * 1e-9;
        self.tick_ns = now_ns;
        self.sum.0 += ratio * seconds;
        self.sum.1 += seconds;
        while let Some((_, ends)) = self.converts
            && ends <= now_ns
        {
            let mean = if self.sum.1 > 0.0 {
                self.sum.0 / self.sum.1
            } else {
                ratio
            };
            self.code = self.convert(mean);
            if self.is_continuous() {
                self.begin(ends, 0.0);
            } else {
                self.converts = None;
            }
        }
    }

    /// A conversion of a share of the supply.
    fn convert(&mut self, ratio: f64) -> i32 {
        let gain = f64::from(1 << (self.registers[0] >> 1 & 7));
        let reference = match self.registers[2] >> 6 {
            3 => SUPPLY_V,
            0 => INTERNAL_V,
            // nothing is wired to REFP and REFN: it reads full scale (chosen)
            _ => return FULL as i32,
        };
        // AIN0 - AIN1 is where the cell is; of the others nothing is known here
        if self.registers[0] >> 4 != 0 {
            return 0;
        }
        if self.wire_cut {
            return FULL as i32;
        }
        let volts = ratio * SUPPLY_V + NOISE_V * self.noise.normal();
        (volts * gain / reference * (FULL + 1.0))
            .round()
            .clamp(-FULL - 1.0, FULL) as i32
    }

    /// Chip select falls: a new command (8.5.1.1). Only mode 1 works: DIN is taken as the clock falls (8.5.1); in modes
    /// 0 and 3 it is taken half a clock late, so that both lines come a bit late (chosen); in mode 2, as in mode 1.
    pub(super) fn select(&mut self, now_ns: u64, mode: ClockMode) {
        self.heard = now_ns >= self.ready_ns;
        self.wrong_phase = mode.on_rising().then(Late::default);
        self.says = Says::Command;
    }

    /// Chip select rises: the interface is reset.
    pub(super) fn deselect(&mut self) {
        self.heard = false;
    }

    pub(super) fn byte(&mut self, now_ns: u64, mosi: u8) -> u8 {
        if !self.heard {
            return FLOATING;
        }
        match self.wrong_phase {
            None => self.exchange(now_ns, mosi),
            Some(mut late) => {
                let heard = late.hear(mosi);
                let said = self.exchange(now_ns, heard);
                let miso = late.say(said);
                self.wrong_phase = Some(late);
                miso
            }
        }
    }

    fn exchange(&mut self, now_ns: u64, mosi: u8) -> u8 {
        match self.says {
            Says::Command => {
                self.command(now_ns, mosi);
                FLOATING
            }
            Says::Data(at) => {
                self.says = Says::Data(at + 1);
                self.shown.get(usize::from(at)).copied().unwrap_or(0)
            }
            Says::Read { register, left } => {
                self.says = next(left, |left| Says::Read {
                    register: (register + 1) & 3,
                    left,
                });
                self.registers[usize::from(register)]
            }
            Says::Write { register, left } => {
                self.says = next(left, |left| Says::Write {
                    register: (register + 1) & 3,
                    left,
                });
                // bit 0 of CONFIG3 is reserved (8.6)
                let reserved = if register == 3 { 1 } else { 0 };
                self.complaints += u64::from(mosi & reserved != 0);
                self.registers[usize::from(register)] = mosi & !reserved;
                // a conversion under way is begun anew (8.4.2.2)
                if self.converts.is_some() {
                    self.begin(now_ns, 0.0);
                }
                FLOATING
            }
        }
    }

    fn command(&mut self, now_ns: u64, command: u8) {
        match command {
            0x06 | 0x07 => {
                self.brown_out(now_ns);
                // 8.5.3.1: 50 us and 32 clocks until the next command
                self.ready_ns = now_ns + 50_000 + (32.0 * CLOCK_NS) as u64;
                self.heard = false;
            }
            // 8.4.2.2: the first conversion begins 210 clocks later
            0x08 | 0x09 => self.begin(now_ns, 210.0),
            0x02 | 0x03 => self.converts = None,
            0x10..=0x1F => {
                let [_, upper, middle, lower] = self.code.to_be_bytes();
                self.shown = [upper, middle, lower];
                self.says = Says::Data(0);
            }
            0x20..=0x2F => {
                self.says = Says::Read {
                    register: command >> 2 & 3,
                    left: command & 3,
                };
            }
            0x40..=0x4F => {
                self.says = Says::Write {
                    register: command >> 2 & 3,
                    left: command & 3,
                };
            }
            // no operation
            0x00 | 0xFF => {}
            _ => self.complaints += 1,
        }
    }
}

/// After a register: the next one, or a command.
fn next(left: u8, says: impl FnOnce(u8) -> Says) -> Says {
    left.checked_sub(1).map_or(Says::Command, says)
}
