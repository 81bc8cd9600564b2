//! A probe with a scripted rig and a store in RAM is asked everything.

use super::*;
use crate::dsp::Plain;
use crate::probe::seams::{Events, Panel, RigHandle, StoredBytes, UnloadedRun};
use crate::rig::Phase;
use crate::rig::calibration::RigCalibration;
use crate::rig::skin::SkinCare;
use crate::wire::{Ask, Counts, Forget, PART, Request, Status};
use std::boxed::Box;

const SECTOR: usize = 16_384;
type Flash = Ram<SECTOR>;

const CALIBRATION: RigCalibration = RigCalibration {
    pressure: crate::sensor::pressure::Calibration::PAPER,
    unloaded_a: (0.037, 0.0),
    newton_per_ampere: 16.4,
    date: 20_261_121,
    serial: [b'0'; 16],
};

/// A rig that feels what its script says, at whatever is commanded.
struct Bench {
    script: Script,
    state: RigState,
    homed: u32,
    began: vec::Vec<u32>,
    refuses: bool,
}

impl Rig for Bench {
    type Error = &'static str;

    fn measures(&self) -> PropertySet {
        PropertySet::ALL
    }

    async fn perform<K: Kernels>(
        &mut self,
        movement: Movement,
        slide: &mut Slide<'_, K>,
    ) -> Result<(), Self::Error> {
        self.state.skin = SkinCare::after(self.state.skin.energy_j() + 1.0, 0.5);
        self.script.perform(movement, slide).await
    }
}

impl RigHandle for Bench {
    fn state(&self) -> RigState {
        self.state
    }

    async fn begin(&mut self, seed: u32) {
        self.began.push(seed);
    }

    async fn home(&mut self) -> Result<(), Self::Error> {
        if self.refuses {
            return Err("it jams");
        }
        self.homed += 1;
        self.state.phase = Phase::Ready;
        Ok(())
    }

    async fn run_unloaded(&mut self, speed_um_s: u32) -> Result<UnloadedRun, Self::Error> {
        let from_mm = self.state.stage_mm;
        self.state.stage_mm = 100.0 - from_mm;
        self.state.air_counts = Some(700.0);
        Ok(UnloadedRun {
            from_mm,
            to_mm: self.state.stage_mm,
            mean_current_a: Some(0.05 + speed_um_s as f32 * 1e-6),
        })
    }

    async fn set_calibration(&mut self, calibration: RigCalibration) -> Result<(), Self::Error> {
        self.state.calibration = calibration;
        Ok(())
    }

    async fn set_skin(&mut self, skin: SkinCare) {
        self.state.skin = skin;
    }
}

/// The stored table, copied.
#[derive(Default)]
struct Copied(vec::Vec<u8>);

impl StoredBytes<Flash> for Copied {
    fn bytes(&mut self, store: &mut Store<Flash>) -> Option<&[u8]> {
        self.0.resize(SECTOR, 0);
        let table = block_on(store.read_table(&mut self.0)).ok()??;
        Some(table.as_bytes())
    }
}

#[derive(Default)]
struct Heard {
    told: vec::Vec<Tell>,
    tables: vec::Vec<TableInUse>,
    trouble: vec::Vec<String>,
}

impl Events for Heard {
    fn tell(&mut self, event: Tell) {
        self.told.push(event);
    }

    fn table(&mut self, table: TableInUse) {
        self.tables.push(table);
    }

    fn trouble(&mut self, what: Text) {
        self.trouble.push(what.as_str().into());
    }
}

type Tested = Probe<'static, Bench, Flash, Copied, Heard>;

/// A probe whose factory's table is this one, on a store or on a broken one.
fn probe_with(factory: vec::Vec<u8>, store: Option<Store<Flash>>) -> Tested {
    let leaked = |bytes: vec::Vec<u8>| Box::leak(bytes.into_boxed_slice());
    let mut probe = Probe {
        rig: Bench {
            script: Script(Default::default()),
            state: RigState::parked(CALIBRATION),
            homed: 0,
            began: vec::Vec::new(),
            refuses: false,
        },
        memory: Memory::new(
            store,
            Copied::default(),
            leaked(factory),
            leaked(vec![0; SECTOR]),
        ),
        events: Heard::default(),
        plan: Box::leak(Box::new(Plan::new())),
    };
    block_on(probe.memory.reload(&mut probe.events));
    probe
}

fn probe() -> Tested {
    probe_with(
        fused_table(),
        Some(block_on(Store::open(Ram::new())).unwrap()),
    )
}

fn ask(probe: &mut Tested, ask: Ask) -> Result<(), String> {
    let done = block_on(probe.perform::<Plain>(&ask));
    done.map_err(|why| why.as_str().into())
}

fn name(name: &str) -> Name {
    Name::try_from(name).unwrap()
}

fn feels(probe: &mut Tested, tractions: &[i16]) {
    probe.rig.script.0 = tractions.iter().copied().map(Some).collect();
}

fn exploration(learn: bool) -> Ask {
    Ask::Identify(Identify {
        method: None,
        open: true,
        learn,
        ..wanted(&[])
    })
}

/// One of each.
fn all() -> vec::Vec<Ask> {
    let training = Train {
        name: name("elm"),
        trials: 1,
        pilot: false,
        seed: 3,
    };
    vec![
        Ask::Status,
        Ask::Home,
        Ask::Stop,
        exploration(false),
        Ask::Answer(name("elm")),
        Ask::Train(training),
        Ask::Rename {
            from: name("t0"),
            to: name("elm"),
        },
        Ask::Forget(Forget::SelfTaught),
        Ask::Calibrate,
        Ask::ReadCalibration,
        Ask::WriteCalibration(Vec::from_slice(&CALIBRATION.to_bytes()).unwrap()),
        Ask::Stream(true),
        Ask::ReadTable(0),
        Ask::BeginTable(100),
        Ask::WriteTable {
            offset: 0,
            bytes: Vec::new(),
        },
        Ask::CommitTable,
        Ask::FactoryTable,
    ]
}

#[test]
fn four_are_answered_at_any_time_and_the_others_when_the_probe_is_free() {
    let now = |ask: &Ask| turn(ask, true) == Turn::Now;
    let at_any_time: vec::Vec<Ask> = all().into_iter().filter(now).collect();
    assert!(matches!(
        at_any_time[..],
        [
            Ask::Status,
            Ask::Stop,
            Ask::ReadCalibration,
            Ask::Stream(true)
        ]
    ));
    for ask in all() {
        let free = turn(&ask, false);
        match turn(&ask, true) {
            Turn::Now => assert_eq!(free, Turn::Now),
            Turn::Busy => assert_eq!(free, Turn::Queue),
            Turn::Queue => panic!("{ask:?} is queued behind something else"),
        }
    }
}

/// What everybody may see and touch.
#[derive(Default)]
struct Desk {
    told: vec::Vec<Tell>,
    stopped: vec::Vec<bool>,
    streams: bool,
}

impl Panel for Desk {
    fn rig(&self) -> RigState {
        RigState {
            phase: Phase::Faulted(crate::rig::Fault::EStop),
            skin: SkinCare::after(1.5, 0.25),
            ..RigState::parked(CALIBRATION)
        }
    }

    fn table(&self) -> TableInUse {
        TableInUse {
            textures: 3,
            bytes: 200,
            crc: 77,
            factory: false,
        }
    }

    fn counts(&self) -> Counts {
        Counts {
            late_slots: 5,
            ..Counts::default()
        }
    }

    fn stop(&mut self, all: bool) {
        self.stopped.push(all);
    }

    fn stream(&mut self, on: bool) {
        self.streams = on;
    }

    fn tell(&mut self, event: Tell) {
        self.told.push(event);
    }
}

#[test]
fn what_comes_while_the_probe_is_busy_is_answered_or_refused() {
    let mut desk = Desk::default();
    let sent = |ask: Ask, busy, desk: &mut Desk| receive(&Request { id: 9, ask }, busy, desk);
    assert_eq!(sent(Ask::Status, true, &mut desk), Turn::Now);
    let [Tell::Status(status), Tell::Done(9)] = &desk.told[..] else {
        panic!("{:?}", desk.told);
    };
    assert_eq!(
        *status,
        Status {
            phase: crate::wire::Phase::Faulted,
            fault: Some(crate::rig::Fault::EStop),
            textures: 3,
            table_bytes: 200,
            table_crc: 77,
            factory: false,
            calibrated: 20_261_121,
            counts: desk.counts(),
            skin_mj: (1500, 250),
        }
    );
    desk.told.clear();
    sent(Ask::ReadCalibration, true, &mut desk);
    let bytes = CALIBRATION.to_bytes();
    assert!(
        matches!(&desk.told[..], [Tell::Calibration(told), Tell::Done(9)] if told[..] == bytes)
    );
    desk.told.clear();
    // nothing to stop for good where nothing was asked for
    sent(Ask::Stop, false, &mut desk);
    sent(Ask::Stop, true, &mut desk);
    assert_eq!(desk.stopped, [false, true]);
    sent(Ask::Stream(true), false, &mut desk);
    assert!(desk.streams);
    sent(Ask::Stream(false), true, &mut desk);
    assert!(!desk.streams);
    assert_eq!(
        desk.told,
        [Tell::Done(9), Tell::Done(9), Tell::Done(9), Tell::Done(9)]
    );
    desk.told.clear();
    assert_eq!(sent(Ask::Home, true, &mut desk), Turn::Busy);
    assert!(
        matches!(&desk.told[..], [Tell::Refused { id: 9, why }] if why.starts_with("busy")),
        "{:?}",
        desk.told
    );
    desk.told.clear();
    assert_eq!(sent(Ask::Home, false, &mut desk), Turn::Queue);
    assert_eq!(desk.told, [], "it has its answer when it is done");
}

#[test]
fn a_request_is_answered_by_its_number_when_it_is_over() {
    let mut probe = probe();
    let request = |id, ask| Request { id, ask };
    block_on(probe.serve::<Plain>(&request(3, Ask::Home)));
    probe.rig.refuses = true;
    block_on(probe.serve::<Plain>(&request(4, Ask::Home)));
    let jams = Tell::Refused {
        id: 4,
        why: text("it jams"),
    };
    assert_eq!(probe.events.told, [Tell::Done(3), jams]);
    assert_eq!(probe.rig.homed, 1);
}

#[test]
fn an_exploration_is_kept_until_the_rig_moves_again() {
    let mut probe = probe();
    let nothing = ask(&mut probe, Ask::Answer(name("elm"))).unwrap_err();
    assert!(nothing.starts_with("nothing was felt"), "{nothing}");
    feels(&mut probe, &[-32_000, -32_000, -32_000]);
    ask(&mut probe, exploration(true)).unwrap();
    assert_eq!(probe.rig.began, [1]);
    let skin = block_on(probe.memory.store().unwrap().skin()).unwrap();
    assert!(skin == probe.rig.state.skin && skin.energy_j() >= 1.0);
    // a name that cannot be; then another
    let empty = ask(&mut probe, Ask::Answer(name(""))).unwrap_err();
    assert!(!empty.starts_with("nothing"), "{empty}");
    ask(&mut probe, Ask::Answer(name("elm"))).unwrap();
    assert!(
        matches!(probe.events.told.last(), Some(Tell::Taught { itself: false, name, .. }) if name == "elm")
    );
    let table = *probe.events.tables.last().unwrap();
    assert_eq!((table.textures, table.factory), (5, false));
    // once is enough
    assert!(ask(&mut probe, Ask::Answer(name("elm"))).is_err());
    for moves in [Ask::Home, Ask::Calibrate] {
        feels(&mut probe, &[-32_000, -32_000, -32_000]);
        ask(&mut probe, exploration(false)).unwrap();
        ask(&mut probe, moves).unwrap();
        let nothing = ask(&mut probe, Ask::Answer(name("oak"))).unwrap_err();
        assert!(nothing.starts_with("nothing was felt"), "{nothing}");
    }
    // nor does one that failed leave anything to learn from
    feels(&mut probe, &[]);
    assert_eq!(
        ask(&mut probe, exploration(false)).unwrap_err(),
        "the lever fell off"
    );
    assert!(ask(&mut probe, Ask::Answer(name("oak"))).is_err());
}

#[test]
fn what_the_probe_learns_by_itself_is_told_and_in_force() {
    let mut probe = probe();
    let before = *probe.events.tables.last().unwrap();
    feels(&mut probe, &[10_000]);
    ask(&mut probe, exploration(false)).unwrap();
    assert_eq!(probe.events.tables.len(), 1, "it was not to learn");
    feels(&mut probe, &[10_000]);
    ask(&mut probe, exploration(true)).unwrap();
    let after = *probe.events.tables.last().unwrap();
    assert!(before.crc != after.crc && after.factory);
    assert!(
        matches!(probe.events.told.last(), Some(Tell::Taught { itself: true, slides: 1, name }) if name == "t2")
    );
    ask(&mut probe, Ask::Forget(Forget::SelfTaught)).unwrap();
    assert_eq!(*probe.events.tables.last().unwrap(), before);
}

#[test]
fn textures_are_trained_renamed_and_forgotten() {
    let mut probe = probe();
    feels(&mut probe, &[31_000]);
    let [.., train] = &mut all()[..6] else {
        panic!();
    };
    ask(&mut probe, train.clone()).unwrap();
    assert_eq!(probe.rig.began, [3]);
    assert_eq!(probe.events.tables.last().unwrap().textures, 5);
    let skin = block_on(probe.memory.store().unwrap().skin()).unwrap();
    assert!(skin.energy_j() >= 1.0);
    let rename = |from, to| Ask::Rename {
        from: name(from),
        to: name(to),
    };
    ask(&mut probe, rename("elm", "oak")).unwrap();
    assert!(probe.memory.table().unwrap().find("oak").is_some());
    let unknown = ask(&mut probe, rename("elm", "ash")).unwrap_err();
    assert_eq!(unknown, "there is no texture elm in the table");
    ask(&mut probe, Ask::Forget(Forget::Texture(name("oak")))).unwrap();
    assert_eq!(probe.events.tables.last().unwrap().textures, 4);
    assert!(ask(&mut probe, Ask::Forget(Forget::Texture(name("oak")))).is_err());
    ask(&mut probe, Ask::FactoryTable).unwrap();
    assert!(probe.events.tables.last().unwrap().factory);
}

#[test]
fn a_calibration_is_measured_told_used_and_kept() {
    let mut probe = probe();
    ask(&mut probe, Ask::Calibrate).unwrap();
    assert_eq!(probe.rig.homed, 1, "it did not know where it was");
    let used = probe.rig.state.calibration;
    let (standstill, per_mm_s) = used.unloaded_a;
    assert!((standstill - 0.05).abs() < 1e-4 && (per_mm_s - 1e-3).abs() < 1e-5);
    assert_eq!(used.pressure.pdc_no_contact, 700.0);
    let told = Tell::Calibration(Vec::from_slice(&used.to_bytes()).unwrap());
    assert_eq!(probe.events.told, [told]);
    let kept = |probe: &mut Tested| block_on(probe.memory.store().unwrap().calibration()).unwrap();
    assert_eq!(kept(&mut probe), Some(used));
    let write = |bytes: &[u8]| Ask::WriteCalibration(Vec::from_slice(bytes).unwrap());
    let short = ask(&mut probe, write(&[0; 59])).unwrap_err();
    assert_eq!(short, "a calibration has 60 bytes");
    assert!(ask(&mut probe, write(&[0xFF; 60])).is_err());
    assert_eq!(
        (kept(&mut probe), probe.rig.state.calibration),
        (Some(used), used)
    );
    ask(&mut probe, write(&CALIBRATION.to_bytes())).unwrap();
    assert_eq!(kept(&mut probe), Some(CALIBRATION));
    // the next life begins with it
    let skin = SkinCare::after(2.0, 1.0);
    let store = probe.memory.store().unwrap();
    block_on(store.set_skin(&skin)).unwrap();
    let mut fresh = self::probe();
    fresh.rig.state.calibration = used;
    block_on(restore(store, &mut fresh.rig)).unwrap();
    assert_eq!(
        (fresh.rig.state.calibration, fresh.rig.state.skin),
        (CALIBRATION, skin)
    );
}

/// Sends a table in parts, each twice.
fn push(probe: &mut Tested, bytes: &[u8]) -> Result<(), String> {
    ask(probe, Ask::BeginTable(bytes.len() as u32))?;
    for (part, offset) in bytes.chunks(PART).zip((0..).step_by(PART)) {
        let write = Ask::WriteTable {
            offset,
            bytes: Vec::from_slice(part).unwrap(),
        };
        ask(probe, write.clone())?;
        // the host did not hear the answer
        ask(probe, write)?;
    }
    ask(probe, Ask::CommitTable)
}

#[test]
fn a_table_comes_and_goes_in_parts_of_which_one_may_come_twice() {
    let mut probe = probe();
    let pushed = table();
    push(&mut probe, &pushed).unwrap();
    let in_use = *probe.events.tables.last().unwrap();
    assert_eq!(
        (in_use.textures, in_use.bytes, in_use.factory),
        (3, pushed.len() as u32, false)
    );
    let pull = |probe: &mut Tested| {
        probe.events.told.clear();
        let length = probe.memory.in_force().len() as u32;
        for offset in (0..length).step_by(PART) {
            ask(probe, Ask::ReadTable(offset)).unwrap();
        }
        let mut pulled = vec::Vec::new();
        for told in &probe.events.told {
            let Tell::TablePart {
                offset,
                length: all,
                bytes,
            } = told
            else {
                panic!("{told:?}");
            };
            assert_eq!((*offset as usize, *all), (pulled.len(), length));
            pulled.extend_from_slice(bytes);
        }
        pulled
    };
    assert_eq!(pull(&mut probe), pushed);
    let length = pushed.len() as u32;
    ask(&mut probe, Ask::ReadTable(length)).unwrap();
    let beyond = ask(&mut probe, Ask::ReadTable(length + 1)).unwrap_err();
    assert_eq!(beyond, "the table has no such byte");
    // a part that is missing is an error, and so is a table that is damaged: the former one stays
    ask(&mut probe, Ask::BeginTable(600)).unwrap();
    let early = Ask::WriteTable {
        offset: 8,
        bytes: Vec::from_slice(&[0; 8]).unwrap(),
    };
    assert!(
        ask(&mut probe, early)
            .unwrap_err()
            .contains("send the table anew")
    );
    let mut damaged = fused_table();
    damaged[40] ^= 1;
    assert!(push(&mut probe, &damaged).unwrap_err().contains("checksum"));
    assert_eq!(pull(&mut probe), pushed);
    ask(&mut probe, Ask::FactoryTable).unwrap();
    assert_eq!(pull(&mut probe), fused_table());
}

#[test]
fn without_a_store_it_explores_and_says_that_it_cannot_learn() {
    let mut probe = probe_with(fused_table(), None);
    assert_eq!(probe.events.tables.last().unwrap().textures, 4);
    feels(&mut probe, &[10_000]);
    ask(&mut probe, exploration(true)).unwrap();
    assert!(
        matches!(
            probe.events.told.last(),
            Some(Tell::Verdict { sure: true, .. })
        ),
        "nothing is said to be learned"
    );
    feels(&mut probe, &[-32_000, -32_000, -32_000]);
    let broken = Err(String::from("the store is broken: see the log"));
    for ask in all() {
        let stores = turn(&ask, false) == Turn::Queue
            && !matches!(ask, Ask::Home | Ask::Identify(_) | Ask::ReadTable(_));
        let done = self::ask(&mut probe, ask.clone());
        assert_eq!(
            done,
            if stores { broken.clone() } else { Ok(()) },
            "{ask:?}"
        );
    }
    assert!(probe.events.trouble.is_empty());
}

#[test]
fn settings_that_cannot_be_read_are_begun_anew_by_a_calibration() {
    let mut store = block_on(Store::open(Flash::new())).unwrap();
    block_on(store.set_calibration(&CALIBRATION)).unwrap();
    let mut ram = store.close();
    // the first record, which says how the others are to be read
    ram.bytes[2 * SECTOR + 4] ^= 1;
    let mut probe = probe_with(fused_table(), Some(block_on(Store::open(ram)).unwrap()));
    assert!(probe.memory.store().unwrap().settings().is_err());
    feels(&mut probe, &[10_000]);
    ask(&mut probe, exploration(false)).unwrap();
    ask(&mut probe, Ask::Calibrate).unwrap();
    let kept = block_on(probe.memory.store().unwrap().calibration()).unwrap();
    assert_eq!(kept, Some(probe.rig.state.calibration));
}

#[test]
fn without_any_table_there_is_trouble_and_no_exploration() {
    let mut probe = probe_with(vec![1, 2, 3], None);
    assert!(probe.events.trouble[0].starts_with("no table: "));
    assert!(probe.events.tables.is_empty());
    assert!(ask(&mut probe, exploration(false)).is_err());
}

#[test]
fn phases_faults_and_places_are_told_as_they_change() {
    let mut watch = Watch::default();
    let mut rig = RigState::parked(CALIBRATION);
    let mut look = |rig: &RigState| {
        let mut told = vec::Vec::new();
        watch.look(rig, |event| told.push(event));
        told
    };
    assert_eq!(look(&rig), [Tell::Phase(crate::wire::Phase::Parked)]);
    assert_eq!(look(&rig), []);
    rig.phase = Phase::Sliding;
    rig.at_rest = false;
    (rig.force_mn, rig.stage_mm) = (500.0, 12.5);
    let told: vec::Vec<Tell> = (0..20).flat_map(|_| look(&rig)).collect();
    let [Tell::Phase(_), Tell::Live(live), Tell::Live(_)] = &told[..] else {
        panic!("{told:?}");
    };
    assert_eq!((live.force_mn, live.stage_um), (500, 12_500));
    rig.phase = Phase::Faulted(crate::rig::Fault::EStop);
    let told = look(&rig);
    assert!(matches!(
        told[..],
        [Tell::Fault(crate::rig::Fault::EStop), Tell::Phase(_)]
    ));
}
