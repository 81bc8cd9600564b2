//! The finger by itself: fig. 3, noise, resonance, slip and wear.

use super::bench::{correlation, deviation, mean, sample, slide};
use crate::Conditions;
use crate::conditions::{TICK_S, TICKS_PER_S};
use crate::finger::{Contact, Finger, N_PER_COUNT, PAC_PA_PER_COUNT};
use crate::surface::Surface;
use crate::textures::draw;

/// Away from everything.
const FREE: Contact<'static> = Contact {
    indentation_mm: 0.0,
    surface: None,
    x_mm: 30.0,
    speed_mm_s: 0.0,
    lever_vibration: 0.0,
};

fn pressed(surface: &Surface, indentation_mm: f64) -> Contact<'_> {
    Contact {
        indentation_mm,
        surface: Some(surface),
        ..FREE
    }
}

fn seconds(s: f64) -> u32 {
    (s * f64::from(TICKS_PER_S)) as u32
}

#[test]
fn p_dc_is_linear_below_2_n_and_bends_above() {
    // fig. 3: loading and unloading, by R^2 and slope of the line
    let surface = sample(46, 1);
    let mut finger = Finger::new(3);
    let (mut counts, mut forces) = (Vec::new(), Vec::new());
    let ticks = seconds(8.0);
    for tick in 0..2 * ticks {
        let part = 1.0 - (f64::from(tick) / f64::from(ticks) - 1.0).abs();
        finger.tick(&pressed(&surface, 1.58 * part));
        if tick % 132 == 0 {
            counts.push(f64::from(finger.sample_channel(1, 1.0)));
            forces.push(finger.force_n());
        }
    }
    let r2 = correlation(&counts, &forces).powi(2);
    let slope = correlation(&counts, &forces) * deviation(&forces) / deviation(&counts);
    assert!((0.995..0.99999).contains(&r2));
    assert!((slope / N_PER_COUNT - 1.0).abs() < 0.03);

    let mut at = |mm: f64| {
        (0..seconds(2.0)).for_each(|_| finger.tick(&pressed(&surface, mm)));
        (
            finger.force_n(),
            mean((0..200).map(|_| f64::from(finger.sample_channel(1, 1.0)))),
        )
    };
    let (low, high, higher) = (at(1.2), at(1.55), at(1.95));
    let slope = |a: (f64, f64), b: (f64, f64)| (b.1 - a.1) / (b.0 - a.0);
    assert!(slope(high, higher) < 0.7 * slope(low, high));
}

#[test]
fn the_skin_relaxes_a_little_in_seconds() {
    let surface = sample(46, 1);
    let mut finger = Finger::new(3);
    // 0.5 mm/s, as the paper approaches
    for tick in 0..seconds(1.2) {
        finger.tick(&pressed(&surface, 0.5 * f64::from(tick) * TICK_S));
    }
    let first = finger.force_n();
    (0..seconds(8.0)).for_each(|_| finger.tick(&pressed(&surface, 0.6)));
    let fall = 1.0 - finger.force_n() / first;
    assert!((0.003..0.03).contains(&fall));
}

#[test]
fn noise_at_rest_is_that_of_the_paper_or_of_recordings() {
    let sample = |mut finger: Finger| {
        let (mut pac, mut pdc) = (Vec::new(), Vec::new());
        for _ in 0..seconds(2.0) / 6 {
            (0..6).for_each(|_| finger.tick(&FREE));
            pac.push(f64::from(finger.sample_channel(0, 0.5)));
            pdc.push(f64::from(finger.sample_channel(1, 0.5)));
        }
        (
            mean(pac.iter().copied()),
            deviation(&pac),
            mean(pdc.iter().copied()),
            deviation(&pdc),
        )
    };
    for seed in 0..5 {
        let (pac, pac_sd, pdc, pdc_sd) = sample(Finger::new(seed));
        // 0.52 Pa, and the rounding of the converter
        assert!((pac_sd * PAC_PA_PER_COUNT - 0.53).abs() < 0.03);
        assert!(
            (2039.9..2045.1).contains(&pac) && (2583.0..2695.0).contains(&pdc) && pdc_sd <= 0.5
        );
    }
}

#[test]
fn the_rest_of_p_dc_drifts_slowly() {
    let mut finger = Finger::new(2);
    let rests: Vec<f64> = (0..30)
        .map(|_| {
            (0..seconds(10.0)).for_each(|_| finger.tick(&FREE));
            mean((0..400).map(|_| f64::from(finger.sample_channel(1, 0.0))))
        })
        .collect();
    let steps: Vec<f64> = rests.windows(2).map(|w| w[1] - w[0]).collect();
    assert!(deviation(&rests) > 0.1 && rests.iter().all(|r| (r - rests[0]).abs() < 10.0));
    assert!(steps.iter().all(|s| s.abs() < 1.0));
}

#[test]
fn p_ac_clips_at_its_range_of_764_pa() {
    let mut finger = Finger::new(1);
    let mut seen = Vec::new();
    for tick in 0..seconds(0.2) {
        let lever_vibration = 3000.0 * (f64::from(tick) * 0.1).sin();
        finger.tick(&Contact {
            lever_vibration,
            ..FREE
        });
        seen.push(finger.sample_channel(0, 1.0));
    }
    assert_eq!(
        (seen.iter().min(), seen.iter().max()),
        (Some(&0), Some(&4095))
    );
}

/// Amplitude of P_AC, Pa, for one of 10 Pa at this frequency in the fluid.
fn gain(indentation_mm: f64, hz: f64) -> f64 {
    let surface = sample(46, 1);
    let mut finger = Finger::new(1);
    let mut pac = Vec::new();
    for tick in 0..seconds(0.6) {
        let lever_vibration = 10.0 * (std::f64::consts::TAU * hz * f64::from(tick) * TICK_S).sin();
        finger.tick(&Contact {
            lever_vibration,
            ..pressed(&surface, indentation_mm)
        });
        if tick > seconds(0.3) {
            pac.push(f64::from(finger.sample_channel(0, 1.0)) * PAC_PA_PER_COUNT);
        }
    }
    deviation(&pac) * 2_f64.sqrt() / 10.0
}

#[test]
fn the_fluid_resonates_between_200_and_350_hz_and_higher_under_load() {
    let peak = |mm: f64| {
        let hz: Vec<f64> = (0..30).map(|i| 150.0 + 10.0 * f64::from(i)).collect();
        hz.iter()
            .map(|hz| (*hz, gain(mm, *hz)))
            .max_by(|a, b| a.1.total_cmp(&b.1))
            .unwrap()
    };
    let (light, heavy) = (peak(0.34), peak(1.5));
    println!("0.2 N: {light:.2?}; 1.8 N: {heavy:.2?} (Hz, gain)");
    assert!(light.0 >= 200.0 && heavy.0 <= 350.0 && heavy.0 > light.0 + 20.0);
    // damped more by force
    assert!(heavy.1 < light.1 && light.1 > 1.3);
    // the band of the amplifier: 10 to 1040 Hz
    let flat = gain(0.34, 50.0);
    assert!(gain(0.34, 3.0) < 0.4 * flat && gain(0.34, 1500.0) < 0.1 * flat);
}

#[test]
fn the_skin_stretches_breaks_away_and_then_slides_against_the_motion() {
    let surface = sample(47, 1);
    let stiction = surface.texture.stiction;
    for direction in [1.0, -1.0] {
        let mut finger = Finger::new(4);
        let mut contact = pressed(&surface, 0.6);
        let run = |finger: &mut Finger, contact: &mut Contact<'_>, s: f64| -> Vec<f64> {
            (0..seconds(s))
                .map(|_| {
                    finger.tick(contact);
                    contact.x_mm += contact.speed_mm_s * TICK_S;
                    finger.shear_n
                })
                .collect()
        };
        run(&mut finger, &mut contact, 0.3);
        assert_eq!(finger.shear_n, 0.0);
        contact.speed_mm_s = 10.0 * direction;
        let shear = run(&mut finger, &mut contact, 1.0);
        let peak = shear.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
        let steady = mean(shear[seconds(0.5) as usize..].iter().copied());
        assert!(steady * direction < -0.3, "opposes the motion");
        assert!(peak > steady.abs() * (1.0 + 0.5 * stiction));
        // before it slips, shear goes with the way
        assert!((shear[seconds(0.01) as usize].abs() - 0.1).abs() < 0.02);
        // stopped, it holds the strain; lifted, it is gone
        contact.speed_mm_s = 0.0;
        assert!(
            run(&mut finger, &mut contact, 0.2)
                .iter()
                .all(|s| s * direction < -0.3)
        );
        finger.tick(&FREE);
        assert_eq!(finger.shear_n, 0.0);
    }
}

#[test]
fn sliding_changes_p_dc_modestly() {
    let surface = sample(47, 1);
    let mut finger = Finger::new(4);
    let mut contact = pressed(&surface, 0.63);
    let counts = |finger: &mut Finger, contact: &mut Contact<'_>| {
        mean((0..seconds(0.5)).map(|_| {
            finger.tick(contact);
            contact.x_mm += contact.speed_mm_s * TICK_S;
            f64::from(finger.sample_channel(1, 1.0))
        }))
    };
    let free = counts(&mut finger, &mut FREE.clone());
    counts(&mut finger, &mut contact);
    let still = counts(&mut finger, &mut contact) - free;
    contact.speed_mm_s = 25.0;
    counts(&mut finger, &mut contact);
    let sliding = counts(&mut finger, &mut contact) - free;
    assert!((0.01..0.10).contains(&(sliding / still - 1.0).abs()));
}

#[test]
fn textures_differ_in_what_load_and_speed_do_to_their_vibrations() {
    // what catches and what clings, nothing that the ridges follow: its level goes with load and speed alone
    let texture = |clamped_n, vibration_speed, vibration_bend| {
        let mut texture = draw(2, 1);
        (texture.relief_um, texture.weave, texture.heterogeneity) = (0.0, None, 0.0);
        (texture.friction_load, texture.damping) = (0.0, 0.0);
        texture.clamped_n = clamped_n;
        (texture.vibration_speed, texture.vibration_bend) = (vibration_speed, vibration_bend);
        Surface::new(&texture, 1, 0.0)
    };
    let usual = texture(0.6, 0.0, 0.0);
    let level = |surface: &Surface, force: f64, speed: f64| {
        let mut finger = Finger::under(
            [3; 2],
            Conditions {
                variation: 0.0,
                ..Conditions::default()
            },
        );
        // roughness is ln of power: half of it is that of amplitude
        0.5 * slide(&mut finger, surface, force, speed, 1)
            .properties()
            .roughness
    };
    let gain = |surface, force, speed| level(surface, force, speed) - level(&usual, force, speed);
    let soon = texture(0.3, 0.0, 0.0);
    for force in [0.2_f64, 1.26] {
        // alike at 0.5 N
        let of = |clamped: f64| (1.0 + 0.5 / clamped) / (1.0 + force / clamped);
        let expected = f64::ln(of(0.3) / of(0.6));
        let gain = gain(&soon, force, 25.0);
        assert!(
            (gain - expected).abs() < 0.05,
            "{force} N: {gain:.3}, {expected:.3}"
        );
    }
    let rising = texture(0.6, 0.5, -0.3);
    for speed in [10.0_f64, 25.0, 63.1] {
        let faster = (speed / 25.1).ln();
        let expected = 0.5 * faster - 0.3 * faster * faster;
        let gain = gain(&rising, 0.5, speed);
        assert!(
            (gain - expected).abs() < 0.05,
            "{speed} mm/s: {gain:.3}, {expected:.3}"
        );
    }
}

#[test]
fn wear_shows_after_high_power_and_not_after_ordinary_slides() {
    let surface = sample(2, 1);
    let mut finger = Finger::new(6);
    let roughness = |finger: &mut Finger| -> (f64, f64) {
        let trials: Vec<f64> = (0..12)
            .map(|i| slide(finger, &surface, 0.2, 63.1, i).properties().roughness)
            .collect();
        (mean(trials.iter().copied()), deviation(&trials))
    };
    let (new, sd) = roughness(&mut finger);
    // the paper's three movements, 30 times
    for i in 0..30 {
        for (force, speed) in [(1.26, 10.0), (0.5, 25.1), (0.2, 63.1)] {
            slide(&mut finger, &surface, force, speed, i);
        }
    }
    let (used, ordinary) = (roughness(&mut finger).0, finger.wear);
    // the corner of the grid that the paper avoided
    for i in 0..60 {
        slide(&mut finger, &surface, 2.0, 100.0, i);
    }
    let (worn, high) = (roughness(&mut finger).0, finger.wear);
    assert!(ordinary < 0.02 && (used - new).abs() < sd);
    assert!(high > 10.0 * ordinary && new - worn > 2.0 * sd);
    finger.put_on_skin(0.0);
    assert!(finger.wear == 0.0 && (roughness(&mut finger).0 - new).abs() < sd);
}
