//! The sensor's side of the BioTac's protocol: its answer at each chip select.
//!
//! Its words are made here, independently of the core's, which are tested with them. [`sim`](super) names the
//! documents; values that none of them gives are chosen and marked.

use std::collections::BTreeMap;

use super::finger::Finger;
use super::noise::Noise;

/// Shortest time from the end of a command to the read of its answer, ns (SPM 8.3.1.1).
pub(crate) const GAP_NS: u64 = 50_000;
/// Time from power-up to the first command that is understood, ns (LIB).
pub(crate) const POWER_UP_NS: u64 = 100_000_000;
/// Time without clock that ends the streaming mode, ns (SPM: 5 s).
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
/// MISO while no part drives it.
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

/// The sensor's answer at the next select.
#[derive(Clone, Copy)]
enum Reply {
    Word([u8; 2]),
    Property([u8; PROPERTY_LEN]),
}

/// The sensor's end of the bus.
#[derive(Default)]
pub struct SensorPeer {
    noise: Noise,
    electrodes: [f64; 19],
    serial: [u8; PROPERTY_LEN],
    /// when power came; `None` while unplugged
    pub(super) powered_ns: Option<u64>,
    pending: Option<Reply>,
    ended_ns: u64,
    streaming: bool,
    /// of this select: whether the sensor heard it, after how long, the bytes so far, the answer
    on: bool,
    quiet_ns: u64,
    bytes: usize,
    line: [u8; PROPERTY_LEN],
    asked_property: bool,
    complaints: BTreeMap<u8, u64>,
}

impl SensorPeer {
    /// A sensor that gets its power at time 0.
    pub(super) fn new(seed: u64) -> Self {
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
            line: [FLOATING; PROPERTY_LEN],
            ..Self::default()
        }
    }

    /// The error frames that it has answered with so far: their second bytes, and how often.
    pub fn complaints(&self) -> &BTreeMap<u8, u64> {
        &self.complaints
    }

    /// Returns true if it is in its streaming mode, and answers nothing.
    pub fn is_streaming(&self) -> bool {
        self.streaming
    }

    /// Pulls the plug.
    pub(super) fn unplug(&mut self) {
        self.powered_ns = None;
        self.pending = None;
        self.streaming = false;
        self.on = false;
        self.asked_property = false;
        self.line = [FLOATING; PROPERTY_LEN];
    }

    /// Plugs it in again.
    pub(super) fn plug(&mut self, now_ns: u64) {
        self.powered_ns.get_or_insert(now_ns);
    }

    /// Chip select falls. A sample is taken at the command, and read at the next select.
    ///
    /// A command while an answer waits starts anew (chosen: a host that restarts between the two is then in step
    /// again).
    pub(super) fn select(&mut self, now_ns: u64) {
        self.quiet_ns = now_ns.saturating_sub(self.ended_ns);
        self.on = self
            .powered_ns
            .is_some_and(|since| now_ns >= since + POWER_UP_NS);
        self.bytes = 0;
        self.line = [FLOATING; PROPERTY_LEN];
    }

    /// Takes a byte. The first one sets the answer: [`SensorPeer::line`]. The sample of a command is taken `fraction`
    /// of a tick after the last but one.
    pub(super) fn byte(&mut self, mosi: u8, finger: &mut Finger, fraction: f64) {
        self.bytes += 1;
        match self.bytes {
            1 => self.first(mosi, finger, fraction),
            2 if self.asked_property => self.obey_property(mosi),
            _ => {}
        }
    }

    /// The sensor's bytes in this period of chip select; later ones float.
    pub(super) fn line(&mut self) -> &mut [u8; PROPERTY_LEN] {
        &mut self.line
    }

    /// Chip select rises.
    pub(super) fn deselect(&mut self, now_ns: u64) {
        if self.asked_property {
            self.obey_property(0);
        }
        self.ended_ns = now_ns;
    }

    /// One period of chip select as a whole, for tests, from `now_ns` on: sends `mosi`, and fills `miso` with the
    /// answer.
    #[cfg(test)]
    pub(super) fn transfer(
        &mut self,
        now_ns: u64,
        duration_ns: u64,
        mosi: &[u8],
        miso: &mut [u8],
        finger: &mut Finger,
        fraction: f64,
    ) {
        self.select(now_ns);
        for byte in mosi {
            self.byte(*byte, finger, fraction);
        }
        miso.fill(FLOATING);
        miso.iter_mut()
            .zip(self.line)
            .for_each(|(to, from)| *to = from);
        self.deselect(now_ns + duration_ns);
    }

    fn first(&mut self, mosi: u8, finger: &mut Finger, fraction: f64) {
        if !self.on {
            return;
        }
        if self.streaming {
            if self.quiet_ns < STREAMING_NS {
                return;
            }
            self.streaming = false;
        }
        if self.pending.is_some() && !is_command(mosi) {
            let reply = self.pending.take().filter(|_| self.quiet_ns >= GAP_NS);
            self.answer(reply.unwrap_or(error(TOO_EARLY)));
        } else if mosi == 0 {
            // a read, and nothing to read
            self.answer(error(NOTHING_TO_SEND));
        } else if mosi == PROPERTY {
            self.asked_property = true;
        } else {
            self.pending = Some(self.obey(mosi, finger, fraction));
        }
    }

    fn obey_property(&mut self, code: u8) {
        self.asked_property = false;
        self.pending = Some(self.property(code));
    }

    /// Puts an answer on the line.
    fn answer(&mut self, reply: Reply) {
        match &reply {
            Reply::Word(word) => {
                if let [ERROR, why] = *word {
                    *self.complaints.entry(why).or_default() += 1;
                }
                self.line[..2].copy_from_slice(word);
            }
            Reply::Property(text) => self.line = *text,
        }
    }

    /// Takes a command that is one byte and prepares its answer.
    fn obey(&mut self, command: u8, finger: &mut Finger, fraction: f64) -> Reply {
        if command.count_ones().is_multiple_of(2) {
            return error(BAD_PARITY);
        }
        match command {
            STREAM => {
                self.streaming = true;
                error(UNKNOWN_COMMAND)
            }
            0x80..=0xFF => self.sample(command >> 1 & 0x3F, finger, fraction),
            _ => error(UNKNOWN_COMMAND),
        }
    }

    /// Samples a channel (SPM table 7).
    fn sample(&mut self, channel: u8, finger: &mut Finger, fraction: f64) -> Reply {
        let value = match channel {
            0 => finger.sample_channel(0, fraction),
            1 => finger.sample_channel(1, fraction),
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

/// Returns true if a first byte starts something: a command of right parity that samples or reads a property.
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
