//! The fingers behind one type, for who learns only at boot which one is there, and how that is found out.

use super::analog::{Analog, AnalogError};
use super::biotac::{BioTac, ErrorCode, WordError};
use super::driver::{BadWord, PressureSensor};
use super::finger::{FingerModel, FingerName};
use super::mems::{Mems, MemsError};
use super::pressure::Pressure;
use super::slot::{Answer, Port, StartStep, Transaction};
use super::{ads1220, iis3dwb, mcp3202};

/// What a finger is on its bus: the constants of its [`PressureSensor`].
#[derive(Clone, Copy, Debug)]
pub struct FingerParts {
    /// [`PressureSensor::MODEL`].
    pub model: FingerModel,
    /// [`PressureSensor::PORTS`].
    pub ports: &'static [Port],
    /// [`PressureSensor::POWER_UP_MS`].
    pub power_up_ms: u32,
    /// [`PressureSensor::START`].
    pub start: &'static [StartStep],
    /// [`PressureSensor::SLOTS`].
    pub slots: &'static [&'static [Transaction]],
    /// [`PressureSensor::DEAF_MS`].
    pub deaf_ms: u32,
    /// [`PressureSensor::FEELS_GRAVITY`].
    pub feels_gravity: bool,
}

impl FingerParts {
    const fn of<S: PressureSensor>() -> Self {
        Self {
            model: S::MODEL,
            ports: S::PORTS,
            power_up_ms: S::POWER_UP_MS,
            start: S::START,
            slots: S::SLOTS,
            deaf_ms: S::DEAF_MS,
            feels_gravity: S::FEELS_GRAVITY,
        }
    }

    /// The transactions of slot `n`.
    pub fn slot(&self, n: u32) -> &'static [Transaction] {
        let number = n as usize % self.slots.len().max(1);
        self.slots.get(number).copied().unwrap_or_default()
    }
}

const BIOTAC: FingerParts = FingerParts::of::<BioTac>();
const ANALOG: FingerParts = FingerParts::of::<Analog>();
const MEMS: FingerParts = FingerParts::of::<Mems>();

impl FingerName {
    /// What a finger of this name is on its bus.
    pub const fn parts(self) -> &'static FingerParts {
        match self {
            Self::Biotac => &BIOTAC,
            Self::Analog => &ANALOG,
            Self::Mems => &MEMS,
        }
    }
}

/// One of the fingers, with what it remembers of the slots before.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)] // there is one
pub enum AnyFinger {
    /// A BioTac.
    BioTac(BioTac),
    /// A piezo disc and a load cell.
    Analog(Analog),
    /// An accelerometer and a load cell.
    Mems(Mems),
}

impl AnyFinger {
    /// The finger of a name, of which nothing was read yet.
    pub const fn new(name: FingerName) -> Self {
        match name {
            FingerName::Biotac => Self::BioTac(BioTac),
            FingerName::Analog => Self::Analog(Analog),
            FingerName::Mems => Self::Mems(Mems::new()),
        }
    }

    /// The sample of slot `n` in its answers, see [`PressureSensor::decode`].
    ///
    /// # Errors
    /// The answers are no sample.
    #[inline]
    pub fn decode(&mut self, n: u32, answer: &[u8]) -> Result<Pressure, FingerError> {
        Ok(match self {
            Self::BioTac(finger) => finger.decode(n, answer)?,
            Self::Analog(finger) => finger.decode(n, answer)?,
            Self::Mems(finger) => finger.decode(n, answer)?,
        })
    }

    /// Gravity along the finger, see [`PressureSensor::gravity`].
    #[inline]
    pub fn gravity(&self) -> Option<i32> {
        match self {
            Self::Mems(finger) => finger.gravity(),
            Self::BioTac(_) | Self::Analog(_) => None,
        }
    }
}

/// Why an answer of a finger is no sample.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FingerError {
    /// A BioTac's.
    #[error(transparent)]
    BioTac(#[from] WordError),
    /// A piezo disc's and a load cell's.
    #[error(transparent)]
    Analog(#[from] AnalogError),
    /// An accelerometer's and a load cell's.
    #[error(transparent)]
    Mems(#[from] MemsError),
}

impl FingerError {
    /// How it is counted, see [`PressureSensor::kind`].
    pub fn kind(&self) -> Option<BadWord> {
        match self {
            Self::BioTac(why) => BioTac::kind(why),
            Self::Analog(why) => Analog::kind(why),
            Self::Mems(why) => Mems::kind(why),
        }
    }
}

/// The fastest clock that every part of every finger can be read with, Hz: for [`find`], and for lists of start-up.
pub const SLOWEST_HZ: u32 = *mcp3202::PORT.clock_hz.end();

/// The words that a finger is asked for before it is known, and those that have to be good.
const WORDS: u32 = 4;
const GOOD: u32 = 2;
/// P_DC of an MCP3202 that is read a few times within a millisecond changes by less, counts.
const STEADY: u16 = 32;

/// Which finger is on the bus; `None` if nothing answers as one of them does. Nothing is set up, but for the registers of an ADS1220.
///
/// `ask` makes one transaction with a part of a finger of this name, as its port wants it but at [`SLOWEST_HZ`] or less, waits so many
/// us more, and gives the answer; an empty one if the bus failed.
///
/// Nobody is asked what could harm another finger's part. The second chip select is an ADS1220's alone. An IIS3DWB is only read: a
/// BioTac takes the address for a channel that it does not have, and answers nothing before it is asked again; an MCP3202 makes a
/// conversion. A BioTac's words would write to registers of an IIS3DWB, so that one is looked for before. The MCP3202 comes last: what a
/// BioTac with a bad cable makes of its command is not to be an answer.
pub fn find(mut ask: impl FnMut(FingerName, &Transaction, u32) -> Answer) -> Option<FingerName> {
    let mut is_part = |steps: &[StartStep]| {
        steps.iter().all(|step| {
            let answer = ask(FingerName::Mems, &step.transaction, step.wait_us);
            step.check(MEMS.ports, &answer).is_ok()
        })
    };
    if is_part(&ads1220::CHECK) || is_part(&iis3dwb::CHECK) {
        return Some(FingerName::Mems);
    }
    if is_biotac(&mut ask) {
        return Some(FingerName::Biotac);
    }
    is_analog(&mut ask).then_some(FingerName::Analog)
}

/// Words with the parity and the zeros of a BioTac's, or its error frames.
fn is_biotac(ask: &mut impl FnMut(FingerName, &Transaction, u32) -> Answer) -> bool {
    let mut finger = BioTac;
    let good = (0..WORDS).filter(|n| {
        let mut answer = Answer::new();
        for transaction in BIOTAC.slot(*n) {
            answer = ask(FingerName::Biotac, transaction, 0);
        }
        match finger.decode(*n, &answer) {
            Ok(_) => true,
            Err(WordError::ErrorFrame(code)) => !matches!(code, ErrorCode::Unknown(_)),
            Err(_) => false,
        }
    });
    good.count() as u32 >= GOOD
}

/// Conversions with their null bit behind a line that nobody drives, and a cell that does not jump.
fn is_analog(ask: &mut impl FnMut(FingerName, &Transaction, u32) -> Answer) -> bool {
    let (mut least, mut most) = (u16::MAX, 0);
    for n in 0..WORDS {
        for transaction in ANALOG.slot(n) {
            let answer = ask(FingerName::Analog, transaction, 0);
            let (Ok(counts), Some(first)) = (mcp3202::decode(&answer), answer.first()) else {
                return false;
            };
            // three bits come before the null bit, all from the pull-up or all from what the line was at
            if !matches!(first >> 5, 0b000 | 0b111) {
                return false;
            }
            if n % 2 == 0 {
                // at an end of the range the line may be stuck there
                if counts.is_clipped() {
                    return false;
                }
            } else {
                least = least.min(counts.get());
                most = most.max(counts.get());
            }
        }
    }
    most.abs_diff(least) < STEADY
}

#[cfg(test)]
mod tests;
