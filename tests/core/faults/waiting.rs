//! A finger that waits over its sample, and the force of sound slides.

use super::*;

/// A rig that has slid, and now waits.
fn slid(seed: u64) -> SimRig {
    let mut rig = homed(setup(1 + draw(seed, 117) as u8, seed), Unguarded::default());
    let ended = rig.slide(Movement::FOR_ROUGHNESS, 0.5, |_, _| ());
    assert_eq!(ended, Ok(Ended::Whole));
    rig.world().reset_extremes();
    rig
}

/// Numbers from 0 to 59, the first few far apart.
fn spread() -> Vec<u64> {
    seeds(60).map(|seed| seed * 13 % 60).collect()
}

/// Its switch bounces, the stage shakes it, and the motors lose their supply: none of that is a lever that comes down.
#[test]
fn a_finger_that_waits_over_its_sample_goes_up_to_its_switch() {
    let parked = spread().into_par_iter().filter(|&seed| {
        let mut rig = slid(seed);
        rig.world().inject(Cause::SwitchesBounce { ms: 50 });
        rig.world().inject(Cause::StageVibrates { um: 3.0 });
        // some are asked again on their way up
        wait(&mut rig, 1_000 + 200 * seed);
        let is_parked = rig.world().lever_top();
        if seed % 3 == 0 {
            wait(&mut rig, 10_000);
            assert!(rig.world().lever_top(), "{seed}");
            rig.world().inject(Cause::SupplyDip { ms: 3 * seed });
            wait(&mut rig, 60_000);
        }
        assert_eq!(rig.control().phase(), Phase::Ready, "{seed}");
        assert_eq!(rig.world().truth().force_max_n, 0.0, "{seed}");
        for _ in 0..2 {
            assert_eq!(slide(&mut rig), Ok(Ended::Whole), "{seed}");
        }
        is_parked
    });
    let (parked, all) = (parked.count(), spread().len());
    assert!(
        (all / 6..=all - all / 6 - 1).contains(&parked),
        "{parked} of {all} were parked"
    );
}

/// From any moment of its waiting: over the sample the lever goes up in time, and its switch sees it later.
#[test]
fn a_runaway_under_a_waiting_finger_without_a_pressure_does_not_touch() {
    assert_all(spread(), |&seed| {
        let mut rig = slid(seed);
        rig.world().inject(Cause::PdcStuck);
        wait(&mut rig, 200 * seed);
        let was_parked = rig.world().lever_top();
        rig.world().inject(Cause::LeverRunaway);
        wait(&mut rig, 60_000);
        let (truth, phase) = (rig.world().truth(), rig.control().phase());
        let seen = phase == Phase::Faulted(Fault::LeverNotHome);
        let is_right = truth.force_max_n == 0.0
            && (seen || !was_parked && phase == Phase::Ready)
            && (seen || rig.world().lever_top());
        if is_right {
            Ok(())
        } else {
            Err(format!("{seed}: {phase:?}, {truth:?}"))
        }
    });
}

#[test]
fn a_rig_may_idle_for_long() {
    let mut rig = homed(Setup::default(), Unguarded::default());
    wait(&mut rig, count(60, 6) * 60_000);
    rig.slide(Movement::FOR_ROUGHNESS, 0.5, |_, _| ()).unwrap();
}

/// One movement by the world's own reckoning: how it ended, and the mean force of the still finger and of the slide, N.
/// A lever that runs down does so from this ms of the slide on.
fn forces_of(
    seed: u64,
    unguarded: Unguarded,
    runs_down_at: Option<u64>,
) -> (SimRig, Result<(), Fault>, [f64; 2]) {
    let mut rig = homed(setup(1 + draw(seed, 117) as u8, seed), unguarded);
    rig.control()
        .start(MOVEMENTS[seed as usize % 3], 0.3)
        .unwrap();
    let mut forces = [(0.0, 0u32); 2];
    let mut slid = 0;
    let ended = loop {
        rig.tick();
        let force_n = rig.world().truth().force_n;
        let of = match rig.control().phase() {
            Phase::Background => &mut forces[0],
            Phase::Sliding => {
                if runs_down_at == Some(slid) {
                    rig.world().inject(Cause::LeverRunaway);
                }
                slid += 1;
                &mut forces[1]
            }
            Phase::Faulted(fault) => break Err(fault),
            Phase::Lifting => break Ok(()),
            _ => continue,
        };
        *of = (of.0 + force_n, of.1 + 1);
    };
    (rig, ended, forces.map(|(sum, n)| sum / f64::from(n.max(1))))
}

/// The rig takes 3 counts and a quarter; a sound slide stays at half of that, of every texture that is tried.
#[test]
fn the_force_of_a_sound_slide_is_that_of_the_still_finger() {
    assert_all(seeds(50).collect(), |&seed| {
        let (_, ended, [still, slide]) = forces_of(seed, Unguarded::default(), None);
        let allowed = 3.0 * 0.0115 + 0.25 * still;
        let is_right = ended == Ok(()) && (slide - still).abs() < 0.5 * allowed;
        if is_right {
            Ok(())
        } else {
            Err(format!("{seed}: {still:.3} and {slide:.3} N, {ended:?}"))
        }
    });
}

/// A driver that steps down by itself, even in a slide of one second: what counts was made with the force that was
/// asked for.
#[test]
fn a_slide_during_which_the_lever_runs_down_does_not_count() {
    let counts_wrongly = |seed: u64, unguarded| {
        let (mut rig, ended, [still, slide]) = forces_of(seed, unguarded, Some(draw(seed, 900)));
        let truth = rig.world().truth().force_max_n;
        assert!(truth < 2.2, "seed {seed}: {truth} N");
        // P_DC knows the force to 5 % and a count
        ended.is_ok() && (slide - still).abs() > 4.0 * 0.0115 + 0.3 * still
    };
    for seed in seeds(60) {
        assert!(!counts_wrongly(seed, Unguarded::default()), "seed {seed}");
    }
    let unguarded = Unguarded::against(Fault::Unsteady);
    let wrong = (0..60).any(|seed| counts_wrongly(seed, unguarded));
    assert!(wrong, "without the check no slide has another force");
}
