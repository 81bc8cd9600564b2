//! A person who lays weights on the lifted finger of a rig.

use super::*;
use crate::rig::Fault;
use crate::rig::weigh::ForceScale;
use crate::sensor::pressure::Calibration;
use embassy_futures::block_on;
use std::boxed::Box;
use std::vec::Vec as List;

const CALIBRATION: RigCalibration = RigCalibration {
    pressure: Calibration::PAPER,
    unloaded_a: (0.0, 0.0),
    newton_per_ampere: 16.4,
    date: 0,
    air_known: true,
    turned: 0,
    serial: [0; 16],
};

/// A rig that stands, and whose finger has so many mN a count.
struct Standing {
    state: RigState,
    mn_per_count: f32,
    prompts: List<Prompt>,
    looks: u32,
    /// Stopped by the host, or faulted, from this look on.
    stops: u32,
    faults: u32,
    homed: bool,
    /// Weights that the guard was told of, and what lay on the finger just then, mN.
    expected: List<u16>,
    lay_mn: List<f32>,
    /// P_DC, which follows what is laid on by 20 counts a look.
    counts: f32,
    /// The board's button at each look.
    button: fn(u32) -> Option<bool>,
}

impl Standing {
    fn rig(mn_per_count: f32) -> ServoRig<Self> {
        ServoRig::new(Self {
            state: RigState::parked(CALIBRATION),
            mn_per_count,
            prompts: List::new(),
            looks: 0,
            stops: u32::MAX,
            faults: u32::MAX,
            homed: false,
            expected: List::new(),
            lay_mn: List::new(),
            counts: 3.0,
            button: |_| None,
        })
    }
}

impl Servo for Standing {
    async fn command(&mut self, command: RigCommand) -> Result<(), Refused> {
        self.homed |= command == RigCommand::Home;
        if let RigCommand::Weigh(mn) = command {
            self.expected.push(mn);
            self.lay_mn.push((self.counts - 3.0) * self.mn_per_count);
        }
        self.state.phase = Phase::Ready;
        Ok(())
    }

    async fn wait(&mut self) {
        self.looks += 1;
        let mn = match self.prompts.last() {
            Some(Prompt::Weigh(mn)) => f32::from(*mn),
            _ => 0.0,
        };
        // P_DC in the air has drifted by 3 counts since its zero
        let counts = 3.0 + mn / self.mn_per_count;
        self.counts += (counts - self.counts).clamp(-20.0, 20.0);
        self.state.force_mn = self.counts * CALIBRATION.pressure.force_mn_per_count;
        if self.looks >= self.faults {
            self.state.phase = Phase::Faulted(Fault::SensorSilent);
        }
    }

    fn pressed(&self) -> Option<bool> {
        (self.button)(self.looks)
    }

    fn state(&self) -> RigState {
        self.state
    }

    fn samples(&mut self) -> Option<Samples> {
        None
    }

    fn lost(&self) -> u32 {
        0
    }

    fn stop(&mut self) {}

    fn end_slide(&mut self) {}

    fn is_stopped(&self) -> bool {
        self.looks >= self.stops
    }

    fn streams(&self) -> bool {
        false
    }

    fn tell(&mut self, event: Event) {
        if let Event::Prompt(prompt) = event {
            self.prompts.push(prompt);
        }
    }
}

#[test]
fn weights_on_a_lifted_finger_give_its_force_per_count() {
    let mut rig = Standing::rig(9.35);
    let points = [294, 588, 883, 1177, 1471].map(|mn| {
        let counts = block_on(rig.weigh(mn)).unwrap();
        (counts, f32::from(mn))
    });
    // where it stands nobody knows before it has homed
    assert!(rig.servo.homed);
    let scale = ForceScale::of(&points).unwrap();
    assert!((scale.mn_per_count - 9.35).abs() < 0.01, "{scale:?}");
    // each weight is taken off before the next, and the last one, too
    let mut prompts = rig.servo.prompts.clone();
    prompts.dedup();
    assert_eq!(prompts.len(), 11);
    let expected = [294, 588, 883, 1177, 1471].map(|mn| [mn, 0]);
    assert_eq!(rig.servo.expected, expected.concat());
    // and is away when the guard is told so
    let most_mn = rig.servo.lay_mn.iter().copied().fold(0.0, f32::max);
    assert!(most_mn < 100.0, "{most_mn}");
    assert_eq!(
        prompts[..3],
        [Prompt::Lift, Prompt::Weigh(294), Prompt::Lift]
    );
}

#[test]
fn a_reversed_cell_a_stop_a_fault_and_nobody_end_it() {
    let weigh = |rig: &mut ServoRig<Standing>| block_on(rig.weigh(588)).map_err(Box::new);
    let failed = |why| Err(Box::new(Failure::Rig(why)));
    let fell = weigh(&mut Standing::rig(-9.35)).unwrap();
    assert!((fell + 62.9).abs() < 0.1, "{fell}");
    let mut rig = Standing::rig(9.35);
    rig.servo.stops = 50;
    assert_eq!(weigh(&mut rig), failed(RigError::Stopped));
    assert_eq!(rig.servo.expected, [588, 0]);
    let mut rig = Standing::rig(9.35);
    rig.servo.faults = 50;
    assert_eq!(
        weigh(&mut rig),
        failed(RigError::Fault(Fault::SensorSilent))
    );
    // so heavy a count that the weight makes no difference; the host is told every second that it is waited for
    let mut rig = Standing::rig(1e6);
    assert_eq!(weigh(&mut rig), failed(RigError::NobodyThere));
    assert_eq!(rig.servo.prompts.len(), 60);
}

/// High forces want a press of the board's button: one that was let go before, within 30 s.
#[test]
fn a_high_force_is_allowed_by_a_person_at_the_board() {
    use crate::store::tests::ram::{Ram, SECTOR};
    type Button = fn(u32) -> Option<bool>;
    let cases: [(Button, u32, Result<(), Failure>); 6] = [
        (|_| None, u32::MAX, Ok(())),
        (|look| Some(look >= 150), u32::MAX, Ok(())),
        (|_| Some(false), u32::MAX, Err(Failure::NotPressed)),
        // held down, or broken
        (|_| Some(true), u32::MAX, Err(Failure::NotPressed)),
        (|look| Some(!(40..=90).contains(&look)), u32::MAX, Ok(())),
        (|_| Some(false), 20, Err(Failure::Rig(RigError::Stopped))),
    ];
    for (n, (button, stops, done)) in cases.into_iter().enumerate() {
        let mut rig = Standing::rig(10.9);
        (rig.servo.button, rig.servo.stops) = (button, stops);
        let mut store = block_on(Store::open(Ram::<SECTOR>::new())).unwrap();
        assert_eq!(
            block_on(rig.set_high_force(true, Ok(&mut store))),
            done,
            "{n}"
        );
        assert_eq!(block_on(store.high_force()), Ok(done.is_ok()), "{n}");
        let seconds = rig.servo.looks.div_ceil(LOOKS_HZ) as usize;
        assert_eq!(rig.servo.prompts, [Prompt::Button].repeat(seconds), "{n}");
        assert!(rig.servo.looks <= 30 * LOOKS_HZ);
        // forbidding wants none
        let looks = rig.servo.looks;
        rig.servo.stops = u32::MAX;
        block_on(rig.set_high_force(false, Ok(&mut store))).unwrap();
        assert_eq!(
            (rig.servo.looks, block_on(store.high_force())),
            (looks, Ok(false))
        );
    }
}
