//! The seam between sensor words and pressures.
//!
//! A sensor is a file that implements [`PressureSensor`]: which bytes ask for a channel, how long the sensor needs, and
//! what its answer means. [`crate::sensor::biotac`] and [`crate::sensor::mcp3202`] are the two there are. Everything after
//! this module sees [`Pressure`]s only.
//!
//! An [`Exchange`] is plain data and does no input or output itself, so there is one logic with three ways to run it:
//! - [`Exchange::perform`] over the blocking traits of embedded-hal,
//! - [`Exchange::perform_async`] over those of embedded-hal-async,
//! - split, for firmware that does not spin through the gap: write [`Exchange::command`] at one timer tick, transfer
//!   [`Exchange::read`] at a tick at least [`Exchange::gap_us`] later, and give what came in to
//!   [`PressureSensor::decode`].

use core::marker::PhantomData;
use core::ops::RangeInclusive;

use embedded_hal::delay::DelayNs;
use embedded_hal::spi::SpiDevice;
use embedded_hal_async::delay::DelayNs as AsyncDelayNs;
use embedded_hal_async::spi::SpiDevice as AsyncSpiDevice;

use crate::sensor::pressure::{Channel, Pressure};

/// One question to a sensor and the read of its answer. Chip select is released after each of the two.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Exchange<R> {
    /// Bytes to write first; `None` for a sensor that answers while it is asked.
    pub command: Option<[u8; 2]>,
    /// Shortest time between the end of the command and the read, us.
    pub gap_us: u32,
    /// Bytes to send while reading; the answer takes their place.
    pub read: R,
    /// Shortest time between the read and the next exchange, us.
    pub rest_us: u32,
}

impl<R: AsMut<[u8]>> Exchange<R> {
    /// Performs the exchange and returns the answer.
    ///
    /// # Errors
    /// That of the bus. The exchange is then left where it was, without the rest after it.
    pub fn perform<SPI, D>(mut self, spi: &mut SPI, delay: &mut D) -> Result<R, SPI::Error>
    where
        SPI: SpiDevice,
        D: DelayNs,
    {
        if let Some(command) = &self.command {
            spi.write(command)?;
            delay.delay_us(self.gap_us);
        }
        spi.transfer_in_place(self.read.as_mut())?;
        delay.delay_us(self.rest_us);
        Ok(self.read)
    }

    /// As [`Exchange::perform`].
    ///
    /// # Errors
    /// That of the bus.
    pub async fn perform_async<SPI, D>(
        mut self,
        spi: &mut SPI,
        delay: &mut D,
    ) -> Result<R, SPI::Error>
    where
        SPI: AsyncSpiDevice,
        D: AsyncDelayNs,
    {
        if let Some(command) = &self.command {
            spi.write(command).await?;
            delay.delay_us(self.gap_us).await;
        }
        spi.transfer_in_place(self.read.as_mut()).await?;
        delay.delay_us(self.rest_us).await;
        Ok(self.read)
    }
}

/// A sensor of the two pressures on an SPI bus: mode 0, most significant bit first.
pub trait PressureSensor {
    /// The bytes of an answer.
    type Reply: AsMut<[u8]>;
    /// What can be wrong with an answer.
    type Error: core::error::Error;
    /// Clock the sensor works with, Hz.
    const CLOCK_HZ: RangeInclusive<u32>;
    /// Shortest time from power-up to the first exchange, ms.
    const POWER_UP_MS: u32;

    /// What to send to get a sample of `channel`.
    fn exchange(channel: Channel) -> Exchange<Self::Reply>;

    /// The sample in the answer to `exchange(channel)`.
    ///
    /// # Errors
    /// The answer is not a sample. Count it and treat the sample as lost: there is no older value to use.
    fn decode(channel: Channel, reply: Self::Reply) -> Result<Pressure, Self::Error>;
}

/// A sensor with its bus and a delay. Owns both; [`Driver::release`] gives them back.
///
/// For one sensor with a chip select of its own. The BioTac also lets several sensors sample on the same command, all
/// chip selects low at once: not done here, since `SpiDevice` has one chip select.
#[derive(Debug)]
pub struct Driver<S, SPI, D> {
    spi: SPI,
    delay: D,
    sensor: PhantomData<S>,
}

impl<S: PressureSensor, SPI, D> Driver<S, SPI, D> {
    /// Takes the bus and the delay, and touches neither.
    pub fn new(spi: SPI, delay: D) -> Self {
        Self {
            spi,
            delay,
            sensor: PhantomData,
        }
    }

    /// Gives the bus and the delay back.
    pub fn release(self) -> (SPI, D) {
        (self.spi, self.delay)
    }
}

impl<S: PressureSensor, SPI: SpiDevice, D: DelayNs> Driver<S, SPI, D> {
    /// Waits for as long as the sensor needs after its power came on.
    pub fn power_up(&mut self) {
        self.delay.delay_ms(S::POWER_UP_MS);
    }

    /// One sample of `channel`.
    ///
    /// # Errors
    /// [`Error::Bus`], or [`Error::Sensor`] if the answer is no sample.
    pub fn sample(&mut self, channel: Channel) -> Result<Pressure, Error<SPI::Error, S::Error>> {
        let reply = self.exchange(S::exchange(channel)).map_err(Error::Bus)?;
        S::decode(channel, reply).map_err(Error::Sensor)
    }

    /// Any other exchange with the sensor.
    ///
    /// # Errors
    /// That of the bus.
    pub fn exchange<R: AsMut<[u8]>>(&mut self, exchange: Exchange<R>) -> Result<R, SPI::Error> {
        exchange.perform(&mut self.spi, &mut self.delay)
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
    /// [`Error::Bus`], or [`Error::Sensor`] if the answer is no sample.
    pub async fn sample_async(
        &mut self,
        channel: Channel,
    ) -> Result<Pressure, Error<SPI::Error, S::Error>> {
        let exchange = S::exchange(channel);
        let reply = self.exchange_async(exchange).await.map_err(Error::Bus)?;
        S::decode(channel, reply).map_err(Error::Sensor)
    }

    /// As [`Driver::exchange`].
    ///
    /// # Errors
    /// That of the bus.
    pub async fn exchange_async<R: AsMut<[u8]>>(
        &mut self,
        exchange: Exchange<R>,
    ) -> Result<R, SPI::Error> {
        exchange.perform_async(&mut self.spi, &mut self.delay).await
    }
}

/// Why there is no sample: the bus failed, or the sensor did.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum Error<B, S> {
    /// The bus or the chip select failed.
    #[error("SPI bus failed: {0:?}")]
    Bus(B),
    /// The bus worked; the answer is not what the sensor should say.
    #[error(transparent)]
    Sensor(S),
}
