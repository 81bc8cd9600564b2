//! Textures and their samples.

use super::bench::{band, deviation, line, mean, sample, slide, spectrum};
use crate::TRIAL_VARIATION;
use crate::finger::Finger;
use crate::surface::Surface;
use crate::textures::{Group, TEXTURES, Weave, draw};

#[test]
fn the_textures_are_those_of_table_1() {
    for (i, named) in TEXTURES.iter().enumerate() {
        assert_eq!(usize::from(named.number), i + 1);
        assert_eq!(
            TEXTURES.iter().filter(|t| t.name == named.name).count(),
            1,
            "{}",
            named.name
        );
    }
    // the ends of the groups as the table's caption gives them
    let last = |group: Group| {
        TEXTURES
            .iter()
            .rposition(|t| t.group == group)
            .map(|i| i + 1)
    };
    use Group::*;
    let groups = [
        Paper,
        Art,
        Glass,
        Foam,
        Tile,
        Wood,
        Engineering,
        Rubber,
        Vinyl,
        Leather,
        Cotton,
        Fabric,
        Weave,
        Fur,
    ];
    let ends = [9, 23, 28, 31, 35, 38, 46, 54, 66, 72, 83, 99, 115, 117];
    for (group, end) in groups.into_iter().zip(ends) {
        assert_eq!(last(group), Some(end), "{group:?}");
    }
    assert_eq!(
        (TEXTURES[19].name, TEXTURES[99].name),
        ("Plastic mesh (5 mm)", "Burlap")
    );
}

#[test]
fn every_texture_of_every_world_is_one_that_could_be() {
    for seed in 0..20 {
        for number in 1..=117 {
            let t = draw(number, seed);
            assert_eq!(t, draw(number, seed));
            assert_ne!(t, draw(number, seed + 100));
            assert!((0.1..2.5).contains(&t.friction), "{t:?}");
            assert!(
                (0.01..40.0).contains(&t.fine_um) && (0.02..0.2).contains(&t.fine_mm),
                "{t:?}"
            );
            assert!(
                (0.1..400.0).contains(&t.relief_um) && (0.15..10.0).contains(&t.relief_mm),
                "{t:?}"
            );
            assert!((100.0..4000.0).contains(&t.impulse_hz), "{t:?}");
            assert!(
                (0.01..0.5).contains(&t.heterogeneity) && (0.0..0.9).contains(&t.damping),
                "{t:?}"
            );
            assert!(
                (0.05..5.0).contains(&t.clamped_n) && t.vibration_speed.abs() < 2.0,
                "{t:?}"
            );
            assert!(
                t.friction_load.abs() < 0.8
                    && t.friction_speed.abs() < 1.0
                    && t.friction_bend.abs() < 0.5,
                "{t:?}"
            );
            assert!(t.thickness_mm > 0.1 && t.compliance_mm_per_n < 2.0, "{t:?}");
        }
    }
}

#[test]
fn a_profile_has_the_heights_and_the_periods_of_its_texture() {
    let mut texture = draw(20, 1);
    texture.heterogeneity = 0.0;
    let surface = Surface::new(&texture, 3, TRIAL_VARIATION);
    let heights: Vec<f64> = (0..7500)
        .map(|i| surface.height_um(0.01 * f64::from(i)))
        .collect();
    let weave = texture.weave.unwrap();
    let expected =
        (weave.rms_um.powi(2) + texture.relief_um.powi(2) + texture.fine_um.powi(2)).sqrt();
    let rms = deviation(&heights);
    assert!(
        (rms / expected - 1.0).abs() < 0.1,
        "{rms:.1} um, {expected:.1} um"
    );
    // the plastic mesh repeats every 5 mm
    assert!((weave.wavelength_mm - 5.0).abs() < 0.25);
    let (period, half) = (weave.wavelength_mm, weave.wavelength_mm / 2.0);
    let likeness = |shift: f64| {
        mean(
            (0..6000)
                .map(|i| 0.01 * f64::from(i))
                .map(|x| surface.height_um(x) * surface.height_um(x + shift)),
        )
    };
    assert!(likeness(period) > 0.9 * likeness(0.0) && likeness(half) < 0.3 * likeness(0.0));
}

#[test]
fn friction_depends_on_speed_load_and_place() {
    let surface = sample(47, 1);
    let texture = &surface.texture;
    let at = |speed, load| surface.friction(30.0, speed, load);
    assert!((at(25.1, 1.26) / texture.friction - 1.0).abs() < 0.2);
    // a power of load; of speed one that bends about the speed at which it is quoted, and no more far beyond
    let (load, power, bend) = (
        texture.friction_load,
        texture.friction_speed,
        texture.friction_bend,
    );
    assert!(load != 0.0 && power != 0.0 && bend != 0.0);
    assert!((at(25.1, 2.0) / at(25.1, 0.2) - 10_f64.powf(load)).abs() < 1e-9);
    let ratio = |a, b| f64::ln(at(a, 0.5) / at(b, 0.5));
    assert!((ratio(50.2, 25.1) - 2_f64.ln() * (power + bend * 2_f64.ln())).abs() < 1e-9);
    assert!((ratio(12.55, 25.1) - 2_f64.ln() * (bend * 2_f64.ln() - power)).abs() < 1e-9);
    assert!((ratio(200.0, 100.0) - 2_f64.ln() * power).abs() < 1e-9);
    assert!((at(0.0, 0.5) / at(5.0, 0.5) - 1.0).abs() < 1e-9);
    let along: Vec<f64> = (0..75)
        .map(|x| surface.friction(f64::from(x), 25.1, 0.5))
        .collect();
    let relative = deviation(&along) / mean(along.iter().copied());
    assert!((0.002..0.1).contains(&relative), "{relative}");
    assert!(
        [f64::MIN, -1.0, 76.0, f64::MAX]
            .iter()
            .all(|x| surface.friction(*x, 0.0, 0.0) > 0.0)
    );
}

#[test]
fn the_mean_force_of_a_slide_is_that_of_the_press() {
    // nobody adjusts it (PAPER); what remains is the start on a crest or in a valley, and relaxation
    let mut finger = Finger::new(1);
    let mut errors: Vec<(f64, u8)> = (1..=117)
        .step_by(2)
        .map(|number| {
            (
                slide(&mut finger, &sample(number, 1), 0.5, 25.1, 1).force_n / 0.5 - 1.0,
                number,
            )
        })
        .collect();
    errors.sort_by(|a, b| a.0.abs().total_cmp(&b.0.abs()));
    assert!(errors[29].0.abs() < 0.01 && errors[55].0.abs() < 0.05);
}

#[test]
fn gratings_give_lines_at_v_over_lambda_and_its_harmonics() {
    // eq. 17, on a grating of 1.3 mm: not a multiple of the ridges
    let mut texture = draw(20, 1);
    texture.weave = Some(Weave {
        wavelength_mm: 1.3,
        ..texture.weave.unwrap()
    });
    // the laws of load and speed are those of an ordinary texture
    (texture.vibration_speed, texture.vibration_bend) = (0.0, 0.0);
    (texture.impulse_load, texture.impulse_bend) = (0.0, 0.0);
    texture.clamped_n = 0.6;
    let surface = Surface::new(&texture, 1, TRIAL_VARIATION);
    let mut finger = Finger::new(1);
    for speed in [25.1, 39.8, 63.1] {
        let slide = slide(&mut finger, &surface, 0.2, speed, 1);
        let hz = speed / 1.3;
        for harmonic in 1..=3 {
            let on = line(&slide.pac, f64::from(harmonic) * hz);
            let beside = line(&slide.pac, (f64::from(harmonic) + 0.5) * hz);
            assert!(on > 10.0 * beside, "{speed} mm/s, harmonic {harmonic}");
        }
    }
}

#[test]
fn smooth_textures_have_a_spectrum_that_falls_and_no_lines() {
    // Results: featureless textures give 1/f noise
    let mut finger = Finger::new(1);
    for number in [46, 47] {
        let slides: Vec<_> = (0..6)
            .map(|i| spectrum(&slide(&mut finger, &sample(number, 2), 0.5, 25.1, i).pac))
            .collect();
        let octave = |hz: f64| mean(slides.iter().map(|s| band(s, hz, 2.0 * hz))) / hz;
        // density an octave up, over the octaves below the resonance
        assert!(
            octave(60.0) < 0.8 * octave(25.0) && octave(450.0) < 0.3 * octave(200.0),
            "{number}"
        );
    }
}
