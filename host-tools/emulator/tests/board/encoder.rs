//! The stage's encoder beside its bridge, whose edges couple into the lines: judged by the world's own count.

use crate::common::elf;
use crate::faults::{board, identify};

const TIM4_CNT: u64 = 0x4000_0824;
/// Length of the spikes, ns: of a wire beside the motor's, without a shield.
const SPIKES_NS: u64 = 600;

#[test]
fn spikes_of_the_bridge_are_not_counted() {
    let Some(elf) = elf() else { return };
    let mut talk = board(&elf, 81, 5);
    talk.board().rig().couple_bridge(SPIKES_NS);
    talk.send(identify(1), 80.0, |_, _| ()).unwrap();
    let counted = talk.board().register(TIM4_CNT).unwrap() as u16;
    let really = talk.board().rig().world().encoder() as u16;
    assert!(
        (counted.wrapping_sub(really) as i16).abs() <= 1,
        "{counted} instead of {really}"
    );
}
