use super::*;
use crate::tests::bench::{correlation, deviation};

fn stage_at(position_mm: f64) -> Stage {
    let mut stage = Stage::new(position_mm, 1, 2);
    stage.enabled = true;
    stage
}

fn run(stage: &mut Stage, seconds: f64, shear_n: f64) {
    for _ in 0..(seconds / TICK_S) as u32 {
        stage.tick(shear_n);
    }
}

/// A stage without what differs over its travel.
fn plain() -> Stage {
    Stage {
        friction_scale: 1.0,
        ..stage_at(5.0)
    }
}

/// Means over a window that begins at 20 mm and is whole revolutions long.
fn steady(stage: &mut Stage, shear_n: f64, window_mm: f64) -> (f64, f64) {
    while stage.position_mm < 20.0 {
        stage.tick(shear_n);
        assert!(stage.speed_mm_s < 200.0);
    }
    let (mut ticks, mut current) = (0.0, 0.0);
    while stage.position_mm < 20.0 + window_mm {
        stage.tick(shear_n);
        ticks += 1.0;
        current += stage.current_a;
    }
    (window_mm / (ticks * TICK_S), current / ticks)
}

/// By hand, from R i = V - K v and K i = F_dry + b v, K = 2 pi 0.0261 / 0.01 = 16.399:
/// v = (K V / R - F_dry) / (K^2 / R + b).
/// At 1.2 V: (2.6239 - 0.6) / (35.858 + 2) = 53.46 mm/s, i = (0.6 + 0.1069) / 16.399 = 43.1 mA.
/// At 2.4 V: (5.2477 - 0.6) / 37.858 = 122.77 mm/s, i = (0.6 + 0.2455) / 16.399 = 51.6 mA.
#[test]
fn a_duty_gives_the_speed_and_the_current_of_the_equations() {
    for (duty, speed_mm_s, current_a) in [(0.1, 53.46, 0.0431), (0.2, 122.77, 0.0516)] {
        let mut stage = plain();
        stage.set_duty(duty);
        let (speed, current) = steady(&mut stage, 0.0, 40.0);
        assert!((speed / speed_mm_s - 1.0).abs() < 0.01, "{speed}");
        assert!((current / current_a - 1.0).abs() < 0.02, "{current}");
    }
}

#[test]
fn speed_rises_with_the_time_constant_of_mass_and_motor() {
    // without dry friction v = v_end (1 - exp(-t / tau)), tau = mass / (K^2 / R + b) = 1.2343 / 37.858 = 32.6 ms
    let mut stage = Stage {
        friction_scale: 0.0,
        ..stage_at(5.0)
    };
    assert!((MASS_KG - 1.2343).abs() < 1e-4);
    stage.set_duty(0.2);
    run(&mut stage, 0.0326, 0.0);
    // v_end = 5.2477 / 37.858 = 138.6 mm/s; torque ripple of 2 % aside
    let share = stage.speed_mm_s / 138.6;
    assert!((share - 0.632).abs() < 0.02, "{share}");
}

/// The paper's inclined stage: weights on it, current at constant speed.
#[test]
fn current_is_linear_in_shear() {
    let shears: Vec<f64> = (0..=10).map(|i| 0.2 * f64::from(i)).collect();
    let current = |shear_n: &f64| {
        let mut stage = stage_at(5.0);
        stage.set_duty(0.25);
        steady(&mut stage, -shear_n, 40.0).1
    };
    let currents: Vec<f64> = shears.iter().map(current).collect();
    let r = correlation(&shears, &currents);
    assert!(r * r > 0.999, "{r}");
    // the speed falls with the load, and the viscous friction with it: b / (K^2 / R + b) of the slope is 5 %
    let slope = r * deviation(&currents) / deviation(&shears) * FORCE_N_PER_A;
    assert!((slope - (1.0 - 2.0 / 37.858)).abs() < 0.01, "{slope}");
}

#[test]
fn a_jammed_stage_draws_the_stall_current() {
    let mut stage = stage_at(40.0);
    stage.jammed = true;
    stage.set_duty(0.5);
    run(&mut stage, 0.05, 0.0);
    assert_eq!(stage.position_mm, 40.0);
    assert!((stage.current_a - 6.0 / 7.5).abs() < 1e-12);
    // 0.8 A at 1 V/A are 993 of 4096 counts over 3.3 V, within the errors of zero and gain
    let counts = i32::from(stage.adc(1)) - 2048 - 993;
    assert!(counts.abs() < 8 + 5 + 6, "{counts}");
    stage.set_duty(-1.0);
    run(&mut stage, 0.05, 0.0);
    assert!((stage.adc(1) as i32 - (2048 - 1986)).abs() < 8 + 10 + 6);
}

#[test]
fn a_small_duty_does_not_overcome_the_friction_of_rest() {
    let mut stage = plain();
    // 0.72 N need 44 mA, 0.33 V, 2.7 %
    stage.set_duty(0.024);
    run(&mut stage, 1.0, 0.0);
    assert_eq!(stage.position_mm, 5.0);
    stage.set_duty(0.031);
    run(&mut stage, 1.0, 0.0);
    assert!(stage.position_mm > 5.5);
}

#[test]
fn friction_differs_over_the_travel() {
    let friction = |position_mm: f64| Stage::new(position_mm, 1, 2).dry_friction_n();
    let all: Vec<f64> = (0..=85).map(|mm| friction(f64::from(mm))).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    let spread = all
        .iter()
        .map(|n| (n / mean - 1.0).abs())
        .fold(0.0, f64::max);
    assert!((0.02..0.05).contains(&spread), "{spread}");
    assert!(
        (mean / (COULOMB_N * BREAKAWAY) - 1.0).abs() < 0.05,
        "{mean}"
    );
    // the part of the screw comes back with each revolution; over half of one, only the other part is left
    let screw = |mm: f64| friction(mm) - friction(mm + 0.5 * LEAD_MM);
    assert!((screw(20.0) - screw(20.0 + LEAD_MM)).abs() < 0.012);
    let largest = (0..10)
        .map(|i| screw(20.0 + f64::from(i)))
        .fold(0.0, f64::max);
    assert!(
        (0.02..0.04).contains(&largest),
        "twice 2 % of 0.72 N: {largest}"
    );
}

#[test]
fn current_has_ripple_of_the_commutation() {
    let mut stage = stage_at(5.0);
    stage.set_duty(0.1);
    while stage.position_mm < 30.0 {
        stage.tick(0.0);
    }
    // one commutation per mm: correlate the current over 20 of them
    let (mut re, mut im, mut n, mut mean) = (0.0, 0.0, 0.0, 0.0);
    while stage.position_mm < 50.0 {
        stage.tick(0.0);
        let (sin, cos) = (stage.position_mm * TAU).sin_cos();
        re += stage.current_a * cos;
        im += stage.current_a * sin;
        mean += stage.current_a;
        n += 1.0;
    }
    let (ripple, mean) = (2.0 * f64::hypot(re, im) / n, mean / n);
    assert!((0.005..0.5).contains(&(ripple / mean)), "{}", ripple / mean);
}

#[test]
fn energy_is_accounted_for() {
    // electrical energy = heat in the winding + friction + kinetic energy, over a start, a run and a short-circuit
    // brake
    let mut stage = stage_at(10.0);
    let (mut put_in, mut heat, mut friction) = (0.0, 0.0, 0.0);
    for (duty, seconds) in [(0.2, 0.3), (0.0, 0.03)] {
        stage.set_duty(duty);
        for _ in 0..(seconds / TICK_S) as u32 {
            let dry = stage.dry_friction_n();
            stage.tick(-0.3);
            let v = stage.speed_mm_s * 1e-3;
            put_in += duty * SUPPLY_V * stage.current_a * TICK_S;
            heat += stage.current_a.powi(2) * RESISTANCE_OHM * TICK_S;
            friction += (dry + VISCOUS_N_S_PER_M * v + 0.3) * v * TICK_S;
        }
        let kinetic = 0.5 * MASS_KG * (stage.speed_mm_s * 1e-3).powi(2);
        let balance = (heat + friction + kinetic) / put_in;
        assert!((balance - 1.0).abs() < 0.01, "{balance}");
    }
}

#[test]
fn shorted_it_brakes_and_disabled_it_coasts() {
    let way = |disable: bool| {
        let mut stage = stage_at(10.0);
        stage.set_duty(0.17);
        run(&mut stage, 0.3, 0.0);
        assert!((stage.speed_mm_s - 100.0).abs() < 5.0);
        let from = stage.position_mm;
        stage.set_duty(0.0);
        stage.enabled = !disable;
        run(&mut stage, 0.001, 0.0);
        assert_eq!(stage.current_a == 0.0, disable);
        run(&mut stage, 0.5, 0.0);
        assert_eq!(stage.speed_mm_s, 0.0);
        stage.position_mm - from
    };
    // coasting: v^2 m / (2 F) = 0.01 * 1.2343 / 1.2 or a little less; shorted: with tau = 32.6 ms
    assert!((7.0..10.5).contains(&way(true)), "{}", way(true));
    assert!((2.0..3.3).contains(&way(false)), "{}", way(false));
}

#[test]
fn limit_switches_and_hard_stops() {
    let mut stage = stage_at(40.0);
    assert_eq!(stage.limits(), (false, false));
    for (duty, limits, closes_mm, stop_mm) in [
        (0.1, (false, true), TRAVEL_MM - LIMIT_MM, TRAVEL_MM),
        (-0.1, (true, false), LIMIT_MM, 0.0),
    ] {
        stage.set_duty(duty);
        while stage.limits() != limits {
            stage.tick(0.0);
        }
        assert!((stage.position_mm - closes_mm).abs() < 0.01);
        run(&mut stage, 1.0, 0.0);
        assert_eq!((stage.position_mm, stage.limits()), (stop_mm, limits));
        assert!(
            (stage.current_a.abs() - 1.2 / 7.5).abs() < 0.01,
            "pushes against the stop"
        );
        stage.set_duty(-duty);
        while stage.limits() == limits {
            stage.tick(0.0);
        }
        let opens_mm = (stage.position_mm - stop_mm).abs();
        assert!((opens_mm - LIMIT_MM - LIMIT_HYSTERESIS_MM).abs() < 0.01);
        stage.set_duty(0.0);
        run(&mut stage, 0.3, 0.0);
    }
}

#[test]
fn noise_of_the_reading_is_what_it_says() {
    let mut stage = stage_at(40.0);
    stage.jammed = true;
    stage.set_duty(0.013);
    stage.tick(0.0);
    let readings: Vec<f64> = (0..10_000)
        .map(|i| f64::from(stage.adc(i * 227_273)))
        .collect();
    let mean = readings.iter().sum::<f64>() / 1e4;
    let sd = (readings.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / 1e4).sqrt();
    // and 1/sqrt(12) of rounding
    assert!(
        (sd - (1.5f64.powi(2) + 1.0 / 12.0).sqrt()).abs() < 0.05,
        "{sd}"
    );
    let white: f64 = readings
        .windows(2)
        .map(|w| (w[0] - mean) * (w[1] - mean))
        .sum::<f64>()
        / 1e4
        / sd
        / sd;
    assert!(white.abs() < 0.04, "{white}");
    assert_eq!(stage.adc(5), stage.adc(5));
}

/// A bridge that is off while its PWM is low: the current is the integral of V = R i + L di/dt, a diode's way back
/// included.
#[test]
fn fast_decay_gives_the_current_of_its_equation() {
    for (duty, speed_mm_s) in [
        (0.08, 0.0),
        (0.1, 20.0),
        (-0.3, -100.0),
        (0.3, -30.0),
        (0.7, 50.0),
    ] {
        let mut stage = stage_at(40.0);
        stage.decays_fast = true;
        stage.set_duty(duty);
        stage.speed_mm_s = speed_mm_s;
        let emf_v = stage.along.force_n_per_a * speed_mm_s * 1e-3;
        let supply_v = SUPPLY_V * duty.signum();
        let inductance_h = TIME_CONSTANT_S * RESISTANCE_OHM;
        let (steps, mut current_a, mut mean_a) = (20_000, 0.0, 0.0);
        // until it repeats
        for _ in 0..8 {
            mean_a = 0.0;
            for step in 0..steps {
                let on = f64::from(step) < duty.abs() * f64::from(steps);
                let bridge_v = if on { supply_v } else { -supply_v };
                let change = (bridge_v - emf_v - RESISTANCE_OHM * current_a) / inductance_h;
                let before: f64 = current_a;
                current_a += change * PWM_S / f64::from(steps);
                if !on && current_a * duty.signum() < 0.0 {
                    current_a = 0.0;
                }
                mean_a += (before + current_a) / 2.0 / f64::from(steps);
            }
        }
        let found_a = stage.fast_current_a();
        assert!(
            (found_a - mean_a).abs() < 2e-4,
            "{duty} at {speed_mm_s}: {found_a} A, not {mean_a}"
        );
    }
}

/// Without duty a motor with slow decay is shorted and brakes; with fast decay it coasts, and no current flows.
#[test]
fn fast_decay_coasts_where_slow_decay_brakes() {
    let [slow, fast] = [false, true].map(|fast| {
        let mut stage = stage_at(40.0);
        stage.set_duty(0.08);
        run(&mut stage, 0.2, 0.0);
        assert!(stage.speed_mm_s > 30.0);
        let from_mm = stage.position_mm;
        stage.decays_fast = fast;
        stage.set_duty(0.0);
        run(&mut stage, 0.002, 0.0);
        let current_a = stage.current_a;
        run(&mut stage, 0.3, 0.0);
        assert_eq!(stage.speed_mm_s, 0.0);
        (current_a, stage.position_mm - from_mm)
    });
    assert!(slow.0 < -0.05 && fast.0 == 0.0, "{slow:?} {fast:?}");
    assert!(slow.1 < 0.8 && fast.1 > 1.0, "{slow:?} {fast:?}");
    // and at the duty that moves the one, the other stays where it is
    let mut stage = stage_at(40.0);
    stage.decays_fast = true;
    stage.set_duty(0.08);
    run(&mut stage, 0.5, 0.0);
    assert_eq!(stage.position_mm, 40.0);
}

/// The vibration has the periods of the screw's turns and of the commutation, the commanded amplitude, and is 0 at
/// rest.
#[test]
fn a_vibration_has_its_amplitude_and_its_frequencies() {
    let mut stage = plain();
    stage.vibration_um = 2.0;
    assert_eq!(stage.heave_mm(), 0.0);
    stage.speed_mm_s = 50.0;
    let heave: Vec<f64> = (0..1000)
        .map(|n| {
            stage.position_mm = f64::from(n) * 1e-3 * LEAD_MM;
            stage.heave_mm() * 1e3
        })
        .collect();
    // amplitudes of a Fourier series over one turn
    for (per_turn, share) in VIBRATIONS {
        let angle = |n: usize| n as f64 * 1e-3 * per_turn * TAU;
        let part = |f: fn(f64) -> f64| -> f64 {
            let products = heave.iter().enumerate().map(|(n, y)| y * f(angle(n)));
            products.sum::<f64>() / 500.0
        };
        let amplitude_um = part(f64::sin).hypot(part(f64::cos));
        assert!(
            (amplitude_um - share).abs() < 1e-6,
            "{per_turn} a turn: {amplitude_um} um"
        );
    }
}
