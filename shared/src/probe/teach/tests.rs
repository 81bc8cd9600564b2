//! Learning by itself and from labels, against running means in f64; the power is cut at every word.

mod cuts;

use super::*;
use crate::features::{FeatureSet, MAX_FEATURES};
use crate::store::tests::ram::{Ram, Torn};
use crate::store::{FlashFault, StoreError, TrainingRecord};
use crate::table::tests::{fused_of, known, naming_new, straight};
use crate::table::{
    Drift, EPISODES, Limits, PAIRS, Population, Sections, Tail, TrainingStats, with_sections,
};
use embassy_futures::block_on;
use std::string::ToString;
use std::vec;
use std::vec::Vec as List;

/// Four textures at three movements, three features, five slides each.
fn base() -> List<u8> {
    let ends = [
        [6.0, 0.0, 0.0],
        [-6.0, 0.0, 0.0],
        [0.0, 6.0, 0.0],
        [0.0, -6.0, 1.0],
    ];
    let known: List<List<Whitened>> = ends.iter().map(|end| vec![known(5, end); 3]).collect();
    let whitenings = [straight(3), straight(3), straight(3)];
    fused_of(FeatureSet::Bands, &whitenings, &known)
}

/// The same with drift and limits.
fn calibrated() -> List<u8> {
    let plain = base();
    let table = Table::read(&plain).unwrap();
    let means: List<Whitened> = (0..4).map(|texture| table.whitened(texture, 0)).collect();
    let population = Population::new(3, means.iter().map(|m| (m.slides, &m.mean[..]))).unwrap();
    let tails = [Tail {
        begin: -1.0,
        excess: 2.0,
    }; EPISODES];
    let limits = Limits {
        false_alarm: 0.02,
        drifted: tails,
        same: tails,
    };
    let sections = Sections {
        drift: (Drift::default(), &[[0.5; PAIRS]; 3]),
        novelty: Some((
            limits,
            &[population.clone(), population.clone(), population],
        )),
        slopes: None,
    };
    let mut out = vec![0; 2000];
    let table = with_sections(&mut out, &table, &sections).unwrap();
    table.as_bytes().to_vec()
}

/// A store with this table.
fn store(bytes: &[u8]) -> Store<Ram> {
    let mut store = block_on(Store::open(Ram::new())).unwrap();
    let mut buffer = bytes.to_vec();
    block_on(store.replace_table(&mut buffer, bytes.len())).unwrap();
    store
}

fn again(store: Store<Ram>) -> Store<Ram> {
    block_on(Store::open(store.close().again())).unwrap()
}

/// The stored table.
fn stored(store: &mut Store<Ram>) -> List<u8> {
    let mut buffer = vec![0; 1024];
    let table = block_on(store.read_table(&mut buffer)).unwrap().unwrap();
    table.as_bytes().to_vec()
}

/// The table in force.
fn in_force(store: &mut Store<Ram>) -> List<u8> {
    let bytes = stored(store);
    let mut buffer = vec![0xa5; 1024];
    let base = Table::read(&bytes).unwrap();
    let length = block_on(put_in_force(&base, Some(store), &mut buffer)).unwrap();
    buffer.truncate(length);
    buffer
}

fn selves(store: &mut Store<Ram>, lineage: u32) -> List<SelfLearnedRecord> {
    let mut all = List::new();
    block_on(store.self_learned(lineage, &mut |record| all.push(record))).unwrap();
    all
}

fn summary(table: &[u8], texture: u16, observed: &[(u8, u8, [i16; 3])]) -> EpisodeSummary {
    EpisodeSummary {
        table: Table::read_first(table).unwrap().crc(),
        texture,
        certain: true,
        observed: observed
            .iter()
            .map(|(movement, slides, mean)| (*movement, *slides, Vector::from_slice(mean).unwrap()))
            .collect(),
        paces: heapless::Vec::new(),
    }
}

/// A buffer for a table, with this one at its beginning.
fn buffer(table: &[u8]) -> List<u8> {
    let mut buffer = table.to_vec();
    buffer.resize(900, 0x5a);
    buffer
}

/// Step 8 of the recipe with a memory of three slides, so many slides of this mean, in steps.
fn recipe(mut mean: f64, mut n: f64, slides: u8, z: i16) -> (f64, f64) {
    for _ in 0..slides {
        mean += (f64::from(z) - mean) / (n.min(3.0) + 1.0);
        n = n.max((n + 1.0).min(3.0));
    }
    (mean, n)
}

fn learned_event(name: &str, slides: u8, itself: bool) -> Event {
    let name = Name::try_from(name).unwrap();
    Event::TextureLearned(TextureLearned {
        name,
        slides,
        itself,
    })
}

/// Checks that these textures' statistics are the same to the bit, and from whom.
fn same(new: &Table<'_>, old: &Table<'_>, textures: &[u16]) {
    for &texture in textures {
        assert_eq!(new.tally(texture), old.tally(texture));
        assert_eq!(new.number(texture), old.number(texture));
        for movement in 0..3 {
            let of = |table: &Table<'_>| table.whitened(texture, movement);
            assert_eq!(of(new), of(old));
        }
    }
}

#[test]
fn without_anything_learned_the_table_in_force_is_the_stored_one() {
    let bytes = base();
    let table = Table::read(&bytes).unwrap();
    let mut buffer = buffer(&[]);
    let length = block_on(put_in_force::<Ram>(&table, None, &mut buffer)).unwrap();
    assert_eq!((&buffer[..length], buffer[length]), (&bytes[..], 0x5a));
    let mut store = store(&bytes);
    assert_eq!(in_force(&mut store), bytes);
    let small = block_on(put_in_force(
        &table,
        Some(&mut store),
        &mut buffer[..length - 1],
    ));
    assert_eq!(small, Err(EncodeError::NoSpace(length)));
    // what was learned of another table, or of a texture that is gone, is nothing to this one
    for (lineage, number) in [(table.lineage() ^ 1, 0), (table.lineage(), 9)] {
        let movements = Vec::from_slice(&[(0, 3, Whitened::default())]).unwrap();
        let record = SelfLearnedRecord {
            lineage,
            number,
            movements,
        };
        block_on(store.set_self_learned(&record)).unwrap();
    }
    assert_eq!(in_force(&mut store), bytes);
}

#[test]
fn it_learns_by_itself_by_the_recipe() {
    let bytes = base();
    let old = Table::read(&bytes).unwrap();
    let mut store = store(&bytes);
    let mut force = buffer(&bytes);
    // mean and number of every movement as the recipe has them
    let mut means = [[0.0, 6.0 * 256.0, 0.0]; 3];
    let mut counts = [5.0; 3];
    let episodes: [&[(u8, u8, [i16; 3])]; 4] = [
        &[(1, 1, [100, 1400, -300])],
        &[(1, 2, [150, 1300, -200]), (2, 4, [-500, 2000, 90])],
        &[(2, 1, [0, 1000, 0])],
        // there is no place for a third movement
        &[(0, 3, [900, 900, 900]), (1, 9, [130, 1380, -280])],
    ];
    let mut total = 0;
    for observed in episodes {
        let episode = summary(&force, 2, observed);
        let told = block_on(learn_by_itself(&episode, &old, &mut store, &mut force)).unwrap();
        let mut slides = 0;
        for &(movement, count, z) in observed.iter().filter(|f| f.0 != 0) {
            slides += count;
            let at = usize::from(movement);
            let before = counts[at];
            for (mean, z) in means[at].iter_mut().zip(z) {
                (*mean, counts[at]) = recipe(*mean, before, count, z);
            }
        }
        assert_eq!(told, Some(learned_event("t2", slides, true)));
        total += slides;
        let table = Table::read_first(&force).unwrap();
        for movement in 0..3 {
            let known = table.whitened(2, movement);
            let at = usize::from(movement);
            assert_eq!(f64::from(known.slides), counts[at]);
            for (mean, expected) in known.mean.iter().zip(means[at]) {
                assert!(
                    (f64::from(*mean) - expected).abs() <= 4.5,
                    "{mean} {expected}"
                );
            }
        }
        let tally = table.tally(2);
        assert_eq!((tally.factory, tally.user, tally.itself), (15, 0, total));
        assert_eq!(table.lineage(), old.crc());
        same(&table, &old, &[0, 1, 3]);
        // and so it is after a reset
        store = again(store);
        assert_eq!(in_force(&mut store), table.as_bytes());
        assert_eq!(stored(&mut store), bytes, "the stored table is as it was");
    }
    assert_eq!(means[0], [0.0, 6.0 * 256.0, 0.0]);
    block_on(delete(&Forget::SelfLearned, &old, &mut store, &mut force)).unwrap();
    assert_eq!(in_force(&mut again(store)), bytes, "to the bit");
}

#[test]
fn nothing_is_learned_that_is_not_certain() {
    let bytes = base();
    let old = Table::read(&bytes).unwrap();
    let mut store = store(&bytes);
    let mut force = buffer(&bytes);
    let observed = [(1, 1, [100, 1400, -300])];
    let sure = summary(&bytes, 2, &observed);
    let uncertain = EpisodeSummary {
        certain: false,
        ..sure.clone()
    };
    let changed = EpisodeSummary {
        table: sure.table ^ 1,
        ..sure.clone()
    };
    let nothing = summary(&bytes, 2, &[]);
    let flash = store.close();
    let before = flash.bytes.clone();
    store = block_on(Store::open(flash)).unwrap();
    for episode in [uncertain, changed, nothing] {
        let told = block_on(learn_by_itself(&episode, &old, &mut store, &mut force));
        assert_eq!(told, Ok(None));
    }
    assert_eq!(force, buffer(&bytes));
    let flash = store.close();
    assert!(flash.bytes == before, "nothing is written");
    // twice from one episode: the table is another one after the first time
    let mut store = block_on(Store::open(flash.again())).unwrap();
    assert!(
        block_on(learn_by_itself(&sure, &old, &mut store, &mut force))
            .unwrap()
            .is_some()
    );
    let once = force.clone();
    assert_eq!(
        block_on(learn_by_itself(&sure, &old, &mut store, &mut force)),
        Ok(None)
    );
    assert_eq!(force, once);
}

#[test]
fn a_mean_shifts_as_far_as_the_drift_and_no_farther() {
    // of variance 0.5 in 3 axes, and 1/7 + 1/5 of the slides: 3 + 4 sqrt(6) = 12.8 = 3.9^2 of 0.843
    for (bytes, most) in [(base(), 2.1), (calibrated(), 3.28)] {
        let old = Table::read(&bytes).unwrap();
        for (off, goes) in [(most - 0.03, true), (most + 0.03, false)] {
            let mut store = store(&bytes);
            let mut force = buffer(&bytes);
            let at = [6 * 256, (off * 256.0) as i16, 0];
            let mut told = Ok(None);
            // until the mean is there
            for _ in 0..40 {
                let episode = summary(&force, 0, &[(0, 2, at)]);
                let before = force.clone();
                told = block_on(learn_by_itself(&episode, &old, &mut store, &mut force));
                if told.is_err() {
                    assert!(force == before && in_force(&mut store) == before[..bytes.len()]);
                    break;
                }
            }
            match goes {
                true => assert_eq!(told, Ok(Some(learned_event("t0", 2, true))), "{off}"),
                false => assert_eq!(told, Err(MemoryError::TooFar(name_of("t0"))), "{off}"),
            }
        }
    }
}

#[test]
fn a_table_that_would_name_new_textures_learns_nothing_by_itself() {
    let plain = base();
    for (share, may) in [(0.1, true), (0.11, false)] {
        let bytes = naming_new(&plain, [share, 0.0, 1.0]);
        let old = Table::read(&bytes).unwrap();
        let (mut store, mut force) = (store(&bytes), buffer(&bytes));
        let episode = summary(&force, 2, &[(1, 2, [100, 1400, -300])]);
        let told = block_on(learn_by_itself(&episode, &old, &mut store, &mut force));
        match may {
            true => assert_eq!(told, Ok(Some(learned_event("t2", 2, true)))),
            false => assert_eq!(told, Err(MemoryError::NamesNew)),
        }
        assert_eq!(force == buffer(&bytes), !may);
    }
}

#[test]
fn textures_that_shift_the_same_way_stop_it_until_the_table_is_another() {
    let bytes = calibrated();
    let old = Table::read(&bytes).unwrap();
    let learned = |shifts: [[f64; 3]; 4], movements: [u8; 4]| {
        let mut store = store(&bytes);
        let mut force = buffer(&bytes);
        let each = shifts.iter().zip(movements).zip(0u16..);
        let each = each.map(|((shift, movement), texture)| {
            let mean = old.whitened(texture, movement).mean;
            let at = [0, 1, 2].map(|axis| mean[axis] + (shift[axis] * 256.0) as i16);
            let mut told = Ok(None);
            for _ in 0..10 {
                let episode = summary(&force, texture, &[(movement, 2, at)]);
                told = block_on(learn_by_itself(&episode, &old, &mut store, &mut force));
            }
            told.is_ok()
        });
        each.collect::<List<bool>>()
    };
    // each goes as far, and none too far; but not the same way
    let (to, back) = ([1.6, 1.0, 0.8], [-1.6, -1.0, -0.8]);
    assert_eq!(learned([to, back, to, back], [0; 4]), [true; 4]);
    assert_eq!(learned([to; 4], [0; 4]), [true, true, true, false]);
    // the axes of other movements are others
    assert_eq!(learned([to; 4], [0, 0, 0, 1]), [true; 4]);
}

#[test]
fn a_label_updates_a_known_texture() {
    let bytes = base();
    let old = Table::read(&bytes).unwrap();
    let mut store = store(&bytes);
    let mut force = buffer(&bytes);
    // it has learned one movement of it by itself before
    let episode = summary(&force, 1, &[(0, 2, [-1600, 40, 50])]);
    block_on(learn_by_itself(&episode, &old, &mut store, &mut force)).unwrap();
    let by_itself = Table::read_first(&force).unwrap().whitened(1, 0);
    let observed = [
        (0, 3, [-1500, 10, 20]),
        (2, 1, [-1700, -10, -20]),
        (9, 1, [1, 2, 3]),
    ];
    // the most probable one was another
    let episode = summary(&force, 3, &observed);
    let told = block_on(label(&episode, "t1", &old, &mut store, &mut force)).unwrap();
    assert_eq!(told, learned_event("t1", 4, false));
    let mut store = again(store);
    let new = stored(&mut store);
    let new = Table::read(&new).unwrap();
    assert!(new.names().eq(old.names()));
    assert_eq!(new.lineage(), old.crc());
    let mut expected = [[-6.0 * 256.0, 0.0, 0.0]; 3];
    for &(movement, count, z) in observed.iter().take(2) {
        let mean = &mut expected[usize::from(movement)];
        for (mean, z) in mean.iter_mut().zip(z) {
            *mean = recipe(*mean, 5.0, count, z).0;
        }
    }
    for movement in 0..3 {
        let known = new.whitened(1, movement);
        assert_eq!(known.slides, 5, "more than the memory already");
        for (mean, expected) in known.mean.iter().zip(expected[usize::from(movement)]) {
            assert!(
                (f64::from(*mean) - expected).abs() <= 4.5,
                "{mean} {expected}"
            );
        }
    }
    let tally = new.tally(1);
    assert_eq!((tally.factory, tally.user, tally.itself), (15, 4, 0));
    same(&new, &old, &[0, 2, 3]);
    // what it had learned by itself goes the same way, and is still in force
    let force = in_force(&mut store);
    let force = Table::read(&force).unwrap();
    let mut expected = by_itself;
    (0..3).for_each(|_| expected.adapt(&[-1500, 10, 20]));
    assert_eq!(force.whitened(1, 0), expected);
    assert_eq!(force.whitened(1, 2), new.whitened(1, 2));
    let tally = force.tally(1);
    assert_eq!((tally.factory, tally.user, tally.itself), (15, 4, 2));
}

#[test]
fn a_label_adds_a_new_texture() {
    let bytes = base();
    let old = Table::read(&bytes).unwrap();
    let mut store = store(&bytes);
    // a cut has left what was learned of a texture that had its number
    let stale = SelfLearnedRecord {
        lineage: old.lineage(),
        number: 4,
        movements: Vec::from_slice(&[(0, 3, known(9, &[30.0; 3]))]).unwrap(),
    };
    block_on(store.set_self_learned(&stale)).unwrap();
    let mut force = buffer(&bytes);
    let observed = [(0, 3, [700, -701, 5]), (2, 1, [-3, 4, 9000])];
    let episode = summary(&force, 3, &observed);
    let told = block_on(label(&episode, "elm", &old, &mut store, &mut force)).unwrap();
    assert_eq!(told, learned_event("elm", 4, false));
    let mut store = again(store);
    let new = stored(&mut store);
    assert_eq!(in_force(&mut store), new, "nothing is left of the other");
    assert_eq!(selves(&mut store, old.lineage()), []);
    let new = Table::read(&new).unwrap();
    assert_eq!(
        (new.textures(), new.find("elm"), new.number(4)),
        (5, Some(4), 4)
    );
    for &(movement, slides, mean) in &observed {
        let mut expected = Whitened {
            slides,
            mean: [0; MAX_FEATURES],
        };
        expected.mean[..3].copy_from_slice(&mean);
        assert_eq!(new.whitened(4, movement), expected);
    }
    assert_eq!(new.whitened(4, 1), Whitened::default());
    let tally = new.tally(4);
    assert_eq!((tally.factory, tally.user, tally.itself), (0, 4, 0));
    same(&new, &old, &[0, 1, 2, 3]);
}

#[test]
fn an_answer_to_nothing_is_refused() {
    let bytes = base();
    let old = Table::read(&bytes).unwrap();
    let mut store = store(&bytes);
    let mut force = buffer(&bytes);
    let good = summary(&bytes, 0, &[(0, 1, [1, 2, 3])]);
    let mut refused =
        |episode: &EpisodeSummary, name: &str, base: &Table<'_>, force: &mut List<u8>| {
            let why = block_on(label(episode, name, base, &mut store, force)).unwrap_err();
            assert_eq!(stored(&mut store), bytes);
            why.to_string()
        };
    let changed = EpisodeSummary {
        table: good.table ^ 1,
        ..good.clone()
    };
    let why = refused(&changed, "elm", &old, &mut force);
    assert!(why.contains("changed since the exploration"), "{why}");
    let nothing = summary(&bytes, 0, &[]);
    let why = refused(&nothing, "elm", &old, &mut force);
    assert!(why.contains("by `train` only"), "{why}");
    let why = refused(&good, "", &old, &mut force);
    assert!(why.contains("the name of texture 5 is empty"), "{why}");
    let full = vec![vec![known(1, &[0.0])]; MAX_TEXTURES];
    let full = fused_of(FeatureSet::Bands, &[straight(1)], &full);
    let episode = summary(&full, 0, &[(0, 1, [1, 2, 3])]);
    let mut force = full.clone();
    let why = refused(&episode, "elm", &Table::read(&full).unwrap(), &mut force);
    assert!(why.contains("forget a texture first"), "{why}");
    // no space for one more
    let mut force = bytes.clone();
    let why = refused(&good, "elm", &old, &mut force);
    assert!(why.contains("there is less room"), "{why}");
}

#[test]
fn textures_are_renamed_and_deleted() {
    let bytes = base();
    let old = Table::read(&bytes).unwrap();
    let mut store = store(&bytes);
    let mut force = buffer(&bytes);
    for texture in [1, 3] {
        let episode = summary(&force, texture, &[(0, 1, [1, 2, 3])]);
        block_on(learn_by_itself(&episode, &old, &mut store, &mut force)).unwrap();
    }
    let learned = Table::read_first(&force).unwrap().whitened(3, 0);
    let refused = block_on(rename("elm", "oak", &old, &mut store, &mut force)).unwrap_err();
    assert_eq!(refused.to_string(), "there is no texture elm in the table");
    let refused = block_on(rename("t1", "t2", &old, &mut store, &mut force)).unwrap_err();
    assert_eq!(refused.to_string(), "there is a texture t2 already");
    assert_eq!(stored(&mut store), bytes);
    block_on(rename("t3", "oak", &old, &mut store, &mut force)).unwrap();
    let bytes = stored(&mut store);
    let renamed = Table::read(&bytes).unwrap();
    assert_eq!(
        renamed.names().collect::<List<_>>(),
        ["t0", "t1", "t2", "oak"]
    );
    let bytes = in_force(&mut store);
    let force_now = Table::read(&bytes).unwrap();
    assert_eq!(
        force_now.whitened(3, 0),
        learned,
        "it keeps what was learned by itself"
    );

    let gone = |name| Forget::Texture(Name::try_from(name).unwrap());
    let refused = block_on(delete(&gone("t3"), &renamed, &mut store, &mut force)).unwrap_err();
    assert_eq!(refused.to_string(), "there is no texture t3 in the table");
    block_on(delete(&gone("t1"), &renamed, &mut store, &mut force)).unwrap();
    let mut store = again(store);
    let bytes = stored(&mut store);
    let less = Table::read(&bytes).unwrap();
    assert_eq!(less.names().collect::<List<_>>(), ["t0", "t2", "oak"]);
    let left = selves(&mut store, old.crc());
    assert_eq!(left.iter().map(|r| r.number).collect::<List<_>>(), [3]);
    let bytes = in_force(&mut store);
    let force_now = Table::read(&bytes).unwrap();
    assert_eq!(force_now.whitened(2, 0), learned, "by its number");
    for movement in 1..3 {
        assert_eq!(force_now.whitened(2, movement), old.whitened(3, movement));
    }
    // the last one stays
    let bytes = fused_of(FeatureSet::Bands, &[straight(1)], &[vec![known(1, &[0.0])]]);
    let one = Table::read(&bytes).unwrap();
    let refused = block_on(delete(&gone("t0"), &one, &mut store, &mut force)).unwrap_err();
    assert_eq!(refused.to_string(), "a table cannot be without any texture");
}

#[test]
fn unfinished_training_is_deleted() {
    let bytes = base();
    let old = Table::read(&bytes).unwrap();
    let mut store = store(&bytes);
    let movement = old.movement(0).unwrap();
    let stats = TrainingStats::Fused(known(2, &[1.0; 3]));
    for name in ["elm", "oak"] {
        let name = Name::try_from(name).unwrap();
        let table = None;
        let record = TrainingRecord {
            name,
            movement,
            table,
            stats,
        };
        block_on(store.set_training_record(&record)).unwrap();
    }
    let what = Forget::Training(Name::try_from("elm").unwrap());
    block_on(delete(&what, &old, &mut store, &mut [])).unwrap();
    assert_eq!(
        block_on(store.training_record("elm", movement, None)),
        Ok(None)
    );
    assert_eq!(
        block_on(store.training_record("oak", movement, None)),
        Ok(Some(stats))
    );
    assert_eq!(stored(&mut store), bytes);
}
