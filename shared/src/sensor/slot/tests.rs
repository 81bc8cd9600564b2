//! Slots of the three fingers on a wire, and start-up lists.

use std::vec;
use std::vec::Vec;

use embedded_hal::spi::{MODE_0, MODE_1, MODE_3};

use super::*;
use crate::sensor::pressure::{Channel, SLOTS_HZ};
use crate::sensor::{AnyFinger, FingerName, FingerParts, ads1220, biotac, iis3dwb, mems};

/// A transaction on the wire: select, mode, bytes, and the pause behind them, us.
type Seen = (u8, Mode, Vec<u8>, u32);

/// Slots `0..slots` of a finger, whose parts answer with `says`: what went over the wire, and the counts.
fn run(
    name: FingerName,
    slots: u32,
    mut says: impl FnMut(u8, &[u8]) -> Vec<u8>,
) -> (Vec<Seen>, Vec<Option<u16>>) {
    let (mut sensor, mut wire) = (AnyFinger::new(name), Vec::new());
    let counts = (0..slots).map(|n| {
        let answer = perform(name.parts().slot(n), |transaction, bytes| {
            let port = &name.parts().ports[usize::from(transaction.port)];
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
    let (wire, counts) = run(FingerName::Biotac, 3, |_, mosi| match mosi[0] {
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
    let (wire, counts) = run(FingerName::Analog, 2, |_, mosi| match mosi[1] {
        0xA0 => vec![0xFF, 0xE7, 0xE5],
        _ => vec![0x00, 0x06, 0x8F],
    });
    let expected = [[0x01, 0xA0, 0x00], [0x01, 0xE0, 0x00]].map(|b| (0, MODE_0, b.to_vec(), 1));
    assert_eq!(wire, expected);
    assert_eq!(counts, [Some(2021), Some(1679)]);
}

#[test]
fn a_finger_of_two_parts_has_two_selects_and_two_modes() {
    let mut conversions = 0;
    let (wire, counts) = run(FingerName::Mems, 24, |port, mosi| match (port, mosi[0]) {
        (0, 0xAC) => vec![0xFF, 0x20, 0x03, 0xFF],
        (0, _) => vec![0xFF, 0xA2],
        _ => {
            conversions += 1;
            vec![0xFF, 0x00, 0x95, 0x10 + conversions]
        }
    });
    let accelerometer = (0, MODE_3, vec![0xAC, 0, 0, 0], 1);
    let cell = (1, MODE_1, vec![0x10, 0, 0, 0], 1);
    let on = (0, MODE_3, vec![0x90, 0], 1);
    let round = [
        &accelerometer,
        &accelerometer,
        &cell,
        &accelerometer,
        &accelerometer,
        &on,
    ];
    let expected: Vec<_> = round.into_iter().cycle().take(36).cloned().collect();
    assert_eq!(wire, expected);
    // the filter takes 15 slots; what does not change is no vibration
    let (vibration, force) = (Some(2048), Some(1000 + 37));
    assert_eq!(counts[15..18], [force, vibration, force]);
}

/// The answers of a part to each step of a start-up list.
fn start(
    name: FingerName,
    mut says: impl FnMut(usize, &[u8]) -> Vec<u8>,
) -> Result<(), Unexpected> {
    let FingerParts { start, ports, .. } = name.parts();
    start.iter().enumerate().try_for_each(|(at, step)| {
        assert!(usize::from(step.transaction.port) < ports.len());
        assert!(usize::from(step.transaction.answer) >= step.expect.len());
        let answer = perform(&[step.transaction], |_, bytes| {
            let came_in = says(at, bytes);
            bytes.copy_from_slice(&came_in);
            Ok::<(), ()>(())
        });
        step.check(ports, &answer.unwrap())
    })
}

#[test]
fn a_start_up_list_names_the_part_that_does_not_answer() {
    let mut written = std::collections::BTreeMap::from([(0x0F, 0x7B)]);
    let mut cell = [0; 4];
    let mut good = |_: usize, mosi: &[u8]| -> Vec<u8> {
        match mosi {
            [read @ 0x80..=0xFF, _] => vec![0xFF, *written.get(&(read & 0x7F)).unwrap_or(&0)],
            [0x23, ..] => [&[0xFF], &cell[..]].concat(),
            [0x43, registers @ ..] => {
                cell.copy_from_slice(registers);
                vec![0xFF; 5]
            }
            // a software reset is over by the time it is looked at
            [0x12, 0x01] => vec![0xFF; 2],
            [write, value] => {
                written.insert(*write, *value);
                vec![0xFF; 2]
            }
            _ => vec![0xFF; mosi.len()],
        }
    };
    assert_eq!(start(FingerName::Mems, &mut good), Ok(()));
    let why = start(FingerName::Mems, |_, mosi| vec![0xFF; mosi.len()]).unwrap_err();
    assert_eq!(
        (why.part, why.sent, why.got, why.want),
        ("IIS3DWB accelerometer", 0x8F, 0xFF, 0x7B)
    );
    let cell_at = iis3dwb::START.len();
    let why = start(FingerName::Mems, |at, mosi| {
        let mut came_in = good(at, mosi);
        if at > cell_at {
            came_in.fill(0);
        }
        came_in
    });
    let why = why.unwrap_err();
    assert_eq!((why.part, why.want), (ads1220::PORT.name, 0x0E));
    assert!(std::format!("{why}").contains("SPI mode"));
    assert_eq!(start(FingerName::Biotac, |_, _| vec![]), Ok(()));
    assert_eq!(start(FingerName::Analog, |_, _| vec![]), Ok(()));
}

/// At the clocks that a chip may have, and with 7 us of lateness of each transaction.
#[test]
fn all_slots_are_over_before_the_next_one() {
    let longest = |name: FingerName, clock_hz: u32| {
        let FingerParts { ports, slots, .. } = name.parts();
        assert!(ports.iter().all(|port| port.clock_hz.contains(&clock_hz)));
        let lengths = slots.iter().map(|slot| {
            assert!(slot.iter().all(|t| usize::from(t.port) < ports.len()));
            assert!(slot.iter().all(|t| t.out.len() <= MAX_BYTES));
            length_us(slot, 8_000_000_000_u64.div_ceil(clock_hz.into()) as u32, 7)
        });
        lengths.max().unwrap()
    };
    let slot_us = 1_000_000 / SLOTS_HZ;
    assert_eq!(
        longest(FingerName::Biotac, 5_250_000),
        4 + 7 + 50 + 4 + 7 + 10
    );
    assert_eq!(longest(FingerName::Analog, 656_250), 37 + 7 + 1);
    assert_eq!(longest(FingerName::Mems, 5_250_000), 7 + 7 + 1 + 7 + 7 + 1);
    assert!(longest(FingerName::Mems, 656_250) < slot_us);
    assert!(longest(FingerName::Biotac, 500_000) < slot_us);
}

#[test]
fn a_bus_that_fails_ends_a_slot() {
    for fails_at in 0..2 {
        let mut done = 0;
        let answer = perform(biotac::PARTS.slot(0), |_, _| {
            done += 1;
            if done > fails_at { Err("off") } else { Ok(()) }
        });
        assert_eq!(answer, Err("off"));
        assert_eq!(done, fails_at + 1);
    }
}

#[test]
fn what_is_wrong_with_a_part_fits_into_a_sentence() {
    for step in mems::PARTS
        .start
        .iter()
        .filter(|step| !step.expect.is_empty())
    {
        let error = step.check(mems::PARTS.ports, &[]).unwrap_err();
        let said = std::string::ToString::to_string(&error);
        let named = std::format!(
            "the {} answers FF to {:02X} and not {:02X}: ",
            error.part,
            step.transaction.out[0],
            error.want
        );
        assert!(said.starts_with(&named), "{said}");
        assert!(said.ends_with("and the SPI mode"), "{said}");
    }
}
