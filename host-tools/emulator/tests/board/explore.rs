//! Explorations by the real ELF, judged by the rig's truth.

use std::sync::OnceLock;

use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tactus_core::wire::{Event, Identify, Report};
use tactus_emulator::host::exploration::explore;
use tactus_emulator::host::under_finger::{self, FirmwareData};
use tactus_lab::eval::evaluate::Method;
use tactus_lab::sim::collection::Collection;

use crate::common::{boot, elf};

/// A simulated world of six textures.
pub(crate) fn world() -> &'static (Collection, FirmwareData) {
    static WORLD: OnceLock<(Collection, FirmwareData)> = OnceLock::new();
    WORLD.get_or_init(|| {
        let collection = Collection::new(3, Collection::spread(47, 6), 5);
        let known =
            under_finger::simulated(&collection, Method::Fused.method(), &[], || ()).unwrap();
        (collection, known)
    })
}

#[test]
fn garbage_on_the_line_is_reported_and_never_believed() {
    let Some(elf) = elf() else { return };
    let (collection, known) = world();
    let unknown = under_finger::mounted(collection, collection.textures[3], 2);
    let mut talk = boot(&elf, &unknown, None);
    talk.teach(&known.calibration, &known.table, |_, _| ())
        .unwrap();
    let mut random = ChaCha8Rng::seed_from_u64(20);
    let mut garbage = vec![0; 20_000];
    random.fill_bytes(&mut garbage);
    let mut pieces = garbage.chunks(400);
    let (mut exploring, mut damaged, mut answers) = (false, 0, 0);
    let asked = Identify {
        seed: 11,
        ..Identify::default()
    };
    let explored = explore(
        &mut talk,
        &known.table,
        asked,
        &unknown.name,
        |board, report| {
            match report.map(|Report { event, .. }| event) {
                Some(Event::Chosen { .. }) => exploring = true,
                Some(Event::Damaged(count)) => damaged = *count,
                // nothing but the requests that frame the exploration
                Some(Event::Done(_) | Event::Refused { .. }) => answers += 1,
                // every 50 ms, so that its answers find room
                None if exploring && board.now_ns() / 1_000_000 % 50 == 0 => {
                    board.send(pieces.next().unwrap_or_default());
                }
                _ => {}
            }
        },
    )
    .unwrap();
    assert_eq!(pieces.next(), None, "all of it was sent");
    // one in 256 bytes ends a frame
    assert!(damaged > 40, "{damaged} damaged frames");
    assert_eq!(explored.counts.damaged_frames, damaged);
    assert_eq!(answers, 3, "Stream, Identify, Status");
    assert_eq!(explored.missed(), [""; 0]);
    assert!(explored.right(), "{explored:?}");
    assert_eq!(talk.board().violations().unwrap(), []);
}
