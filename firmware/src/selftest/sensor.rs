//! The sensor on its bus: who it is, whether its words come whole and in time, and what it measures when nobody touches it.
use embassy_time::{Duration, Instant, Timer};
use tactus_core::sensor::biotac::{
    BioTac, Diagnosis, Identity, IdentityBytes, PropertyError, WordError, WordStats, keep,
};
use tactus_core::sensor::pressure::{Channel, Pressure, SLOTS_HZ};
use tactus_core::sensor::slot::{self, Answer, Transaction};
use tactus_core::sensor::{PressureSensor as _, slot_of};
use tactus_core::wire::bringup::{Stopped, limits};

use super::account::{Account, wait_us};
use crate::board;
use crate::chip::slots::Bus;

/// The slot that gives P_DC.
const PDC: u32 = 1;
/// A slot that begins later than this leaves the sensor less than its 50 us before the next one.
const LATE_US: u64 = 100;

/// A squeeze is over, counts of P_DC: 0.06 N.
const LEFT_COUNTS: f32 = 5.0;
/// The finger lies still for so long, ms, and so long the squeeze is waited for.
const LEFT_MS: u32 = 500;
const ASKED_MS: u32 = 30_000;
/// P_DC says nothing any more after so many damaged words in a row.
const MOST_DAMAGED: u32 = 10;

/// The bus of the sensor, used directly.
pub(super) struct Sensor(Bus);

impl Sensor {
    /// Takes the bus and waits until the sensor is up.
    pub(super) async fn new(pins: board::Sensor) -> Self {
        let sensor = Self(Bus::new(pins));
        Timer::after_millis(BioTac::POWER_UP_MS.into()).await;
        sensor
    }

    /// The answer to transactions; nothing if the bus is off.
    fn perform(&mut self, transactions: &[Transaction]) -> Answer {
        let answer = slot::perform(transactions, |transaction, bytes| {
            let done = self.0.transact(transaction, bytes);
            wait_us(transaction.gap_us);
            done
        });
        answer.unwrap_or_default()
    }

    /// Asks it who it is.
    pub(super) fn identity(&mut self) -> Result<Identity, PropertyError> {
        let mut bytes = IdentityBytes::default();
        for (transactions, place) in bytes.reads() {
            keep(place, &self.perform(&transactions));
        }
        bytes.decode()
    }

    fn word(&mut self, slot: u32) -> Result<Pressure, WordError> {
        BioTac.decode(slot, &self.perform(slot_of::<BioTac>(slot)))
    }

    /// Reads it for a second, in slots as the rig's; `each` gets every word that is good.
    pub(super) async fn second(&mut self, mut each: impl FnMut(Pressure)) -> Second {
        let mut second = Second::default();
        let began = Instant::now();
        for slot in 0..SLOTS_HZ {
            let due_us = u64::from(slot) * 1_000_000 / u64::from(SLOTS_HZ);
            let due = began + Duration::from_micros(due_us);
            Timer::at(due).await;
            if Instant::now().saturating_duration_since(due).as_micros() > LATE_US {
                second.late += 1;
            }
            let answer = self.perform(slot_of::<BioTac>(slot));
            // a bus that is off reads as a sensor that is not there
            second.last = answer.first_chunk().copied().unwrap_or([0xFF; 2]);
            let word = BioTac.decode(slot, &answer);
            second.stats.count(&word);
            if let Ok(pressure) = word {
                match pressure.channel {
                    Channel::Pac => second.pac.add(pressure.counts.get()),
                    Channel::Pdc => second.pdc.add(pressure.counts.get()),
                }
                each(pressure);
            }
        }
        second
    }
}

/// What a second of words said.
#[derive(Default)]
pub(super) struct Second {
    pub(super) stats: WordStats,
    pub(super) late: u32,
    pub(super) last: [u8; 2],
    pub(super) pac: Spread,
    pub(super) pdc: Spread,
}

/// Mean and standard deviation of counts.
#[derive(Default)]
pub(super) struct Spread {
    number: f32,
    sum: f32,
    squares: f32,
    /// sums are about the first value, so that they stay small
    first: f32,
}

impl Spread {
    pub(super) fn add(&mut self, counts: u16) {
        let counts = f32::from(counts);
        if self.number == 0.0 {
            self.first = counts;
        }
        let off = counts - self.first;
        self.number += 1.0;
        self.sum += off;
        self.squares += off * off;
    }

    pub(super) fn mean(&self) -> f32 {
        self.first + self.sum / self.number.max(1.0)
    }

    pub(super) fn rms(&self) -> f32 {
        let mean = self.sum / self.number.max(1.0);
        libm::sqrtf((self.squares / self.number.max(1.0) - mean * mean).max(0.0))
    }
}

/// P_DC against that of the finger that nobody touches, asked for every millisecond while a motor may press it.
pub(super) struct Touch {
    sensor: Sensor,
    rest: f32,
    /// Mean over some 8 ms.
    counts: f32,
    damaged: u32,
}

impl Touch {
    /// Nobody touches the finger now.
    pub(super) fn new(sensor: Sensor, rest: f32) -> Self {
        Self {
            sensor,
            rest,
            counts: rest,
            damaged: 0,
        }
    }

    /// The sensor, for what else it says; and what P_DC is while nobody touches it, when that was measured.
    pub(super) fn sensor(&mut self) -> &mut Sensor {
        &mut self.sensor
    }

    /// Nobody touches the finger now, and this is its P_DC.
    pub(super) fn rests_at(&mut self, counts: f32) {
        (self.rest, self.counts, self.damaged) = (counts, counts, 0);
    }

    /// Another word; how far P_DC is above its rest, counts.
    pub(super) fn rise(&mut self) -> Result<f32, Stopped> {
        match self.sensor.word(PDC) {
            Ok(word) => {
                self.damaged = 0;
                self.counts += (f32::from(word.counts.get()) - self.counts) / 8.0;
            }
            Err(_) => self.damaged += 1,
        }
        if self.damaged >= MOST_DAMAGED {
            return Err(Stopped::Silent);
        }
        Ok(self.counts - self.rest)
    }

    /// Waits for somebody who squeezes the finger and lays it down: then P_DC lives, and its rest is known.
    pub(super) async fn squeezed(&mut self) -> Result<(), Stopped> {
        let (mut squeezed, mut left_ms) = (false, 0);
        for _ in 0..ASKED_MS {
            Timer::after_millis(1).await;
            let rise = self.rise()?;
            squeezed |= rise > limits::SQUEEZED;
            left_ms = if squeezed && rise.abs() < LEFT_COUNTS {
                left_ms + 1
            } else {
                0
            };
            if left_ms >= LEFT_MS {
                self.rest = self.counts;
                return Ok(());
            }
        }
        Err(Stopped::NobodySqueezed)
    }
}

pub(super) async fn sensor(pins: board::Sensor, account: &mut Account) -> Touch {
    let mut sensor = Sensor::new(pins).await;
    match sensor.identity() {
        Ok(id) => account.check(
            true,
            "sensor identity",
            format_args!("{}, firmware {}, flex {}", id.serial, id.firmware, id.flex),
            "",
        ),
        Err(why) => account.check(
            false,
            "sensor identity",
            why,
            "SCK PA5, MISO PA6, MOSI PB5, CS PD14, 3.3 V and ground",
        ),
    };

    let Second {
        stats,
        late,
        pac,
        pdc,
        ..
    } = sensor.second(|_| ()).await;
    let diagnosis = stats.diagnosis();
    account.check(
        diagnosis == Diagnosis::Good && late == 0,
        "sensor words",
        format_args!(
            "words: {}, {} garbled, error frames: {}, {} silent, {late} late: {diagnosis}",
            stats.words,
            stats.parity + stats.padding,
            stats.error_frames,
            stats.no_sensor
        ),
        "Shorten the cable and check the pins named above",
    );
    let within = |(least, most): (f32, f32), counts: f32| (least..=most).contains(&counts);
    let at_rest = BioTac::MODEL.at_rest;
    account.check(
        within(at_rest.pac_noise_counts, pac.rms()),
        "P_AC noise",
        format_args!("{:.2} counts rms", pac.rms()),
        "1 to 8 are right. Less: the sensor does not convert. More: is the finger touched? Check its ground",
    );
    account.check(
        within(at_rest.pdc_counts, pdc.mean()),
        "P_DC",
        format_args!("{:.0} counts", pdc.mean()),
        "2000 to 3200 are right without contact. Refill the finger as its manual says; keep off anything that presses it",
    );
    Touch::new(sensor, pdc.mean())
}
