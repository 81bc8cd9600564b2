//! The motor's current as the firmware reads it, against that of the simulated motor, which swings with every period of
//! its PWM.

use std::path::Path;

use tactus_core::wire::Event;
use tactus_emulator::board::{Emulator, Options};
use tactus_emulator::host::talk::Talk;
use tactus_link::Request;
use tactus_world::world::Setup;

use crate::common::{elf, ready};
use crate::faults::identify;

/// Speeds of the runs without load, mm/s.
const SPEEDS: [f64; 4] = [10.0, 25.0, 40.0, 63.0];
/// Largest error of the motor's current, which traction needs, A.
const NEEDED_A: f64 = 0.005;

/// Mean of what is seen while the stage goes to the right at a speed.
#[derive(Clone, Copy, Default, Debug)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1.0;
    }

    fn value(self) -> f64 {
        assert!(self.count > 100.0, "{self:?}");
        self.sum / self.count
    }
}

fn over(elf: &Path, texture: u8) -> Talk {
    let setup = Setup {
        texture,
        ..Setup::default()
    };
    let board = Emulator::start(elf, setup, Options::default()).unwrap();
    let mut talk = Talk::new(board);
    ready(&mut talk);
    talk
}

/// The largest error of the current without load among the speeds, A: of what the firmware calibrates itself with, less
/// the error that all speeds have in common, which the amplifier's zero makes.
fn unloaded_error_a(talk: &mut Talk) -> f64 {
    let mut truths = [Mean::default(); SPEEDS.len()];
    let read = talk.run(Request::calibrate(), 80.0, |board, _| {
        let truth = board.rig().world().truth();
        for (speed, mean) in SPEEDS.iter().zip(&mut truths) {
            if (truth.speed_mm_s - speed).abs() < 0.02 * speed {
                mean.add(truth.current_a);
            }
        }
    });
    let (standstill, per_mm_s) = read.unwrap().unloaded_a;
    let errors = SPEEDS.iter().zip(truths).map(|(speed, truth)| {
        let read_a = f64::from(standstill) + f64::from(per_mm_s) * speed;
        read_a - truth.value()
    });
    let errors: Vec<f64> = errors.collect();
    let common = errors.iter().sum::<f64>() / errors.len() as f64;
    eprintln!("without load: {errors:.4?} A");
    errors
        .iter()
        .map(|error| (error - common).abs())
        .fold(0.0, f64::max)
}

/// Errors of the traction of slides, as a current, A.
fn traction_errors_a(talk: &mut Talk, slides: u8) -> Vec<f64> {
    let mut errors = Vec::new();
    let mut movement = None;
    let mut shear = Mean::default();
    talk.send(identify(slides), 120.0, |board, report| {
        match report.map(|report| &report.event) {
            Some(Event::Chosen {
                movement: chosen, ..
            }) => {
                movement = Some(*chosen);
                shear = Mean::default();
            }
            Some(Event::SlideReport { observed, .. }) => {
                let [traction, ..] = observed.properties;
                let traction_n = f64::from(traction.expect("a slide at constant speed"));
                let error_n = traction_n - shear.value();
                eprintln!(
                    "{movement:?}: {traction_n:.3} N, {:.3} N of the world",
                    shear.value()
                );
                errors.push(error_n / 16.4);
            }
            _ => {}
        }
        let truth = board.rig().world().truth();
        if let Some(movement) = movement
            && truth.force_n > 0.1
        {
            let speed = f64::from(movement.speed_mm_s());
            if (truth.speed_mm_s - speed).abs() < 0.02 * speed {
                shear.add(-truth.shear_n);
            }
        }
    })
    .unwrap();
    errors
}

#[test]
#[ignore = "long"]
fn the_current_is_the_mean_over_the_periods_of_the_motors_pwm() {
    let Some(elf) = elf() else { return };
    let mut talk = over(&elf, 30);
    let unloaded_a = unloaded_error_a(&mut talk);
    let tractions_a = traction_errors_a(&mut talk, 3);
    let worst_a = tractions_a
        .iter()
        .copied()
        .fold(unloaded_a, |worst, error| f64::max(worst, error.abs()));
    assert!(
        worst_a < NEEDED_A,
        "the current is wrong by {:.1} mA: {unloaded_a:.4} A without load, {tractions_a:.4?} A in slides",
        1e3 * worst_a
    );
}
