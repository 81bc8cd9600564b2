//! Wrote `store-before-4.bin.gz` and `store-before-4.json` at commit 92327c6, the last one before version 4 of tables: see
//! README.md. It is compiled there only, and shall stay as it is.

use std::cell::RefCell;
use std::fs;
use std::io::Write as _;
use std::path::PathBuf;

use embassy_futures::block_on;
use flate2::{Compression, write::GzEncoder};
use serde::Serialize;
use serde_json::json;
use tactus_lab::sim::collection::{Collection, calibrated};
use tactus_lab::sim::flash::{RamFlash, SECTOR};
use tactus_lab::sim::probe::{Host, switch_on};
use tactus_lab::sim::rig::SimRig;
use tactus_core::dsp::{Plain, Plan};
use tactus_core::explorer::Method;
use tactus_core::features::Movement;
use tactus_core::probe::teach::put_in_force;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::store::{SelfLearnedRecord, Store};
use tactus_core::table::{Name, Table};
use tactus_core::wire::{Command, Event, Identify, MAX_FRAME, PART, Train, encode};

/// The texture that is learned, one that the table has, and one that is given a name.
const NEW: u8 = 31;
const OLD: u8 = 47;
const NAMED: u8 = 100;

struct Said;

impl Host for Said {
    fn tell(&mut self, event: Event) {
        match event {
            Event::Verdict(_) | Event::TextureLearned(_) | Event::Trouble(_) => {
                println!("{event:?}");
            }
            _ => {}
        }
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

fn frame(message: &impl Serialize) -> String {
    hex(encode(message, &mut [0; MAX_FRAME + 1]).unwrap())
}

/// What the image of that day does with a texture under the finger; the flash that is left.
fn life(
    world: &Collection,
    calibration: RigCalibration,
    texture: u8,
    trial: u64,
    flash: RamFlash,
    commands: &[Command],
) -> RamFlash {
    let factory = fs::read("shared/tables/factory.tact").unwrap();
    let (mut buffer, plan, host) = (vec![0; SECTOR], Plan::new(), RefCell::new(Said));
    let mut rig = SimRig::new(world.setup(texture, trial));
    rig.control().calibrate(calibration).unwrap();
    rig.home().unwrap();
    let mut probe = switch_on(rig, flash, &factory, &mut buffer, &plan, &host).unwrap();
    for command in commands {
        block_on(probe.perform::<Plain>(command)).unwrap();
    }
    probe.memory.close().0.unwrap().close()
}

fn main() {
    let out = PathBuf::from(std::env::args().nth(1).expect("a folder"));
    // the world of the board's tests
    let world = Collection {
        seed: 3,
        textures: Collection::spread(OLD, 8),
        trials: 5,
    };
    let first = *world.textures.first().unwrap();
    let measured = calibrated(world.setup(first, 0)).unwrap();
    let calibration = RigCalibration {
        date: 20_261_121,
        serial: *b"BT-0123456789abc",
        ..measured
    };
    let name = |name: &str| Name::try_from(name).unwrap();
    let table = world.learn(Method::Fused, measured, || ()).unwrap();
    let mut commands = vec![
        Command::WriteCalibration(calibration.to_bytes().into_iter().collect()),
        Command::BeginTable(table.len() as u32),
    ];
    for (part, at) in table.chunks(PART).zip((0..).step_by(PART)) {
        commands.push(Command::WriteTable {
            offset: at,
            bytes: part.iter().copied().collect(),
        });
    }
    commands.push(Command::CommitTable);
    let train = |texture: &str, trials| {
        Command::Train(Train {
            name: name(texture),
            trials,
            pilot: false,
            seed: 1,
        })
    };
    commands.push(train("trained", 2));
    let flash = life(&world, calibration, NEW, 1, RamFlash::blank(), &commands);
    // it learns by itself, and is told a name
    let identify = |learn, seed| {
        Command::Identify(Identify {
            learn,
            seed,
            ..Identify::default()
        })
    };
    let told = [identify(false, 4), Command::Label(name("named"))];
    let flash = life(&world, calibration, NAMED, 1, flash, &told);
    let flash = life(&world, calibration, OLD, 1, flash, &[identify(true, 6)]);

    let mut store = block_on(Store::open(flash)).unwrap();
    let mut bytes = vec![0; SECTOR];
    let table = block_on(store.read_table(&mut bytes)).unwrap().unwrap();
    let table = table.as_bytes().to_vec();
    let base = Table::read(&table).unwrap();
    let mut in_force = vec![0; SECTOR];
    let length = block_on(put_in_force(&base, Some(&mut store), &mut in_force)).unwrap();
    let mut learned = Vec::new();
    let mut each = |record: SelfLearnedRecord| learned.push(frame(&record));
    block_on(store.self_learned(base.lineage(), &mut each)).unwrap();
    assert_eq!(learned.len(), 1);
    // trainings that were begun
    let stats = tactus_core::table::TrainingStats::Fused(base.whitened(0, 0));
    let mut trained = Vec::new();
    for (n, movement) in (0..).zip(Collection::MOVEMENTS) {
        let record = tactus_core::store::TrainingRecord {
            name: name("unfinished"),
            movement,
            table: (n < 2).then_some(base.crc()),
            stats,
        };
        block_on(store.set_training_record(&record)).unwrap();
        let found = store.training_record("unfinished", movement, record.table);
        let found = block_on(found).unwrap().unwrap();
        let movement: Movement = movement;
        trained.push(json!(["unfinished", movement, record.table, frame(&found)]));
    }
    let skin = block_on(store.skin()).unwrap();
    let stored = store.table().unwrap();
    let holds = json!({
        "calibration": hex(&block_on(store.calibration()).unwrap().unwrap().to_bytes()),
        "skin": [skin.energy_j(), skin.wear_j()],
        "offset": stored.offset,
        "generation": stored.generation,
        "table": hex(&table),
        "in_force": hex(&in_force[..length]),
        "names": base.names().collect::<Vec<_>>(),
        "tallies": (0..base.textures()).map(|t| {
            let force = Table::read(&in_force[..length]).unwrap();
            let tally = force.tally(t);
            [tally.factory, tally.user, tally.itself]
        }).collect::<Vec<_>>(),
        "trained": trained,
        "self_taught": learned,
    });
    let holds = serde_json::to_string(&holds).unwrap().replace(",\"", ",\n\"");
    fs::write(out.join("store-before-4.json"), holds + "\n").unwrap();
    let file = fs::File::create(out.join("store-before-4.bin.gz")).unwrap();
    let mut gz = GzEncoder::new(file, Compression::best());
    gz.write_all(&store.close().bytes).unwrap();
    gz.finish().unwrap();
}
