//! The seam between sensor words and pressures.
//!
//! A sensor is a file that implements [`PressureSensor`]: its parts, the transactions of each slot, and the meaning of
//! the answers. The three are [`crate::sensor::biotac`], [`crate::sensor::analog`] and [`crate::sensor::mems`].
//! Everything after this module sees [`Pressure`]s only.
//!
//! A slot is plain data ([`Transaction`]s) and does no input or output itself, so there is one logic with several ways
//! to run it:
//! - [`Driver::sample`] over the blocking traits of embedded-hal,
//! - [`Driver::sample_async`] over those of embedded-hal-async,
//! - [`slot::perform`] by whatever has the bus,
//! - by interrupts, for firmware that neither spins through a gap nor waits for a byte: see
//!   `firmware/src/chip/slots.rs`.

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use embedded_hal_async::delay::DelayNs as AsyncDelayNs;
use embedded_hal_async::spi::SpiDevice as AsyncSpiDevice;

use crate::sensor::finger::FingerModel;
use crate::sensor::pressure::Pressure;
use crate::sensor::slot::{self, Answer, MAX_BYTES, Port, StartStep, Transaction, Unexpected};

/// A sensor of the two pressures: a finger, of one part or of several.
pub trait PressureSensor {
    /// The faults that an answer can have.
    type Error: core::error::Error;
    /// The kind of finger.
    const MODEL: FingerModel;
    /// Its parts, each with a chip select of its own.
    const PORTS: &'static [Port];
    /// Shortest time from power-up to the first slot, ms.
    const POWER_UP_MS: u32;
    /// The start-up list after that, before the first slot. A part that has lost its power needs it again.
    const START: &'static [StartStep];
    /// The transactions of each slot of a cycle, which then begins again. Slot `n` does `SLOTS[n % SLOTS.len()]`, and
    /// gives the sample of [`Channel::of_slot`](crate::sensor::pressure::Channel::of_slot).
    const SLOTS: &'static [&'static [Transaction]];
    /// Time without clock after which a finger answers again that took noise for a command, ms; 0: no such command is
    /// known.
    const DEAF_MS: u32 = 0;
    /// True if it feels gravity: see [`PressureSensor::gravity`].
    const FEELS_GRAVITY: bool = false;

    /// The sample of slot `n` in its answers.
    ///
    /// # Errors
    /// The answers are not a sample. Count it and treat the sample as lost: there is no older value to use.
    fn decode(&mut self, n: u32, answer: &[u8]) -> Result<Pressure, Self::Error>;

    /// Gravity along the finger in its last answers, [`GRAVITY_PARTS`] of a count of P_AC; `None` from a finger that
    /// does not feel it.
    fn gravity(&self) -> Option<i32> {
        None
    }

    /// Returns the counter for such an answer; `None` if the finger has just begun.
    fn kind(why: &Self::Error) -> Option<BadWord>;
}

/// [`PressureSensor::gravity`] has so many to a count: whole numbers for interrupts.
pub const GRAVITY_PARTS: f32 = 16.0;

/// The kinds of answers that are not samples, as all fingers count them.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BadWord {
    /// The answer was damaged on its way.
    Garbled,
    /// The finger says that it has no sample.
    Refused,
    /// Nothing answers.
    Silent,
}

/// Returns the transactions of slot `n`.
pub fn slot_of<S: PressureSensor>(n: u32) -> &'static [Transaction] {
    let number = n as usize % S::SLOTS.len().max(1);
    S::SLOTS.get(number).copied().unwrap_or_default()
}

/// A sensor with its bus and a delay. Owns all; [`Driver::release`] gives bus and delay back.
///
/// For a sensor of one part: `SpiDevice` has one chip select. The BioTac also lets several sensors sample on the same
/// command, all chip selects low at once: not done here either.
#[derive(Debug)]
pub struct Driver<S, SPI, D> {
    sensor: S,
    spi: SPI,
    delay: D,
}

impl<S: PressureSensor, SPI, D> Driver<S, SPI, D> {
    /// Takes the bus and the delay, and touches neither.
    pub fn new(sensor: S, spi: SPI, delay: D) -> Self {
        const { assert!(S::PORTS.len() == 1) };
        Self { sensor, spi, delay }
    }

    /// Gives the bus and the delay back.
    pub fn release(self) -> (SPI, D) {
        (self.spi, self.delay)
    }

    fn decode<B>(&mut self, n: u32, answer: &[u8]) -> Result<Pressure, Error<B, S::Error>> {
        self.sensor.decode(n, answer).map_err(Error::Sensor)
    }
}

impl<S: PressureSensor, SPI: SpiDevice, D: DelayNs> Driver<S, SPI, D> {
    /// Waits for as long as the sensor needs after its power came on.
    pub fn power_up(&mut self) {
        self.delay.delay_ms(S::POWER_UP_MS);
    }

    /// Carries out the start-up list.
    ///
    /// # Errors
    /// The error of the bus, or of the first step whose answer is wrong. The steps after it are not carried out.
    pub fn start(&mut self) -> Result<(), StartError<SPI::Error>> {
        for step in S::START {
            let answer = self.perform(&[step.transaction]).map_err(StartError::Bus)?;
            step.check(S::PORTS, &answer).map_err(StartError::Part)?;
            self.delay.delay_us(step.wait_us);
        }
        Ok(())
    }

    /// The sample of slot `n`.
    ///
    /// # Errors
    /// [`Error::Bus`], or [`Error::Sensor`] if the answer is not a sample.
    pub fn sample(&mut self, n: u32) -> Result<Pressure, Error<SPI::Error, S::Error>> {
        let answer = self.perform(slot_of::<S>(n)).map_err(Error::Bus)?;
        self.decode(n, &answer)
    }

    /// Carries out any other transactions with the sensor, one after the other, each with the gap after it.
    ///
    /// # Errors
    /// The error of the bus. The transactions after it are not carried out.
    pub fn perform(&mut self, transactions: &[Transaction]) -> Result<Answer, SPI::Error> {
        slot::perform(transactions, |transaction, bytes| {
            if transaction.answer == 0 {
                self.spi.write(bytes)?;
            } else {
                self.spi.transfer_in_place(bytes)?;
            }
            self.delay.delay_us(transaction.gap_us);
            Ok(())
        })
    }
}

impl<S: PressureSensor, SPI: AsyncSpiDevice, D: AsyncDelayNs> Driver<S, SPI, D> {
    /// As [`Driver::power_up`].
    pub async fn power_up_async(&mut self) {
        self.delay.delay_ms(S::POWER_UP_MS).await;
    }

    /// As [`Driver::sample`].
    ///
    /// # Errors
    /// [`Error::Bus`], or [`Error::Sensor`] if the answer is not a sample.
    pub async fn sample_async(&mut self, n: u32) -> Result<Pressure, Error<SPI::Error, S::Error>> {
        let answer = self.perform_async(slot_of::<S>(n)).await;
        let answer = answer.map_err(Error::Bus)?;
        self.decode(n, &answer)
    }

    /// As [`Driver::perform`].
    ///
    /// # Errors
    /// The error of the bus.
    pub async fn perform_async(
        &mut self,
        transactions: &[Transaction],
    ) -> Result<Answer, SPI::Error> {
        let mut answer = Answer::new();
        for transaction in transactions {
            let mut buffer = [0; MAX_BYTES];
            let bytes = transaction.bytes(&mut buffer);
            if transaction.answer == 0 {
                self.spi.write(bytes).await?;
            } else {
                self.spi.transfer_in_place(bytes).await?;
            }
            transaction.add_to(&mut answer, bytes);
            self.delay.delay_us(transaction.gap_us).await;
        }
        Ok(answer)
    }
}

/// The reasons why a sensor does not start: the bus failed, or a part of it did.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum StartError<B> {
    /// The bus or the chip select failed.
    #[error("SPI bus failed: {0:?}")]
    Bus(B),
    /// The bus worked; a part's answer is wrong.
    #[error(transparent)]
    Part(Unexpected),
}

/// The reasons why there is no sample: the bus failed, or the sensor did.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Error<B, S> {
    /// The bus or the chip select failed.
    #[error("SPI bus failed: {0:?}")]
    Bus(B),
    /// The bus worked; the sensor's answer is wrong.
    #[error(transparent)]
    Sensor(S),
}
