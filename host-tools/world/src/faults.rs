//! Faults of the rig, and their effect on the words on the way from the sensor.

use super::encoder::Cut;
use super::maths::pow;
use super::noise::Noise;
use super::stage::{ADC_REFERENCE_V, ADC_V_PER_A};

/// Stream of the trial's seed that faults draw from.
const STREAM: u64 = 0xfa01;

/// Something that breaks. Each shows only at the pins, as it would on a bench.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Fault {
    /// The sensor's plug is out: MISO's pull-up reads as FF.
    SensorUnplugged,
    /// This share of the words has one bit flipped, any of the 16.
    BitFlips {
        /// 0 to 1.
        share: f64,
    },
    /// This share of the words is noise: all 16 bits by chance, so that every fourth one has good parity.
    WordNoise {
        /// 0 to 1.
        share: f64,
    },
    /// MISO is shorted to a level.
    MisoStuck {
        /// Its level.
        high: bool,
    },
    /// The sensor's converter hangs: the last word of each channel comes again and again, with good parity.
    SensorFrozen,
    /// The static pressure drifts, as with the temperature of the fluid. The finger itself feels nothing.
    PdcDrift {
        /// Counts of P_DC per second, of either sign.
        counts_per_s: f64,
    },
    /// The converter of the static pressure sticks: P_DC stays the same from now on, while P_AC lives.
    PdcStuck,
    /// The amplifier of the static pressure loses its gain: P_DC returns to its value at rest, while P_AC lives.
    PdcFades {
        /// Time in which the gain falls to 1/e, s; 0: it is gone at once.
        seconds: f64,
    },
    /// The amplifier of the static pressure has this gain of a sound one's: P_DC reads too low, while P_AC lives.
    PdcWeak {
        /// 0 to 1.
        gain: f64,
    },
    /// The skin is torn: the fluid runs out while it is pressed, and its pressure goes with it, for both signals.
    SkinLeaks {
        /// Time in which the pressure of a still finger falls to 1/e, s.
        seconds: f64,
    },
    /// The stage is held by something; its motor can still push.
    StageJammed,
    /// The stage's bridge is off, even when it is enabled.
    BridgeOff,
    /// The stage's bridge is off while its PWM is low, and lets the motor coast.
    FastDecay,
    /// The stage vibrates while it moves, and the sample with it.
    StageVibrates {
        /// Amplitude at 100 mm/s, um.
        um: f64,
    },
    /// A wire of the encoder is cut.
    EncoderCut(Cut),
    /// The wires of the encoder are exchanged: it counts backwards.
    EncoderSwapped,
    /// The amplifier of the motor current reads this much too high.
    CurrentOffset {
        /// A, of either sign.
        amperes: f64,
    },
    /// The amplifier of the motor current is at its end.
    CurrentSaturated,
    /// The supply of both motors is gone for so long.
    SupplyDip {
        /// Duration, ms.
        ms: u64,
    },
    /// A limit switch of the stage sticks.
    StageLimitStuck {
        /// The upper or the lower one.
        upper: bool,
        /// Closed or open.
        closed: bool,
    },
    /// The lever's limit switch sticks.
    LeverTopStuck {
        /// Closed or open.
        closed: bool,
    },
    /// The limit switches' contacts bounce: each goes to and fro for so long whenever it opens or closes.
    SwitchesBounce {
        /// Duration, ms.
        ms: u64,
    },
    /// The lever misses this share of its steps.
    LeverLosesSteps {
        /// 0 to 1.
        share: f64,
    },
    /// The lever's driver steps down on its own with 800 steps/s, until its enable is taken away or STEP has commanded
    /// more steps up than it made by itself.
    LeverRunaway,
    /// The wire of the lever's DIR comes in inverted: up is down.
    LeverDirInverted,
    /// A person presses the emergency stop. The firmware sees one contact, which bounces; the other one takes the
    /// supply of both motors.
    EStop,
    /// A disturbance on the wire of the stop's first contact.
    EStopGlitch {
        /// Duration for which it reads as pressed, us.
        us: u64,
    },
}

impl Fault {
    /// One of each kind, for campaigns.
    pub const EXAMPLES: [Self; 34] = [
        Self::SensorUnplugged,
        Self::BitFlips { share: 0.05 },
        Self::WordNoise { share: 0.005 },
        Self::MisoStuck { high: false },
        Self::MisoStuck { high: true },
        Self::SensorFrozen,
        Self::PdcDrift {
            counts_per_s: -20.0,
        },
        Self::PdcStuck,
        Self::PdcFades { seconds: 0.0 },
        Self::PdcWeak { gain: 0.5 },
        Self::SkinLeaks { seconds: 0.3 },
        Self::StageJammed,
        Self::EncoderSwapped,
        Self::CurrentOffset { amperes: 0.1 },
        Self::CurrentSaturated,
        Self::SupplyDip { ms: 200 },
        Self::BridgeOff,
        Self::FastDecay,
        Self::StageVibrates { um: 0.5 },
        Self::EncoderCut(Cut::A),
        Self::EncoderCut(Cut::B),
        Self::EncoderCut(Cut::Both),
        Self::StageLimitStuck {
            upper: false,
            closed: true,
        },
        Self::StageLimitStuck {
            upper: false,
            closed: false,
        },
        Self::StageLimitStuck {
            upper: true,
            closed: true,
        },
        Self::StageLimitStuck {
            upper: true,
            closed: false,
        },
        Self::LeverTopStuck { closed: true },
        Self::LeverTopStuck { closed: false },
        Self::SwitchesBounce { ms: 5 },
        Self::LeverLosesSteps { share: 0.1 },
        Self::LeverRunaway,
        Self::LeverDirInverted,
        Self::EStop,
        Self::EStopGlitch { us: 1_000 },
    ];

    /// The same kind of fault to another degree, `share` of the way from the smallest to the largest that is to be
    /// expected; itself where there is but one.
    #[must_use]
    pub fn varied(self, share: f64) -> Self {
        let between = |low: f64, high: f64| low * pow(high / low, share);
        match self {
            Self::BitFlips { .. } => Self::BitFlips {
                share: between(1e-4, 0.3),
            },
            Self::WordNoise { .. } => Self::WordNoise {
                share: between(1e-4, 0.3),
            },
            Self::SwitchesBounce { .. } => Self::SwitchesBounce {
                ms: between(1.0, 50.0) as u64,
            },
            Self::PdcDrift { .. } => Self::PdcDrift {
                counts_per_s: if share < 0.5 { -1.0 } else { 1.0 } * between(1.0, 50.0),
            },
            Self::PdcFades { .. } => Self::PdcFades {
                seconds: between(0.05, 5.0),
            },
            Self::PdcWeak { .. } => Self::PdcWeak { gain: 0.9 * share },
            Self::SkinLeaks { .. } => Self::SkinLeaks {
                seconds: between(0.1, 20.0),
            },
            Self::CurrentOffset { .. } => Self::CurrentOffset {
                amperes: 2.0 * share - 1.0,
            },
            Self::SupplyDip { .. } => Self::SupplyDip {
                ms: between(1.0, 1_000.0) as u64,
            },
            Self::LeverLosesSteps { .. } => Self::LeverLosesSteps {
                share: between(0.01, 1.0),
            },
            Self::EStopGlitch { .. } => Self::EStopGlitch {
                us: between(10.0, 20_000.0) as u64,
            },
            other => other,
        }
    }
}

/// The present faults, without those of the finger, the lever, the stage and the encoder.
#[derive(Clone, Debug, Default)]
pub(super) struct Faults {
    pub(super) e_stop: Stop,
    pub(super) switches: Switches,
    pub(super) bridge_off: bool,
    pub(super) flip_share: f64,
    pub(super) noise_share: f64,
    pub(super) miso_stuck: Option<bool>,
    pub(super) frozen: bool,
    pub(super) pdc_stuck: bool,
    /// A, or the amplifier's end
    pub(super) current: Option<f64>,
    /// until when the motors have no supply
    pub(super) dip_ends_ns: u64,
    /// counts per second, and since when
    pub(super) drift: Option<(f64, u64)>,
}

impl Faults {
    /// Reading behind the amplifier of the motor current, for a reading of a sound one.
    pub(super) fn amplified(&self, reading: u16) -> u16 {
        let off = self.current.unwrap_or_default() * ADC_V_PER_A * 4096.0 / ADC_REFERENCE_V;
        // the addition saturates at both ends, as the amplifier does
        (f64::from(reading) + off).round().clamp(0.0, 4095.0) as u16
    }
}

/// Time for which the emergency stop's contact bounces, and the time between changes meanwhile, ns (chosen: usual for a
/// mushroom button).
pub const BOUNCES_NS: u64 = 4_000_000;
const BOUNCE_NS: u64 = 350_000;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stop {
    pressed_ns: Option<u64>,
    /// from when to when its wire is disturbed
    glitch_ns: (u64, u64),
}

impl Stop {
    pub(super) fn press(&mut self, now_ns: u64) {
        self.pressed_ns.get_or_insert(now_ns);
    }

    pub(super) fn disturb(&mut self, now_ns: u64, us: u64) {
        self.glitch_ns = (now_ns, now_ns + 1000 * us);
    }

    /// Returns true if the supply of the motors is off.
    pub(super) fn cuts_power(self) -> bool {
        self.pressed_ns.is_some()
    }

    /// Returns true if the firmware's contact is open.
    pub(super) fn is_open(self, now_ns: u64) -> bool {
        let (from_ns, to_ns) = self.glitch_ns;
        // it opens first, and bounces
        let pressed = self
            .pressed_ns
            .is_some_and(|since_ns| !is_back(since_ns, now_ns, BOUNCES_NS));
        pressed || (from_ns..to_ns).contains(&now_ns)
    }
}

/// Returns true if a contact that has changed at `since_ns`, and bounces for `lasts_ns`, is as it was before: every
/// third time, seen from any instant of power-up.
fn is_back(since_ns: u64, now_ns: u64, lasts_ns: u64) -> bool {
    let after_ns = now_ns.saturating_sub(since_ns);
    let bounce = after_ns / BOUNCE_NS;
    after_ns < lasts_ns && (bounce * 7 + since_ns / BOUNCE_NS * u64::from(bounce > 0)) % 3 == 1
}

/// The contacts of the limit switches: the lever's, the stage's lower and upper one. `true` is closed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Switches {
    pub(super) stuck: [Option<bool>; 3],
    bounce_ns: u64,
    /// how they were, and since when
    were: [(bool, u64); 3],
}

impl Switches {
    /// From now on they bounce for so long.
    pub(super) fn bounce(&mut self, now: [bool; 3], ms: u64) {
        self.bounce_ns = ms * 1_000_000;
        self.were = now.map(|closed| (closed, 0));
    }

    pub(super) fn watch(&mut self, now: [bool; 3], at_ns: u64) {
        if self.bounce_ns == 0 {
            return;
        }
        for (were, closed) in self.were.iter_mut().zip(now) {
            if were.0 != closed {
                *were = (closed, at_ns);
            }
        }
    }

    pub(super) fn read(&self, now: [bool; 3], at_ns: u64) -> [bool; 3] {
        std::array::from_fn(|n| {
            self.stuck[n].unwrap_or(now[n] ^ is_back(self.were[n].1, at_ns, self.bounce_ns))
        })
    }
}

/// Command that samples the static pressure (SPM table 7).
const SAMPLE_PDC: u8 = 0x83;

/// The wire from the sensor: the level of MISO for each byte that the sensor sent.
#[derive(Clone, Debug)]
pub(super) struct Miso {
    command: u8,
    /// last word of each channel, by command
    last: [Option<[u8; 2]>; 256],
    noise: Noise,
}

impl Miso {
    pub(super) fn new(trial_seed: u64) -> Self {
        Self {
            command: 0,
            last: [None; 256],
            noise: Noise::new(trial_seed, STREAM),
        }
    }

    /// Changes what the sensor puts on the line in answer to a transfer that begins with `mosi`.
    pub(super) fn pass(&mut self, now_ns: u64, mosi: u8, line: &mut [u8], faults: &Faults) {
        // a read begins with 00, every command with another byte
        if mosi != 0 {
            self.command = mosi;
        } else if let [byte0, byte1, ..] = line {
            let last = &mut self.last[usize::from(self.command)];
            let sticks = faults.frozen || (faults.pdc_stuck && self.command == SAMPLE_PDC);
            match *last {
                Some(word) if sticks => [*byte0, *byte1] = word,
                _ => {
                    *last = is_sample([*byte0, *byte1])
                        .then_some([*byte0, *byte1])
                        .or(*last)
                }
            }
            if let Some((counts_per_s, since_ns)) = faults.drift
                && self.command == SAMPLE_PDC
                && is_sample([*byte0, *byte1])
            {
                let drift = counts_per_s * now_ns.saturating_sub(since_ns) as f64 * 1e-9;
                [*byte0, *byte1] = shifted([*byte0, *byte1], drift);
            }
            if faults.noise_share > 0.0 && self.noise.uniform() < faults.noise_share {
                [*byte0, *byte1] = [(); 2].map(|()| (self.noise.uniform() * 256.0) as u8);
            }
            if faults.flip_share > 0.0 && self.noise.uniform() < faults.flip_share {
                let bit = (self.noise.uniform() * 16.0) as usize;
                line[bit / 8] ^= 1 << (bit % 8);
            }
        }
        if faults.miso_stuck.is_some() {
            line.fill(Self::idle(faults));
        }
    }

    /// The byte of a part of a finger other than a BioTac, after the wire's faults.
    pub(super) fn disturb(&mut self, said: u8, faults: &Faults) -> u8 {
        if faults.miso_stuck.is_some() {
            return Self::idle(faults);
        }
        // the share is of words, which are two bytes there
        if faults.flip_share > 0.0 && self.noise.uniform() < faults.flip_share / 2.0 {
            return said ^ 1 << (self.noise.uniform() * 8.0) as u8;
        }
        said
    }

    /// Level of a line that nothing drives: its pull-up, or the level that it is shorted to.
    pub(super) fn idle(faults: &Faults) -> u8 {
        match faults.miso_stuck {
            Some(false) => 0x00,
            _ => 0xFF,
        }
    }
}

/// Returns true if a word has odd parity in both bytes, as samples have, and is neither an error frame nor a floating
/// line.
fn is_sample(word: [u8; 2]) -> bool {
    word.iter().all(|byte| byte.count_ones() % 2 == 1)
}

/// The word of a sample that is some counts larger.
fn shifted(word: [u8; 2], counts: f64) -> [u8; 2] {
    let value = f64::from(word[0] >> 1) * 32.0 + f64::from(word[1] >> 3);
    let value = (value + counts).round().clamp(0.0, 4095.0) as u16;
    [(value >> 5 << 1) as u8, (value << 3) as u8]
        .map(|bits| bits | u8::from(bits.count_ones().is_multiple_of(2)))
}
