//! A kitchen scale's weights on the lifted finger of a rig, as [`ServoRig`] asks for them: its guard is on with any
//! weight on it.

use embassy_futures::block_on;
use rayon::prelude::*;
use tactus_core::probe::RigState;
use tactus_core::probe::seams::RigHandle as _;
use tactus_core::probe::servo_rig::{LOOK_MS, RigCommand, Samples, Servo, ServoRig};
use tactus_core::rig::turning::Turned;
use tactus_core::rig::weigh::ForceScale;
use tactus_core::rig::{Fault, Phase, Refused, RigError};
use tactus_core::sensor::FingerName;
use tactus_core::wire::{Event, Failure, Prompt};

use crate::sim::rig::SimRig;
use tactus_world::faults::Fault as WorldFault;
use tactus_world::noise::Noise;
use tactus_world::parts::PartFault;
use tactus_world::person::{Hand, Manner};

/// Weights as a kitchen scale shows them, 30, 60, 90, 120 and 150 g, as forces in mN.
const WEIGHTS_MN: [u16; 5] = [294, 588, 883, 1177, 1471];
use tactus_world::slot::Reader;
use tactus_world::world::Setup;

const MOST_N: f64 = 2.2;
/// Seeds of each finger.
const SEEDS: u64 = 2;

/// A person at a rig who follows its prompts, without a tremor: a weight lies on the finger.
struct Weights {
    rig: SimRig,
    /// True weight, relative to the one that is written on it.
    share: f64,
    state: RigState,
}

fn calibrated(finger: FingerName, seed: u64, broken: Option<PartFault>) -> SimRig {
    let mut rig = SimRig::new(Setup {
        texture: 1 + (seed * 37 % 117) as u8,
        finger,
        trial_seed: seed,
        finger_seed: seed,
        ..Setup::default()
    });
    if let Some(fault) = broken {
        rig.world().break_part(fault);
    }
    rig.home().unwrap();
    let calibration = rig.calibrate_current().unwrap();
    let air = rig.control().air_counts().unwrap();
    let calibration = calibration.with_air(air);
    rig.control().calibrate(calibration).unwrap();
    rig
}

fn each(seeds: u64, run: impl Fn(FingerName, u64) + Sync) {
    let all = FingerName::ALL.into_iter();
    let all: Vec<_> = all
        .flat_map(|finger| (1..=seeds).map(move |seed| (finger, seed)))
        .collect();
    all.par_iter().for_each(|&(finger, seed)| run(finger, seed));
}

impl Weights {
    fn on(mut rig: SimRig, seed: u64, share: f64) -> ServoRig<Self> {
        let still = Manner {
            tremor: 0.0,
            wander: 0.0,
            ..Manner::default()
        };
        rig.world().hold(Hand::new(seed, still));
        let state = rig.state(None);
        ServoRig::new(Self { rig, share, state })
    }

    fn tick(&mut self, ms: u32) {
        for _ in 0..ms {
            self.rig.tick();
        }
        self.state = self.rig.state(None);
    }

    /// Lays on so much, N, for a second.
    fn lay(&mut self, newton: f64) -> Phase {
        self.rig.world().hand().unwrap().intend(newton, 0.0);
        self.tick(1000);
        self.state.phase
    }
}

impl Servo for Weights {
    async fn command(&mut self, command: RigCommand) -> Result<(), Refused> {
        let answer = command.apply(self.rig.control());
        self.tick(1);
        answer
    }

    async fn wait(&mut self) {
        self.tick(LOOK_MS);
    }

    fn state(&self) -> RigState {
        self.state
    }

    fn samples(&mut self) -> Option<Samples> {
        None
    }

    fn gravity(&self) -> Option<f32> {
        self.rig.gravity()
    }

    fn lost(&self) -> u32 {
        0
    }

    fn stop(&mut self) {}

    fn end_slide(&mut self) {}

    fn is_stopped(&self) -> bool {
        false
    }

    fn streams(&self) -> bool {
        false
    }

    fn tell(&mut self, event: Event) {
        let newton = match event {
            Event::Prompt(Prompt::Weigh(mn)) => f64::from(mn) * 1e-3 * self.share,
            _ => 0.0,
        };
        let hand = self.rig.world().hand().unwrap();
        hand.intend(newton, 0.0);
        hand.turn(event == Event::Prompt(Prompt::TurnOver));
    }
}

#[test]
fn weights_on_the_lifted_finger_give_its_force_per_count() {
    each(SEEDS, |finger, seed| {
        let mut rig = Weights::on(calibrated(finger, seed, None), seed, 1.0);
        let points = WEIGHTS_MN.map(|mn| {
            let counts = block_on(rig.weigh(mn));
            (
                counts.unwrap_or_else(|why| panic!("{finger}, {seed}, {mn}: {why}")),
                f32::from(mn),
            )
        });
        let weighed = ForceScale::of(&points);
        let weighed = weighed.unwrap_or_else(|| panic!("{finger}, {seed}: {points:?}"));
        let model = Reader::new(finger).model().calibration;
        let share = weighed.mn_per_count / model.force_mn_per_count;
        assert!((share - 1.0).abs() < 0.03, "{finger}, {seed}: {weighed:?}");
        // the request for a weight is over: a press now is a fault
        let servo = &mut rig.servo;
        assert_eq!(servo.lay(0.3), Phase::Ready, "{finger}, {seed}");
        let phase = servo.lay(0.6);
        assert_eq!(phase, Phase::Faulted(Fault::ForceHigh), "{finger}, {seed}");
    });
}

#[test]
fn a_load_cell_that_is_wired_the_wrong_way_round_falls() {
    for finger in [FingerName::Analog, FingerName::Mems] {
        let reversed = calibrated(finger, 1, Some(PartFault::CellReversed));
        let counts = block_on(Weights::on(reversed, 1, 1.0).weigh(WEIGHTS_MN[0])).unwrap();
        assert!(counts < -10.0, "{finger}: {counts}");
    }
}

/// The rig asks for a weight of 150 g, and 230 g lie there.
#[test]
fn too_heavy_a_weight_stops() {
    each(1, |finger, seed| {
        let mut rig = Weights::on(calibrated(finger, seed, None), seed, 1.53);
        let why = block_on(rig.weigh(1471)).unwrap_err();
        let high = Failure::Rig(RigError::Fault(Fault::ForceHigh));
        assert_eq!(why, high, "{finger}");
    });
}

/// The lever's driver begins to step down by itself while the finger waits for a weight.
#[test]
fn a_lever_that_comes_down_in_place_of_a_weight_is_seen() {
    each(SEEDS, |finger, seed| {
        let mut rig = calibrated(finger, seed, None);
        for ms in 0..30_000 {
            if ms == 0 {
                rig.control().weigh(1471).unwrap();
            }
            if ms == 100 * seed {
                rig.world().inject(WorldFault::LeverRunaway);
            }
            rig.tick();
        }
        let phase = rig.control().phase();
        assert!(
            matches!(phase, Phase::Faulted(_)),
            "{finger}, {seed}: {phase:?}"
        );
        let most_n = rig.world().truth().force_max_n;
        assert!(most_n < MOST_N, "{finger}, {seed}: {most_n:.3} N");
    });
}

/// A person who points the finger down and turns it over, as asked. Returns the result, and the true values of a g and
/// of the zero, in counts.
fn turned(seed: u64, lean_rad: f64) -> (Result<Turned, Failure>, [f64; 2]) {
    let mut draws = Noise::new(seed, 77);
    let (share, zero_g) = (draws.between(-0.03, 0.03), draws.between(-0.06, 0.06));
    let off = PartFault::AccelerometerOff { share, zero_g };
    let mut rig = Weights::on(calibrated(FingerName::Mems, seed, Some(off)), seed, 1.0);
    let hand = rig.servo.rig.world().hand().unwrap();
    hand.lean(lean_rad);
    let counts_per_g = 1e3 / 0.976;
    let truth = [(1.0 + share) * counts_per_g, zero_g * counts_per_g];
    (block_on(rig.turn_over()), truth)
}

#[test]
fn an_accelerometer_that_is_turned_over_says_what_a_count_is() {
    (1..=10u64).into_par_iter().for_each(|seed| {
        // it stands on something
        let (turned, [g, zero]) = turned(seed, 0.02);
        let turned = turned.unwrap_or_else(|why| panic!("{seed}: {why}"));
        assert!(
            (f64::from(turned.g_counts) / g - 1.0).abs() < 0.005,
            "{seed}: {turned:?}, {g}"
        );
        assert!(
            (f64::from(turned.offset_counts) - zero).abs() < 6.0,
            "{seed}: {turned:?}, {zero}"
        );
        assert!(turned.mg_per_count().is_some(), "{seed}: {turned:?}");
    });
}

/// In a hand that leans by 11 degrees rms a g looks smaller, and a turn that is too far askew is refused.
#[test]
fn a_hand_that_leans_measures_a_little_less() {
    let each = (1..=50u64).into_par_iter().map(|seed| {
        let (turned, [g, _]) = turned(seed, 0.2);
        let turned = turned.ok()?;
        let share = f64::from(turned.g_counts) / g - 1.0;
        assert!((-0.12..0.01).contains(&share), "{seed}: {share}");
        turned.mg_per_count().map(|_| share)
    });
    let each: Vec<Option<f64>> = each.collect();
    let kept: Vec<f64> = each.iter().flatten().copied().collect();
    let mean = kept.iter().sum::<f64>() / kept.len() as f64;
    assert!(
        kept.len() >= 40 && mean > -0.05,
        "{} kept, {mean}",
        kept.len()
    );
}

#[test]
fn a_finger_without_an_accelerometer_is_not_turned_over() {
    for finger in [FingerName::Biotac, FingerName::Analog] {
        let mut rig = Weights::on(calibrated(finger, 1, None), 1, 1.0);
        assert_eq!(block_on(rig.turn_over()), Err(Failure::OtherProbe));
    }
}
