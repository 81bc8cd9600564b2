use super::*;
use crate::sensor::biotac;
use core::f32::consts::TAU;
use std::vec::Vec;

/// Counts of P_DC per newton, and of P_AC per count of P_DC.
const PER_N: f32 = 1.0 / 0.0115;
const PAC_PER_PDC: f32 = 99.1;

/// A finger that comes down with 800 steps/s on a sample, as P_DC and P_AC show it.
#[derive(Clone, Copy)]
struct Press {
    /// Compliance of the sample, mm/N.
    compliance: f32,
    /// Place from which the lever makes no more steps, or P_DC sticks, mm after contact.
    slips_mm: f32,
    sticks_mm: f32,
    /// Time in which the pressure runs out, s.
    leak_s: f32,
    /// P_AC: amplitude of the motor's hum, its frequency, and noise, counts.
    hum: (f32, f32),
    noise: f32,
}

const SOUND: Press = Press {
    compliance: 0.0,
    slips_mm: 99.0,
    sticks_mm: 99.0,
    leak_s: f32::INFINITY,
    hum: (2.0, 173.0),
    noise: 1.4,
};

/// Force on the ball of the finger at an indentation that it shares with the sample, N (Hertz: 2 N at 1.59 mm).
fn force_n(mm: f32, compliance: f32) -> f32 {
    let (mut low, mut high) = (0.0, mm.max(0.0));
    for _ in 0..40 {
        let skin = (low + high) / 2.0;
        let over = skin + compliance * skin * skin.sqrt() > mm;
        (low, high) = if over { (low, skin) } else { (skin, high) };
    }
    low * low.sqrt()
}

/// A number from -1 to 1 whose variance is a third, the same for the same seed.
fn noise(seed: &mut u32) -> f32 {
    *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    (*seed >> 8) as f32 / (1 << 23) as f32 - 1.0
}

impl Press {
    /// Presses to `target` counts from 1 mm above the sample: the fault, and the real force at the end, N.
    fn run(&self, target: f32, seed: u32) -> (Option<Fault>, f32) {
        let mut seed = seed.wrapping_mul(2_654_435_761);
        let calibration = Calibration::PAPER;
        let mut progress = Progress::new(&biotac::PARTS.model, Unguarded::default());
        progress.lifted();
        let phase = TAU * noise(&mut seed);
        let hum = |sample: u32, seed: &mut u32| {
            let at = sample as f32 / RATE_HZ as f32;
            2043.0
                + self.hum.0 * (TAU * self.hum.1 * at + phase).sin()
                + self.noise * 1.732 * noise(seed)
        };
        for sample in 0..1540 {
            progress.rest(hum(sample, &mut seed).round() as u16);
        }
        let (mut fluid_n, mut before_n, mut slow) = (0.0, 0.0, 0.0);
        let (mut shown, mut recent) = (0.0, Vec::new());
        let mut touches = false;
        for sample in 1540_u32.. {
            let steps = ((sample - 1540) as f32 * 800.0 / RATE_HZ as f32) as i32;
            let mm = steps as f32 * 0.625e-3 - 1.1;
            let at_mm = if mm > self.slips_mm {
                self.slips_mm + 0.1 * (mm - self.slips_mm)
            } else {
                mm
            };
            let force = force_n(at_mm, self.compliance);
            fluid_n += force - before_n - fluid_n / (self.leak_s * RATE_HZ as f32);
            before_n = force;
            let pressure = fluid_n * PER_N;
            slow += (pressure - slow) / (HIGH_PASS_S * RATE_HZ as f32);
            let pac = hum(sample, &mut seed) + PAC_PER_PDC * (pressure - slow);
            progress.hear(pac.round().clamp(0.0, 4095.0) as u16, &calibration);
            if mm < self.sticks_mm {
                shown = pressure;
            }
            recent.push((shown + 0.5 * noise(&mut seed)).round());
            let mean = recent.iter().rev().take(22).sum::<f32>() / 22.0;
            touches |= mean > 3.0;
            if let Err(fault) = progress.judge(steps, mean, touches) {
                return (Some(fault), force);
            }
            if mean >= target || mm > 15.0 {
                return (None, force);
            }
        }
        unreachable!("the lever has an end")
    }
}

const SOFT: [f32; 6] = [0.0, 0.1, 0.3, 0.8, 1.4, 3.0];
/// Counts of 0.2, 0.5, 1.26 and 2 N.
const TARGETS: [f32; 4] = [17.0, 43.0, 109.0, 173.0];

#[test]
fn whatever_gives_way_is_pressed_on() {
    for compliance in SOFT {
        for (seed, target) in (0..).zip(TARGETS.repeat(4)) {
            for (hum, pac_noise) in [
                ((2.0, 173.0), 1.4),
                ((30.0, 61.0), 4.8),
                ((25.0, 430.0), 4.8),
            ] {
                let press = Press {
                    compliance,
                    hum,
                    noise: pac_noise,
                    ..SOUND
                };
                let (fault, force) = press.run(target, seed);
                assert_eq!(fault, None, "{compliance} mm/N, {target} counts, {hum:?}");
                assert!((force * PER_N - target).abs() < 3.0, "{force} N");
            }
        }
    }
}

#[test]
fn a_dead_pressure_is_noticed_half_a_millimetre_after_contact() {
    for compliance in SOFT {
        for seed in 0..8 {
            let press = Press {
                compliance,
                sticks_mm: -1.0,
                ..SOUND
            };
            let (fault, force) = press.run(100.0, seed);
            assert_eq!(fault, Some(Fault::PressureDead), "{compliance} mm/N");
            assert!(
                force < force_n(0.65, compliance),
                "{compliance} mm/N: {force} N"
            );
        }
    }
}

#[test]
fn a_pressure_that_sticks_while_it_is_pressed_is_noticed() {
    for compliance in SOFT {
        for sticks_mm in [0.1, 0.3, 0.6, 1.0, 1.3, 1.55] {
            let press = Press {
                compliance,
                sticks_mm,
                ..SOUND
            };
            let (fault, force) = press.run(173.0, 1);
            assert_eq!(
                fault,
                Some(Fault::PressureDead),
                "{compliance} mm/N, {sticks_mm} mm"
            );
            assert!(force < 2.15, "{compliance} mm/N, {sticks_mm} mm: {force} N");
        }
    }
}

#[test]
fn a_lever_that_slips_is_told_from_a_dead_pressure() {
    for compliance in SOFT {
        for slips_mm in [0.2, 0.5, 1.0] {
            let press = Press {
                compliance,
                slips_mm,
                ..SOUND
            };
            let (fault, force) = press.run(173.0, 1);
            assert_eq!(
                fault,
                Some(Fault::LeverSlips),
                "{compliance} mm/N, {slips_mm} mm"
            );
            assert!(force < 2.0, "{force} N");
        }
    }
}

/// Up to the force that every rig may press with any leak, if it only holds a pressure for 0.2 s; up to 2 N where it is
/// quick.
#[test]
fn a_leaking_skin_is_not_pressed_too_hard() {
    // up to the softest of the simulated worlds
    for compliance in [0.0, 0.1, 0.3, 0.8, 1.4] {
        for leak_s in [0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 30.0] {
            for target in TARGETS {
                if target > 110.0 && leak_s > 2.5 {
                    continue;
                }
                let press = Press {
                    compliance,
                    leak_s,
                    ..SOUND
                };
                let (fault, force) = press.run(target, 1);
                assert!(
                    force < 2.1,
                    "{compliance} mm/N, {leak_s} s, {target} counts: {force} N, {fault:?}"
                );
            }
        }
    }
}

#[test]
fn what_is_not_looked_for_is_not_found() {
    let dead = Press {
        sticks_mm: -1.0,
        ..SOUND
    };
    assert_eq!(dead.run(100.0, 1).0, Some(Fault::PressureDead));
    let mut progress = Progress::new(
        &biotac::PARTS.model,
        Unguarded::against(Fault::PressureDead),
    );
    progress.lately = 9.0;
    for steps in 0..5000 {
        progress.of_piece = 9.0;
        assert_eq!(progress.judge(steps, 0.0, false), Ok(()));
    }
    progress.unguarded = Unguarded::default();
    progress.touched = Some(Mark {
        steps: 0,
        counts: 0.0,
    });
    assert_eq!(
        (0..=800).map(|s| progress.judge(s, 0.0, false)).last(),
        Some(Err(Fault::PressureDead))
    );
}

/// A knock against the bench does not count after its end: P_AC swings back.
#[test]
fn a_knock_is_no_contact() {
    let mut progress = Progress::new(&biotac::PARTS.model, Unguarded::default());
    progress.lifted();
    (0..440).for_each(|_| progress.rest(2043));
    let mut slow = 0.0;
    for sample in 0..22_000_u32 {
        // 20 counts of P_DC for 100 ms, every second
        let knock = if sample % 2200 < 220 { 20.0 } else { 0.0 };
        slow += (knock - slow) / (HIGH_PASS_S * RATE_HZ as f32);
        let pac = 2043.0 + PAC_PER_PDC * (knock - slow);
        progress.hear(pac.round() as u16, &Calibration::PAPER);
        let steps = (sample as f32 * 800.0 / RATE_HZ as f32) as i32;
        assert_eq!(progress.judge(steps, 0.0, false), Ok(()), "sample {sample}");
    }
}
