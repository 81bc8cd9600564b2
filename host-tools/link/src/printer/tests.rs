//! A press onto a sample that is harder than any, by a printer that does at once what it is told.

use std::time::Duration;

use tactus_core::rig::arm::{ArmMovement, ArmOrder, ArmState, ArmTask};

use super::{Printer, PrinterError, Setup};

const SETUP: &str = r#"{"version": 1, "port": "nobody", "baud": 115200,
    "dialect": {"marlin": {"emergency_parser": true}}, "axis": "X", "sample_mm": [0.0, 75.0], "lifted_mm": 0.5,
    "floor_mm": -8.0, "acceleration_mm_s2": 500.0, "start_s": [-0.1, 1.5], "stiffness_n_mm": 1.0,
    "backlash_mm": 0.05, "parked": [0.0, 0.0]}"#;
/// Height of the sample, mm, and the force once it is touched, N.
const SAMPLE_MM: f64 = -2.5;
const JUMPS_TO_N: f64 = 1.0;

/// The value behind a letter in a line of G-code.
fn value(line: &str, letter: char) -> Option<f64> {
    let word = line
        .split([' ', '*'])
        .find(|word| word.starts_with(letter))?;
    word[1..].parse().ok()
}

/// The probe's own guard is not there: the finger must not be pressed again.
#[test]
fn a_force_that_jumps_ends_the_press() {
    let (printer, mut carrier) = Printer::new(Some(Setup::read(SETUP).unwrap()));
    let movement = ArmMovement {
        force_mn: 200,
        speed_um_s: 25_000,
        length_um: 20_000,
        start: 250,
        approach_um_s: 1000,
    };
    let task = ArmTask::Press(movement);
    printer.order(ArmOrder { number: 1, task });
    let (mut at, mut touches, mut said) = ([0.0, 0.0], 0, b"start\n".to_vec());
    for ms in 0..60_000 {
        let sent = carrier.carry(&std::mem::take(&mut said), Duration::from_millis(ms));
        for line in String::from_utf8(sent).unwrap().lines() {
            let felt = at[1] < SAMPLE_MM;
            if line.contains("G1 ") || line.contains("G92 ") {
                at = ['X', 'Z']
                    .map(|letter| value(line, letter).unwrap_or(at[usize::from(letter == 'Z')]));
                touches += u32::from(!felt && at[1] < SAMPLE_MM);
            }
            let answer = match line {
                _ if line.contains("M115") => {
                    "FIRMWARE_NAME:Marlin 2.1\nCap:EMERGENCY_PARSER:1\nok\n".to_owned()
                }
                _ if line.contains("M114") => {
                    format!("X:{:.3} Y:0 Z:{:.3} E:0 Count X:0\nok\n", at[0], at[1])
                }
                _ => "ok\n".to_owned(),
            };
            said.extend_from_slice(answer.as_bytes());
        }
        let newton = if at[1] < SAMPLE_MM { JUMPS_TO_N } else { 0.0 };
        printer.force((1e3 * newton) as i16);
        if printer
            .reports()
            .iter()
            .any(|report| report.state == ArmState::Failed)
        {
            // the light touch that measures the height
            assert_eq!(printer.take_failure(), Some(PrinterError::Unsteady(0.1)));
            assert_eq!(touches, 1, "it presses again");
            return;
        }
    }
    panic!("it goes on");
}
