//! A finger that presses when the rig starts, and its zero.

use super::*;

/// The chip starts again, wherever lever and stage are.
fn reboot(rig: &mut SimRig, calibration: RigCalibration, unguarded: Unguarded) {
    *rig.control() = Control::new(
        &biotac::PARTS.model,
        StageConstants::REFERENCE,
        calibration,
        unguarded,
    );
}

/// The wire of the lever's switch breaks, and the chip starts again while the finger presses: to the firmware it is at
/// the top. Only P_DC says that it is not, to a rig that knows what its finger says in the air.
#[test]
fn a_finger_that_is_not_in_the_air_is_neither_dragged_nor_pressed_further() {
    let booted = |unguarded, like_the_firmware: bool| {
        let mut rig = SimRig::new(sample());
        rig.home().unwrap();
        let calibration = rig.calibrate(20_261_121).unwrap();
        start(&mut rig, Movement::FOR_TRACTION, Phase::Sliding);
        rig.world().inject(Cause::LeverTopStuck { closed: true });
        if like_the_firmware {
            // it lifts the finger, then reads its calibration
            let unmeasured = RigCalibration {
                pressure: Calibration::PAPER,
                air_known: false,
                turned: 0,
                ..calibration
            };
            reboot(&mut rig, unmeasured, unguarded);
            wait(&mut rig, 200);
            rig.control().home().unwrap();
            rig.control().stop();
            rig.rest(|_| ()).unwrap();
            rig.control().calibrate(calibration).unwrap();
        } else {
            reboot(&mut rig, calibration, unguarded);
            wait(&mut rig, 200);
        }
        let pressed = rig.world().truth();
        assert!(pressed.force_n > 0.6, "{pressed:?}");
        rig.world().reset_extremes();
        let mut first = None;
        // with the operator who tries again
        for _ in 0..3 {
            let _ = rig.control().reset();
            let _ = rig.control().home();
            let homed = rig.rest(|_| ());
            first.get_or_insert(homed);
            let _ = slide(&mut rig);
        }
        let truth = rig.world().truth();
        let dragged_mm = truth.stage_reach_mm.1 - truth.stage_reach_mm.0;
        (rig, calibration, first, dragged_mm)
    };
    for like_the_firmware in [false, true] {
        let (mut rig, calibration, first, dragged_mm) =
            booted(Unguarded::default(), like_the_firmware);
        let not_home = Err(SimError::Fault(Fault::LeverNotHome));
        assert_eq!(first, Some(not_home));
        let truth = rig.world().truth();
        assert!(
            truth.force_max_n < 1.3 && dragged_mm < 0.1,
            "{dragged_mm} mm {truth:?}"
        );
        // the wire is mended
        rig.world().clear();
        rig.control().reset().unwrap();
        rig.home().unwrap();
        let slid = slide(&mut rig);
        assert_eq!(slid, Ok(Ended::Whole));
        assert_eq!(rig.control().calibration(), &calibration);
        // and without the guards of the zero it does harm
        let unguarded = Unguarded::against(Fault::LeverNotHome).and(Fault::Unsteady);
        let (mut rig, _, _, dragged_mm) = booted(unguarded, like_the_firmware);
        let truth = rig.world().truth();
        assert!(truth.force_max_n > 2.2 && dragged_mm > 10.0, "{truth:?}");
    }
}

/// A finger whose P_DC drifts away after homing and before the first zero.
#[test]
fn the_first_zero_is_that_of_the_calibration() {
    let unwatched = Unguarded::against(Fault::LeverNotHome);
    for (counts_per_s, unguarded, slides) in [
        (0.0, Unguarded::default(), true),
        (30.0, Unguarded::default(), false),
        (-30.0, Unguarded::default(), false),
        (3.0, Unguarded::default(), true),
        (-30.0, unwatched, true),
    ] {
        let mut rig = SimRig::new(Setup::default());
        rig.home().unwrap();
        let calibration = rig.calibrate(20_261_121).unwrap();
        reboot(&mut rig, calibration, unguarded);
        rig.home().unwrap();
        rig.world().inject(Cause::PdcDrift { counts_per_s });
        wait(&mut rig, 1500);
        rig.world().reset_extremes();
        let slid = rig.slide(Movement::FOR_ROUGHNESS, 0.5, |_, _| ());
        let faults = [Fault::LeverNotHome, Fault::ForceHigh];
        let seen =
            |fault: Fault| slid == Err(fault.into()) || slid == Err(Refused::Fault(fault).into());
        // one that rises is seen before, while the rig waits
        let fault = faults.into_iter().find(|fault| seen(*fault));
        assert_eq!(fault.is_none(), slides, "{counts_per_s} counts/s: {slid:?}");
        if !slides {
            assert_eq!(rig.world().truth().force_max_n, 0.0);
        }
    }
}

/// The calibration of a rig that nobody has calibrated, whose finger says 240 counts more in the air than the default.
fn far_off_default(rig: &mut SimRig) -> RigCalibration {
    let unmeasured = *rig.control().calibration();
    assert!(!unmeasured.air_known);
    RigCalibration {
        pressure: Calibration {
            pdc_no_contact: 2400.0,
            ..unmeasured.pressure
        },
        ..unmeasured
    }
}

#[test]
fn a_finger_far_from_the_default_can_be_homed_and_calibrated() {
    let mut rig = SimRig::new(Setup::default());
    let calibration = far_off_default(&mut rig);
    reboot(&mut rig, calibration, Unguarded::default());
    rig.home().unwrap();
    let measured = rig.calibrate(20_261_121).unwrap();
    assert!(measured.pressure.pdc_no_contact > 2580.0, "{measured:?}");
    // taken into use while nothing moves, and by a rig that starts with it
    rig.control().calibrate(calibration).unwrap();
    wait(&mut rig, 100);
    assert_eq!(rig.control().phase(), Phase::Ready);
    rig.control().calibrate(measured).unwrap();
    wait(&mut rig, 100);
    let slid = rig.slide(Movement::FOR_ROUGHNESS, 0.5, |_, _| ());
    assert_eq!(slid, Ok(Ended::Whole));
    reboot(&mut rig, measured, Unguarded::default());
    rig.home().unwrap();
}

/// Before there is a zero the force is what P_DC has risen by. A finger that is down when the chip starts must not be
/// the measure of that once it is lifted.
#[test]
fn a_finger_that_nobody_calibrated_is_guarded_before_its_first_zero() {
    let pressed_by_a_runaway = |down_at_boot: bool, unguarded| {
        let mut rig = SimRig::unguarded(sample(), unguarded);
        let calibration = far_off_default(&mut rig);
        rig.home().unwrap();
        if down_at_boot {
            start(&mut rig, Movement::FOR_TRACTION, Phase::Sliding);
        }
        reboot(&mut rig, calibration, unguarded);
        rig.control().home().unwrap();
        rig.rest(|_| ()).unwrap();
        assert_eq!(rig.world().truth().force_n, 0.0);
        rig.world().reset_extremes();
        rig.world().inject(Cause::LeverRunaway);
        wait(&mut rig, 40_000);
        let force_max_n = rig.world().truth().force_max_n;
        (force_max_n, rig.control().phase())
    };
    for down_at_boot in [false, true] {
        // nobody looks at the lever's switch
        let blind = Unguarded::against(Fault::LeverNotHome);
        let (force_max_n, phase) = pressed_by_a_runaway(down_at_boot, blind);
        // 40 counts are 0.46 N
        assert!((0.4..0.8).contains(&force_max_n), "{force_max_n} N");
        assert_eq!(phase, Phase::Faulted(Fault::ForceHigh));
        let (force_max_n, _) = pressed_by_a_runaway(down_at_boot, blind.and(Fault::ForceHigh));
        assert!(force_max_n > 2.2, "{force_max_n} N");
        let (force_max_n, phase) = pressed_by_a_runaway(down_at_boot, Unguarded::default());
        assert_eq!(force_max_n, 0.0);
        assert_eq!(phase, Phase::Faulted(Fault::LeverNotHome));
    }
}

/// A movement that does not come to an end: before anybody says so the finger is lifted.
#[test]
fn a_rig_that_hangs_lifts_its_finger_before_it_says_so() {
    let unguarded = Unguarded::against(Fault::Unsteady).and(Fault::PressureDead);
    let mut rig = SimRig::unguarded(Setup::default(), unguarded.and(Fault::LeverSlips));
    rig.home().unwrap();
    start(&mut rig, Movement::FOR_TRACTION, Phase::Pressing);
    touching(&mut rig, 0.9);
    rig.world().inject(Cause::PdcDrift {
        counts_per_s: -20.0,
    });
    let ended = rig.rest(|_| ());
    assert!(matches!(ended, Err(SimError::Hangs(_))), "{ended:?}");
    let truth = rig.world().truth();
    assert!(
        truth.force_n == 0.0 && truth.indentation_mm < -0.5,
        "{truth:?}"
    );
}
