use std::vec::Vec as List;

use super::*;
use crate::sensor::biotac;
use crate::sensor::pressure::{Counts, Pressure};

const AIR: f32 = 2000.0;

/// A rig, the force on its finger in counts of P_DC, and every order that was sent, with the ms.
struct Bench {
    rig: RigOverLink,
    counts: f32,
    ms: u32,
    sent: List<(u32, ArmOrder)>,
    outputs: Outputs,
}

impl Bench {
    fn new() -> Self {
        let pressure = biotac::PARTS.model.calibration;
        let calibration = RigCalibration {
            pressure,
            unloaded_a: (0.0, 0.0),
            newton_per_ampere: 1.0,
            date: 0,
            air_known: false,
            turned: 0,
            serial: [0; 16],
        };
        Self {
            rig: RigOverLink::new(&biotac::PARTS.model, calibration, Unguarded::default()),
            counts: 0.0,
            ms: 0,
            sent: List::new(),
            outputs: Outputs::default(),
        }
    }

    fn tick(&mut self, reports: &[ArmReport]) {
        self.ms += 1;
        let mut inputs = Inputs::default();
        // 4.4 words a millisecond
        for slot in self.ms * 44 / 10..(self.ms + 1) * 44 / 10 {
            let (channel, counts) = match slot % 2 {
                0 => (Channel::Pac, 2048.0 + (slot % 7) as f32),
                _ => (Channel::Pdc, AIR + self.counts),
            };
            let counts = Counts::new(counts as u16).unwrap();
            let _ = inputs.words.push(Some(Pressure { channel, counts }));
        }
        let (outputs, order) = self.rig.tick(&inputs, reports);
        self.outputs = outputs;
        self.sent.extend(order.map(|order| (self.ms, order)));
    }

    fn run(&mut self, ms: u32) {
        (0..ms).for_each(|_| self.tick(&[]));
    }

    /// Reports this about the last order for so long, ms.
    fn says(&mut self, state: ArmState, ms: u32) {
        for n in 0..ms {
            let number = self.sent.last().unwrap().1.number;
            let report = ArmReport { number, state };
            self.tick(if n % 50 == 0 {
                core::slice::from_ref(&report)
            } else {
                &[]
            });
        }
    }

    fn last(&self) -> ArmTask {
        self.sent.last().unwrap().1.task
    }

    /// Homed, with a movement whose press is ordered.
    fn pressing(movement: Movement) -> Self {
        let mut bench = Self::new();
        bench.run(50);
        bench.rig.home().unwrap();
        bench.run(1);
        assert_eq!(bench.last(), ArmTask::Lift);
        bench.says(ArmState::Lifted, 400);
        assert_eq!(bench.rig.phase(), Phase::Ready);
        bench.rig.start(movement, 0.5).unwrap();
        bench.run(ZERO_MS + 1);
        assert!(matches!(bench.last(), ArmTask::Press(_)));
        bench
    }

    /// The slide is ordered.
    fn sliding(movement: Movement) -> Self {
        let mut bench = Self::pressing(movement);
        bench.counts = bench.counts_of(movement);
        bench.says(ArmState::Busy, 200);
        bench.says(ArmState::Pressed, SETTLE_MS + BACKGROUND_MS + 5);
        assert_eq!(bench.last(), ArmTask::Slide);
        bench
    }

    fn counts_of(&self, movement: Movement) -> f32 {
        f32::from(movement.force_mn()) / self.rig.calibration.pressure.force_mn_per_count
    }
}

#[test]
fn a_movement_is_press_slide_and_lift_and_its_samples_are_those_at_constant_speed() {
    let movement = Movement::FOR_FINENESS;
    let mut bench = Bench::sliding(movement);
    bench.says(ArmState::Busy, 30);
    let number = bench.sent.last().unwrap().1.number;
    bench.tick(&[ArmReport {
        number,
        state: ArmState::Steady,
    }]);
    let (length_mm, slide_ms) = (bench.rig.length_mm, bench.rig.run.slide_ms());
    let SamplePhase::Begin(steady) = bench.outputs.sample_phase.clone() else {
        panic!("{:?}", bench.outputs.sample_phase);
    };
    // a fifth at most for the filter, and what a word may be late at the end
    assert!(steady.start <= 2200 / 5 && steady.end == (slide_ms - LINK_MS) * 22 / 10);
    bench.says(ArmState::Steady, slide_ms);
    assert_eq!(bench.outputs.sample_phase, SamplePhase::Slide);
    let slid = ArmState::Slid {
        length_um: (length_mm * 1e3) as u32,
        speed_um_s: movement.speed_um_s(),
    };
    bench.says(slid, 1);
    assert_eq!(bench.rig.take_ended(), Some(Ended::Whole));
    assert_eq!(bench.rig.phase(), Phase::Lifting);
    bench.run(1);
    bench.counts = 0.0;
    bench.says(ArmState::Lifted, 60);
    assert_eq!(bench.rig.phase(), Phase::Ready);
    let tasks: List<ArmTask> = bench.sent.iter().map(|(_, order)| order.task).collect();
    let [.., ArmTask::Press(asked), ArmTask::Slide, ArmTask::Lift] = tasks[..] else {
        panic!("{tasks:?}");
    };
    assert_eq!((asked.force_mn, asked.start), (movement.force_mn(), 500));
    assert_eq!(
        tasks[0],
        ArmTask::Stop,
        "what an arm does at power-up nobody knows"
    );
}

#[test]
fn an_order_is_said_again_until_it_is_heard_and_reports_of_another_are_none() {
    let mut bench = Bench::pressing(Movement::FOR_FINENESS);
    let before = bench.sent.len();
    let number = bench.sent.last().unwrap().1.number;
    let old = ArmReport {
        number: number.wrapping_sub(1),
        state: ArmState::Pressed,
    };
    for _ in 0..350 {
        bench.tick(&[old]);
    }
    assert_eq!(bench.sent.len(), before + 3);
    assert!(
        bench.sent[before..]
            .iter()
            .all(|(_, order)| order.number == number)
    );
    assert_eq!(bench.rig.there_ms, None);
    bench.says(ArmState::Busy, 1);
    let heard = bench.sent.len();
    bench.run(300);
    assert_eq!(bench.sent.len(), heard);
}

/// Runs until there is a fault; returns it, and the time from `since` to the order to stop, ms.
fn faulted(bench: &mut Bench, since: u32) -> (Fault, u32) {
    for _ in 0..60_000 {
        bench.run(1);
        if let Phase::Faulted(fault) = bench.rig.phase() {
            let (sent, order) = *bench.sent.last().unwrap();
            assert_eq!(order.task, ArmTask::Stop);
            return (fault, sent - since);
        }
    }
    panic!("no fault");
}

#[test]
fn too_much_force_demands_a_stop_in_the_same_millisecond() {
    let movement = Movement::FOR_FINENESS;
    let mut bench = Bench::sliding(movement);
    bench.says(ArmState::Steady, 300);
    let since = bench.ms;
    // 0.9 N instead of half a newton
    bench.counts = 900.0 / bench.rig.calibration.pressure.force_mn_per_count;
    let (fault, ms) = faulted(&mut bench, since);
    assert_eq!(fault, Fault::ForceHigh);
    // a mean of 10 ms
    assert!(ms <= 12, "{ms}");
    assert!(bench.outputs.lever_enabled);
    assert_eq!(bench.rig.reset(), Err(Refused::Busy));
    // it obeys
    bench.counts = 0.0;
    bench.says(ArmState::Busy, 100);
    bench.says(ArmState::Lifted, 60);
    assert!(bench.rig.is_at_rest());
    assert_eq!(bench.rig.phase(), Phase::Faulted(Fault::ForceHigh));
    bench.rig.reset().unwrap();
    assert_eq!(bench.rig.phase(), Phase::Parked);
}

#[test]
fn an_arm_that_does_not_stop_is_named_and_loses_its_permission() {
    let mut bench = Bench::sliding(Movement::FOR_FINENESS);
    bench.says(ArmState::Steady, 300);
    let since = bench.ms;
    bench.counts = 900.0 / bench.rig.calibration.pressure.force_mn_per_count;
    faulted(&mut bench, since);
    bench.says(ArmState::Busy, STOPS_MS - 20);
    assert_eq!(bench.rig.phase(), Phase::Faulted(Fault::ForceHigh));
    bench.says(ArmState::Busy, 40);
    assert_eq!(bench.rig.phase(), Phase::Faulted(Fault::ArmRuns));
    assert!(!bench.outputs.lever_enabled);
    let before = bench.sent.len();
    bench.says(ArmState::Busy, 1000);
    assert!(
        bench.sent.len() >= before + 9,
        "the stop is said again and again"
    );
    assert!(!bench.rig.is_at_rest());
    bench.says(ArmState::Busy, GAVE_UP_MS);
    assert!(bench.rig.is_at_rest(), "nobody waits for ever");
}

#[test]
fn a_silent_arm_is_told_to_stop_after_half_a_second() {
    let mut bench = Bench::sliding(Movement::FOR_FINENESS);
    bench.says(ArmState::Steady, 300);
    let since = bench.ms;
    let (fault, ms) = faulted(&mut bench, since);
    assert_eq!(fault, Fault::ArmSilent);
    // its last report was up to 50 ms before
    assert!((SILENT_MS - 50..=SILENT_MS + 2).contains(&ms), "{ms}");
    assert!(!bench.outputs.lever_enabled);
    // its stop does not make it another fault, nor does further pressing
    bench.run(4000);
    assert_eq!(bench.rig.phase(), Phase::Faulted(Fault::ArmSilent));
}

#[test]
fn what_an_arm_says_is_compared_with_force_clock_and_order() {
    let movement = Movement::FOR_FINENESS;
    let (slide_ms, length_um) = {
        let bench = Bench::sliding(movement);
        (bench.rig.run.slide_ms(), (bench.rig.length_mm * 1e3) as u32)
    };
    let speed = movement.speed_um_s();
    let share = |of: u32, share: f32| (of as f32 * share) as u32;
    let cases = [
        (slide_ms, length_um, speed, None),
        (slide_ms, share(length_um, 0.97), share(speed, 1.03), None),
        (slide_ms, share(length_um, 0.93), speed, Some(Fault::ArmOff)),
        (slide_ms, length_um, share(speed, 1.07), Some(Fault::ArmOff)),
        (
            slide_ms - LINK_MS - 20,
            length_um,
            speed,
            Some(Fault::ArmOff),
        ),
    ];
    for (ms, length_um, speed_um_s, fault) in cases {
        let mut bench = Bench::sliding(movement);
        bench.says(ArmState::Steady, ms);
        let slid = ArmState::Slid {
            length_um,
            speed_um_s,
        };
        bench.says(slid, 1);
        let phase = fault.map_or(Phase::Lifting, Phase::Faulted);
        assert_eq!(bench.rig.phase(), phase, "{ms} {length_um} {speed_um_s}");
        assert_eq!(bench.rig.take_ended().is_some(), fault.is_none());
    }
    // it takes too long
    let mut bench = Bench::sliding(movement);
    bench.says(ArmState::Steady, slide_ms + slide_ms / 10 + RAMP_MS);
    assert_eq!(bench.rig.phase(), Phase::Faulted(Fault::ArmOff));
    // it reports that it presses, and does not; and presses with a quarter more
    for times in [0.0, 0.8, 1.25] {
        let mut bench = Bench::pressing(movement);
        // not at once: a step of force looks like the beginning of a greater one
        let pressed = bench.counts_of(movement) * times;
        for tenths in 1..=10_u8 {
            bench.counts = pressed * f32::from(tenths) / 10.0;
            bench.says(ArmState::Busy, 20);
        }
        bench.says(ArmState::Pressed, SETTLE_MS + 5);
        assert_eq!(bench.rig.phase(), Phase::Faulted(Fault::ArmOff), "{times}");
    }
    // it reports the finger as lifted, and it is not
    let mut bench = Bench::sliding(movement);
    bench.rig.stop();
    bench.run(1);
    bench.says(ArmState::Lifted, RELEASE_MS + 5);
    assert_eq!(bench.rig.phase(), Phase::Faulted(Fault::ArmOff));
    bench.says(ArmState::Lifted, FREE_MS + 5);
    assert_eq!(bench.rig.phase(), Phase::Faulted(Fault::ArmRuns));
}

#[test]
fn a_weight_may_lie_on_a_lifted_finger_that_is_to_be_weighed() {
    for (asked_mn, fault) in [(800, None), (0, Some(Fault::ForceHigh))] {
        let mut bench = Bench::pressing(Movement::FOR_FINENESS);
        bench.rig.stop();
        bench.run(1);
        bench.says(ArmState::Lifted, 60);
        assert_eq!(bench.rig.phase(), Phase::Ready);
        bench.rig.weigh(asked_mn).unwrap();
        bench.counts = 70.0;
        bench.run(50);
        assert_eq!(
            bench.rig.phase(),
            fault.map_or(Phase::Ready, Phase::Faulted),
            "{asked_mn}"
        );
    }
}
