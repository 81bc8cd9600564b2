//! Ways to crush a finger that no guard of a movement sees: judged by the world's force.

use rayon::prelude::*;
use tactus_core::features::Movement;
use tactus_core::rig::guard::Unguarded;
use tactus_core::rig::{Ended, Fault, Phase};
use tactus_lab::sim::rig::SimRig;
use tactus_tests::seeds;
use tactus_world::faults::Fault as Cause;
use tactus_world::mount::Mount;
use tactus_world::world::Setup;

use crate::rigs::{assert_all, homed, setup, start, texture, wait};

/// A rig that nobody has calibrated, its DIR inverted from power-up on, over one of the samples.
fn inverted(seed: u64) -> SimRig {
    let mut rig = SimRig::new(Setup {
        finger_seed: seed,
        ..setup(texture(seed), seed)
    });
    rig.world().inject(Cause::LeverDirInverted);
    rig
}

/// The greatest force of so many homings, N, each after a reset, whatever came of the one before.
fn homed_again_and_again(rig: &mut SimRig, times: u32) -> f64 {
    for _ in 0..times {
        let _ = rig.control().reset();
        let _ = rig.home();
    }
    rig.world().truth().force_max_n
}

/// Up is down. The first homing presses until the guard sees it; the zero that it began with must not be forgotten
/// then.
#[test]
fn a_homing_that_goes_down_adds_no_force_to_the_last_one() {
    assert_all(seeds(50).collect(), |&seed| {
        let mut rig = inverted(seed);
        let once_n = homed_again_and_again(&mut rig, 1);
        let often_n = homed_again_and_again(&mut rig, 7);
        let is_right = once_n <= 2.2 && often_n <= once_n + 1e-3;
        let said = format!("{seed}: {once_n:.2} N, {often_n:.2} N after eight homings");
        if is_right { Ok(()) } else { Err(said) }
    });
}

/// DIR turns round while the finger presses, and then it is to be lifted.
#[test]
fn a_lift_that_goes_down_is_given_up_in_time() {
    assert_all(seeds(200).collect(), |&seed| {
        let mut rig = homed(sample(seed), Unguarded::default());
        start(&mut rig, Movement::FOR_TRACTION, Phase::Sliding);
        rig.world().inject(Cause::LeverDirInverted);
        rig.control().stop();
        let _ = rig.rest(|_| ());
        let lifted_n = rig.world().truth().force_max_n;
        let often_n = homed_again_and_again(&mut rig, 7);
        let said = format!("{seed}: {lifted_n:.2} N, then {often_n:.2} N by lifting");
        if often_n <= 2.2 { Ok(()) } else { Err(said) }
    });
}

fn sample(seed: u64) -> Setup {
    Setup {
        texture: texture(seed),
        trial_seed: seed,
        ..Setup::default()
    }
}

/// DIR turns round while the finger hangs over its sample: when it goes up to its switch, to wait there, it comes down.
/// P_DC sees it; where that is dead, too, the spring of the mount holds it.
#[test]
fn a_finger_that_is_parked_downwards_is_given_up_in_time() {
    for (dead, limits_n) in [(false, 0.05..0.5), (true, 0.0..2.2)] {
        let parked = |seed: u64| {
            let mut rig = SimRig::new(sample(seed));
            rig.world().mount(Mount::SPRUNG);
            rig.home().unwrap();
            rig.slide(Movement::FOR_ROUGHNESS, 0.5, |_, _| ()).unwrap();
            rig.world().inject(Cause::LeverDirInverted);
            if dead {
                rig.world().inject(Cause::PdcStuck);
            }
            rig.world().reset_extremes();
            wait(&mut rig, 15_000);
            let Phase::Faulted(fault) = rig.control().phase() else {
                panic!("{seed}: {:?}", rig.control().phase());
            };
            assert!(fault.recovery().contains("knob"), "{seed}: {fault}");
            homed_again_and_again(&mut rig, 7)
        };
        let seeds: Vec<u64> = seeds(50).collect();
        let forces: Vec<f64> = seeds.into_par_iter().map(parked).collect();
        let most_n = forces.into_iter().fold(0.0, f64::max);
        println!("at most {most_n:.2} N, P_DC dead: {dead}");
        assert!(limits_n.contains(&most_n), "{most_n} N, P_DC dead: {dead}");
    }
}

/// The screw locks itself: a finger that is still pressed when nothing moves any more is freed by the knob alone, and
/// whoever reads of the fault is told so.
#[test]
fn who_has_to_turn_the_knob_is_told_of_it() {
    let mut rig = inverted(3);
    homed_again_and_again(&mut rig, 1);
    let Phase::Faulted(fault) = rig.control().phase() else {
        panic!("{:?}", rig.control().phase());
    };
    wait(&mut rig, 60_000);
    let pressed_n = rig.world().truth().force_n;
    assert!(pressed_n > 0.05, "nobody has lifted it: {pressed_n} N");
    for fault in [fault, Fault::ForceHigh, Fault::LeverNotHome] {
        let told = fault.recovery();
        assert!(told.contains("knob"), "no word of the knob: {told}");
    }
    // and then it works
    assert!(rig.world().turn_knob(3.0));
    assert_eq!(rig.world().truth().indentation_mm.max(0.0), 0.0);
    rig.world().clear();
    rig.control().reset().unwrap();
    rig.home().unwrap();
    rig.slide(Movement::FOR_ROUGHNESS, 0.5, |_, _| ()).unwrap();
}

/// A spark nearby is no emergency stop: what is shorter than the contact's own bouncing says nothing.
#[test]
fn a_disturbance_of_the_stops_wire_ends_no_slide() {
    for us in [100, 1_000, 2_000] {
        let mut rig = SimRig::new(Setup::default());
        rig.home().unwrap();
        let now_ns = rig.now().as_nanos() as u64;
        for n in 0..400 {
            let at_ns = now_ns + n * 23_700_000;
            rig.world().schedule(at_ns, Cause::EStopGlitch { us });
        }
        let slid = rig.slide(Movement::FOR_ROUGHNESS, 0.5, |_, _| ());
        assert_eq!(slid, Ok(Ended::Whole), "{us} us: {}", slid.unwrap_err());
    }
}

/// The stop's second contact takes the motors' supply: no program has to do anything for that.
#[test]
fn a_stop_needs_no_program() {
    for (seed, running) in [(1, Phase::Pressing), (2, Phase::Sliding)] {
        let setup = Setup {
            trial_seed: seed,
            ..Setup::default()
        };
        let mut rig = homed(setup, Unguarded::against(Fault::EStop));
        rig.control().start(Movement::FOR_TRACTION, 0.3).unwrap();
        while rig.control().phase() != running || rig.world().truth().force_n < 0.2 {
            rig.tick();
        }
        let before = rig.world().truth();
        rig.world().inject(Cause::EStop);
        rig.world().reset_extremes();
        wait(&mut rig, 3_000);
        let after = rig.world().truth();
        assert_eq!(after.tip_mm, before.tip_mm, "{running:?}");
        assert_eq!(after.speed_mm_s, 0.0, "{running:?}");
        let far_mm = (after.stage_mm - before.stage_mm).abs();
        assert!(far_mm < 10.0 && after.force_max_n < 1.5, "{after:?}");
    }
}
