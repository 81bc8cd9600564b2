//! A probe with a scripted rig and a store in RAM is asked everything.

mod busy;
mod memory;

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
