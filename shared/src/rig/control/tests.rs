use super::*;
use crate::sensor::biotac;
use crate::sensor::pressure::Calibration;

#[test]
fn a_lever_that_cannot_press_is_a_fault_and_lifts() {
    let calibration = RigCalibration {
        pressure: Calibration::PAPER,
        unloaded_a: (0.0, 0.0),
        newton_per_ampere: 8.0,
        date: 0,
        air_known: false,
        turned: 0,
        serial: [0; 16],
    };
    let mut control = Control::new(
        &biotac::PARTS.model,
        StageConstants::REFERENCE,
        calibration,
        Unguarded::against(Fault::SensorSilent),
    );
    assert_eq!(control.lever.state(), LeverState::Unknown);
    control.enter(Phase::Positioning);
    // the stage's place is known, the lever's is not
    control.stage.home();
    for ms in 0..100 {
        let inputs = Inputs {
            stage_limits: (ms > 10, false),
            ..Inputs::default()
        };
        control.tick(&inputs);
    }
    assert_eq!(control.phase(), Phase::Faulted(Fault::LeverSlips));
    assert_eq!(control.lever.state(), LeverState::Homing);
}
