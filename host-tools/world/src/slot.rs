//! A finger's decoder with its bus, in virtual time.

use std::convert::Infallible;

use tactus_core::sensor::pressure::Pressure;
use tactus_core::sensor::slot::{self, Port, StartStep, Transaction, Unexpected};
use tactus_core::sensor::{AnyFinger, FingerModel, FingerName, FingerParts, GRAVITY_PARTS};

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
    /// Its falling edge, and the time that it stays low, ns.
    pub begins_ns: u64,
    /// See [`Transfer::begins_ns`].
    pub(crate) takes_ns: u64,
}

/// A finger, as a probe reads it.
#[derive(Clone, Debug)]
pub struct Reader {
    finger: AnyFinger,
    parts: &'static FingerParts,
}

impl Reader {
    /// The decoder of a finger, which has seen nothing yet.
    pub fn new(finger: FingerName) -> Self {
        Self {
            finger: AnyFinger::new(finger),
            parts: finger.parts(),
        }
    }

    /// The kind of finger.
    pub fn model(&self) -> &'static FingerModel {
        &self.parts.model
    }

    /// Its parts.
    pub fn ports(&self) -> &'static [Port] {
        self.parts.ports
    }

    /// The time from power to the first transfer, ms.
    pub fn power_up_ms(&self) -> u32 {
        self.parts.power_up_ms
    }

    /// Its start-up list.
    pub fn start(&self) -> &'static [StartStep] {
        self.parts.start
    }

    /// Gravity along it, counts of P_AC: see [`AnyFinger::gravity`].
    pub fn gravity(&self) -> Option<f32> {
        let parts = self.finger.gravity()?;
        Some(parts as f32 / GRAVITY_PARTS)
    }

    /// The transfer of a transaction that begins at this time, ns.
    pub fn transfer(&self, transaction: &Transaction, begins_ns: u64) -> Transfer {
        let port = self.ports().get(usize::from(transaction.port));
        Transfer {
            part: transaction.port,
            mode: ClockMode::of(port.map_or(0, Port::mode_number)),
            begins_ns,
            takes_ns: BYTE_NS * transaction.out.len() as u64,
        }
    }

    /// The word of slot `n`, which begins at `at_ns`. `transact` gets each of its transfers, the bytes to send, and a
    /// buffer for the answer.
    pub fn word_of_slot(
        &mut self,
        n: u64,
        at_ns: u64,
        mut transact: impl FnMut(&Transfer, &[u8], &mut [u8]),
    ) -> Option<Pressure> {
        // slots begin again after two, or four
        let n = n as u32;
        let mut begins_ns = at_ns;
        let Ok(answer) = slot::perform(self.parts.slot(n), |transaction, miso| {
            let transfer = self.transfer(transaction, begins_ns);
            transact(&transfer, transaction.out, miso);
            begins_ns += transfer.takes_ns + 1000 * u64::from(transaction.gap_us) + LATE_NS;
            Ok::<(), Infallible>(())
        });
        self.finger.decode(n, &answer).ok()
    }

    /// Does the start-up list. `transact` gets each of its transfers and lets time pass until the given one, ns.
    /// Errors: The first answer that is not as it must be.
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
