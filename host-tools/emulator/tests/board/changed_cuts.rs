//! "Is it the same one, but changed?": the power is cut while the probe stores the answer, over the link and by the button,
//! yes and no. Judged by the tables that it gave before the answer and after it.

use std::path::Path;

use tactus_core::explorer::Method;
use tactus_core::table::{Name, Table};
use tactus_core::wire::{Event, Identify, Phase, Report, Reset};
use tactus_emulator::board::{Emulator, FlashWrite, Options};
use tactus_emulator::host::power_cut::{Cut, Torn, left_by};
use tactus_emulator::host::talk::{TIMEOUT_S, Talk};
use tactus_emulator::host::under_finger::{self, Unknown};
use tactus_lab::sim::collection::Collection;
use tactus_link::{ReadTable, Request};
use tactus_world::person::Manner;

use crate::common::{boot, elf, elf_of, with_limits_of_change};
use crate::handheld_link::{Held, shows};

/// The texture under the finger, which the table has, and textures of the table.
const TEXTURE: u8 = 47;
const AMONG: u8 = 4;
/// Cuts spread over an answer, and in its last writes: what is written last makes it valid.
const SPREAD: usize = 20;
const LAST: usize = 6;
/// Limits from which on every texture has changed.
const ALL_CHANGED: f32 = -9000.0;
/// Longest exploration, virtual seconds; the store is open by then.
const LONG_S: f64 = 300.0;
const OPEN_S: f64 = 20.0;

/// An answer that was stored without a cut: the store before it, what was done to it, and the tables before and after.
struct Answered {
    before: Vec<u8>,
    writes: Vec<FlashWrite>,
    old: Vec<u8>,
    new: Vec<u8>,
}

impl Answered {
    /// `store` is the one that the answer left.
    fn noted(before: Vec<u8>, writes: Vec<FlashWrite>, tables: [Vec<u8>; 2], store: &[u8]) -> Self {
        let whole = Cut {
            at: writes.len(),
            torn: Torn::Nothing,
            seed: 0,
        };
        assert!(left_by(&before, &writes, whole) == store, "not all noted");
        let [old, new] = tables;
        assert_ne!(old, new);
        Self {
            before,
            writes,
            old,
            new,
        }
    }

    /// The cuts, and what is left of the flash by each: at the first write and the last, in every erase, and between.
    fn cuts(&self) -> impl Iterator<Item = (Cut, Vec<u8>)> + '_ {
        let last = self.writes.len() - 1;
        assert!(last > SPREAD);
        let spread = (0..SPREAD).map(move |n| n * (last - LAST) / (SPREAD - 1));
        let erase = |(_, write): &(usize, &FlashWrite)| matches!(write, FlashWrite::Erase { .. });
        let erases = self.writes.iter().enumerate().filter(erase);
        let places = spread
            .chain(last - LAST + 1..=last + 1)
            .chain(erases.map(|(at, _)| at));
        places.enumerate().map(|(n, at)| {
            let cut = Cut {
                at,
                torn: Torn::ALL[n % Torn::ALL.len()],
                seed: n as u64,
            };
            (cut, left_by(&self.before, &self.writes, cut))
        })
    }

    /// Cuts, boots by `held`, which gives the table that is in force then, and judges it. Returns how often it was the old
    /// one and the new one.
    fn cut(&self, mut held: impl FnMut(Vec<u8>) -> Vec<u8>) -> (usize, usize) {
        let (mut old, mut new) = (0, 0);
        for (cut, store) in self.cuts() {
            let found = held(store);
            old += usize::from(found == self.old);
            new += usize::from(found == self.new);
            let names = |table: &[u8]| -> Vec<String> {
                let table = Table::read(table).unwrap();
                table.names().map(str::to_owned).collect()
            };
            assert!(
                found == self.old || found == self.new,
                "{cut:?} of {}: {:?}",
                self.writes.len(),
                names(&found)
            );
        }
        eprintln!(
            "{} writes: {} cuts left the old table, {} the new one",
            self.writes.len(),
            old,
            new
        );
        assert!(old >= SPREAD && new > 0, "{old} {new}");
        (old, new)
    }
}

fn table(talk: &mut Talk) -> Vec<u8> {
    talk.run(ReadTable::default(), TIMEOUT_S, |_, _| ())
        .unwrap()
}

/// Explores what has changed, and answers with this name.
fn explore(talk: &mut Talk, seed: u32, truth: &str) {
    let identify = Request::identify(Identify {
        seed,
        ..Identify::default()
    });
    let verdict = talk.run(identify, LONG_S, |_, _| ()).unwrap().verdict;
    assert!(verdict.changed && verdict.name == truth, "{verdict:?}");
}

/// The table that a rig holds which boots on this store; nothing is to be complained about.
pub(crate) fn reboot(elf: &Path, unknown: &Unknown, store: Vec<u8>) -> (Talk, Vec<u8>) {
    let options = Options {
        store: Some(store),
        ..Options::default()
    };
    let mut talk = Talk::new(unknown.start(elf, options).unwrap());
    let hear = |_: &mut Emulator, report: Option<&Report>| {
        if let Some(Event::Trouble(why)) = report.map(|r| &r.event) {
            panic!("trouble: {why}");
        }
    };
    let booted = |event: &Event| match event {
        Event::Booted { reset, .. } => Some(Ok(*reset)),
        _ => None,
    };
    assert_eq!(talk.wait(1.0, hear, booted).unwrap(), Reset::Power);
    // no table is in force before the store is open
    while talk
        .run(Request::status(), TIMEOUT_S, hear)
        .unwrap()
        .textures
        == 0
    {
        assert!(talk.now_ns() < (OPEN_S * 1e9) as u64);
        talk.board().run_ms(10).unwrap();
    }
    let bytes = talk.run(ReadTable::default(), TIMEOUT_S, hear).unwrap();
    (talk, bytes)
}

/// Waits until a rig has homed that may have said so already.
fn homed(talk: &mut Talk) {
    let status = |talk: &mut Talk| talk.run(Request::status(), TIMEOUT_S, |_, _| ()).unwrap();
    while status(talk).phase != Phase::Ready {
        assert!(talk.now_ns() < (LONG_S * 1e9) as u64);
        talk.board().run_ms(100).unwrap();
    }
}

#[test]
fn an_answer_over_the_link_is_stored_or_not() {
    let Some(elf) = elf() else { return };
    let collection = Collection {
        seed: 3,
        textures: Collection::spread(TEXTURE, AMONG),
        trials: 5,
    };
    let known = under_finger::simulated(&collection, Method::Fused, || ()).unwrap();
    let unknown = under_finger::mounted(&collection, TEXTURE, 2);
    let mut talk = boot(&elf, &unknown, None);
    let changed = with_limits_of_change(&known.table, ALL_CHANGED);
    talk.teach(&known.calibration, &changed, |_, _| ()).unwrap();
    let answers = [unknown.name.as_str(), "another one"];
    for (answer, seed) in answers.into_iter().zip(1..) {
        explore(&mut talk, seed, &unknown.name);
        let old = table(&mut talk);
        talk.board().store_writes().unwrap();
        let before = talk.board().store().unwrap();
        let label = |talk: &mut Talk| {
            let name = Name::try_from(answer).unwrap();
            talk.run(Request::label(name), TIMEOUT_S, |_, _| ())
                .unwrap();
            table(talk)
        };
        let new = label(&mut talk);
        let writes = talk.board().store_writes().unwrap();
        let store = talk.board().store().unwrap();
        let answered = Answered::noted(before, writes, [old, new], &store);
        let textures = |table: &[u8]| Table::read(table).unwrap().textures();
        let more = textures(&answered.new) - textures(&answered.old);
        assert_eq!(more, u16::from(answer != unknown.name));
        answered.cut(|store| reboot(&elf, &unknown, store).1);
        // what was cut can be done again
        let middle = Cut {
            at: answered.writes.len() / 2,
            torn: Torn::Bits,
            seed: 1,
        };
        let store = left_by(&answered.before, &answered.writes, middle);
        let (mut again, found) = reboot(&elf, &unknown, store);
        assert_eq!(found, answered.old);
        homed(&mut again);
        explore(&mut again, seed, &unknown.name);
        let done = label(&mut again);
        assert_ne!(done, answered.old);
        assert_eq!(textures(&done), textures(&answered.new));
    }
}

#[test]
fn an_answer_by_the_button_is_stored_or_not() {
    let Some(elf) = elf_of("TACTUS_HANDHELD_ELF") else {
        return;
    };
    let hold = |store| Held::with(&elf, "burlap", Manner::default(), store);
    let mut held = hold(None);
    let changed = with_limits_of_change(&held.table(), ALL_CHANGED);
    held.push(&changed);
    for yes in [true, false] {
        held.slide_until("Is it the same one?");
        let old = held.table();
        let hold_button = |held: &mut Held| {
            held.press_for(700);
            held.until("what was learned", 5.0, |board| shows(board, "Learned"));
        };
        if !yes {
            held.press_for(100);
            held.until("a new one", 2.0, |board| shows(board, "new: sample 1"));
        }
        held.talk.board().store_writes().unwrap();
        let before = held.talk.board().store().unwrap();
        hold_button(&mut held);
        let writes = held.talk.board().store_writes().unwrap();
        let store = held.talk.board().store().unwrap();
        let new = held.table();
        held.until("ready", 5.0, |board| shows(board, "and hold"));
        Answered::noted(before, writes, [old, new], &store).cut(|store| {
            // nothing is to be complained about
            let mut held = hold(Some(store));
            assert!(shows(held.talk.board(), "textures"));
            held.table()
        });
    }
}
