//! The power is cut at every word and in every erase of every operation: the state before it or the one after it is
//! left.

use super::ram::Torn;
use super::*;
use crate::table::Whitened;
use crate::table::tests::fixed;
use proptest::prelude::*;

/// An operation of the store, small enough for a page of the tests.
#[derive(Clone, Debug)]
enum Operation {
    Push(u8, usize),
    /// Begun, and never committed.
    Half(u8),
    Factory,
    Calibrate(u8),
    Skin(u8),
    Train(u8, Option<u32>, u8),
    Forget(u8),
    /// By itself.
    Learn(u8, u8),
    /// Forgets what was learned by itself: of this texture, or all.
    Unlearn(Option<u8>),
    EraseSettings,
}

/// The expected contents of the store.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct Model {
    pub(super) table: Option<Vec<u8>>,
    pub(super) calibration: Option<RigCalibration>,
    pub(super) skin: SkinCare,
    /// By texture and table.
    pub(super) training_record: [[Option<TrainingStats>; 2]; 2],
    pub(super) self_learned: [Option<SelfLearnedRecord>; 2],
}

const NAMES: [&str; 2] = ["felt", "sandpaper of 100 grit"];
const TABLES: [Option<u32>; 2] = [None, Some(0x1234_5678)];

/// Of both textures that are learned: lineage and number.
const SELVES: [(u32, u16); 2] = [(0x89AB_CDEF, 0), (0x89AB_CDEF, 300)];

pub(super) fn self_learned(texture: u8, n: u8) -> SelfLearnedRecord {
    let (lineage, number) = SELVES[usize::from(texture)];
    let whitened = Whitened {
        slides: n,
        mean: core::array::from_fn(|i| i16::from(n) * i as i16),
    };
    SelfLearnedRecord {
        lineage,
        number,
        movements: (0..1 + n % 2)
            .map(|movement| (movement, n, whitened))
            .collect(),
    }
}

impl Model {
    fn after(&self, operation: &Operation) -> Self {
        let mut next = self.clone();
        match *operation {
            Operation::Push(n, _) => next.table = Some(any_table(n)),
            Operation::Half(_) => {}
            Operation::Factory => next.table = None,
            Operation::Calibrate(n) => next.calibration = Some(calibration(n)),
            Operation::Skin(n) => next.skin = SkinCare::after(n.into(), n.into()),
            Operation::Train(name, on, trials) => {
                let on = TABLES.iter().position(|t| *t == on).unwrap();
                next.training_record[usize::from(name)][on] = Some(stats(trials));
            }
            Operation::Forget(name) => next.training_record[usize::from(name)] = [None; 2],
            Operation::Learn(texture, n) => {
                next.self_learned[usize::from(texture)] = Some(self_learned(texture, n));
            }
            Operation::Unlearn(Some(texture)) => next.self_learned[usize::from(texture)] = None,
            Operation::Unlearn(None) => next.self_learned = [None, None],
            Operation::EraseSettings => {
                next = Self {
                    table: next.table,
                    ..Self::default()
                };
            }
        }
        next
    }

    pub(super) fn of(store: &mut Store<Ram>) -> Self {
        assert_eq!(store.settings(), Ok(()));
        assert_eq!(store.damaged_table(), None, "a cut is no damage");
        Self::damaged(store)
    }

    /// Number of the settings that are not as in `other`.
    pub(super) fn differences(&self, other: &Self) -> usize {
        let records = self.training_record.iter().flatten();
        let theirs = other.training_record.iter().flatten();
        let selves = self.self_learned.iter().zip(&other.self_learned);
        usize::from(self.table != other.table)
            + usize::from(self.calibration != other.calibration)
            + usize::from(self.skin != other.skin)
            + records.zip(theirs).filter(|(a, b)| a != b).count()
            + selves.filter(|(a, b)| a != b).count()
    }

    /// Of a store that may be damaged; nothing where the settings cannot be used.
    pub(super) fn damaged(store: &mut Store<Ram>) -> Self {
        let table = used(store);
        if store.settings().is_err() {
            return Self {
                table,
                ..Self::default()
            };
        }
        block_on(async {
            let mut training_record = [[None; 2]; 2];
            for (name, of_name) in NAMES.into_iter().zip(&mut training_record) {
                for (on, found) in TABLES.into_iter().zip(of_name) {
                    *found = store
                        .training_record(name, Movement::FOR_FINENESS, on)
                        .await
                        .unwrap();
                }
            }
            let mut selves = [None, None];
            let mut each = |record: SelfLearnedRecord| {
                let of = (record.lineage, record.number);
                let texture = SELVES.iter().position(|s| *s == of).unwrap();
                assert_eq!(selves[texture].replace(record), None, "once only");
            };
            store.self_learned(SELVES[0].0, &mut each).await.unwrap();
            Self {
                self_learned: selves,
                table,
                calibration: store.calibration().await.unwrap(),
                skin: store.skin().await.unwrap(),
                training_record,
            }
        })
    }

    /// True if this is left by a cut in `operation`: deleting goes record by record.
    fn is_between(&self, before: &Self, after: &Self, operation: &Operation) -> bool {
        let mut like = before.clone();
        if let Operation::Forget(name) = *operation {
            let name = usize::from(name);
            for on in 0..2 {
                if self.training_record[name][on].is_none() {
                    like.training_record[name][on] = None;
                }
            }
        }
        if let Operation::Unlearn(None) = *operation {
            for (like, left) in like.self_learned.iter_mut().zip(&self.self_learned) {
                if left.is_none() {
                    *like = None;
                }
            }
        }
        *self == like || self == after
    }
}

async fn perform(store: &mut Store<Ram>, operation: &Operation) -> Outcome<()> {
    match *operation {
        Operation::Push(n, part) => push(store, &any_table(n), part).await,
        Operation::Half(n) => {
            let bytes = any_table(n);
            store.begin_table(bytes.len()).await?;
            store.write_table(0, &bytes).await
        }
        Operation::Factory => store.factory_table().await,
        Operation::Calibrate(n) => store.set_calibration(&calibration(n)).await,
        Operation::Skin(n) => {
            let skin = SkinCare::after(n.into(), n.into());
            store.set_skin(&skin).await
        }
        Operation::Train(name, on, trials) => {
            let name = NAMES[usize::from(name)];
            let new = training_record(name, Movement::FOR_FINENESS, on, trials);
            store.set_training_record(&new).await
        }
        Operation::Forget(name) => {
            store
                .delete_training_records(NAMES[usize::from(name)])
                .await
        }
        Operation::Learn(texture, n) => store.set_self_learned(&self_learned(texture, n)).await,
        Operation::Unlearn(texture) => {
            let of = texture.map(|texture| SELVES[usize::from(texture)]);
            store.delete_self_learned(of).await
        }
        Operation::EraseSettings => store.erase_settings().await,
    }
}

/// Ways to be cut, of which the seed picks the random one.
fn ways(seed: u32) -> [Torn; 8] {
    [
        Torn::Nothing,
        Torn::Begin(3),
        Torn::Begin(60),
        Torn::End(3),
        Torn::End(60),
        Torn::Bits(seed | 1),
        Torn::Bits(seed.wrapping_mul(0x9E37_79B9) | 1),
        Torn::All,
    ]
}

/// Cuts `operation` at every word and in every erase, in every way; `before` is what `ram` holds. Returns the flash
/// after the operation without a cut, and the number of cuts.
fn cut_everywhere(ram: &Ram, before: &Model, operation: &Operation) -> (Ram, usize) {
    let after = before.after(operation);
    let mut whole = open(ram.clone().again());
    block_on(perform(&mut whole, operation)).unwrap();
    assert_eq!(Model::of(&mut whole), after, "{operation:?}");
    let whole = whole.close();
    let mut cuts = 0;
    for at in 1..=whole.operations {
        for torn in ways(at as u32) {
            cuts += 1;
            let mut flash = ram.clone().again();
            flash.cut = Some((at, torn));
            let mut store = open(flash);
            let why = block_on(perform(&mut store, operation));
            assert_eq!(why, Err(StoreError::Flash(FlashFault::Work)));
            let mut store = open(store.close().again());
            let left = Model::of(&mut store);
            assert!(
                left.is_between(before, &after, operation),
                "{operation:?} cut at {at}, {torn:?}: {left:?}"
            );
            // and it goes on from there
            block_on(perform(&mut store, operation)).unwrap();
            let after = left.after(operation);
            assert_eq!(
                Model::of(&mut store),
                after,
                "again, {operation:?} {at} {torn:?}"
            );
            assert_eq!(Model::of(&mut open(store.close().again())), after);
        }
    }
    (whole, cuts)
}

#[test]
fn a_cut_anywhere_leaves_the_old_or_the_new_state() {
    let mut ram = Ram::new();
    let mut model = Model::default();
    let (mut cuts, mut erases) = (0, 0);
    let mut operations = vec![
        Operation::Push(1, 5),
        Operation::Push(2, 64),
        Operation::Calibrate(1),
        Operation::Half(4),
        Operation::Factory,
        Operation::Push(3, 16),
        Operation::Train(0, TABLES[0], 2),
        Operation::Train(1, TABLES[0], 3),
        Operation::Train(0, TABLES[1], 2),
        Operation::Push(5, 64),
        Operation::Push(6, 200),
        Operation::Half(7),
        Operation::Push(8, 64),
        Operation::Factory,
    ];
    // round and round the pages
    for n in 0..45 {
        operations.push(Operation::Skin(n));
        if n % 9 == 0 {
            operations.push(Operation::Calibrate(n));
            operations.push(Operation::Train(0, TABLES[0], n));
            operations.push(Operation::Learn(n % 2, n + 1));
        }
    }
    operations.extend([
        Operation::Unlearn(Some(0)),
        Operation::Learn(0, 7),
        Operation::Unlearn(None),
        Operation::Learn(1, 8),
        Operation::Forget(0),
        Operation::EraseSettings,
    ]);
    for operation in &operations {
        let (next, made) = cut_everywhere(&ram, &model, operation);
        model = model.after(operation);
        erases += next.erases;
        ram = next.again();
        cuts += made;
    }
    std::println!("{cuts} cuts, {erases} erases");
    assert!(cuts > 5_000 && erases >= 10, "{cuts} cuts, {erases} erases");
}

/// After a first cut, the recovery is cut as well, and the recovery from that.
#[test]
fn a_cut_in_the_recovery_from_a_cut_loses_nothing() {
    let mut store = open(Ram::new());
    let mut model = Model::default();
    let mut fill = vec![Operation::Calibrate(1), Operation::Train(1, TABLES[1], 9)];
    fill.extend((0..60).map(Operation::Skin));
    let mut cuts = 0;
    for operation in &fill {
        let ram = store.close();
        let erases = ram.erases;
        let before = ram.clone();
        store = open(ram);
        block_on(perform(&mut store, operation)).unwrap();
        let after = model.after(operation);
        if store.flash.erases > erases {
            // this one turned the pages
            let length = store.flash.operations - before.operations;
            for at in (1..=length).rev().take(40) {
                for (n, torn) in ways(at as u32).into_iter().enumerate() {
                    cuts += 1;
                    let mut flash = before.clone().again();
                    flash.cut = Some((at, torn));
                    let mut cut = open(flash);
                    let _ = block_on(perform(&mut cut, operation));
                    let mut flash = cut.close().again();
                    for again in 1..12 {
                        let ways = ways((7 * n + again) as u32);
                        flash.cut = Some((1 + (at + again) % 5, ways[(n + again) % 8]));
                        flash = match block_on(Store::open(flash.clone())) {
                            Ok(mut opened) => {
                                let _ = block_on(perform(&mut opened, operation));
                                opened.close().again()
                            }
                            // the cut fell into the opening, which kept the flash: let it happen without the store
                            Err(_) => {
                                let mut erasures = 0;
                                let mut pages =
                                    super::super::pages::Pages(&mut flash, &mut erasures);
                                let _ = block_on(pages.recover());
                                flash.again()
                            }
                        };
                    }
                    let left = Model::of(&mut open(flash));
                    assert!(left == model || left == after, "{at} {torn:?}: {left:?}");
                }
            }
        }
        model = after;
    }
    assert!(cuts > 300, "{cuts}");
}

proptest! {
    #![proptest_config(fixed(300))]
    #[test]
    fn operations_and_cuts_in_any_order_agree_with_the_model(
        steps in prop::collection::vec((0..13u8, 0..2u8, 0..60u8, any::<Option<(u16, u8)>>()), 1..60)
    ) {
        let mut store = open(Ram::new());
        let mut model = Model::default();
        for (kind, name, n, cut) in steps {
            let on = TABLES[usize::from(n % 2)];
            let operation = match kind {
                0 => Operation::Push(n, 1 + usize::from(n)),
                1 => Operation::Half(n),
                2 => Operation::Factory,
                3 => Operation::Calibrate(n),
                4..=5 => Operation::Skin(n),
                6..=7 => Operation::Train(name, on, n),
                8..=10 => Operation::Learn(name, n),
                11 => Operation::Unlearn((n > 9).then_some(name)),
                _ if n == 0 => Operation::EraseSettings,
                _ => Operation::Forget(name),
            };
            let mut ram = store.close().again();
            ram.cut = cut.map(|(at, way)| (1 + usize::from(at % 150), ways(at.into())[usize::from(way) % 8]));
            store = open_through_cuts(ram);
            let done = block_on(perform(&mut store, &operation));
            let after = model.after(&operation);
            if done.is_err() {
                prop_assert_eq!(done, Err(StoreError::Flash(FlashFault::Work)));
                store = open(store.close().again());
                let left = Model::of(&mut store);
                prop_assert!(left.is_between(&model, &after, &operation), "{:?}: {:?}", operation, left);
                model = left;
            } else {
                model = after;
                prop_assert_eq!(Model::of(&mut store), model.clone());
            }
        }
        let mut again = open(store.close().again());
        prop_assert_eq!(Model::of(&mut again), model);
    }
}

/// Opening a flash that was opened before writes nothing: the cut falls into what comes after.
fn open_through_cuts(ram: Ram) -> Store<Ram> {
    let store = open(ram);
    assert_eq!(store.flash.operations, 0);
    store
}
