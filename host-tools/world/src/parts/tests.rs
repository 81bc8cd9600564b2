//! The parts on their own bus: words worked out by hand from the data sheets, and what each does when it is used
//! wrongly.

use super::ads1220::Ads1220;
use super::iis3dwb::{BOOT_NS, Iis3dwb};
use super::mcp3202::Mcp3202;
use super::*;
use crate::conditions::TICKS_PER_S;

const MODES: [ClockMode; 4] = [
    ClockMode::of(0),
    ClockMode::of(1),
    ClockMode::of(2),
    ClockMode::of(3),
];
const MS: u64 = 1_000_000;

#[test]
fn an_mcp3202_converts_in_modes_0_and_3() {
    for (number, mode) in MODES.into_iter().enumerate() {
        let mut part = Mcp3202::default();
        let mut read = |bytes: [u8; 3]| {
            part.select(mode);
            let miso = bytes.map(|byte| part.byte(byte, |channel| 0x0A5C + u16::from(channel)));
            part.deselect();
            miso
        };
        let (first, second) = (read([0x01, 0xA0, 0x00]), read([0x01, 0xE0, 0x00]));
        if number == 0 || number == 3 {
            // figure 6-1: three bits that no part drives, the null bit, twelve bits
            assert_eq!(first, [0xFF, 0xEA, 0x5C]);
            assert_eq!(second, [0xFF, 0xEA, 0x5D]);
        } else {
            assert_eq!(first, [0xFF; 3], "mode {number}");
        }
        // both inputs as a pair: their difference, not below 0
        if number == 0 {
            assert_eq!(read([0x01, 0x20, 0x00]), [0xFF, 0xE0, 0x00]);
            assert_eq!(read([0x01, 0x60, 0x00]), [0xFF, 0xE0, 0x01]);
            assert_eq!(read([0x00, 0xA0, 0x00])[0], 0xFF, "no start bit in byte 0");
        }
    }
}

/// An accelerometer that feels this, with its bus.
struct Accelerometer {
    part: Iis3dwb,
    now_ns: u64,
    mode: ClockMode,
}

impl Accelerometer {
    fn transfer(&mut self, mosi: &[u8]) -> Vec<u8> {
        self.part.select(self.now_ns, self.mode);
        let miso = mosi.iter().map(|byte| self.part.byte(self.now_ns, *byte));
        let miso = miso.collect();
        self.part.deselect();
        miso
    }

    fn wait(&mut self, ms: u64, g: f64) {
        for _ in 0..ms * u64::from(TICKS_PER_S) / 1000 {
            self.now_ns += 1_000_000_000 / u64::from(TICKS_PER_S);
            self.part.tick(self.now_ns, g);
        }
    }

    fn z(&mut self) -> i16 {
        let miso = self.transfer(&[0xAC, 0, 0]);
        i16::from_le_bytes([miso[1], miso[2]])
    }

    fn started(mode: ClockMode) -> Self {
        let mut it = Self {
            part: Iis3dwb::new(1),
            now_ns: 0,
            mode,
        };
        assert_eq!(it.transfer(&[0x8F, 0])[1], 0xFF, "before it has booted");
        it.now_ns = BOOT_NS;
        for write in [[0x15, 3], [0x17, 0x40], [0x10, 0xA2]] {
            it.transfer(&write);
        }
        it.wait(20, 1.0);
        it
    }
}

#[test]
fn an_iis3dwb_measures_gravity_when_it_is_on_and_in_modes_0_and_3() {
    for (number, mode) in MODES.into_iter().enumerate() {
        let mut it = Accelerometer::started(mode);
        if number == 1 || number == 2 {
            assert_eq!(it.transfer(&[0x8F, 0]), [0xFF, 0xFF], "mode {number}");
            continue;
        }
        assert_eq!(it.transfer(&[0x8F, 0])[1], 0x7B);
        // 1 g are 16 393 LSB; noise of one axis behind 1333 Hz, 2.4 mg, 40 LSB
        let z: Vec<f64> = (0..400)
            .map(|_| {
                it.wait(1, 1.0);
                it.z().into()
            })
            .collect();
        let mean = z.iter().sum::<f64>() / 400.0;
        let rms = (z.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / 400.0).sqrt();
        assert!((mean - 16_393.0).abs() < 8.0, "{mean}");
        assert!((32.0..44.0).contains(&rms), "{rms}");
        // beyond its range it is at its end
        it.wait(20, 3.0);
        assert_eq!(it.z(), i16::MAX);
        // 4 g: half as many LSB
        it.transfer(&[0x10, 0xAA]);
        it.wait(20, 3.0);
        assert!((f64::from(it.z()) / 24_590.0 - 1.0).abs() < 0.01);
    }
}

#[test]
fn a_brown_out_leaves_an_iis3dwb_its_name_and_stops_its_data() {
    let mut it = Accelerometer::started(ClockMode::of(3));
    it.part.brown_out(it.now_ns);
    it.wait(20, 1.0);
    assert_eq!(it.transfer(&[0x8F, 0])[1], 0x7B);
    assert_eq!(it.transfer(&[0x90, 0])[1], 0x00);
    let stopped = it.z();
    it.wait(20, 0.3);
    assert_eq!(it.z(), stopped);
    assert_eq!(it.transfer(&[0x9E, 0])[1] & 1, 0, "no data");
    assert_eq!(it.part.complaints, 0);
    // reserved bits stay 0, and are complained of
    it.transfer(&[0x10, 0xFF]);
    assert_eq!(it.transfer(&[0x90, 0])[1], 0xEE);
    assert_eq!(it.part.complaints, 1);
}

#[test]
fn an_iis3dwb_whose_clock_is_off_has_another_corner() {
    // a tone at the corner, 1333 Hz, against one far below it
    let gain = |clock: f64, hz: f64| {
        let mut it = Accelerometer::started(ClockMode::of(3));
        it.part.set_clock(clock);
        let mut peak = 0.0f64;
        for tick in 0..u64::from(TICKS_PER_S) {
            it.now_ns += 1_000_000_000 / u64::from(TICKS_PER_S);
            let turns = hz * tick as f64 / f64::from(TICKS_PER_S);
            it.part
                .tick(it.now_ns, (std::f64::consts::TAU * turns).sin());
            if tick > 1000 {
                peak = peak.max(f64::from(it.z()).abs());
            }
        }
        peak
    };
    let at = |clock| gain(clock, 1333.0) / gain(clock, 100.0);
    let (slow, right, fast) = (at(-0.05), at(0.0), at(0.05));
    assert!(slow < right && right < fast, "{slow} {right} {fast}");
    assert!((fast / slow).ln() < 0.15, "{slow} {fast}");
}

struct Cell {
    part: Ads1220,
    now_ns: u64,
    mode: ClockMode,
}

impl Cell {
    fn transfer(&mut self, mosi: &[u8]) -> Vec<u8> {
        self.part.select(self.now_ns, self.mode);
        let miso = mosi.iter().map(|byte| self.part.byte(self.now_ns, *byte));
        let miso = miso.collect();
        self.part.deselect();
        self.now_ns += 10_000;
        miso
    }

    fn wait(&mut self, us: u64, ratio: f64) {
        let ends_ns = self.now_ns + 1000 * us;
        while self.now_ns < ends_ns {
            self.now_ns += 75_757;
            self.part.tick(self.now_ns, ratio);
        }
    }

    fn code(&mut self) -> i32 {
        let miso = self.transfer(&[0x10, 0, 0, 0]);
        i32::from_be_bytes([miso[1], miso[2], miso[3], 0]) >> 8
    }

    fn started(mode: ClockMode) -> Self {
        let mut it = Self {
            part: Ads1220::new(1),
            now_ns: MS,
            mode,
        };
        it.transfer(&[0x06]);
        it.wait(120, 0.0);
        it.transfer(&[0x43, 0x0E, 0xC4, 0xC0, 0x00]);
        it.transfer(&[0x08]);
        it.wait(5000, 0.5e-3);
        it
    }
}

#[test]
fn an_ads1220_converts_in_mode_1_and_no_other_phase() {
    let mut it = Cell::started(ClockMode::of(1));
    assert_eq!(it.transfer(&[0x23, 0, 0, 0, 0])[1..], [0x0E, 0xC4, 0xC0, 0]);
    // half a mV/V at gain 128 is 0.064 of the range, 536 871 LSB; noise of 0.9 uV is 293 LSB
    let codes: Vec<f64> = (0..200)
        .map(|_| {
            it.wait(1100, 0.5e-3);
            it.code().into()
        })
        .collect();
    let mean = codes.iter().sum::<f64>() / 200.0;
    let rms = (codes.iter().map(|c| (c - mean).powi(2)).sum::<f64>() / 200.0).sqrt();
    assert!((mean - 536_871.0).abs() < 80.0, "{mean}");
    assert!((230.0..360.0).contains(&rms), "{rms}");
    assert_eq!(it.part.complaints, 0);
    // beyond the range: its ends
    it.wait(3000, 0.01);
    assert_eq!(it.code(), 0x7F_FFFF);
    it.wait(3000, -0.01);
    assert_eq!(it.code(), -0x80_0000);
    for mode in [0, 3] {
        let mut it = Cell::started(ClockMode::of(mode));
        let registers = it.transfer(&[0x23, 0, 0, 0, 0])[1..].to_vec();
        assert_ne!(registers, [0x0E, 0xC4, 0xC0, 0], "mode {mode}");
        let codes: Vec<i32> = (0..20)
            .map(|_| {
                it.wait(1100, 0.5e-3);
                it.code()
            })
            .collect();
        assert!(
            codes.iter().all(|code| *code == codes[0]),
            "mode {mode}: {codes:?}"
        );
    }
}

#[test]
fn an_ads1220_stops_by_a_brown_out_and_begins_anew_by_a_write() {
    let mut it = Cell::started(ClockMode::of(1));
    it.part.brown_out(it.now_ns);
    it.wait(100, 0.5e-3);
    assert_eq!(it.transfer(&[0x23, 0, 0, 0, 0])[1..], [0; 4]);
    it.wait(5000, 0.5e-3);
    assert_eq!(it.code(), 0);
    // single conversions: one for each START
    it.transfer(&[0x43, 0x0E, 0xC0, 0xC0, 0x00]);
    it.transfer(&[0x08]);
    it.wait(5000, 0.5e-3);
    let first = it.code();
    assert!((530_000..545_000).contains(&first));
    it.wait(5000, 0.1e-3);
    assert_eq!(it.code(), first);
    // a write every half a millisecond: no conversion ends
    let mut it = Cell::started(ClockMode::of(1));
    let before = it.code();
    for _ in 0..20 {
        it.transfer(&[0x40, 0x0E]);
        it.wait(500, 0.1e-3);
    }
    assert_eq!(it.code(), before);
    it.part.wire_cut = true;
    it.wait(3000, 0.1e-3);
    assert_eq!(it.code(), 0x7F_FFFF);
}
