//! What the real ELF learns on the go: from trainings, from the host's labels, and by itself; asked over the link, judged by
//! the texture that really lies under the finger.

use std::path::Path;
use std::sync::OnceLock;

use tactus_core::explorer::Method;
use tactus_core::table::{Name, Table, Tally};
use tactus_core::wire::{Event, Forget, Identify, Status, TextureLearned, Train, Verdict};
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
/// Longest exploration or training, virtual seconds.
const LONG_S: f64 = 300.0;

/// A simulated world of eight textures without [`NEW`].
fn world() -> &'static (Collection, FirmwareData) {
    static WORLD: OnceLock<(Collection, FirmwareData)> = OnceLock::new();
    WORLD.get_or_init(|| {
        let textures = Collection::spread(OLD, 8);
        assert!(!textures.contains(&NEW) && textures.contains(&OLD));
        let collection = Collection {
            seed: 3,
            textures,
            trials: 5,
        };
        let known = under_finger::simulated(&collection, Method::Fused, || ()).unwrap();
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
    eprintln!(
        "{truth}: {:?}\n{}",
        explored.found,
        explored.log().join("\n")
    );
    assert_eq!(explored.missed(), [""; 0]);
    explored
}

fn assert_is(found: &Verdict, name: &str) {
    assert!(found.sure && !found.unknown, "{found:?}");
    assert_eq!(found.name.as_str(), name);
}

#[test]
fn a_texture_trained_by_touching_is_recognised() {
    let Some(elf) = elf() else { return };
    let mut talk = told(&elf, &under(NEW, 1));
    let before = table(&mut talk);
    let train = Train {
        name: name("trained"),
        trials: 2,
        pilot: false,
        seed: 1,
    };
    let slides = talk.run(Request::train(train), LONG_S, |_, _| ()).unwrap();
    assert_eq!(slides, 6);
    let after = table(&mut talk);
    let (old, new) = (Table::read(&before).unwrap(), Table::read(&after).unwrap());
    // nothing else has changed
    assert_eq!(new.textures(), old.textures() + 1);
    for (texture, movement) in (0..old.textures()).flat_map(|t| (0..3).map(move |m| (t, m))) {
        assert_eq!(
            new.whitened(texture, movement),
            old.whitened(texture, movement)
        );
    }
    assert_eq!(new.lineage(), old.crc());
    let learned = new.find("trained").unwrap();
    assert_eq!(
        new.tally(learned),
        Tally {
            user: 6,
            ..Tally::default()
        }
    );
    assert!(!status(&mut talk).factory);
    // other trials of it, after the power was off, and of one that was there before
    let mut talk = again(&elf, talk, &under(NEW, 2));
    let explored = run_episode(&mut talk, identify(2), "trained");
    assert_is(&explored.found, "trained");
    let before = under(OLD, 2);
    let mut talk = again(&elf, talk, &before);
    let explored = run_episode(&mut talk, identify(3), &before.name);
    assert_is(&explored.found, &before.name);
}

#[test]
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

#[test]
fn what_it_learns_by_itself_is_kept_and_can_be_deleted() {
    let Some(elf) = elf() else { return };
    let known = under(OLD, 3);
    let mut talk = told(&elf, &known);
    let base = table(&mut talk);
    let asked = Identify {
        learn: true,
        ..identify(6)
    };
    let mut told = None;
    let explored = explore(&mut talk, &base, asked, &known.name, |_, report| {
        if let Some(Event::TextureLearned(learned)) = report.map(|report| &report.event) {
            told = Some(learned.clone());
        }
    })
    .unwrap();
    assert_eq!(explored.missed(), [""; 0]);
    assert_is(&explored.found, &known.name);
    let found = &explored.found;
    let learned = TextureLearned {
        name: found.name.clone(),
        slides: found.slides,
        itself: true,
    };
    assert_eq!(told, Some(learned));
    assert_eq!(explored.learned, found.slides);
    let learned = table(&mut talk);
    assert_ne!(learned, base);
    let tally = Table::read(&learned).unwrap().tally(found.texture);
    assert_eq!((tally.itself, tally.user), (found.slides, 0));
    // a power cycle later it is the same
    let mut talk = again(&elf, talk, &known);
    assert_eq!(table(&mut talk), learned);
    // deleting it gives back the table that was pushed, to the bit
    let forget = || Request::forget(Forget::SelfLearned);
    let store = talk.board().store().unwrap();
    let mut forgetful = boot(&elf, &known, Some(store));
    forgetful.run(forget(), TIMEOUT_S, |_, _| ()).unwrap();
    assert_eq!(table(&mut forgetful), base);
    let mut forgetful = again(&elf, forgetful, &known);
    assert_eq!(table(&mut forgetful), base);
    drop(forgetful);
    // what it learned stays with a texture that gets another name
    let rename = |from: &str, to: &str| Request::rename(name(from), name(to));
    let other = Table::read(&base).unwrap().names().next().unwrap();
    let taken = talk.run(rename(other, &known.name), TIMEOUT_S, |_, _| ());
    assert!(matches!(taken, Err(TalkError::Refused(_))), "{taken:?}");
    talk.run(rename(&known.name, "renamed"), TIMEOUT_S, |_, _| ())
        .unwrap();
    let mut talk = again(&elf, talk, &known);
    let renamed = table(&mut talk);
    let table_of = |bytes| Table::read(bytes).unwrap();
    assert_eq!(table_of(&renamed).find(&known.name), None);
    assert_eq!(table_of(&renamed).find("renamed"), Some(found.texture));
    assert_eq!(table_of(&renamed).tally(found.texture), tally);
    talk.run(rename("renamed", &known.name), TIMEOUT_S, |_, _| ())
        .unwrap();
    // what it learned by itself can still be deleted
    talk.run(forget(), TIMEOUT_S, |_, _| ()).unwrap();
    let forgotten = table(&mut talk);
    for (texture, movement) in (0..8).flat_map(|t| (0..3).map(move |m| (t, m))) {
        let of = |bytes| table_of(bytes).whitened(texture, movement);
        assert_eq!(of(&forgotten), of(&base));
    }
    assert_eq!(table_of(&forgotten).tally(found.texture).itself, 0);
    // a texture goes altogether
    let gone = Request::forget(Forget::Texture(name(other)));
    talk.run(gone, TIMEOUT_S, |_, _| ()).unwrap();
    let less = table(&mut talk);
    assert_eq!(table_of(&less).textures(), 7);
    assert_eq!(table_of(&less).find(other), None);
    assert_eq!(status(&mut talk).fault, None);
}
