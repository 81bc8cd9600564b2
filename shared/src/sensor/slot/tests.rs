//! Slots of three fingers on a wire: the BioTac, the MCP3202, and one of two parts that no file has yet.

use std::vec;
use std::vec::Vec;

use embedded_hal::spi::{MODE_0, MODE_1, MODE_3};

use super::*;
use crate::sensor::biotac::BioTac;
use crate::sensor::mcp3202::Mcp3202;
use crate::sensor::pressure::{Channel, Counts, Pressure, SLOTS_HZ};
use crate::sensor::{PressureSensor, slot_of};

/// An accelerometer of 16 bits and a load cell behind a converter of 24, which share the bus: each has its own select, mode
/// and clock. The accelerometer is read in every slot and averaged over two, the cell in every fourth.
#[derive(Default)]
struct TwoParts {
    /// Of the two slots before.
    last: i16,
    cell: Option<u16>,
}

const ACCELEROMETER: Transaction = Transaction {
    port: 0,
    out: &[0xAC, 0, 0],
    answer: 2,
    gap_us: 1,
};
const CELL: Transaction = Transaction {
    port: 1,
    out: &[0x10, 0, 0, 0],
    answer: 3,
    gap_us: 1,
};

#[derive(Debug, PartialEq, Eq, thiserror::Error)]
#[error("no sample")]
struct NoSample;

impl PressureSensor for TwoParts {
    type Error = NoSample;
    const PORTS: &'static [Port] = &[
        Port {
            mode: MODE_3,
            clock_hz: 100_000..=10_000_000,
        },
        Port {
            mode: MODE_1,
            clock_hz: 100_000..=4_000_000,
        },
    ];
    const POWER_UP_MS: u32 = 10;
    const SLOTS: &'static [&'static [Transaction]] = &[
        &[ACCELEROMETER, CELL],
        &[ACCELEROMETER],
        &[ACCELEROMETER],
        &[ACCELEROMETER],
    ];

    fn decode(&mut self, n: u32, answer: &[u8]) -> Result<Pressure, NoSample> {
        let [low, high, cell @ ..] = answer else {
            return Err(NoSample);
        };
        let z = i16::from_le_bytes([*low, *high]);
        let mean = (i32::from(self.last) + i32::from(z)) / 2;
        self.last = z;
        if let [upper, middle, _] = *cell {
            self.cell = Some(u16::from_be_bytes([upper, middle]) >> 4);
        }
        let channel = Channel::of_slot(n);
        let counts = match channel {
            Channel::Pac => (2048 + (mean >> 4)) as u16,
            Channel::Pdc => self.cell.ok_or(NoSample)?,
        };
        let counts = Counts::new(counts).ok_or(NoSample)?;
        Ok(Pressure { channel, counts })
    }
}

/// What a part of the wire saw: select, mode, bytes, and the pause behind them, us.
type Seen = (u8, Mode, Vec<u8>, u32);

/// Slots `0..slots` of a finger, whose parts answer with `says`: what went over the wire, and the counts.
fn run<S: PressureSensor>(
    sensor: &mut S,
    slots: u32,
    says: impl Fn(u8, &[u8]) -> Vec<u8>,
) -> (Vec<Seen>, Vec<Option<u16>>) {
    let mut wire = Vec::new();
    let counts = (0..slots).map(|n| {
        let answer = perform(slot_of::<S>(n), |transaction, bytes| {
            let port = &S::PORTS[usize::from(transaction.port)];
            let (mode, gap_us) = (port.mode, transaction.gap_us);
            wire.push((transaction.port, mode, bytes.to_vec(), gap_us));
            let came_in = says(transaction.port, bytes);
            bytes.copy_from_slice(&came_in);
            Ok::<(), ()>(())
        });
        let sample = sensor.decode(n, &answer.unwrap()).ok()?;
        assert_eq!(sample.channel, Channel::PATTERN[(n % 2) as usize]);
        Some(sample.counts.get())
    });
    let counts = counts.collect();
    (wire, counts)
}

#[test]
fn a_biotac_is_asked_and_read_after_its_gap() {
    let (wire, counts) = run(&mut BioTac, 3, |_, mosi| match mosi[0] {
        // what comes in during a command is no answer
        0x80.. => vec![0x01, 0x01],
        _ => vec![0xA2, 0x08],
    });
    let asked = |command| (0, MODE_0, vec![command, 0x00], 50);
    let read = (0, MODE_0, vec![0x00, 0x01], 10);
    assert_eq!(
        wire,
        [
            asked(0x80),
            read.clone(),
            asked(0x83),
            read.clone(),
            asked(0x80),
            read
        ]
    );
    assert_eq!(counts, [Some(2593); 3]);
}

#[test]
fn a_converter_answers_while_it_is_asked() {
    let (wire, counts) = run(&mut Mcp3202, 2, |_, mosi| match mosi[1] {
        0xA0 => vec![0xFF, 0xE7, 0xE5],
        _ => vec![0x00, 0x0A, 0x8F],
    });
    let expected = [[0x01, 0xA0, 0x00], [0x01, 0xE0, 0x00]].map(|b| (0, MODE_0, b.to_vec(), 1));
    assert_eq!(wire, expected);
    assert_eq!(counts, [Some(2021), Some(2703)]);
}

#[test]
fn a_finger_of_two_parts_has_two_selects_and_two_modes() {
    let (wire, counts) = run(&mut TwoParts::default(), 6, |port, mosi| match port {
        0 => vec![0xFF, 0x20, 0x03],
        _ => [&[0xFF, 0x95, 0x10], &mosi[3..]].concat(),
    });
    let accelerometer = (0, MODE_3, vec![0xAC, 0, 0], 1);
    let mut expected = vec![accelerometer; 6];
    let cell = (1, MODE_1, vec![0x10, 0, 0, 0], 1);
    expected.insert(5, cell.clone());
    expected.insert(1, cell);
    assert_eq!(wire, expected);
    // the mean of the slot and the one before, 0x0320 / 16 / 2 and 0x0320 / 16 above the middle; the cell's upper 12 bits
    let (first, vibration, force) = (Some(2048 + 25), Some(2048 + 50), Some(0x951));
    assert_eq!(counts, [first, force, vibration, force, vibration, force]);
}

/// At the clocks that a chip may have, and with 7 us of lateness of each transaction.
#[test]
fn all_slots_are_over_before_the_next_one() {
    fn longest<S: PressureSensor>(clock_hz: u32) -> u32 {
        for port in S::PORTS {
            assert!(port.clock_hz.contains(&clock_hz));
        }
        let slots = S::SLOTS.iter();
        let lengths = slots.map(|slot| {
            assert!(slot.iter().all(|t| usize::from(t.port) < S::PORTS.len()));
            assert!(slot.iter().all(|t| t.out.len() <= MAX_BYTES));
            length_us(slot, 8_000_000_000_u64.div_ceil(clock_hz.into()) as u32, 7)
        });
        lengths.max().unwrap()
    }
    let slot_us = 1_000_000 / SLOTS_HZ;
    assert_eq!(longest::<BioTac>(5_250_000), 4 + 7 + 50 + 4 + 7 + 10);
    assert_eq!(longest::<Mcp3202>(656_250), 37 + 7 + 1);
    assert_eq!(longest::<TwoParts>(2_625_000), 10 + 7 + 1 + 13 + 7 + 1);
    assert!(longest::<BioTac>(500_000) < slot_us);
}

#[test]
fn a_bus_that_fails_ends_a_slot() {
    for fails_at in 0..2 {
        let mut done = 0;
        let answer = perform(slot_of::<BioTac>(0), |_, _| {
            done += 1;
            if done > fails_at { Err("off") } else { Ok(()) }
        });
        assert_eq!(answer, Err("off"));
        assert_eq!(done, fails_at + 1);
    }
}

/// Bytes of an answer are the last ones that came in, and go where [`Transaction::answers_at`] says.
#[test]
fn answers_are_the_last_bytes() {
    let expected: Vec<u8> = (0..CELL.out.len())
        .filter(|index| CELL.answers_at(*index))
        .map(|index| index as u8)
        .collect();
    let answer = perform(&[CELL], |_, bytes| {
        bytes
            .iter_mut()
            .zip(0..)
            .for_each(|(to, index)| *to = index);
        Ok::<(), ()>(())
    });
    assert_eq!(answer.unwrap()[..], expected);
    assert_eq!(expected, [1, 2, 3]);
}
