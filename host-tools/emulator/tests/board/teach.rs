//! What the real ELF learns from the host's labels, judged by the texture that really lies under the finger.

use std::path::Path;
use std::sync::OnceLock;

use tactus_core::explorer::Method;
use tactus_core::table::{Name, Table};
use tactus_core::wire::{Identify, Status};
use tactus_emulator::host::exploration::{Exploration, explore};
use tactus_emulator::host::talk::{TIMEOUT_S, Talk, TalkError};
use tactus_emulator::host::under_finger::{self, FirmwareData, Unknown};
use tactus_lab::sim::collection::Collection;
use tactus_link::{ReadTable, Request};

use crate::common::{boot, elf};

/// A texture that the table does not have.
const NEW: u8 = 31;
/// One that it has.
const OLD: u8 = 47;

/// A simulated world of eight textures without [`NEW`].
fn world() -> &'static (Collection, FirmwareData) {
    static WORLD: OnceLock<(Collection, FirmwareData)> = OnceLock::new();
    WORLD.get_or_init(|| {
        let textures = Collection::spread(OLD, 8);
        assert!(!textures.contains(&NEW) && textures.contains(&OLD));
        let collection = Collection::new(3, textures, 5);
        let known = under_finger::simulated(&collection, Method::Fused, &[], || ()).unwrap();
        (collection, known)
    })
}

/// A trial of a texture that nothing was learned from.
fn under(texture: u8, trial: u64) -> Unknown {
    under_finger::mounted(&world().0, texture, trial)
}

/// A board that was given the world's table.
fn told(elf: &Path, unknown: &Unknown) -> Talk {
    let mut talk = boot(elf, unknown, None);
    let FirmwareData { calibration, table } = &world().1;
    talk.teach(calibration, table, |_, _| ()).unwrap();
    talk
}

/// Switches the board off, puts another sample under the finger, and switches it on again.
fn again(elf: &Path, mut talk: Talk, unknown: &Unknown) -> Talk {
    let store = talk.board().store().unwrap();
    drop(talk);
    boot(elf, unknown, Some(store))
}

fn name(name: &str) -> Name {
    name.try_into().unwrap()
}

fn identify(seed: u32) -> Identify {
    Identify {
        seed,
        ..Identify::default()
    }
}

fn status(talk: &mut Talk) -> Status {
    talk.run(Request::status(), TIMEOUT_S, |_, _| ()).unwrap()
}

/// The table in force, which the status reports as well.
fn table(talk: &mut Talk) -> Vec<u8> {
    let bytes = talk
        .run(ReadTable::default(), TIMEOUT_S, |_, _| ())
        .unwrap();
    let read = Table::read(&bytes).unwrap();
    let told = status(talk);
    assert_eq!(
        (told.table_crc, told.table_bytes, told.textures),
        (read.crc(), bytes.len() as u32, read.textures())
    );
    bytes
}

/// Explores, and follows; the probe's work is as good as ever.
fn run_episode(talk: &mut Talk, asked: Identify, truth: &str) -> Exploration {
    let bytes = table(talk);
    let explored = explore(talk, &bytes, asked, truth, |_, _| ()).unwrap();
    eprintln!("{truth}: {:?}", explored.found);
    assert_eq!(explored.missed(), [""; 0]);
    explored
}

#[test]
#[ignore = "long"]
fn an_unknown_texture_is_said_to_be_and_its_name_learned() {
    let Some(elf) = elf() else { return };
    let unknown = under(NEW, 1);
    let mut talk = told(&elf, &unknown);
    // no slide was measured yet
    let answer =
        |talk: &mut Talk, text: &str| talk.run(Request::label(name(text)), TIMEOUT_S, |_, _| ());
    let early = answer(&mut talk, "my texture");
    assert!(matches!(early, Err(TalkError::Refused(_))), "{early:?}");
    let asked = Identify {
        learn: true,
        ..identify(4)
    };
    let before = table(&mut talk);
    let explored = run_episode(&mut talk, asked, &unknown.name);
    let found = explored.found.clone();
    assert!(
        found.unknown && !found.sure && found.wants_label,
        "{found:?}"
    );
    assert!(explored.right() && found.log_odds > Some(0.0), "{found:?}");
    // the probe learns nothing from an unknown texture before it has a name
    assert_eq!(explored.learned, 0);
    assert_eq!(table(&mut talk), before);
    let nameless = answer(&mut talk, "");
    assert!(
        matches!(nameless, Err(TalkError::Refused(_))),
        "{nameless:?}"
    );
    let learned = answer(&mut talk, "my texture").unwrap();
    assert_eq!(
        (learned.name.as_str(), learned.slides),
        ("my texture", found.slides)
    );
    // a label is taken once
    let twice = answer(&mut talk, "my texture");
    assert!(matches!(twice, Err(TalkError::Refused(_))), "{twice:?}");
    let after = table(&mut talk);
    let new = Table::read(&after).unwrap();
    assert_eq!(new.textures(), Table::read(&before).unwrap().textures() + 1);
    // the next episode, of another trial
    let mut talk = again(&elf, talk, &under(NEW, 2));
    assert_eq!(table(&mut talk), after);
    let explored = run_episode(&mut talk, identify(5), "my texture");
    assert_eq!(explored.found.name.as_str(), "my texture");
    assert!(!explored.found.unknown, "{:?}", explored.found);
}
