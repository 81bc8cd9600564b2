//! The sensor on its bus: who it is, whether its words come whole and in time, and what it measures when nobody touches
//! it.
use embassy_time::{Duration, Instant, Timer};
use tactus_core::sensor::biotac::{IdentityBytes, keep};
use tactus_core::sensor::pressure::{Channel, Counts, Pressure, SLOTS_HZ};
use tactus_core::sensor::slot::{self, Answer, Transaction, Unexpected};
use tactus_core::sensor::{AnyFinger, BadWord, FingerError, FingerName, FingerParts, mcp3202};
use tactus_core::wire::bringup::{Stopped, limits};
use tactus_core::wire::{Reset, Text, text};

use super::chip::wait_us;
use crate::board;
use crate::chip::finger;
use crate::chip::slots::Bus;

const PDC: u32 = 1;
/// A slot that begins later than this leaves a BioTac less than its 50 us before the next one.
const LATE_US: u64 = 100;
/// Slots in which a finger that has just begun fills its filters.
const FILLS: u32 = 16;

/// A squeeze is over, mN.
const LEFT_MN: f32 = 57.5;
/// The finger lies still for so long, ms, and so long the squeeze is waited for.
const LEFT_MS: u32 = 500;
const ASKED_MS: u32 = 30_000;
/// P_DC says nothing any more after so many damaged words in a row.
const MOST_DAMAGED: u32 = 10;

pub(super) struct Sensor {
    bus: Bus,
    finger: AnyFinger,
    /// Whether a finger answered, and why its parts did not start.
    found: bool,
    started: Result<(), Unexpected>,
}

impl Sensor {
    /// Takes the bus, waits until the sensor is up, finds out which one it is, and starts its parts.
    pub(super) async fn new(pins: board::Sensor, reset: Reset) -> Self {
        let mut bus = Bus::new(pins);
        let found = finger::find_at_boot(&mut bus, reset).await;
        let started = finger::start(&mut bus);
        let mut sensor = Self {
            found,
            started,
            bus,
            finger: AnyFinger::new(finger::name()),
        };
        sensor.speed_up();
        sensor
    }

    /// Has the bus as fast as the finger's parts can be read.
    pub(super) fn speed_up(&mut self) {
        self.bus.speed_up(finger::parts());
    }

    /// Both channels of an MCP3202 in the finger's place, counts; `None` is one that nobody drives. The bus is as fast
    /// as that afterwards.
    pub(super) fn conversions(&mut self) -> [Option<u16>; 2] {
        let parts = FingerName::Analog.parts();
        self.bus.speed_up(parts);
        [0, 1].map(|slot| {
            let answer = self.perform(parts, parts.slot(slot));
            mcp3202::decode(&answer).map(Counts::get)
        })
    }

    /// The answer to transactions; nothing if the bus is off.
    fn perform(&mut self, parts: &FingerParts, transactions: &[Transaction]) -> Answer {
        let answer = slot::perform(transactions, |transaction, bytes| {
            let port = parts.ports.get(usize::from(transaction.port));
            let done = self.bus.transact(port, transaction, bytes);
            wait_us(transaction.gap_us);
            done
        });
        answer.unwrap_or_default()
    }

    /// Who it is: a BioTac says it, other fingers have parts that answered as they must.
    pub(super) fn identity(&mut self) -> Result<Text, Text> {
        if !self.found {
            return Err(text("no finger answers"));
        }
        let (name, ports) = (finger::name(), finger::parts().ports);
        if name != FingerName::Biotac {
            let started = self.started.map_err(text);
            return started.map(|()| text(format_args!("{name}, {} parts", ports.len())));
        }
        let mut bytes = IdentityBytes::default();
        for (transactions, place) in bytes.reads() {
            keep(place, &self.perform(finger::parts(), &transactions));
        }
        let id = bytes.decode().map_err(text)?;
        Ok(text(format_args!(
            "{}, firmware {}, flex {}",
            id.serial, id.firmware, id.flex
        )))
    }

    fn word(&mut self, slot: u32) -> (Result<Pressure, FingerError>, Answer) {
        let parts = finger::parts();
        let answer = self.perform(parts, parts.slot(slot));
        (self.finger.decode(slot, &answer), answer)
    }

    /// Reads it for a second, in slots as the rig's; `each` gets every word that is good.
    pub(super) async fn second(&mut self, mut each: impl FnMut(Pressure)) -> Second {
        let mut second = Second::default();
        let began = Instant::now();
        for slot in 0..FILLS + SLOTS_HZ {
            let due_us = u64::from(slot) * 1_000_000 / u64::from(SLOTS_HZ);
            let due = began + Duration::from_micros(due_us);
            Timer::at(due).await;
            let late = Instant::now().saturating_duration_since(due).as_micros() > LATE_US;
            let (word, answer) = self.word(slot);
            if slot < FILLS {
                continue;
            }
            second.words += 1;
            second.late += u32::from(late);
            // a bus that is off reads as a sensor that is not there
            second.last = answer.first_chunk().copied().unwrap_or([0xFF; 2]);
            match word {
                Ok(pressure) => {
                    match pressure.channel {
                        Channel::Pac => second.pac.add(pressure.counts.get()),
                        Channel::Pdc => second.pdc.add(pressure.counts.get()),
                    }
                    each(pressure);
                }
                Err(why) => {
                    match why.kind() {
                        Some(BadWord::Garbled) => second.garbled += 1,
                        Some(BadWord::Refused) => second.refused += 1,
                        Some(BadWord::Silent) => second.silent += 1,
                        None => {}
                    }
                    if finger::name() != FingerName::Biotac {
                        second.why = Some(why);
                    }
                }
            }
        }
        second
    }
}

#[derive(Default)]
pub(super) struct Second {
    pub(super) words: u32,
    pub(super) garbled: u32,
    pub(super) refused: u32,
    pub(super) silent: u32,
    pub(super) late: u32,
    pub(super) last: [u8; 2],
    /// what a part of another finger than a BioTac said last
    pub(super) why: Option<FingerError>,
    pub(super) pac: Spread,
    pub(super) pdc: Spread,
}

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
    pub(super) sensor: Sensor,
    rest: f32,
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

    /// Nobody touches the finger now, and this is its P_DC.
    pub(super) fn rests_at(&mut self, counts: f32) {
        (self.rest, self.counts, self.damaged) = (counts, counts, 0);
    }

    /// Another word; how far P_DC is above its rest, counts.
    pub(super) fn rise(&mut self) -> Result<f32, Stopped> {
        match self.sensor.word(PDC).0 {
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
        let model = &finger::parts().model;
        let squeezed_counts = model.counts(limits::SQUEEZED_MN);
        let left_counts = model.counts(LEFT_MN);
        let (mut squeezed, mut left_ms) = (false, 0);
        for _ in 0..ASKED_MS {
            Timer::after_millis(1).await;
            let rise = self.rise()?;
            squeezed |= rise > squeezed_counts;
            left_ms = if squeezed && rise.abs() < left_counts {
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
