//! The sensor's side of the bus: words that were worked out by hand from SPM, and the rules of its timing.

use std::convert::Infallible;

use tactus_core::sensor::biotac;
use tactus_core::sensor::slot::{Transaction, perform};
use tactus_core::sensor::{AnyFinger, FingerName};

use crate::finger::{Contact, Finger};
use crate::sensor::{GAP_NS, POWER_UP_NS, SensorPeer};

/// A sensor that has been powered for long enough, and the time.
struct Bus {
    sensor: SensorPeer,
    finger: Finger,
    now_ns: u64,
}

/// Two bytes at 5.25 MHz.
const SELECT_NS: u64 = 3_048;

impl Bus {
    fn new() -> Self {
        Self {
            sensor: SensorPeer::new(1),
            finger: Finger::new(1),
            now_ns: POWER_UP_NS,
        }
    }

    fn select(&mut self, mosi: &[u8]) -> Vec<u8> {
        let mut miso = vec![0; mosi.len()];
        self.sensor.transfer(
            self.now_ns,
            SELECT_NS,
            mosi,
            &mut miso,
            &mut self.finger,
            0.5,
        );
        self.now_ns += SELECT_NS;
        miso
    }

    /// A command, a gap, a read of as many bytes.
    fn ask(&mut self, command: [u8; 2], gap_ns: u64, len: usize) -> Vec<u8> {
        self.select(&command);
        self.now_ns += gap_ns;
        let mut mosi = vec![0; len];
        mosi[len - 1] = 1;
        let answer = self.select(&mosi);
        self.now_ns += 10_000;
        answer
    }

    fn value(&mut self, command: u8) -> u16 {
        let answer = self.ask([command, 0], GAP_NS, 2);
        assert!(
            answer.iter().all(|b| b.count_ones() % 2 == 1),
            "{answer:02X?}"
        );
        assert_eq!(answer[1] & 0b110, 0, "{answer:02X?}");
        u16::from(answer[0] >> 1) * 32 + u16::from(answer[1] >> 3)
    }
}

#[test]
fn resting_values_are_those_of_recorded_sensors() {
    let mut bus = Bus::new();
    for _ in 0..100 {
        bus.finger.tick(&Contact {
            indentation_mm: 0.0,
            surface: None,
            x_mm: 0.0,
            speed_mm_s: 0.0,
            lever_vibration: 0.0,
        });
        assert!((2030..=2055).contains(&bus.value(0x80)));
        assert!((2580..=2700).contains(&bus.value(0x83)));
    }
    // temperatures, Hall, the 19 electrodes
    for command in [0x85, 0x86, 0x9E, 0xA2, 0xA4, 0xA7, 0xC7] {
        assert!((1000..4000).contains(&bus.value(command)), "{command:02X}");
    }
}

#[test]
fn an_answer_read_too_early_is_an_error_frame() {
    let mut bus = Bus::new();
    assert_eq!(bus.ask([0x80, 0], GAP_NS - 1, 2), [0xA5, 0x2D]);
    assert_ne!(bus.ask([0x80, 0], GAP_NS, 2)[0], 0xA5);
    // the gap counts from the end of the command, not from its start
    bus.select(&[0x83, 0]);
    bus.now_ns += GAP_NS - SELECT_NS;
    assert_eq!(bus.select(&[0, 1]), [0xA5, 0x2D]);
}

#[test]
fn wrong_commands_get_the_error_that_names_them() {
    let mut bus = Bus::new();
    // there is no channel 5
    assert_eq!(bus.ask([0x8A, 0], GAP_NS, 2), [0xA5, 0x58]);
    // 0x81: bad parity
    assert_eq!(bus.ask([0x81, 0], GAP_NS, 2), [0xA5, 0x45]);
    assert_eq!(bus.ask([0x01, 0], GAP_NS, 2), [0xA5, 0x3F]);
    assert_eq!(bus.select(&[0, 1]), [0xA5, 0x5F]);
    // and after all of that it still works
    bus.value(0x80);
}

#[test]
fn properties_are_text_without_parity() {
    let mut bus = Bus::new();
    let serial = bus.ask([0x61, 0x15], GAP_NS, 16);
    assert!(serial.starts_with(b"BT") && serial.is_ascii(), "{serial:?}");
    assert_eq!(bus.ask([0x61, 0x13], GAP_NS, 4).len(), 4);
    assert_eq!(bus.ask([0x61, 0x13], GAP_NS - 1, 4)[..2], [0xA5, 0x2D]);
    assert_eq!(bus.ask([0x61, 0x77], GAP_NS, 2), [0xA5, 0x3F]);
}

#[test]
fn no_power_no_plug_and_streaming_leave_the_line_floating() {
    let mut bus = Bus::new();
    bus.now_ns = POWER_UP_NS - 1;
    bus.select(&[0x80, 0]);
    bus.now_ns = POWER_UP_NS + 1_000_000;
    bus.value(0x80);
    bus.sensor.unplug();
    assert_eq!(bus.ask([0x80, 0], GAP_NS, 2), [0xFF, 0xFF]);
    bus.sensor.plug(bus.now_ns);
    assert_eq!(bus.ask([0x80, 0], GAP_NS, 2), [0xFF, 0xFF]);
    bus.now_ns += POWER_UP_NS;
    bus.value(0x80);
    // streaming is left by 5 s without clock
    bus.ask([0xA1, 0], GAP_NS, 2);
    assert_eq!(bus.ask([0x80, 0], GAP_NS, 2), [0xFF, 0xFF]);
    bus.now_ns += 5_000_000_000;
    bus.value(0x80);
}

#[test]
fn a_host_that_restarts_between_command_and_read_is_in_step_again() {
    let mut bus = Bus::new();
    bus.select(&[0x80, 0]);
    bus.value(0x83);
    assert!((2580..=2700).contains(&bus.value(0x83)));
}

/// The core's slots as data on the sensor's wire; how many of `slots` gave a word, and what the sensor complained of.
fn on_the_wire(slots: u32, change: impl Fn(&mut [Transaction; 2])) -> (usize, Vec<(u8, u64)>) {
    let mut bus = Bus::new();
    let mut sensor = AnyFinger::new(FingerName::Biotac);
    let words = (0..slots).filter(|n| {
        let mut slot: [Transaction; 2] = biotac::PARTS.slot(*n).try_into().unwrap();
        change(&mut slot);
        let Ok(answer) = perform(&slot, |transaction, bytes| {
            bytes.copy_from_slice(&bus.select(transaction.out));
            bus.now_ns += 1000 * u64::from(transaction.gap_us);
            Ok::<(), Infallible>(())
        });
        sensor.decode(*n, &answer).is_ok()
    });
    let words = words.count();
    let complaints = bus.sensor.complaints().iter();
    (words, complaints.map(|(why, many)| (*why, *many)).collect())
}

#[test]
fn the_sensor_has_nothing_to_complain_of_the_cores_slots() {
    assert_eq!(on_the_wire(1000, |_| ()), (1000, vec![]));
}

#[test]
fn the_sensor_complains_of_a_slot_with_a_short_gap_or_another_order() {
    let short = on_the_wire(100, |[command, _]| command.gap_us -= 1);
    assert_eq!(short, (0, vec![(0x2D, 100)]), "too early");
    // the first read finds nothing, each other one the answer to the slot before, too early
    let swapped = on_the_wire(100, |[first, second]| {
        std::mem::swap(&mut first.out, &mut second.out);
    });
    assert_eq!(swapped.0, 0);
    assert_eq!(swapped.1, [(0x2D, 99), (0x5F, 1)]);
}
