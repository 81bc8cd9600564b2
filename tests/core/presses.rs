//! Presses on soft and hard things, with P_DC sound, dead, dying and leaking. What counts is the world's own force.
//!
//! The whole campaign takes about an hour: `cargo xtask campaign press`, which gives a world by `TACTUS_PRESSES_WORLD`;
//! every seventh rig of it with `TACTUS_PRESSES_EVERY=7`.

use rayon::prelude::*;
use tactus_core::features::Movement;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::{Ended, Fault, Phase};
use tactus_core::sensor::FingerName;
use tactus_lab::sim::collection::Collection;
use tactus_lab::sim::rig::{FORCE_LIMIT_N, SimRig};
use tactus_tests::{count, seeds};
use tactus_world::faults::Fault as Cause;
use tactus_world::mount::Mount;
use tactus_world::world::Setup;

use crate::press::{self, Bench, Campaign, Press, Trouble};
use crate::rigs::texture;

/// Objects to presses that were too hard, and to sound ones that were refused.
fn judge(presses: &[Press]) {
    println!("{} presses", presses.len());
    let progress = [Fault::PressureDead, Fault::LeverSlips].map(|fault| Err(fault.into()));
    let refused = |p: &Press| p.bench.trouble == Trouble::Sound && progress.contains(&p.ended);
    let wrong = presses.iter().filter(|p| p.is_too_hard() || refused(p));
    let wrong: Vec<_> = wrong.take(40).map(ToString::to_string).collect();
    assert_eq!(wrong, [""; 0]);
}

#[test]
fn a_sample_of_the_campaign_presses_nothing_too_hard() {
    let campaign = Campaign {
        worlds: 1..=100,
        every: 1999 / count(5, 1) as usize,
        unguarded: Unguarded::default(),
    };
    judge(&campaign.run(|| ()));
}

#[test]
#[ignore = "an hour"]
fn the_whole_campaign_presses_nothing_too_hard() {
    let every = std::env::var("TACTUS_PRESSES_EVERY");
    let world = std::env::var("TACTUS_PRESSES_WORLD");
    let world = world.as_ref().map(|text| text.parse().unwrap());
    for unguarded in [Unguarded::default(), Unguarded::against(Fault::ForceHigh)] {
        let campaign = Campaign {
            worlds: world.map_or(1..=100, |world| world..=world),
            every: every.as_ref().map_or(1, |text| text.parse().unwrap()),
            unguarded,
        };
        println!("{unguarded:?}");
        judge(&campaign.run(|| ()));
    }
}

/// The guard is what holds the force back: without it a dead P_DC presses too hard.
#[test]
fn without_the_guard_a_dead_pressure_crushes_the_finger() {
    let presses = |unguarded| {
        let bench = Bench {
            world: 1,
            texture: 45,
            trouble: Trouble::Dead,
            unguarded,
            mount: Mount::STIFF,
        };
        bench.run()
    };
    let guarded = presses(Unguarded::default());
    let dead = Err(Fault::PressureDead.into());
    for press in &guarded {
        assert!(press.ended == dead && press.force_max_n < 1.0, "{press}");
    }
    let unguarded = presses(Unguarded::against(Fault::PressureDead));
    assert!(unguarded.iter().any(Press::is_too_hard), "{}", unguarded[0]);
}

/// Soft foam gives way by more than 3 mm on the way to 2 N, and is no lever that slips.
#[test]
fn the_softest_foam_is_pressed_with_two_newtons() {
    for world in [2, 3, 4711, 4712] {
        let bench = Bench {
            world,
            texture: 30,
            trouble: Trouble::Sound,
            unguarded: Unguarded::against(Fault::ForceHigh),
            mount: Mount::STIFF,
        };
        for press in bench.run() {
            let wanted_n = f64::from(press.movement.force_n());
            assert_eq!(press.ended, Ok(Ended::Whole), "{press}");
            assert!(press.force_max_n > 0.9 * wanted_n, "{press}");
            assert!(!press.is_too_hard(), "{press}");
        }
    }
}

/// A rig over a stiff, a soft, a rough and a furry sample: of world 1 in the test command.
fn rigs() -> Vec<(String, SimRig)> {
    let samples =
        (1..=count(2, 1)).flat_map(|world| [45, 30, 100, 117].map(|texture| (world, texture)));
    let rig = |(seed, texture)| {
        let world = Collection::new(seed, Vec::new(), 1);
        let setup = Setup {
            shimmed: true,
            ..world.setup(texture, 950)
        };
        (format!("world {seed}, T{texture}"), SimRig::new(setup))
    };
    samples.map(rig).collect()
}

/// Presses while the skin leaks in so many seconds, from this share of the force on.
fn leaks(sample: &str, rig: &mut SimRig, force_mn: u16, each_s: &[f64], shares: &[f64]) {
    let movement = Movement::new(force_mn, 39_811).unwrap();
    // every third of them in the test command, at each force others
    let step = 3 / count(3, 1) as usize;
    for &seconds in each_s
        .iter()
        .skip(usize::from(force_mn) % step)
        .step_by(step)
    {
        for &share in shares {
            let leak = Some((Cause::SkinLeaks { seconds }, share));
            let ended = press::make(rig, movement, leak);
            let most_n = rig.world().truth().force_max_n;
            assert!(
                most_n <= FORCE_LIMIT_N,
                "{sample}, {movement}, {seconds} s at {share}: {most_n:.2} N, {ended:?}"
            );
        }
    }
}

/// At the forces that a probe makes, however slowly the skin leaks.
#[test]
fn no_leak_of_a_tenth_of_a_second_or_more_presses_too_hard() {
    const SECONDS: [f64; 10] = [0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0];
    rigs().into_par_iter().for_each(|(sample, mut rig)| {
        for force_mn in [200, 500, 1259] {
            leaks(&sample, &mut rig, force_mn, &SECONDS, &[0.0, 0.5]);
        }
    });
}

/// Over seconds a leak looks like a sample that gives way: beyond the probe's forces the lever stands on its way and
/// looks.
#[test]
fn no_slow_leak_presses_too_hard_at_two_newtons() {
    const SECONDS: [f64; 12] = [
        0.1, 0.5, 2.0, 3.0, 5.0, 7.0, 10.0, 14.0, 20.0, 30.0, 50.0, 100.0,
    ];
    rigs().into_par_iter().for_each(|(sample, mut rig)| {
        rig.control().allow_high_force(true);
        for force_mn in [1585, 1995] {
            let movement = Movement::new(force_mn, 39_811).unwrap();
            // near 2 N the guard may end the slide, and nothing else
            let sound = press::make(&mut rig, movement, None);
            let good = sound == Ok(Ended::Whole) || sound == Err(Fault::ForceHigh.into());
            assert!(good, "{sample}, {movement}: {sound:?}");
            leaks(
                &sample,
                &mut rig,
                force_mn,
                &SECONDS,
                &[0.0, 0.3, 0.55, 0.8],
            );
        }
    });
}

/// A skin that tears at once shows contact in neither signal: the place of the last contact has to stop the lever.
#[test]
fn a_torn_skin_is_not_pressed_further_than_a_sound_one() {
    for (sample, mut rig) in rigs() {
        for seconds in [0.0, 0.01, 0.05] {
            let movement = Movement::new(500, 39_811).unwrap();
            assert_eq!(
                press::make(&mut rig, movement, None),
                Ok(Ended::Whole),
                "{sample}"
            );
            let torn = Some((Cause::SkinLeaks { seconds }, 0.0));
            let ended = press::make(&mut rig, movement, torn);
            let most_n = rig.world().truth().force_max_n;
            assert!(
                most_n < 1.5 && ended.is_err(),
                "{sample}, {seconds} s: {most_n:.2} N, {ended:?}"
            );
        }
    }
}

/// Where nothing was felt before, no signal shows a torn skin: what keeps the finger whole then is a mount that yields.
#[test]
fn a_sprung_mount_holds_a_torn_finger_at_its_first_press() {
    let mut hardest_n = [0.0_f64; 2];
    for (sprung, hardest_n) in [true, false].into_iter().zip(&mut hardest_n) {
        for (sample, mut rig) in rigs() {
            if sprung {
                rig.world().mount(Mount::SPRUNG);
            }
            for force_mn in [200, 1259] {
                let movement = Movement::new(force_mn, 39_811).unwrap();
                // it yields to none of the probe's own forces
                let ended = press::make(&mut rig, movement, None);
                assert_eq!(ended, Ok(Ended::Whole), "{sample}, {movement}");
                assert_eq!(rig.world().truth().mount_mm, 0.0, "{sample}, {movement}");
                for seconds in [0.0, 0.01, 0.05] {
                    rig.control().sample_changed();
                    let torn = Some((Cause::SkinLeaks { seconds }, 0.0));
                    let ended = press::make(&mut rig, movement, torn);
                    let most_n = rig.world().truth().force_max_n;
                    let case = format!("{sample}, {movement}, {seconds} s: {most_n:.2} N");
                    assert!(ended.is_err(), "{case}");
                    assert!(!sprung || most_n <= FORCE_LIMIT_N, "{case}");
                    *hardest_n = hardest_n.max(most_n);
                }
            }
        }
    }
    // else this would show nothing of the mount
    let [with, without] = hardest_n;
    println!("with the mount {with:.2} N at most, without it {without:.2} N");
    assert!(without > 8.0, "{without:.2} N");
}

/// The work of one rig from power-up to the second press.
struct Pressed {
    name: String,
    ready_s: f64,
    /// From the command until the finger is pressed, s: where the sample is not known, and where it is.
    pressed_s: [f64; 2],
    /// Largest share of what was asked for on the way, and by how much it was off when the stage began to move.
    most: f64,
    off_n: f64,
    /// Where the stage is by its encoder, less where it is, mm.
    stage_off_mm: f64,
}

fn two_presses(finger: FingerName, seed: u64) -> Pressed {
    let collection = Collection::new(seed, Vec::new(), 1).touched_by(finger);
    let texture = texture(seed);
    let setup = Setup {
        shimmed: true,
        ..collection.setup(texture, 1)
    };
    let name = format!("{finger}, seed {seed}, texture {texture}");
    let mut rig = SimRig::new(setup);
    rig.home().unwrap_or_else(|why| panic!("{name}: {why}"));
    let ready_s = rig.now().as_secs_f64();
    let stage_mm = rig.world().truth().stage_mm;
    let mut pressed = Pressed {
        ready_s,
        pressed_s: [0.0; 2],
        most: 0.0,
        off_n: 0.0,
        stage_off_mm: f64::from(rig.control().stage_mm()) - stage_mm,
        name,
    };
    // the lightest, then another
    for (at, mn) in [100, 500].into_iter().enumerate() {
        let (began_s, wanted_n) = (rig.now().as_secs_f64(), f64::from(mn) * 1e-3);
        rig.world().reset_extremes();
        let movement = Movement::new(mn, 63_100).unwrap();
        rig.control().start(movement, 0.3).unwrap();
        while rig.control().phase() != Phase::Background {
            rig.tick();
            let phase = rig.control().phase();
            let pressing = matches!(
                phase,
                Phase::Positioning | Phase::Pressing | Phase::Background
            );
            assert!(pressing, "{}: {phase:?}", pressed.name);
        }
        pressed.pressed_s[at] = rig.now().as_secs_f64() - began_s;
        pressed.most = pressed.most.max(rig.world().truth().force_max_n / wanted_n);
        while rig.control().phase() != Phase::Sliding {
            rig.tick();
        }
        let off_n = (rig.world().truth().force_n - wanted_n).abs();
        // a count of a BioTac, or 5 %
        pressed.off_n = pressed.off_n.max(off_n / (0.05 * wanted_n).max(0.0115));
        rig.rest(|_| ()).unwrap();
    }
    pressed
}

/// Rigs of each finger: soon ready, soon pressed, and never by much more than was asked for.
#[test]
fn a_rig_is_soon_ready_and_presses_soon_and_no_harder() {
    for finger in [FingerName::Biotac, FingerName::Analog, FingerName::Mems] {
        let seeds: Vec<u64> = seeds(50).collect();
        let rigs = seeds.into_par_iter().map(|seed| two_presses(finger, seed));
        let rigs: Vec<Pressed> = rigs.collect();
        // median, largest, smallest
        let sorted = |of: fn(&Pressed) -> f64| {
            let mut values: Vec<f64> = rigs.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            (
                values[values.len() / 2],
                values[values.len() - 1],
                values[0],
            )
        };
        for rig in &rigs {
            let (name, most, off) = (&rig.name, rig.most, rig.off_n);
            assert!(most < 1.15, "{name}: {most} of what was asked for");
            assert!(off < 1.0, "{name}: off by {off} of what may be");
        }
        let ready = sorted(|rig| rig.ready_s);
        let pressed = [
            sorted(|rig| rig.pressed_s[0]),
            sorted(|rig| rig.pressed_s[1]),
        ];
        let stage = sorted(|rig| rig.stage_off_mm);
        println!("{finger}: ready {ready:.2?}, pressed {pressed:.2?}, stage {stage:.3?}");
        assert!(ready.0 < 5.0 && ready.1 < 7.0, "{ready:?}");
        assert!(pressed[0].0 < 6.0 && pressed[1].0 < 5.0, "{pressed:?}");
        // the switch is touched slowly: it closes at the same place
        assert!(stage.1 - stage.2 < 0.1, "{stage:?}");
    }
}
