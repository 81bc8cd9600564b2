//! The BioTac's protocol as the sensor plays it: what it answers at each chip select.
//!
//! Its words are made here, apart from the core's, which are what is tested with them. Facts of SPM and HDR by
//! shared/facts/biotac.md; what no document says is chosen and marked.

use super::finger::Finger;
use super::noise::Noise;

/// Shortest time from the end of a command to the read of its answer, ns (SPM 8.3.1.1).
pub const GAP_NS: u64 = 50_000;
/// Time from power-up to the first command that is understood, ns (LIB).
pub const POWER_UP_NS: u64 = 100_000_000;
/// Time without clock that ends the streaming mode, ns (facts/biotac.md: 5 s).
const STREAMING_NS: u64 = 5_000_000_000;

/// First byte of an error frame.
const ERROR: u8 = 0xA5;
/// Second bytes of error frames: too little delay and bad channel (SPM, HDR), the others HDR.
const TOO_EARLY: u8 = 0x2D;
const BAD_CHANNEL: u8 = 0x58;
const BAD_PARITY: u8 = 0x45;
const UNKNOWN_COMMAND: u8 = 0x3F;
const NOTHING_TO_SEND: u8 = 0x5F;

/// Command that reads a property.
const PROPERTY: u8 = 0x61;
/// Command that starts the streaming mode.
const STREAM: u8 = 0xA1;
/// MISO with nobody driving it.
const FLOATING: u8 = 0xFF;

/// Longest property, bytes: the serial number.
const PROPERTY_LEN: usize = 16;

/// Plausible values of the slow channels at rest, counts (chosen; the maker's quick start shows such).
const TAC_REST: f64 = 2030.0;
const TDC_REST: f64 = 1850.0;
const HALL: u16 = 2048;
const ELECTRODE_REST: (f64, f64) = (2600.0, 3300.0);
/// Noise of the electrodes and temperatures, counts rms (chosen).
const SLOW_NOISE: f64 = 1.0;
/// Electrodes change with the force on the finger, counts/N (chosen).
const ELECTRODE_PER_N: f64 = -150.0;

/// What the sensor has to say at the next select.
#[derive(Clone, Copy)]
enum Reply {
    Word([u8; 2]),
    Property([u8; PROPERTY_LEN]),
}

/// The sensor's end of the bus.
pub struct SensorPeer {
    noise: Noise,
    electrodes: [f64; 19],
    serial: [u8; PROPERTY_LEN],
    /// when power came; `None` while unplugged
    powered_ns: Option<u64>,
    pending: Option<Reply>,
    /// end of the last select
    ended_ns: u64,
    streaming: bool,
    flip: u16,
}

impl SensorPeer {
    /// A sensor that gets its power at time 0.
    pub fn new(seed: u64) -> Self {
        let mut noise = Noise::new(seed, 600);
        let electrodes = std::array::from_fn(|_| noise.between(ELECTRODE_REST.0, ELECTRODE_REST.1));
        let mut serial = *b"BT000000SIMULATE";
        for digit in &mut serial[2..8] {
            *digit = b'0' + (10.0 * noise.uniform()) as u8;
        }
        Self {
            noise,
            electrodes,
            serial,
            powered_ns: Some(0),
            pending: None,
            ended_ns: 0,
            streaming: false,
            flip: 0,
        }
    }

    /// Pulls the plug.
    pub fn unplug(&mut self) {
        self.powered_ns = None;
        self.pending = None;
        self.streaming = false;
    }

    /// Plugs it in again.
    pub fn plug(&mut self, now_ns: u64) {
        self.powered_ns.get_or_insert(now_ns);
    }

    /// Flips these bits of the next word, first byte high: a disturbed line.
    pub fn flip_bits(&mut self, bits: u16) {
        self.flip = bits;
    }

    /// One period of chip select, from `now_ns` on: what comes of `mosi`, and `miso` in answer. A sample is taken at the
    /// command, `fraction` of a tick after the last but one, and read at the next select.
    ///
    /// A command while an answer waits starts anew (chosen: a host that restarts between the two is then in step again).
    pub fn transfer(
        &mut self,
        now_ns: u64,
        duration_ns: u64,
        mosi: &[u8],
        miso: &mut [u8],
        finger: &mut Finger,
        fraction: f64,
    ) {
        miso.fill(FLOATING);
        let quiet_ns = now_ns.saturating_sub(self.ended_ns);
        self.ended_ns = now_ns + duration_ns;
        let on = self
            .powered_ns
            .is_some_and(|since| now_ns >= since + POWER_UP_NS);
        if !on || mosi.is_empty() {
            return;
        }
        if self.streaming {
            if quiet_ns < STREAMING_NS {
                return;
            }
            self.streaming = false;
        }
        if self.pending.is_some() && !is_command(mosi[0]) {
            let reply = self.pending.take().filter(|_| quiet_ns >= GAP_NS);
            self.answer(reply.unwrap_or(error(TOO_EARLY)), miso);
        } else if mosi[0] == 0 {
            // a read, and nothing to read
            self.answer(error(NOTHING_TO_SEND), miso);
        } else {
            self.pending = Some(self.obey(mosi, finger, fraction));
        }
    }

    /// Puts an answer on the line.
    fn answer(&mut self, reply: Reply, miso: &mut [u8]) {
        match &reply {
            Reply::Word(word) => {
                let flipped = (u16::from_be_bytes(*word) ^ self.flip).to_be_bytes();
                self.flip = 0;
                miso.iter_mut()
                    .zip(flipped)
                    .for_each(|(to, from)| *to = from);
            }
            Reply::Property(text) => miso.iter_mut().zip(text).for_each(|(to, from)| *to = *from),
        }
    }

    /// Takes a command and prepares its answer.
    fn obey(&mut self, mosi: &[u8], finger: &mut Finger, fraction: f64) -> Reply {
        let command = mosi[0];
        if command.count_ones().is_multiple_of(2) {
            return error(BAD_PARITY);
        }
        match command {
            STREAM => {
                self.streaming = true;
                error(UNKNOWN_COMMAND)
            }
            PROPERTY => self.property(mosi.get(1).copied().unwrap_or(0)),
            0x80..=0xFF => self.sample(command >> 1 & 0x3F, finger, fraction),
            _ => error(UNKNOWN_COMMAND),
        }
    }

    /// Samples a channel (SPM table 7).
    fn sample(&mut self, channel: u8, finger: &mut Finger, fraction: f64) -> Reply {
        let value = match channel {
            0 => finger.sample_pac(fraction),
            1 => finger.sample_pdc(fraction),
            2 => self.slow(TAC_REST),
            3 => self.slow(TDC_REST),
            15 => HALL,
            17..=35 => {
                let rest = self.electrodes[usize::from(channel - 17)];
                self.slow(rest + ELECTRODE_PER_N * finger.force_n())
            }
            _ => return error(BAD_CHANNEL),
        };
        Reply::Word(word(value))
    }

    fn slow(&mut self, value: f64) -> u16 {
        (value + SLOW_NOISE * self.noise.normal())
            .round()
            .clamp(0.0, 4095.0) as u16
    }

    /// A property by its code (HDR): flex version, firmware, serial number, CPU clock in kHz, sampling rate.
    fn property(&self, code: u8) -> Reply {
        let mut text = [0; PROPERTY_LEN];
        match code {
            0x10 => text[..2].copy_from_slice(b"01"),
            0x13 => text[..4].copy_from_slice(b"0203"),
            0x15 => text = self.serial,
            0x61 => text[..2].copy_from_slice(&14_745_u16.to_be_bytes()),
            0x70 => text[..2].copy_from_slice(&4_400_u16.to_be_bytes()),
            _ => return error(UNKNOWN_COMMAND),
        }
        Reply::Property(text)
    }
}

/// Whether a first byte starts something: a command of right parity that samples or reads a property.
fn is_command(byte: u8) -> bool {
    (byte >= 0x80 || byte == PROPERTY) && !byte.count_ones().is_multiple_of(2)
}

fn error(code: u8) -> Reply {
    Reply::Word([ERROR, code])
}

/// The two bytes of a value: its upper seven bits and odd parity, its lower five bits, two zeros and odd parity.
fn word(value: u16) -> [u8; 2] {
    let odd = |bits: u8| bits | u8::from(bits.count_ones().is_multiple_of(2));
    [odd((value >> 5) as u8 * 2), odd((value & 0x1F) as u8 * 8)]
}
