//! A kitchen scale's weights on a rig's lifted finger, as `device calibrate --weights` asks for them.

use tactus_core::rig::weigh::ForceScale;
use tactus_core::sensor::FingerName;
use tactus_core::wire::{Event, Prompt, Report};
use tactus_emulator::board::{Emulator, Options};
use tactus_emulator::host::talk::{TIMEOUT_S, Talk};
use tactus_link::Request;
use tactus_world::person::{Hand, Manner};
use tactus_world::world::Setup;

/// Weights as a kitchen scale shows them, 30, 60, 90, 120 and 150 g, as forces in mN.
const WEIGHTS_MN: [u16; 5] = [294, 588, 883, 1177, 1471];

use crate::common::{elf_of, ready};

/// The finger must never feel more, N.
const MOST_N: f64 = 2.2;
/// Day of the calibration.
const DAY: u32 = 20_261_125;

/// A rig with the finger `mems`, which is ready.
fn mems() -> Option<Talk> {
    let setup = Setup {
        texture: 60,
        finger: FingerName::Mems,
        ..Setup::default()
    };
    let elf = elf_of("TACTUS_ELF")?;
    let mut talk = Talk::new(Emulator::start(&elf, setup, Options::default()).unwrap());
    ready(&mut talk);
    Some(talk)
}

/// Lays on what the probe asks for, and takes it away again when it asks for that.
struct Scale {
    /// The world's force on the finger at the last moment that the weight lay there, N.
    lay_n: f64,
}

impl Scale {
    fn hear(&mut self, board: &mut Emulator, report: Option<&Report>) {
        let newton = match report.map(|report| &report.event) {
            Some(Event::Prompt(Prompt::Weigh(mn))) => f64::from(*mn) * 1e-3,
            Some(Event::Prompt(_)) => 0.0,
            _ => return,
        };
        let mut rig = board.rig();
        if newton == 0.0 {
            self.lay_n = self.lay_n.max(rig.world().truth().force_n);
        }
        let hand = rig.world().hand();
        hand.expect("a hand lays weights").intend(newton, 0.0);
    }

    /// P_DC above the air as the probe tells it, counts, and what lay on the finger in truth, mN.
    fn weigh(talk: &mut Talk, mn: u16) -> (f32, f32) {
        let mut scale = Self { lay_n: 0.0 };
        let weigh = Request::weigh(mn);
        let counts = talk.run(weigh, TIMEOUT_S, |board, report| scale.hear(board, report));
        (counts.unwrap(), (scale.lay_n * 1e3) as f32)
    }
}

#[test]
#[ignore = "long"]
fn a_rig_is_weighed_and_reads_what_lies_on_its_finger() {
    let Some(mut talk) = mems() else { return };
    let mut calibration = talk
        .run(Request::calibrate(), TIMEOUT_S, |_, _| ())
        .unwrap();
    assert!(calibration.air_known && calibration.scale_day().is_none());
    // what lies on the finger does not tremble
    let still = Manner {
        tremor: 0.0,
        wander: 0.0,
        ..Manner::default()
    };
    talk.board().rig().world().hold(Hand::new(1, still));
    let weighed = WEIGHTS_MN.map(|mn| Scale::weigh(&mut talk, mn));
    eprintln!("counts, mN in truth: {weighed:?}");
    for ((_, lay_mn), mn) in weighed.iter().zip(WEIGHTS_MN) {
        let off = (lay_mn - f32::from(mn)).abs();
        assert!(off < 0.02 * f32::from(mn), "{mn} mN: {lay_mn} in truth");
    }
    // as `device calibrate` does
    let points = std::array::from_fn::<_, 5, _>(|at| (weighed[at].0, f32::from(WEIGHTS_MN[at])));
    let scale = ForceScale::of(&points).expect("a line through 0");
    calibration.pressure.force_mn_per_count = scale.mn_per_count;
    calibration.date = DAY;
    let write = Request::write_calibration(&calibration).unwrap();
    talk.run(write, TIMEOUT_S, |_, _| ()).unwrap();
    let kept = talk
        .run(Request::read_calibration(), TIMEOUT_S, |_, _| ())
        .unwrap();
    assert_eq!(kept.scale_day(), Some(DAY));
    let mn_per_count = kept.pressure.force_mn_per_count;
    for (counts, lay_mn) in weighed {
        let share = counts * mn_per_count / lay_mn;
        assert!((share - 1.0).abs() < 0.03, "{counts} counts: {share}");
    }
    // another weight, by the constants that it keeps now
    let (counts, lay_mn) = Scale::weigh(&mut talk, 700);
    let share = counts * mn_per_count / lay_mn;
    assert!((share - 1.0).abs() < 0.03, "{counts} counts: {share}");
    let mut rig = talk.board().rig();
    assert_eq!(rig.world().complaints(), 0);
    assert!(rig.world().truth().force_max_n < MOST_N);
}
