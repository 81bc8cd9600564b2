//! Power cuts, and a flash that fails, while the probe learns.

use super::*;

const WAYS: [Torn; 6] = [
    Torn::Nothing,
    Torn::Begin(50),
    Torn::End(50),
    Torn::Bits(77),
    Torn::Bits(1_234_567),
    Torn::All,
];

/// Cuts an operation, which says whether it went well, at every word and in every erase; hands the store as it is
/// afterwards to `check`.
fn cut_everywhere(
    ram: &Ram,
    operation: impl Fn(&mut Store<Ram>) -> bool,
    mut check: impl FnMut(&mut Store<Ram>, bool),
) -> usize {
    let mut whole = block_on(Store::open(ram.clone().again())).unwrap();
    assert!(operation(&mut whole));
    let length = whole.close().operations;
    for at in 1..=length {
        for torn in WAYS {
            let mut flash = ram.clone().again();
            flash.cut = Some((at, torn));
            let mut store = block_on(Store::open(flash)).unwrap();
            assert!(!operation(&mut store), "{at} {torn:?}");
            let mut store = again(store);
            assert_eq!(store.settings(), Ok(()));
            check(&mut store, false);
            // and it goes on from there
            operation(&mut store);
            check(&mut again(store), true);
        }
    }
    length * WAYS.len()
}

#[test]
fn a_cut_in_an_answer_leaves_the_old_or_the_new_table() {
    cut_in_an_answer(&base());
}

/// "It is like t1, but changed": yes moves it, another name begins a texture.
#[test]
fn a_cut_while_a_changed_texture_is_confirmed_or_denied_loses_nothing() {
    let bytes = calibrated();
    let table = Table::read(&bytes).unwrap();
    assert!(table.limits().is_some() && table.drift().is_some());
    cut_in_an_answer(&bytes);
}

fn cut_in_an_answer(bytes: &[u8]) {
    let old = Table::read(bytes).unwrap();
    let mut store = store(bytes);
    let mut force = buffer(bytes);
    let episode = summary(&force, 1, &[(0, 2, [-1600, 40, 50])]);
    block_on(learn_by_itself(&episode, &old, &mut store, &mut force)).unwrap();
    let ram = store.close().again();
    for name in ["t1", "elm"] {
        let episode = summary(&force, 1, &[(0, 3, [-1500, 10, 20]), (1, 1, [9, 8, 7])]);
        let operation = |store: &mut Store<Ram>| {
            // the table that was explored with
            let mut force = force.clone();
            block_on(label(&episode, name, &old, store, &mut force)).is_ok()
        };
        let open = |ram: &Ram| {
            let mut store = block_on(Store::open(ram.clone().again())).unwrap();
            let state = |store: &mut Store<Ram>| (stored(store), selves(store, old.crc()));
            let before = state(&mut store);
            assert!(operation(&mut store));
            (before, state(&mut store))
        };
        let (before, after) = open(&ram);
        assert_ne!(before.0, after.0);
        assert_eq!(before.1 != after.1, name == "t1");
        let (mut olds, mut news) = (0, 0);
        let cuts = cut_everywhere(&ram, operation, |store, again| {
            let table = stored(store);
            let selves = selves(store, old.crc());
            if again {
                assert_eq!(table, after.0);
                return;
            }
            assert!(table == before.0 || table == after.0);
            assert!(selves == before.1 || selves == after.1);
            // first the table
            assert!(table == after.0 || selves == before.1);
            olds += usize::from(table == before.0);
            news += usize::from(table == after.0);
            let force = in_force(store);
            let force = Table::read(&force).unwrap();
            assert_eq!((force.limits(), force.drift()), (old.limits(), old.drift()));
        });
        assert!(olds > 100 && news > 0, "{olds} {news} of {cuts}");
    }
}

#[test]
fn a_cut_while_it_learns_leaves_what_it_knew_or_what_it_learned() {
    let bytes = base();
    let old = Table::read(&bytes).unwrap();
    let mut store = store(&bytes);
    let mut force = buffer(&bytes);
    let mut episode = summary(&force, 2, &[(1, 1, [100, 1400, -300])]);
    block_on(learn_by_itself(&episode, &old, &mut store, &mut force)).unwrap();
    episode = summary(&force, 2, &[(1, 1, [90, 1300, -200]), (2, 2, [4, 1500, 8])]);
    let before = in_force(&mut store);
    let ram = store.close().again();
    let mut after = force.clone();
    let mut whole = block_on(Store::open(ram.clone())).unwrap();
    block_on(learn_by_itself(&episode, &old, &mut whole, &mut after)).unwrap();
    after.truncate(before.len());
    let operation = |store: &mut Store<Ram>| {
        let mut buffer = force.clone();
        let told = block_on(learn_by_itself(&episode, &old, store, &mut buffer));
        assert_eq!(told.is_err(), buffer == force, "as it was, if it failed");
        told.is_ok()
    };
    let (mut olds, mut news) = (0, 0);
    cut_everywhere(&ram, operation, |store, again| {
        assert_eq!(stored(store), bytes);
        let now = in_force(store);
        if !again {
            assert!(now == before || now == after);
            olds += usize::from(now == before);
            news += usize::from(now == after);
        }
    });
    assert!(olds > 20 && news > 0, "{olds} {news}");
}

#[test]
fn a_failing_flash_is_reported() {
    let bytes = base();
    let old = Table::read(&bytes).unwrap();
    let mut flash = store(&bytes).close().again();
    flash.cut = Some((1, Torn::Nothing));
    let mut store = block_on(Store::open(flash)).unwrap();
    let mut force = buffer(&bytes);
    let episode = summary(&bytes, 2, &[(1, 1, [100, 1400, -300])]);
    let why = block_on(learn_by_itself(&episode, &old, &mut store, &mut force)).unwrap_err();
    assert_eq!(why, MemoryError::Store(StoreError::Flash(FlashFault::Work)));
    assert_eq!(force, buffer(&bytes));
}
