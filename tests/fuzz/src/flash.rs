//! A flash in RAM, and what stores leave in one.

use std::sync::OnceLock;

use embassy_futures::block_on;
use tactus_core::explorer::Method;
use tactus_core::features::{FeatureSet, Movement, Observation, Properties};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::sensor::pressure::Calibration;
use tactus_core::store::Store;
use tactus_lab::eval::learn::learn;
use tactus_lab::sim::flash::RamFlash;

/// Bytes of the smallest sector: a sixteenth of the chip's, so that they fill up.
pub(crate) const SECTOR: usize = 1024;

/// The sectors of a store.
pub type Flash = RamFlash<SECTOR>;

pub(crate) fn calibration() -> RigCalibration {
    RigCalibration {
        pressure: Calibration::PAPER,
        unloaded_a: (0.037, 0.001),
        newton_per_ampere: 16.4,
        date: 1,
        air_known: true,
        turned: 0,
        serial: *b"BT000000FUZZFUZZ",
    }
}

/// Tables small enough for a sector: of the paper's method, and fused.
pub fn tables() -> &'static [Vec<u8>] {
    static TABLES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    TABLES.get_or_init(|| {
        let movement = |um_s| Movement::new(500, um_s).expect("of the grid's range");
        [
            (Method::Paper, 3, 2),
            (Method::Fused, 3, 2),
            (Method::Fused, 2, 1),
            (Method::Paper, 1, 1),
        ]
        .into_iter()
        .map(|(method, textures, movements)| {
            let names: Vec<String> = (0..textures).map(|n| format!("texture {n}")).collect();
            let movements: Vec<Movement> = (0..movements).map(|n| movement(25_000 + n)).collect();
            let slide = |texture: usize, slide: u8| {
                let wave = f32::from(slide * 7 % 5) * 0.1;
                let value = |by: f32| Some(texture as f32 + wave * by);
                Observation::from(Properties::new([value(1.0), value(-0.6), value(0.3)]))
            };
            let slides: Vec<_> = (0..textures)
                .map(|t| vec![(0..5).map(|n| slide(t, n)).collect(); movements.len()])
                .collect();
            let features = Some(FeatureSet::Properties);
            learn(method, features, &names, &movements, &slides).expect("a table")
        })
        .collect()
    })
}

/// Flash as stores leave it: with a table and a calibration, and full of settings.
pub fn images() -> &'static [Vec<u8>] {
    static IMAGES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    IMAGES.get_or_init(|| {
        (0..tables().len() as u8 + 1)
            .map(|fill| {
                let mut buffer = vec![0; Store::<Flash>::MAX_TABLE];
                block_on(async {
                    let mut store = Store::open(Flash::blank()).await.expect("blank flash");
                    if let Some(table) = tables().get(usize::from(fill)) {
                        store.begin_table(table.len()).await.expect("room");
                        store.write_table(0, table).await.expect("in order");
                        store.commit_table(None, &mut buffer).await.expect("whole");
                    }
                    for date in 0..10 * u32::from(fill) {
                        let calibration = RigCalibration {
                            date,
                            ..calibration()
                        };
                        store.set_calibration(&calibration).await.expect("room");
                    }
                    store.close().bytes
                })
            })
            .collect()
    })
}
