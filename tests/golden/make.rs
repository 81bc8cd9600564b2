//! Wrote the files of this folder at commit c026dfc, before anything was renamed or moved: see README.md. It is compiled there
//! only, and shall stay as it is.

use std::convert::Infallible;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use flate2::{Compression, write::GzEncoder};
use serde::Serialize;
use serde_json::{Value, json};
use tactus::collection::{Collection, calibrated};
use tactus::learn::learn;
use tactus::replay::measure;
use tactus::simulated::{SimError, SimRig};
use tactus_core::explorer::{Method, Strategy};
use tactus_core::features::{FUSED_BANDS, Plan, Property, PropertySet, Slide};
use tactus_core::fused::{FeatureSet, Observation};
use tactus_core::kernels::{Kernels, Plain};
use tactus_core::movement::Movement;
use tactus_core::rig::Rig;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::guard::Fault;
use tactus_core::rig::skin::SkinCare;
use tactus_core::session;
use tactus_core::store::{SECTORS, SelfTaught, Store, Trained};
use tactus_core::table::{Action, Contents, Experience, Table};
use tactus_core::teaching;
use tactus_core::training::Lesson;
use tactus_core::wire::*;

const SECTOR: usize = 16 * 1024;

fn main() {
    let out = PathBuf::from(std::env::args().nth(1).expect("a folder"));
    fs::create_dir_all(&out).unwrap();
    lines(&out, "requests.jsonl", requests());
    lines(&out, "reports.jsonl", reports());
    let world = Collection {
        seed: 5,
        textures: vec![10, 47, 100],
        trials: 3,
    };
    let calibration = calibrated(world.setup(10, 0)).unwrap();
    tables(&out, &world, calibration);
    stores(&out, &world, calibration);
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|b| format!("{b:02x}")).collect()
}

/// Any value in postcard's form, in a frame.
fn frame(message: &impl Serialize) -> String {
    hex(encode(message, &mut [0; MAX_FRAME + 1]).unwrap())
}

fn lines<M: Serialize>(out: &Path, name: &str, messages: Vec<M>) {
    let mut file = fs::File::create(out.join(name)).unwrap();
    for message in messages {
        let line = json!({"frame": frame(&message), "message": message});
        writeln!(file, "{line}").unwrap();
    }
}

fn requests() -> Vec<Request> {
    // a message that is not listed does not compile
    let number = |ask: &Ask| match ask {
        Ask::Status => 0,
        Ask::Home => 1,
        Ask::Stop => 2,
        Ask::Identify(_) => 3,
        Ask::Answer(_) => 4,
        Ask::Train(_) => 5,
        Ask::Rename { .. } => 6,
        Ask::Forget(Forget::Texture(_) | Forget::SelfTaught | Forget::Training(_)) => 7,
        Ask::Calibrate => 8,
        Ask::ReadCalibration => 9,
        Ask::WriteCalibration(_) => 10,
        Ask::Stream(_) => 11,
        Ask::ReadTable(_) => 12,
        Ask::BeginTable(_) => 13,
        Ask::WriteTable { .. } => 14,
        Ask::CommitTable => 15,
        Ask::FactoryTable => 16,
    };
    let name = |name: &str| Name::try_from(name).unwrap();
    let bytes = |n: u8| (0..n).collect::<Vec<u8>>();
    let mut asks = vec![Ask::Status, Ask::Home, Ask::Stop];
    let methods = [
        None,
        Some(Method::Paper),
        Some(Method::Student),
        Some(Method::StudentAll),
        Some(Method::Fused),
    ];
    for method in methods {
        for strategy in [Strategy::Bayesian, Strategy::Cycling, Strategy::Random] {
            let among: &[u16] = if method.is_some() { &[0, 116, 300] } else { &[] };
            asks.push(Ask::Identify(Identify {
                among: heapless(among),
                threshold: 0.99,
                max_slides: 10,
                method,
                strategy,
                open: method.is_none(),
                learn: strategy == Strategy::Random,
                seed: 0x1234_5678,
            }));
        }
    }
    asks.extend([
        Ask::Answer(name("Bath towel")),
        Ask::Train(Train {
            name: name("Körnerbrot"),
            trials: 5,
            pilot: true,
            seed: 7,
        }),
        Ask::Rename {
            from: name("a"),
            to: name("another name of forty bytes, not one more"[..40].trim_end()),
        },
        Ask::Forget(Forget::Texture(name("cork"))),
        Ask::Forget(Forget::SelfTaught),
        Ask::Forget(Forget::Training(name("felt"))),
        Ask::Calibrate,
        Ask::ReadCalibration,
        Ask::WriteCalibration(heapless(&bytes(60))),
        Ask::Stream(true),
        Ask::Stream(false),
        Ask::ReadTable(256),
        Ask::BeginTable(12_816),
        Ask::WriteTable {
            offset: 512,
            bytes: heapless(&bytes(17)),
        },
        Ask::CommitTable,
        Ask::FactoryTable,
    ]);
    let mut kinds: Vec<u8> = asks.iter().map(number).collect();
    kinds.dedup();
    assert!(kinds.into_iter().eq(0..17), "all of them, in their order");
    let ids = [0, 1, 127, 128, 65_535].into_iter().cycle();
    let requests = asks.into_iter().zip(ids);
    requests.map(|(ask, id)| Request { id, ask }).collect()
}

fn heapless<T: Clone, const N: usize>(items: &[T]) -> heapless::Vec<T, N> {
    heapless::Vec::from_slice(items).unwrap_or_else(|_| panic!("too many"))
}

const FAULTS: [Fault; 18] = [
    Fault::ForceHigh,
    Fault::EStop,
    Fault::LeverLimit,
    Fault::StageLimit,
    Fault::StageStall,
    Fault::EncoderSilent,
    Fault::StageOff,
    Fault::SensorSilent,
    Fault::SensorErrors,
    Fault::SensorFrozen,
    Fault::SlideGap,
    Fault::Rejected,
    Fault::NoContact,
    Fault::LeverSlips,
    Fault::Unsteady,
    Fault::TasksHung,
    Fault::LeverNotHome,
    Fault::StageNotHome,
];

const PHASES: [Phase; 10] = [
    Phase::Parked,
    Phase::Homing,
    Phase::Ready,
    Phase::Positioning,
    Phase::Pressing,
    Phase::Background,
    Phase::Sliding,
    Phase::Lifting,
    Phase::Unloaded,
    Phase::Faulted,
];

fn reports() -> Vec<Report> {
    let number = |tell: &Tell| match tell {
        Tell::Booted { .. } => 0,
        Tell::Status(_) => 1,
        Tell::Done(_) => 2,
        Tell::Refused { .. } => 3,
        Tell::Damaged(_) => 4,
        Tell::Phase(_) => 5,
        Tell::Chosen { .. } => 6,
        Tell::Felt { .. } => 7,
        Tell::Rejected { .. } => 8,
        Tell::Verdict { .. } => 9,
        Tell::Taught { .. } => 10,
        Tell::Learned { .. } => 11,
        Tell::Live(_) => 12,
        Tell::Fault(_) => 13,
        Tell::Block(_) => 14,
        Tell::Calibration(_) => 15,
        Tell::TablePart { .. } => 16,
    };
    let name = |name: &str| Name::try_from(name).unwrap();
    let text = |text: &str| Text::try_from(text).unwrap();
    let felt = |bound: bool| Felt {
        properties: [(!bound).then_some(0.963), Some(7.298), Some(-2.5)],
        roughness_is_bound: bound,
        background: 2.2,
        bands: heapless(&[-1000i16, 0, 1, 63, 64, 12_000, i16::MAX, 5, 6, 7, 8, 9][..FUSED_BANDS]),
        pressure: bound.then_some([1234, -77]),
    };
    let properties = [
        None,
        Some(Property::Traction),
        Some(Property::Roughness),
        Some(Property::Fineness),
    ];
    let mut tells = Vec::new();
    let resets = [
        Reset::Power,
        Reset::Pin,
        Reset::Watchdog,
        Reset::Software,
        Reset::Other,
    ];
    for reset in resets {
        let last_words = (reset == Reset::Software).then(|| text("panicked: the \"stage\""));
        tells.push(Tell::Booted {
            protocol: PROTOCOL,
            version: "0.1.0".try_into().unwrap(),
            reset,
            last_words,
        });
    }
    for (phase, fault) in PHASES.into_iter().zip([None, Some(Fault::StageOff)].into_iter().cycle()) {
        tells.push(Tell::Status(Status {
            phase,
            fault,
            textures: 117,
            table_bytes: 12_816,
            table_crc: 0xDEAD_BEEF,
            factory: fault.is_none(),
            calibrated: 20_261_121,
            counts: Counts {
                slots: 1,
                late_slots: 2,
                parity_errors: 3,
                error_frames: 4,
                lost_samples: 5,
                lost_reports: 6,
                damaged_frames: u32::MAX,
            },
            skin_mj: (1500, 250),
            false_alarm: None,
        }));
    }
    tells.extend([
        Tell::Done(128),
        Tell::Refused {
            id: 3,
            why: text("busy: wait, or stop what is being done"),
        },
        Tell::Damaged(9),
    ]);
    tells.extend(PHASES.map(Tell::Phase));
    for (property, movement) in properties.into_iter().zip(0..) {
        let action = Action { movement, property };
        let promise = Promise {
            action,
            uncertainty: 0.566,
            benefit: 1.25,
        };
        tells.push(Tell::Chosen {
            slide: 1,
            movement: Movement::FOR_TRACTION,
            action,
            outlook: heapless(&vec![promise; usize::from(movement)]),
        });
    }
    for (property, movement) in properties.into_iter().zip(0..) {
        tells.push(Tell::Felt {
            slide: 2,
            action: Action { movement, property },
            felt: felt(movement == 1),
            posterior: heapless(&[0.0, 0.553, 0.0, 0.444, 0.0, 0.003][usize::from(movement)..]),
        });
    }
    tells.push(Tell::Rejected {
        slide: 2,
        why: text("the slide is too short"),
    });
    for log_odds in [None, Some(-12.5)] {
        tells.push(Tell::Verdict {
            texture: 46,
            name: name("Polyester felt"),
            probability: 0.998,
            sure: log_odds.is_none(),
            unknown: log_odds.is_some(),
            log_odds,
            slides: 2,
            asks: log_odds.is_some(),
        });
    }
    for itself in [false, true] {
        tells.push(Tell::Taught {
            name: name("cork"),
            slides: 3,
            itself,
        });
    }
    tells.push(Tell::Learned {
        movement: Movement::FOR_ROUGHNESS,
        trial: 4,
        left: 11,
        felt: felt(false),
    });
    tells.push(Tell::Live(Live {
        force_mn: -20,
        steps: -1500,
        stage_um: 12_345,
        speed_um_s: -10_000,
        current_ma: 250,
    }));
    tells.extend(FAULTS.map(Tell::Fault));
    for steady in [None, Some((110, 2310))] {
        tells.push(Tell::Block(Block {
            number: 5,
            still: steady.is_none(),
            steady,
            pac: heapless(&[-2048, -1, 0, 1, 2047]),
            shear_mn: heapless(&[963, -5][..usize::from(steady.is_some()) * 2]),
            lost: 3,
        }));
    }
    tells.push(Tell::Calibration(heapless(&(0..60).collect::<Vec<u8>>())));
    tells.push(Tell::TablePart {
        offset: 256,
        length: 12_816,
        bytes: heapless(&(0..PART).map(|n| n as u8).collect::<Vec<u8>>()),
    });
    let mut kinds: Vec<u8> = tells.iter().map(number).collect();
    kinds.dedup();
    assert!(kinds.into_iter().eq(0..17), "all of them, in their order");
    let numbers = [0, 1, 127, 128, 65_535].into_iter().cycle();
    let reports = tells.into_iter().zip(numbers);
    let reports = reports.map(|(tell, number)| Report {
        number,
        at_ms: u32::from(number) * 1000,
        tell,
    });
    reports.collect()
}

/// A table of each kind, and what is read from it.
fn tables(out: &Path, world: &Collection, calibration: RigCalibration) {
    let plan = Plan::new();
    let recorded = world.record(calibration, || ()).unwrap();
    let slides: Vec<Vec<Vec<Observation>>> = recorded
        .iter()
        .map(|slides| {
            let of = |movement| slides.iter().filter(move |slide| slide.movement == movement);
            let felt = |movement| of(movement).map(|slide| (&measure(&plan, slide).unwrap()).into());
            Collection::MOVEMENTS.map(|movement| felt(movement).collect()).to_vec()
        })
        .collect();
    let movements = Collection::MOVEMENTS;
    let tables = [
        ("paper", Method::Paper, None),
        ("fused-force", Method::Fused, Some(FeatureSet::Force)),
        ("fused-pressure", Method::Fused, Some(FeatureSet::Pressure)),
        ("fused-bands", Method::Fused, Some(FeatureSet::Bands)),
        ("fused-properties", Method::Fused, Some(FeatureSet::Properties)),
    ];
    for (name, method, features) in tables {
        // a slide of the rig has no pressure unless it is given one
        let mut slides = slides.clone();
        let mut some = 0;
        for slide in slides.iter_mut().flatten().flatten() {
            some += 37;
            slide.pressure.get_or_insert([some % 500, some % 90]);
        }
        let bytes = learn(method, features, &world.names(), &movements, &slides).unwrap();
        table(out, name, &bytes);
    }
    table(out, "factory", &fs::read("shared/tables/factory.tact").unwrap());
    table(out, "handheld", &fs::read("shared/tables/handheld.tact").unwrap());
}

fn table(out: &Path, name: &str, bytes: &[u8]) {
    fs::write(out.join(name).with_extension("tact"), bytes).unwrap();
    let values = serde_json::to_string(&values(bytes)).unwrap();
    let values = values.replace("{\"factory\"", "\n{\"factory\"");
    fs::write(out.join(name).with_extension("json"), values + "\n").unwrap();
}

/// What a table holds; of a large one, every thirteenth texture.
fn values(bytes: &[u8]) -> Value {
    let table = Table::read(bytes).unwrap();
    let every = if table.textures() > 13 { 13 } else { 1 };
    let (set, features) = match table.contents() {
        Contents::Gaussians(_) => (None, 0),
        Contents::Fused(set, features) => (Some(set), features),
    };
    let textures = (0..table.textures()).step_by(every).map(|texture| {
        let tally = table.tally(texture);
        let learned = (0..table.movements().len() as u8).map(|movement| {
            let gaussian = |property| {
                let property = Some(property);
                let gaussian = table.gaussian(texture, Action { movement, property });
                gaussian.map(|gaussian| [gaussian.mean, gaussian.sd])
            };
            match set {
                None => json!([
                    table.trials(texture, movement),
                    Property::ALL.map(gaussian),
                    frame(&table.experience(texture, movement))
                ]),
                Some(_) => {
                    let whitened = table.whitened(texture, movement);
                    let mean = &whitened.mean[..usize::from(features)];
                    json!([table.trials(texture, movement), whitened.slides, mean])
                }
            }
        });
        json!({
            "factory": tally.factory,
            "user": tally.user,
            "itself": tally.itself,
            "texture": texture,
            "name": table.name(texture),
            "number": table.number(texture),
            "learned": learned.collect::<Vec<_>>(),
        })
    });
    // what the whitening makes of some slide
    let slide: Vec<i16> = (1..=i16::from(features)).map(|n| 700 * n - 3000).collect();
    let whitened = (0..table.movements().len() as u8)
        .map(|movement| table.whiten(movement, &slide).map(|white| white.to_vec()));
    json!({
        "textures": table.textures(),
        "names": table.names().collect::<Vec<_>>(),
        "movements": table.movements().collect::<Vec<_>>(),
        "features": set.and_then(|set| FeatureSet::ALL.iter().position(|s| *s == set)),
        "dimensions": features,
        "measured": table.measured().bits(),
        "next_number": table.next_number(),
        "lineage": table.lineage(),
        "crc": table.crc(),
        "whitened": whitened.collect::<Vec<_>>(),
        "learned": textures.collect::<Vec<_>>(),
    })
}

struct Flash(Vec<u8>);

impl ErrorType for Flash {
    type Error = Infallible;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 4;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        let at = offset as usize;
        bytes.copy_from_slice(&self.0[at..at + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Infallible> {
        self.0[from as usize..to as usize].fill(0xFF);
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Infallible> {
        let there = &mut self.0[offset as usize..][..bytes.len()];
        there.iter_mut().zip(bytes).for_each(|(cell, b)| *cell &= b);
        Ok(())
    }
}

/// The simulated rig, which is stopped after so many movements.
struct Stopped(SimRig, u32);

impl Rig for Stopped {
    type Error = SimError;

    fn measures(&self) -> PropertySet {
        PropertySet::ALL
    }

    async fn perform<K: Kernels>(
        &mut self,
        movement: Movement,
        slide: &mut Slide<'_, K>,
    ) -> Result<(), SimError> {
        self.1 = self.1.checked_sub(1).ok_or(SimError::Stopped)?;
        self.0.perform(movement, slide).await
    }
}

fn rig(world: &Collection, texture: u8, calibration: RigCalibration, movements: u32) -> Stopped {
    let mut rig = SimRig::new(world.setup(texture, 0));
    rig.control().calibrate(calibration).unwrap();
    rig.home().unwrap_or_else(|why| panic!("texture {texture}: {why}"));
    Stopped(rig, movements)
}

/// A store with everything in it: a pushed table with a texture taught and one trained, what was learned by itself, an
/// unfinished training and a pilot, calibration, skin.
fn stores(out: &Path, world: &Collection, calibration: RigCalibration) {
    let plan = Plan::new();
    for (kind, method) in [("fused", Method::Fused), ("gaussians", Method::Paper)] {
        let mut store = block_on(Store::open(Flash(vec![0xFF; SECTORS * SECTOR]))).unwrap();
        let calibration = RigCalibration {
            date: 20_261_121,
            serial: *b"BT-0123456789abc",
            ..calibration
        };
        block_on(store.set_calibration(&calibration)).unwrap();
        block_on(store.set_skin(&SkinCare::after(1.5, 2.25))).unwrap();
        let pushed = world.learn(method, calibration, || ()).unwrap();
        block_on(store.begin_table(pushed.len())).unwrap();
        for (part, at) in pushed.chunks(PART).zip((0..).step_by(PART)) {
            block_on(store.write_table(at, part)).unwrap();
        }
        block_on(store.commit_table(&mut [0; SECTOR])).unwrap();
        let wanted = |texture: &str, trials, pilot| Train {
            name: texture.try_into().unwrap(),
            trials,
            pilot,
            seed: 1,
        };
        let base = |store: &mut Store<Flash>| {
            let mut bytes = vec![0; SECTOR];
            let table = block_on(store.read_table(&mut bytes)).unwrap().unwrap();
            table.as_bytes().to_vec()
        };
        let train = |store: &mut Store<Flash>, texture, slides, wanted: &Train| {
            let bytes = base(store);
            let table = Table::read(&bytes).unwrap();
            let mut rig = rig(world, texture, calibration, slides);
            let mut room = vec![0; SECTOR];
            let done = session::train::<_, _, Plain>(
                wanted, &mut rig, store, table, &plan, &mut room, |_| (),
            );
            println!("{kind}, {}: {:?}", wanted.name, block_on(done));
        };
        // finished: a table with a fourth texture
        train(&mut store, 47, 100, &wanted("a trained one", 2, false));
        // a visit that the probe learns from, and one that the user answers
        for (texture, answer) in [(10, None), (100, None), (47, Some("an answer")), (10, Some("Bath towel"))] {
            let bytes = base(&mut store);
            let table = Table::read(&bytes).unwrap();
            let mut room = vec![0; SECTOR];
            block_on(teaching::put_in_force(&table, Some(&mut store), &mut room)).unwrap();
            let in_force = room.clone();
            let identify = Identify {
                among: heapless(&[]),
                threshold: 0.99,
                max_slides: 10,
                method: None,
                strategy: Strategy::Bayesian,
                open: false,
                learn: true,
                seed: 3,
            };
            let mut rig = rig(world, texture, calibration, 100);
            let visited = block_on(session::identify::<_, Plain>(
                &identify,
                &mut rig,
                Table::read(&in_force).unwrap(),
                &plan,
                |_| (),
            ))
            .unwrap();
            let told = match answer {
                None => block_on(teaching::learn_by_itself(&visited, &mut store, &mut room)),
                Some(name) => {
                    let name = if texture == 10 { table.name(0).unwrap() } else { name };
                    let taught = teaching::answer(&visited, name, &table, &mut store, &mut room);
                    block_on(taught).map(Some)
                }
            };
            println!("{kind}, texture {texture}: {told:?}");
        }
        // unfinished
        train(&mut store, 47, 4, &wanted("unfinished", 3, false));
        train(&mut store, 47, 2, &wanted("a pilot", 2, true));
        let table = base(&mut store);
        let mut extra = Experience::default();
        let trial = tactus_core::features::Properties::new([Some(0.5), Some(7.0), Some(2.5)]);
        extra.learn(PropertySet::ALL, &trial).unwrap();
        let record = Trained {
            name: "of its own".try_into().unwrap(),
            movement: Movement::FOR_FINENESS,
            table: None,
            lesson: Lesson::Gaussians(extra),
        };
        block_on(store.set_trained(&record)).unwrap();
        let crc = Table::read(&table).unwrap().crc();
        let lineage = Table::read(&table).unwrap().lineage();
        let mut trained = Vec::new();
        for name in ["unfinished", "a pilot", "of its own", "a trained one"] {
            for table in [None, Some(crc)] {
                for movement in Movement::grid().chain(Collection::MOVEMENTS) {
                    let found = block_on(store.trained(name, movement, table)).unwrap();
                    if let Some(lesson) = found {
                        let known = json!([name, movement, table, frame(&lesson)]);
                        if !trained.contains(&known) {
                            trained.push(known);
                        }
                    }
                }
            }
        }
        let mut self_taught = Vec::new();
        let mut each = |record: SelfTaught| self_taught.push(frame(&record));
        block_on(store.self_taught(lineage, &mut each)).unwrap();
        let mut in_force = vec![0; SECTOR];
        let base = Table::read(&table).unwrap();
        let length = block_on(teaching::put_in_force(&base, Some(&mut store), &mut in_force)).unwrap();
        let skin = block_on(store.skin()).unwrap();
        let stored = store.table().unwrap();
        let holds = json!({
            "calibration": hex(&block_on(store.calibration()).unwrap().unwrap().to_bytes()),
            "skin": [skin.energy_j(), skin.wear_j()],
            "offset": stored.offset,
            "generation": stored.generation,
            "table": hex(&table),
            "in_force": hex(&in_force[..length]),
            "trained": trained,
            "self_taught": self_taught,
        });
        let holds = serde_json::to_string(&holds).unwrap().replace(",\"", ",\n\"");
        fs::write(out.join(format!("store-{kind}.json")), holds + "\n").unwrap();
        let file = fs::File::create(out.join(format!("store-{kind}.bin.gz"))).unwrap();
        let mut gz = GzEncoder::new(file, Compression::best());
        gz.write_all(&store.close().0).unwrap();
        gz.finish().unwrap();
    }
}
