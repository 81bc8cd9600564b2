//! The power is cut at every half of every word that a store writes, and in the middle of every erase: what was stored
//! before is there, or what was being stored; all else stays, and the store goes on.

use embassy_futures::block_on;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::skin::SkinCare;
use tactus_core::sensor::pressure::Calibration;
use tactus_core::store::{Store, StoreError};
use tactus_core::table::factory;
use tactus_lab::sim::flash::RamFlash;

/// Small sectors, so that pages turn after a few records.
type Flash = RamFlash<1024>;
const CALIBRATION: RigCalibration = RigCalibration {
    pressure: Calibration::PAPER,
    unloaded_a: (0.1, 0.001),
    newton_per_ampere: 8.0,
    date: 20_261_121,
    air_known: true,
    turned: 0,
    serial: [b'0'; 16],
};

fn open(flash: Flash) -> Store<Flash> {
    let mut store = block_on(Store::open(flash)).unwrap();
    block_on(store.mend()).unwrap();
    store
}

/// The flash when the power is back.
fn again(store: Store<Flash>) -> Flash {
    let flash = store.close();
    RamFlash {
        halves: None,
        ..flash
    }
}

fn skin(n: u16) -> SkinCare {
    SkinCare::after(n.into(), n.into())
}

/// Runs something with the power cut after each half word; `check` looks at what is left, whether it was done, and `go`
/// is done again on it.
fn cut_everywhere(
    flash: &Flash,
    go: impl Fn(&mut Store<Flash>) -> Result<(), StoreError>,
    check: impl Fn(&mut Store<Flash>, Option<bool>),
) -> (Flash, u32) {
    let mut cuts = 0;
    loop {
        let mut store = open(flash.clone());
        let halves = Some(cuts);
        let cut = RamFlash {
            halves,
            ..store.close()
        };
        store = block_on(Store::open(cut)).unwrap();
        let done = go(&mut store).is_ok();
        let mut store = open(again(store));
        check(&mut store, done.then_some(true));
        go(&mut store).unwrap();
        let mut store = open(again(store));
        check(&mut store, Some(true));
        if done {
            return (again(store), cuts);
        }
        cuts += 1;
    }
}

#[test]
fn a_cut_at_any_half_word_of_a_record_loses_no_other() {
    let mut flash = Flash::blank();
    let (mut cuts, erases) = (0, flash.erases);
    let calibrate = |store: &mut Store<Flash>| block_on(store.set_calibration(&CALIBRATION));
    flash = cut_everywhere(&flash, calibrate, |store, done| {
        let found = block_on(store.calibration()).unwrap();
        assert!(found == Some(CALIBRATION) || done.is_none() && found.is_none());
    })
    .0;
    for n in 1..90 {
        let wear = |store: &mut Store<Flash>| block_on(store.set_skin(&skin(n)));
        let (next, made) = cut_everywhere(&flash, wear, |store, done| {
            let found = block_on(store.skin()).unwrap();
            assert!(found == skin(n) || done.is_none() && found == skin(n - 1));
            assert_eq!(block_on(store.calibration()), Ok(Some(CALIBRATION)));
            assert_eq!((store.settings(), store.damaged_record()), (Ok(()), None));
        });
        cuts += made;
        flash = next;
    }
    assert!(
        cuts > 800 && flash.erases > erases + 3,
        "{cuts} cuts, {} erases",
        flash.erases
    );
}

#[test]
fn a_cut_at_any_half_word_of_a_table_leaves_the_old_or_the_new_one() {
    let long = |at: usize| factory::ALL[at].1;
    let flash = RamFlash::<16384>::blank();
    let mut buffer = vec![0; 65_536];
    let push = |flash: RamFlash<16384>, table: &[u8], buffer: &mut [u8]| {
        let mut store = block_on(Store::open(flash)).unwrap();
        buffer[..table.len()].copy_from_slice(table);
        let done = block_on(store.replace_table(buffer, table.len())).is_ok();
        let flash = store.close();
        (
            RamFlash {
                halves: None,
                ..flash
            },
            done,
        )
    };
    let (flash, _) = push(flash, long(0), &mut buffer);
    // the first words, some in the middle, and the header and commit word at the end
    let whole = (2 + long(1).len().div_ceil(2) + 14) as u32;
    for cut in (0..40)
        .chain((40..whole).step_by(997))
        .chain(whole - 40..whole + 4)
    {
        let halves = Some(cut);
        let (left, done) = push(
            RamFlash {
                halves,
                ..flash.clone()
            },
            long(1),
            &mut buffer,
        );
        let mut store = block_on(Store::open(left)).unwrap();
        let found = block_on(store.read_table(&mut buffer)).unwrap().unwrap();
        let found = found.as_bytes();
        assert!(
            found == long(1) || !done && found == long(0),
            "cut at {cut}"
        );
        assert_eq!(store.damaged_table(), None, "cut at {cut}");
    }
}
