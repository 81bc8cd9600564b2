//! A finger's decoder with its bus, in virtual time.

use std::convert::Infallible;

use tactus_core::sensor::analog::Analog;
use tactus_core::sensor::biotac::BioTac;
use tactus_core::sensor::mems::Mems;
use tactus_core::sensor::pressure::Pressure;
use tactus_core::sensor::slot::{self, Port, StartStep, Transaction, Unexpected};
use tactus_core::sensor::{FingerModel, FingerName, GRAVITY_PARTS, PressureSensor, slot_of};

use super::parts::ClockMode;

/// A byte at 5.25 MHz.
const BYTE_NS: u64 = 1_524;
/// A transaction begins so much later than the gap before it asks for.
const LATE_NS: u64 = 5_000;

/// A period of chip select as the bus makes it.
#[derive(Clone, Copy, Debug)]
pub struct Transfer {
    /// Whose chip select, and how the clock goes.
    pub part: u8,
    /// See [`Transfer::part`].
    pub mode: ClockMode,
    /// When it falls, and how long it stays low, ns.
    pub begins_ns: u64,
    /// See [`Transfer::begins_ns`].
    pub takes_ns: u64,
}

/// One of the fingers, as a probe reads it.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant)]
pub enum Reader {
    /// A BioTac.
    BioTac(BioTac),
    /// A piezo disc and a load cell.
    Analog(Analog),
    /// An accelerometer and a load cell.
    Mems(Mems),
}

/// What one decoder or the other says.
macro_rules! each {
    ($self:expr, $S:ident, $expression:expr) => {
        match $self {
            Reader::BioTac(_) => {
                type $S = BioTac;
                $expression
            }
            Reader::Analog(_) => {
                type $S = Analog;
                $expression
            }
            Reader::Mems(_) => {
                type $S = Mems;
                $expression
            }
        }
    };
}

impl Reader {
    /// The decoder of a finger, which has seen nothing yet.
    pub fn new(finger: FingerName) -> Self {
        match finger {
            FingerName::Biotac => Self::BioTac(BioTac),
            FingerName::Analog => Self::Analog(Analog),
            FingerName::Mems => Self::Mems(Mems::new()),
        }
    }

    /// What kind of finger it is.
    pub fn model(&self) -> &'static FingerModel {
        each!(self, S, &S::MODEL)
    }

    /// Its parts.
    pub fn ports(&self) -> &'static [Port] {
        each!(self, S, S::PORTS)
    }

    /// From power to the first transfer, ms.
    pub fn power_up_ms(&self) -> u32 {
        each!(self, S, S::POWER_UP_MS)
    }

    /// Its start-up list.
    pub fn start(&self) -> &'static [StartStep] {
        each!(self, S, S::START)
    }

    fn slot(&self, n: u32) -> &'static [Transaction] {
        each!(self, S, slot_of::<S>(n))
    }

    fn decode(&mut self, n: u32, answer: &[u8]) -> Option<Pressure> {
        match self {
            Self::BioTac(finger) => finger.decode(n, answer).ok(),
            Self::Analog(finger) => finger.decode(n, answer).ok(),
            Self::Mems(finger) => finger.decode(n, answer).ok(),
        }
    }

    /// Gravity along it, counts of P_AC: see [`PressureSensor::gravity`].
    pub fn gravity(&self) -> Option<f32> {
        let parts = match self {
            Self::BioTac(finger) => finger.gravity(),
            Self::Analog(finger) => finger.gravity(),
            Self::Mems(finger) => finger.gravity(),
        };
        parts.map(|parts| parts as f32 / GRAVITY_PARTS)
    }

    /// How a transaction is made that begins at this time, ns.
    pub fn transfer(&self, transaction: &Transaction, begins_ns: u64) -> Transfer {
        let port = self.ports().get(usize::from(transaction.port));
        Transfer {
            part: transaction.port,
            mode: ClockMode::of(port.map_or(0, Port::mode_number)),
            begins_ns,
            takes_ns: BYTE_NS * transaction.out.len() as u64,
        }
    }

    /// The word of slot `n`, which begins at `at_ns`. `transact` gets each of its transfers, what is sent, and room for what comes in.
    pub fn word_of_slot(
        &mut self,
        n: u64,
        at_ns: u64,
        mut transact: impl FnMut(&Transfer, &[u8], &mut [u8]),
    ) -> Option<Pressure> {
        // slots begin again after two, or four
        let n = n as u32;
        let mut begins_ns = at_ns;
        let Ok(answer) = slot::perform(self.slot(n), |transaction, miso| {
            let transfer = self.transfer(transaction, begins_ns);
            transact(&transfer, transaction.out, miso);
            begins_ns += transfer.takes_ns + 1000 * u64::from(transaction.gap_us) + LATE_NS;
            Ok::<(), Infallible>(())
        });
        self.decode(n, &answer)
    }

    /// Does the start-up list. `transact` gets each of its transfers and lets time pass until the given one, ns.
    ///
    /// # Errors
    /// The first answer that is not as it must be.
    pub fn start_up(
        &self,
        at_ns: u64,
        mut transact: impl FnMut(&Transfer, &[u8], &mut [u8]),
    ) -> Result<u64, Unexpected> {
        let mut now_ns = at_ns;
        for step in self.start() {
            let transfer = self.transfer(&step.transaction, now_ns);
            let Ok(answer) = slot::perform(&[step.transaction], |transaction, miso| {
                transact(&transfer, transaction.out, miso);
                Ok::<(), Infallible>(())
            });
            step.check(self.ports(), &answer)?;
            let waits_us = u64::from(step.transaction.gap_us + step.wait_us);
            now_ns += transfer.takes_ns + 1000 * waits_us + LATE_NS;
        }
        Ok(now_ns)
    }
}
