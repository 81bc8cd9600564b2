use super::*;
use embedded_hal_mock::eh1::spi::{Mock, Transaction as Spi};
use proptest::prelude::*;
use std::string::ToString as _;
use std::vec;
use std::vec::Vec;

fn read(register: u8, values: Vec<u8>) -> Vec<Spi<u8>> {
    vec![
        Spi::transaction_start(),
        Spi::write_vec(vec![register]),
        Spi::delay(2_000),
        Spi::read_vec(values),
        Spi::delay(1_500),
        Spi::transaction_end(),
    ]
}

fn write(register: u8, value: u8) -> Vec<Spi<u8>> {
    vec![
        Spi::transaction_start(),
        Spi::write_vec(vec![register | 0x80, value]),
        Spi::delay(10_500),
        Spi::transaction_end(),
    ]
}

#[test]
fn another_part_and_no_part_are_told_and_asked_again() {
    for is in [[0x49, 0x00], [0x00, 0x00], [0xFF, 0xFF], [0xB6, 0x49]] {
        let look = [
            write(0x3A, 0x5A),
            read(0x00, vec![is[0]]),
            read(0x5F, vec![is[1]]),
        ]
        .concat();
        let mut sensor = Paa5100je::new(Mock::new(&[&look[..], &look].concat()));
        // the clock turns over meanwhile
        let begins = u32::MAX - 100;
        for ms in (0..1_050).step_by(10) {
            assert_eq!(sensor.poll(begins.wrapping_add(ms)), None);
        }
        let fault = sensor.fault().unwrap();
        assert_eq!(fault, MotionFault::Identity(is));
        assert!(fault.to_string().contains("SPI mode 3"), "{fault}");
        sensor.bus().done();
    }
}

fn ready(bus: Vec<Vec<Spi<u8>>>) -> Paa5100je<Mock<u8>> {
    Paa5100je {
        state: State::Ready,
        orientation: 0xA0,
        ..Paa5100je::new(Mock::new(&bus.concat()))
    }
}

fn is_well() -> Vec<Spi<u8>> {
    let looks = [
        read(0x00, vec![0x49]),
        read(0x5F, vec![0xB6]),
        read(0x5B, vec![0xA0]),
    ];
    looks.concat()
}

#[test]
fn a_burst_is_read_at_once() {
    let bytes = vec![0x80, 0, 0x2C, 0x01, 0xFE, 0xFF, 0x40, 1, 2, 3, 0x0A, 0xBB];
    let mut sensor = ready(vec![read(0x16, bytes), is_well()]);
    assert_eq!(sensor.poll(10), Some([300, -2]));
    assert_eq!(sensor.fault(), None);
    sensor.bus().done();
}

#[test]
fn lines_that_float_and_settings_that_are_gone_give_no_reading() {
    for (level, burst) in [(0x00, vec![0x00; 12]), (0xFF, vec![0xFF; 12])] {
        let looks = [read(0x00, vec![level]), read(0x5F, vec![level])].concat();
        let mut sensor = ready(vec![read(0x16, burst), looks]);
        assert_eq!(sensor.poll(10), None);
        assert_eq!(sensor.fault(), Some(MotionFault::Identity([level; 2])));
        sensor.bus().done();
    }
    let there = [read(0x00, vec![0x49]), read(0x5F, vec![0xB6])].concat();
    let mut sensor = ready(vec![
        read(0x16, vec![0; 12]),
        there,
        read(0x5B, vec![0x00]),
        write(0x3A, 0x5A),
    ]);
    assert_eq!(sensor.poll(10), None);
    assert_eq!(sensor.fault(), Some(MotionFault::Forgot));
    assert_eq!(sensor.poll(1_000), None, "a second has not passed");
    assert_eq!(sensor.poll(1_010), None);
    sensor.bus().done();
}

/// Rejected: fewer than 25 features and the longest exposure, both.
#[test]
fn what_it_does_not_see_is_not_a_stillness() {
    for (quality, shutter, any, expected) in [
        (0x18, 0x1F, 0x80, None),
        (0x18, 0x1F, 0x00, None),
        (0x19, 0x1F, 0x80, Some([5, 6])),
        (0x18, 0x1E, 0x80, Some([5, 6])),
        (0x40, 0x05, 0x00, Some([0, 0])),
    ] {
        let burst = [any, 0, 5, 0, 6, 0, quality, 0, 0, 0, shutter, 0];
        assert_eq!(moved(burst), expected);
    }
}

proptest! {
    #[test]
    fn any_burst_is_read(burst: [u8; 12]) {
        let lost = burst[6] < 25 && burst[10] & 0x1F == 0x1F;
        prop_assert_eq!(moved(burst).is_none(), lost);
        if let Some([x, y]) = moved(burst) {
            let moved = burst[0] >= 0x80;
            let x0 = i32::from(burst[2]) + 256 * i32::from(burst[3] as i8);
            let y0 = i32::from(burst[4]) + 256 * i32::from(burst[5] as i8);
            prop_assert_eq!((i32::from(x), i32::from(y)), if moved { (x0, y0) } else { (0, 0) });
        }
    }

    #[test]
    fn any_trim_is_within_its_six_bits(first: u8, second: u8) {
        let (first, second) = trimmed(first, second);
        prop_assert!(first <= 0x3F && second <= 114);
    }
}
