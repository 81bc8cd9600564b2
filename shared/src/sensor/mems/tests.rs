use super::*;
use core::f32::consts::TAU;
use std::vec::Vec;

/// Answers of slot `n` with this acceleration and this cell, LSB.
fn answer(n: u32, z: i16, cell: i32) -> Vec<u8> {
    let [low, high] = z.to_le_bytes();
    let mut answer = Vec::from([low, high, 0x55]);
    match n % 4 {
        1 => answer.extend(&cell.to_be_bytes()[1..]),
        3 => answer.push(0xA2),
        _ => {}
    }
    answer
}

/// Counts of both channels over so many slots; the first 100 are left out.
fn run(
    slots: u32,
    mut z: impl FnMut(f32) -> f32,
    mut cell: impl FnMut(u32) -> i32,
) -> [Vec<f32>; 2] {
    let mut finger = Mems::new();
    let mut counts = [Vec::new(), Vec::new()];
    for n in 0..slots {
        let z = z(n as f32 / 4400.0).round() as i16;
        let sample = finger.sample(n, &answer(n, z, cell(n)));
        if n >= 100 {
            let sample = sample.unwrap();
            counts[sample.channel as usize].push(f32::from(sample.counts.get()));
        }
    }
    counts
}

fn amplitude(pac: &[f32]) -> f32 {
    let late = &pac[pac.len() / 2..];
    let mean = late.iter().sum::<f32>() / late.len() as f32;
    let power = late.iter().map(|c| (c - mean) * (c - mean)).sum::<f32>() / late.len() as f32;
    (2.0 * power).sqrt()
}

/// A cell with the noise that it has.
fn noisy(n: u32) -> i32 {
    (n as i32).wrapping_mul(7919) % 601
}

#[test]
fn the_band_is_flat_to_800_hz_and_what_folds_is_kept_out() {
    let gain = |hz: f32| {
        let [pac, _] = run(8800, |s| 8000.0 * (TAU * hz * s).sin(), noisy);
        20.0 * (amplitude(&pac) / 500.0).log10()
    };
    for hz in [60.0, 200.0, 403.0, 611.0, 797.0] {
        assert!(gain(hz).abs() < 0.25, "{hz} Hz: {} dB", gain(hz));
    }
    assert!((gain(10.0) + 3.0).abs() < 0.3, "{} dB", gain(10.0));
    assert!((-5.0..-3.0).contains(&gain(1040.0)), "{} dB", gain(1040.0));
    for hz in [1_407.0, 1_600.0, 1_900.0, 2_150.0] {
        assert!(gain(hz) < -31.0, "{hz} Hz: {} dB", gain(hz));
    }
}

#[test]
fn gravity_and_tilt_are_taken_away() {
    for g in [-1.0f32, 0.0, 1.0] {
        let [pac, _] = run(8800, |_| g / iis3dwb::G_PER_LSB, noisy);
        let last = pac.last().unwrap();
        assert!((last - 2048.0).abs() <= 1.0, "{g} g: {last}");
    }
    // a hand that turns by a right angle in a second
    let [pac, _] = run(4400, |s| (TAU / 4.0 * s).sin() / iis3dwb::G_PER_LSB, noisy);
    assert!(pac.iter().all(|c| (c - 2048.0).abs() < 40.0));
}

#[test]
fn the_cell_reads_forces_and_is_held() {
    assert!((MN_PER_COUNT - 9.352).abs() < 1e-3);
    for (newton, counts) in [(0.0, 1000.0), (1.0, 1107.0), (-1.0, 893.0), (10.0, 2069.0)] {
        let lsb = (newton * 109_492.0) as i32;
        let [_, pdc] = run(400, |_| 0.0, |n| lsb + noisy(n));
        assert!(pdc.iter().all(|c| (c - counts).abs() <= 1.0), "{newton} N");
    }
}

#[test]
fn a_cell_that_stops_is_noticed_after_five_reads() {
    let mut finger = Mems::new();
    let mut lost = None;
    for n in 0..4000 {
        let cell = noisy(n.min(2000) / 4 * 4);
        let sample = finger.sample(n, &answer(n, 0, cell));
        if n % 2 == 1 && n > 100 {
            match sample {
                Ok(_) => assert_eq!(lost, None, "it does not come back"),
                Err(why) => {
                    assert_eq!(why, FingerError::Stale);
                    lost.get_or_insert(n);
                }
            }
        }
    }
    // its last conversion was read at 2001 first
    assert_eq!(lost, Some(2001 + 4 * 4));
}

#[test]
fn what_is_read_twice_is_no_fault() {
    // two conversions that happen to be equal, one of them read twice
    let [_, pdc] = run(4400, |_| 0.0, |n| noisy((n / 4).next_multiple_of(4)));
    assert_eq!(pdc.len(), 2150);
    // every eleventh read finds no new conversion
    let [_, pdc] = run(4400, |_| 0.0, |n| noisy(n / 4 - n / 44));
    assert_eq!(pdc.len(), 2150);
}

#[test]
fn a_brown_out_and_an_open_wire_are_named() {
    let mut finger = Mems::new();
    for n in 0..40 {
        let _ = finger.sample(n, &answer(n, 0, noisy(n)));
    }
    assert!(finger.sample(40, &answer(40, 0, 1)).is_ok());
    for n in 41..43 {
        let _ = finger.sample(n, &answer(n, 0, 5));
    }
    let mut off = answer(43, 0, 0);
    *off.last_mut().unwrap() = 0x00;
    assert!(finger.sample(43, &off).is_ok(), "P_DC is heard still");
    assert_eq!(finger.sample(44, &answer(44, 0, 0)), Err(FingerError::Off));
    for end in [0x7F_FFFF, -0x80_0000] {
        assert_eq!(
            finger.sample(45, &answer(45, 0, end)),
            Err(FingerError::Cell)
        );
    }
    assert_eq!(finger.sample(46, &[0, 0]), Err(FingerError::Silent));
    // nobody on the line
    assert_eq!(finger.sample(49, &[0xFF; 6]), Err(FingerError::Silent));
    assert_eq!(finger.sample(51, &[0xFF; 4]), Err(FingerError::Begins));
    assert_eq!(finger.sample(52, &[0xFF; 3]), Err(FingerError::Off));
}

#[test]
fn an_acceleration_beyond_the_range_is_clipped() {
    let [pac, _] = run(
        400,
        |s| {
            40_000.0f32
                .copysign((TAU * 100.0 * s).sin())
                .clamp(-32_768.0, 32_767.0)
        },
        noisy,
    );
    assert!(pac.iter().all(|c| [0.0, 4095.0].contains(c)));
}

#[test]
fn it_begins_with_nothing() {
    let mut finger = Mems::new();
    assert_eq!(finger.sample(0, &answer(0, 0, 0)), Err(FingerError::Begins));
    assert_eq!(
        Mems::new().sample(3, &answer(3, 0, 0)),
        Err(FingerError::Begins)
    );
}
