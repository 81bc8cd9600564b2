//! The transactions of a slot as plain data: chip selects, bytes and gaps. The owner of the bus carries them out:
//! The firmware's interrupts, a simulated finger, or [`perform`] over whatever bus there is.

use core::ops::RangeInclusive;

use embedded_hal::spi::{Mode, Phase, Polarity};

/// A part of a finger on the bus: a chip with a chip select of its own.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Port {
    /// Its name in messages.
    pub name: &'static str,
    /// Polarity and phase of the clock.
    pub mode: Mode,
    /// The allowed clocks of the part, Hz.
    pub clock_hz: RangeInclusive<u32>,
}

impl Port {
    /// Its SPI mode by number: bit 1 is the clock's polarity, bit 0 its phase.
    pub const fn mode_number(&self) -> u8 {
        let polarity = matches!(self.mode.polarity, Polarity::IdleHigh);
        let phase = matches!(self.mode.phase, Phase::CaptureOnSecondTransition);
        (polarity as u8) << 1 | phase as u8
    }
}

/// One period of chip select, and the pause after it. Most significant bit first.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Transaction {
    /// Whose chip select: an index into [`FingerParts::ports`](crate::sensor::FingerParts::ports).
    pub port: u8,
    /// Bytes to send, at most [`MAX_BYTES`]; as many come in meanwhile.
    pub out: &'static [u8],
    /// The number of incoming bytes that are the answer: the last ones.
    pub answer: u8,
    /// Shortest time from here, with chip select high, to the next transaction of this slot or of the next one, us.
    pub gap_us: u32,
}

/// Most bytes of a transaction, and of the answers of a slot.
pub const MAX_BYTES: usize = 16;

/// The answers of a slot's transactions, one after the other.
pub type Answer = heapless::Vec<u8, MAX_BYTES>;

impl Transaction {
    /// A transaction with the first part of a finger.
    pub(crate) const fn first_port(out: &'static [u8], answer: u8, gap_us: u32) -> Self {
        Self {
            port: 0,
            out,
            answer,
            gap_us,
        }
    }

    pub(super) fn bytes<'a>(&self, buffer: &'a mut [u8; MAX_BYTES]) -> &'a mut [u8] {
        let bytes = buffer.get_mut(..self.out.len()).unwrap_or_default();
        bytes
            .iter_mut()
            .zip(self.out)
            .for_each(|(to, from)| *to = *from);
        bytes
    }

    pub(super) fn add_to(&self, answer: &mut Answer, came_in: &[u8]) {
        let first = came_in.len().saturating_sub(self.answer.into());
        // there is room for all answers of a slot
        let _ = answer.extend_from_slice(came_in.get(first..).unwrap_or_default());
    }
}

/// A step of a finger's start-up list: a transaction, the expected answer, and the time until the next step.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct StartStep {
    /// The transaction.
    pub transaction: Transaction,
    /// For each byte of its answer: a mask of the bits that matter, and their expected values.
    pub expect: &'static [(u8, u8)],
    /// Shortest time to the next step, or to the first slot, beyond the transaction's own gap, us.
    pub wait_us: u32,
}

impl StartStep {
    pub(super) const fn new(
        transaction: Transaction,
        expect: &'static [(u8, u8)],
        wait_us: u32,
    ) -> Self {
        Self {
            transaction,
            expect,
            wait_us,
        }
    }

    /// Checks the answer against the expected bits.
    /// Errors: the first byte that is wrong or missing.
    pub fn check(&self, ports: &[Port], answer: &[u8]) -> Result<(), Unexpected> {
        for (at, (mask, want)) in self.expect.iter().enumerate() {
            let got = answer.get(at).copied().unwrap_or(0xFF);
            if got & mask != want & mask || answer.len() <= at {
                let port = ports.get(usize::from(self.transaction.port));
                return Err(Unexpected {
                    part: port.map_or("", |port| port.name),
                    sent: self.transaction.out.first().copied().unwrap_or(0),
                    got,
                    want: want & mask,
                });
            }
        }
        Ok(())
    }
}

/// A part of a finger gives a wrong answer during start-up.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
#[error(
    "the {part} answers {got:02X} to {sent:02X} and not {want:02X}: check its power, its wires, its chip select and \
     the SPI mode"
)]
pub struct Unexpected {
    /// The part.
    pub part: &'static str,
    /// The first byte that was sent to it.
    pub sent: u8,
    /// The byte that came.
    pub got: u8,
    /// The byte that should have come, in the bits that matter.
    pub want: u8,
}

/// Carries out transactions one after the other, and returns their answers. `transact` gets the bytes to send, replaces
/// them by the incoming ones, and keeps the gap after the transaction.
/// Errors: the first error of `transact`; the transactions after it are not carried out.
pub fn perform<E>(
    transactions: &[Transaction],
    mut transact: impl FnMut(&Transaction, &mut [u8]) -> Result<(), E>,
) -> Result<Answer, E> {
    let mut answer = Answer::new();
    for transaction in transactions {
        let mut buffer = [0; MAX_BYTES];
        let bytes = transaction.bytes(&mut buffer);
        transact(transaction, bytes)?;
        transaction.add_to(&mut answer, bytes);
    }
    Ok(answer)
}

/// The time of transactions and their gaps, us, if a byte takes `byte_ns` and each transaction may end `slack_us` late:
/// a slot of them has to be as long.
pub const fn length_us(transactions: &[Transaction], byte_ns: u32, slack_us: u32) -> u32 {
    let (mut us, mut rest) = (0, transactions);
    while let [transaction, others @ ..] = rest {
        let bytes_ns = transaction.out.len() as u32 * byte_ns;
        us += bytes_ns.div_ceil(1000) + slack_us + transaction.gap_us;
        rest = others;
    }
    us
}

#[cfg(test)]
mod tests;
