//! A probe with a scripted rig and a store in RAM is asked everything.

use super::*;
use crate::probe::seams::{Events, Panel, RigHandle, StoredBytes, UnloadedRun};
use crate::rig::calibration::RigCalibration;
use crate::rig::skin::SkinCare;
use crate::rig::{Fault, Phase};
use crate::sensor::{FingerCode, FingerName};
use crate::store::{Store, StoreError};
use crate::wire::{
    Command, Counts, Failure, Forget, MemoryError, PART, Request, Status, TextureLearned,
};
use embedded_storage_async::nor_flash::NorFlash;
use std::boxed::Box;
use std::string::ToString;

const SECTOR: usize = 16_384;
pub(super) type Flash = Ram<SECTOR>;

const CALIBRATION: RigCalibration = RigCalibration {
    pressure: crate::sensor::pressure::Calibration::PAPER,
    unloaded_a: (0.037, 0.0),
    newton_per_ampere: 16.4,
    date: 20_261_121,
    air_known: true,
    turned: 0,
    serial: [b'0'; 16],
};

const JAMS: RigError = RigError::Fault(Fault::LeverNotHome);

/// A rig that feels what its script says, at whatever is commanded.
pub(super) struct Bench {
    script: Script,
    state: RigState,
    homed: u32,
    began: vec::Vec<u32>,
    refuses: bool,
}

impl Rig for Bench {
    type Error = RigError;

    fn measures(&self) -> PropertySet {
        PropertySet::ALL
    }

    async fn perform(&mut self, slide: &mut Slide<'_>) -> Result<(), Self::Error> {
        self.state.skin = SkinCare::after(self.state.skin.energy_j() + 1.0, 0.5);
        self.script.perform(slide).await
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
            return Err(JAMS);
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

    async fn calibrate(&mut self) -> Result<RigCalibration, Failure> {
        super::super::calibrate::by_motor(self).await
    }

    async fn weigh(&mut self, _: u16) -> Result<f32, Failure> {
        Err(Failure::Rig(RigError::NobodyThere))
    }

    async fn set_calibration(&mut self, calibration: RigCalibration) -> Result<(), Self::Error> {
        self.state.calibration = calibration;
        Ok(())
    }

    async fn set_high_force<F: NorFlash>(
        &mut self,
        allow: bool,
        store: Result<&mut Store<F>, MemoryError>,
    ) -> Result<(), Failure> {
        let kept = store?.set_high_force(allow).await;
        self.state.high_force = allow && kept.is_ok();
        kept.map_err(Failure::from)
    }

    async fn restore_high_force<F: NorFlash>(&mut self, store: &mut Store<F>) {
        self.state.high_force = store.high_force().await.unwrap_or(false);
    }

    async fn set_skin(&mut self, skin: SkinCare) {
        self.state.skin = skin;
    }
}

/// The stored table, copied.
#[derive(Default)]
pub(super) struct Copied(vec::Vec<u8>);

impl StoredBytes<Flash> for Copied {
    fn finger(&self) -> FingerCode {
        FingerCode::BIOTAC
    }

    fn bytes(&mut self, store: &mut Store<Flash>) -> Option<&[u8]> {
        self.0.resize(SECTOR, 0);
        let table = block_on(store.read_table(&mut self.0)).ok()??;
        Some(table.as_bytes())
    }
}

#[derive(Default)]
pub(super) struct Heard {
    pub(super) told: vec::Vec<Event>,
    pub(super) tables: vec::Vec<TableInUse>,
    pub(super) erased: u32,
}

impl Events for Heard {
    fn tell(&mut self, event: Event) {
        self.told.push(event);
    }

    fn table(&mut self, table: TableInUse) {
        self.tables.push(table);
    }

    fn erased(&mut self, sectors: u32) {
        self.erased = sectors;
    }
}

pub(super) type Tested = Probe<'static, Bench, Flash, Copied, Heard>;

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
            store.ok_or(StoreError::Silent),
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

pub(super) fn probe() -> Tested {
    probe_with(
        fused_table(),
        Some(block_on(Store::open(Ram::new())).unwrap()),
    )
}

/// A stored table as the chip's flash has it, whatever it is.
struct Mapped(vec::Vec<u8>);

impl StoredBytes<Flash> for Mapped {
    fn finger(&self) -> FingerCode {
        FingerCode::BIOTAC
    }

    fn bytes(&mut self, _: &mut Store<Flash>) -> Option<&[u8]> {
        Some(&self.0)
    }
}

#[test]
fn a_stored_table_that_cannot_be_read_is_reported() {
    let factory = fused_table();
    let mut damaged = factory.clone();
    damaged[60] ^= 4;
    // nor is one of another finger put in force
    let mut other = vec![0; factory.len() + crate::table::FINGER_LENGTH];
    let table = crate::table::Table::read(&factory).unwrap();
    crate::table::with_finger(
        &mut other,
        &table,
        FingerCode::of(FingerName::Analog),
        0,
        "",
    )
    .unwrap();
    for (stored, told) in [(factory.clone(), 0), (damaged, 1), (other, 1)] {
        let store = block_on(Store::open(Ram::new())).unwrap();
        let mut buffer = vec![0; SECTOR];
        let mut memory = Memory::new(Ok(store), Mapped(stored), &factory, &mut buffer);
        let mut heard = Heard::default();
        block_on(memory.reload(&mut heard));
        let trouble = |event: &&Event| {
            let Event::Trouble(Failure::Memory(why)) = event else {
                return false;
            };
            matches!(why, crate::wire::MemoryError::StoredTable(_))
        };
        assert_eq!(
            heard.told.iter().filter(trouble).count(),
            told,
            "{:?}",
            heard.told
        );
        assert_eq!(heard.tables.len(), 1);
        assert_eq!(heard.tables[0].factory, told == 1);
    }
}

#[test]
fn a_table_whose_bytes_have_changed_is_reported_whatever_is_in_its_place() {
    let factory = fused_table();
    // damage to the newest of so many tables
    for tables in [1, 2] {
        let mut store = block_on(Store::open(Ram::new())).unwrap();
        for _ in 0..tables {
            let mut buffer = vec![0; SECTOR];
            buffer[..factory.len()].copy_from_slice(&factory);
            block_on(store.replace_table(&mut buffer, factory.len())).unwrap();
        }
        let at = store.table().unwrap().offset as usize + 60;
        let mut flash = store.close().again();
        flash.bytes[at] ^= 4;
        let store = block_on(Store::open(flash)).unwrap();
        let probe = probe_with(factory.clone(), Some(store));
        let [Event::Trouble(Failure::Memory(why))] = &probe.events.told[..] else {
            panic!("{:?}", probe.events.told);
        };
        assert_eq!(probe.memory.trouble(), Some(why));
        let why = why.to_string();
        let instead = ["that of the firmware", "the one stored before it"][tables - 1];
        assert!(why.contains(instead) && why.contains("damaged"), "{why}");
        assert_eq!(probe.events.tables[0].factory, tables == 1);
    }
}

pub(super) fn command(probe: &mut Tested, command: Command) -> Result<(), String> {
    let done = block_on(probe.perform(&command));
    done.map(drop).map_err(|why| why.to_string())
}

pub(super) fn name(name: &str) -> Name {
    Name::try_from(name).unwrap()
}

fn feels(probe: &mut Tested, tractions: &[i16]) {
    probe.rig.script.0 = tractions.iter().copied().map(Some).collect();
}

fn exploration(learn: bool) -> Command {
    Command::Identify(Identify {
        method: None,
        open: true,
        learn,
        ..wanted(&[])
    })
}

/// One of each.
fn all() -> vec::Vec<Command> {
    let training = Train {
        name: name("elm"),
        trials: 1,
        pilot: false,
        seed: 3,
    };
    vec![
        Command::Status,
        Command::Home,
        Command::Stop,
        exploration(false),
        Command::Label(name("elm")),
        Command::Train(training),
        Command::Rename {
            from: name("t0"),
            to: name("elm"),
        },
        Command::Forget(Forget::SelfLearned),
        Command::Calibrate,
        Command::ReadCalibration,
        Command::WriteCalibration(CALIBRATION.to_bytes()),
        Command::Stream(true),
        Command::ReadTable(0),
        Command::BeginTable(100),
        Command::WriteTable {
            offset: 0,
            bytes: Vec::new(),
        },
        Command::CommitTable,
        Command::FactoryTable,
    ]
}

#[test]
fn four_are_answered_at_any_time_and_the_others_when_the_probe_is_free() {
    let now = |command: &Command| turn(command, true) == Turn::Now;
    let at_any_time: vec::Vec<Command> = all().into_iter().filter(now).collect();
    assert!(matches!(
        at_any_time[..],
        [
            Command::Status,
            Command::Stop,
            Command::ReadCalibration,
            Command::Stream(true)
        ]
    ));
    for command in all() {
        let free = turn(&command, false);
        match turn(&command, true) {
            Turn::Now => assert_eq!(free, Turn::Now),
            Turn::Busy => assert_eq!(free, Turn::Queue),
            Turn::Queue => panic!("{command:?} is queued behind something else"),
        }
    }
}

/// What everybody may see and touch.
#[derive(Default)]
struct Desk {
    told: vec::Vec<Event>,
    stopped: vec::Vec<bool>,
    streams: bool,
}

impl Panel for Desk {
    fn finger(&self) -> FingerCode {
        FingerCode::BIOTAC
    }

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
            false_alarm: Some(0.1),
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

    fn tell(&mut self, event: Event) {
        self.told.push(event);
    }
}

#[test]
fn what_comes_while_the_probe_is_busy_is_answered_or_refused() {
    let mut desk = Desk::default();
    let sent =
        |command: Command, busy, desk: &mut Desk| receive(&Request { id: 9, command }, busy, desk);
    assert_eq!(sent(Command::Status, true, &mut desk), Turn::Now);
    let [Event::Status(status), Event::Done(9)] = &desk.told[..] else {
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
            false_alarm: Some(0.1),
            high_force: false,
            finger: FingerCode::BIOTAC,
        }
    );
    desk.told.clear();
    sent(Command::ReadCalibration, true, &mut desk);
    let bytes = CALIBRATION.to_bytes();
    assert!(
        matches!(&desk.told[..], [Event::Calibration(told), Event::Done(9)] if told[..] == bytes)
    );
    desk.told.clear();
    // nothing to stop for good where nothing was asked for
    sent(Command::Stop, false, &mut desk);
    sent(Command::Stop, true, &mut desk);
    assert_eq!(desk.stopped, [false, true]);
    sent(Command::Stream(true), false, &mut desk);
    assert!(desk.streams);
    sent(Command::Stream(false), true, &mut desk);
    assert!(!desk.streams);
    assert_eq!(
        desk.told,
        [
            Event::Done(9),
            Event::Done(9),
            Event::Done(9),
            Event::Done(9)
        ]
    );
    desk.told.clear();
    assert_eq!(sent(Command::Home, true, &mut desk), Turn::Busy);
    assert!(
        matches!(&desk.told[..], [Event::Refused { id: 9, why }] if *why == Failure::Busy),
        "{:?}",
        desk.told
    );
    desk.told.clear();
    assert_eq!(sent(Command::Home, false, &mut desk), Turn::Queue);
    assert_eq!(desk.told, [], "it has its answer when it is done");
}

#[test]
fn a_request_is_answered_by_its_number_when_it_is_over() {
    let mut probe = probe();
    let request = |id, command| Request { id, command };
    block_on(probe.serve(&request(3, Command::Home)));
    probe.rig.refuses = true;
    block_on(probe.serve(&request(4, Command::Home)));
    let jams = Event::Refused {
        id: 4,
        why: Failure::Rig(JAMS),
    };
    assert_eq!(probe.events.told, [Event::Done(3), jams]);
    assert_eq!(probe.rig.homed, 1);
}

#[test]
fn an_exploration_is_kept_until_the_rig_moves_again() {
    let mut probe = probe();
    let nothing = command(&mut probe, Command::Label(name("elm"))).unwrap_err();
    assert!(nothing.starts_with("no slide was measured"), "{nothing}");
    feels(&mut probe, &[-32_000, -32_000, -32_000]);
    command(&mut probe, exploration(true)).unwrap();
    assert_eq!(probe.rig.began, [1]);
    let skin = block_on(probe.memory.store().unwrap().skin()).unwrap();
    assert!(skin == probe.rig.state.skin && skin.energy_j() >= 1.0);
    // a name that cannot be; then another
    let empty = command(&mut probe, Command::Label(name(""))).unwrap_err();
    assert!(!empty.starts_with("nothing"), "{empty}");
    command(&mut probe, Command::Label(name("elm"))).unwrap();
    assert!(matches!(
        probe.events.told.last(),
        Some(Event::TextureLearned(TextureLearned { itself: false, name, .. })) if name == "elm"
    ));
    let table = *probe.events.tables.last().unwrap();
    assert_eq!((table.textures, table.factory), (5, false));
    // once is enough
    assert!(command(&mut probe, Command::Label(name("elm"))).is_err());
    for moves in [Command::Home, Command::Calibrate] {
        feels(&mut probe, &[-32_000, -32_000, -32_000]);
        command(&mut probe, exploration(false)).unwrap();
        command(&mut probe, moves).unwrap();
        let nothing = command(&mut probe, Command::Label(name("oak"))).unwrap_err();
        assert!(nothing.starts_with("no slide was measured"), "{nothing}");
    }
    // nor does one that failed leave anything to learn from
    feels(&mut probe, &[]);
    assert_eq!(
        command(&mut probe, exploration(false)).unwrap_err(),
        "the movement does not end: home the rig"
    );
    assert!(command(&mut probe, Command::Label(name("oak"))).is_err());
}

#[test]
fn what_the_probe_learns_by_itself_is_reported_and_in_force() {
    let mut probe = probe();
    let before = *probe.events.tables.last().unwrap();
    feels(&mut probe, &[10_000]);
    command(&mut probe, exploration(false)).unwrap();
    assert_eq!(probe.events.tables.len(), 1, "it was not to learn");
    feels(&mut probe, &[10_000, 10_000]);
    command(&mut probe, exploration(true)).unwrap();
    let after = *probe.events.tables.last().unwrap();
    assert!(before.crc != after.crc && after.factory);
    assert!(matches!(
        probe.events.told.last(),
        Some(Event::TextureLearned(TextureLearned { itself: true, slides: 2, name })) if name == "t2"
    ));
    command(&mut probe, Command::Forget(Forget::SelfLearned)).unwrap();
    assert_eq!(*probe.events.tables.last().unwrap(), before);
}

#[test]
fn textures_are_trained_renamed_and_deleted() {
    let mut probe = probe();
    feels(&mut probe, &[31_000]);
    let [.., train] = &mut all()[..6] else {
        panic!();
    };
    command(&mut probe, train.clone()).unwrap();
    assert_eq!(probe.rig.began, [3]);
    assert_eq!(probe.events.tables.last().unwrap().textures, 5);
    let skin = block_on(probe.memory.store().unwrap().skin()).unwrap();
    assert!(skin.energy_j() >= 1.0);
    let rename = |from, to| Command::Rename {
        from: name(from),
        to: name(to),
    };
    command(&mut probe, rename("elm", "oak")).unwrap();
    assert!(probe.memory.table().unwrap().find("oak").is_some());
    let unknown = command(&mut probe, rename("elm", "ash")).unwrap_err();
    assert_eq!(unknown, "there is no texture elm in the table");
    command(&mut probe, Command::Forget(Forget::Texture(name("oak")))).unwrap();
    assert_eq!(probe.events.tables.last().unwrap().textures, 4);
    assert!(command(&mut probe, Command::Forget(Forget::Texture(name("oak")))).is_err());
    command(&mut probe, Command::FactoryTable).unwrap();
    assert!(probe.events.tables.last().unwrap().factory);
}

#[test]
fn a_calibration_is_measured_reported_used_and_kept() {
    let mut probe = probe();
    command(&mut probe, Command::Calibrate).unwrap();
    assert_eq!(probe.rig.homed, 1, "it did not know where it was");
    let used = probe.rig.state.calibration;
    let (standstill, per_mm_s) = used.unloaded_a;
    assert!((standstill - 0.05).abs() < 1e-4 && (per_mm_s - 1e-3).abs() < 1e-5);
    assert_eq!(used.pressure.pdc_no_contact, 700.0);
    let told = Event::Calibration(used.to_bytes());
    assert_eq!(probe.events.told, [told]);
    let kept = |probe: &mut Tested| block_on(probe.memory.store().unwrap().calibration()).unwrap();
    assert_eq!(kept(&mut probe), Some(used));
    let write = |bytes: &[u8]| Command::WriteCalibration(Vec::from_slice(bytes).unwrap());
    let short = command(&mut probe, write(&[0; 59])).unwrap_err();
    assert_eq!(short, "a calibration has 64 bytes");
    assert!(command(&mut probe, write(&[0xFF; 64])).is_err());
    assert_eq!(
        (kept(&mut probe), probe.rig.state.calibration),
        (Some(used), used)
    );
    command(&mut probe, write(&CALIBRATION.to_bytes())).unwrap();
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

#[test]
fn a_high_force_holds_only_where_it_is_kept() {
    let mut probe = probe();
    for allow in [true, false, true] {
        command(&mut probe, Command::SetHighForce(allow)).unwrap();
        assert_eq!(probe.rig.state.high_force, allow);
    }
    // after a reset
    let mut fresh = self::probe();
    let store = probe.memory.store().unwrap();
    block_on(restore(store, &mut fresh.rig)).unwrap();
    assert!(fresh.rig.state.high_force);
    // erased with the other settings
    block_on(store.erase_settings()).unwrap();
    let mut fresh = self::probe();
    block_on(restore(store, &mut fresh.rig)).unwrap();
    assert!(!fresh.rig.state.high_force);
    let mut broken = probe_with(fused_table(), None);
    assert!(command(&mut broken, Command::SetHighForce(true)).is_err());
    assert!(!broken.rig.state.high_force);
}

/// Sends a table in parts, each twice.
pub(super) fn push(probe: &mut Tested, bytes: &[u8]) -> Result<(), String> {
    command(probe, Command::BeginTable(bytes.len() as u32))?;
    for (part, offset) in bytes.chunks(PART).zip((0..).step_by(PART)) {
        let write = Command::WriteTable {
            offset,
            bytes: Vec::from_slice(part).unwrap(),
        };
        command(probe, write.clone())?;
        // the host did not hear the answer
        command(probe, write)?;
    }
    command(probe, Command::CommitTable)
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
            command(probe, Command::ReadTable(offset)).unwrap();
        }
        let mut pulled = vec::Vec::new();
        for told in &probe.events.told {
            let Event::TablePart {
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
    command(&mut probe, Command::ReadTable(length)).unwrap();
    let beyond = command(&mut probe, Command::ReadTable(length + 1)).unwrap_err();
    assert_eq!(beyond, "the table has no such byte");
    // a part that is missing is an error, and so is a table that is damaged: the former one stays
    command(&mut probe, Command::BeginTable(600)).unwrap();
    let early = Command::WriteTable {
        offset: 8,
        bytes: Vec::from_slice(&[0; 8]).unwrap(),
    };
    assert!(
        command(&mut probe, early)
            .unwrap_err()
            .contains("send the table anew")
    );
    let mut damaged = fused_table();
    damaged[40] ^= 1;
    assert!(push(&mut probe, &damaged).unwrap_err().contains("checksum"));
    assert_eq!(pull(&mut probe), pushed);
    command(&mut probe, Command::FactoryTable).unwrap();
    assert_eq!(pull(&mut probe), fused_table());
}

#[test]
fn without_a_store_it_explores_and_says_that_it_cannot_learn() {
    let mut probe = probe_with(fused_table(), None);
    assert_eq!(probe.events.tables.last().unwrap().textures, 4);
    feels(&mut probe, &[10_000, 10_000]);
    command(&mut probe, exploration(true)).unwrap();
    assert!(
        matches!(
            probe.events.told.last(),
            Some(Event::Verdict(Verdict { sure: true, .. }))
        ),
        "nothing is said to be learned"
    );
    feels(&mut probe, &[-32_000, -32_000, -32_000]);
    let broken = Err(String::from(
        "the store is broken: the flash does not answer: switch the probe off and on",
    ));
    for command in all() {
        let stores = turn(&command, false) == Turn::Queue
            && !matches!(
                command,
                Command::Home | Command::Identify(_) | Command::ReadTable(_)
            );
        let done = self::command(&mut probe, command.clone());
        assert_eq!(
            done,
            if stores { broken.clone() } else { Ok(()) },
            "{command:?}"
        );
    }
    let trouble = |event: &Event| matches!(event, Event::Trouble(_));
    assert!(!probe.events.told.iter().any(trouble));
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
    command(&mut probe, exploration(false)).unwrap();
    command(&mut probe, Command::Calibrate).unwrap();
    let kept = block_on(probe.memory.store().unwrap().calibration()).unwrap();
    assert_eq!(kept, Some(probe.rig.state.calibration));
}

#[test]
fn without_any_table_there_is_trouble_and_no_exploration() {
    let mut probe = probe_with(vec![1, 2, 3], None);
    let Event::Trouble(why) = &probe.events.told[0] else {
        panic!("{:?}", probe.events.told);
    };
    let why = why.to_string();
    assert_eq!(why, "there is no table: truncated: 3 bytes of 16");
    assert!(probe.events.tables.is_empty());
    // who asks is told the same
    assert_eq!(command(&mut probe, exploration(false)), Err(why));
}

#[test]
fn phases_faults_and_places_are_reported_as_they_change() {
    let mut watch = Watch::default();
    let mut rig = RigState::parked(CALIBRATION);
    let mut look = |rig: &RigState| {
        let mut told = vec::Vec::new();
        watch.look(rig, |event| told.push(event));
        told
    };
    assert_eq!(look(&rig), [Event::Phase(crate::wire::Phase::Parked)]);
    assert_eq!(look(&rig), []);
    rig.phase = Phase::Sliding;
    rig.at_rest = false;
    (rig.force_mn, rig.stage_mm) = (500.0, 12.5);
    let told: vec::Vec<Event> = (0..20).flat_map(|_| look(&rig)).collect();
    let [Event::Phase(_), Event::Live(live), Event::Live(_)] = &told[..] else {
        panic!("{told:?}");
    };
    assert_eq!((live.force_mn, live.stage_um), (500, 12_500));
    rig.phase = Phase::Faulted(crate::rig::Fault::EStop);
    let told = look(&rig);
    assert!(matches!(
        told[..],
        [Event::Fault(crate::rig::Fault::EStop), Event::Phase(_)]
    ));
}
