//! What the host asks for, one thing after the other: explorations, training, calibration, tables. Owns the store.
use core::pin::pin;
use core::sync::atomic::Ordering::Relaxed;

use embassy_time::{Duration, Timer, with_timeout};
use heapless::Vec;
use heapless::spsc::Consumer;
use static_cell::ConstStaticCell;
use tactus_core::features::Plan;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::control::Phase;
use tactus_core::rig::unloaded::UnloadedRuns;
use tactus_core::session::{self, Visited, text};
use tactus_core::store::StoreError;
use tactus_core::table::Table;
use tactus_core::teaching;
use tactus_core::wire::{Ask, PART, Tell, Text};

use crate::board;
use crate::kernels::Chip;
use crate::link::{self, BUSY, JOBS, TABLE, TableInUse, refuse, tell};
use crate::memory::{self, Memory, Storage, broken};
use crate::probe::Probe;
use crate::servo::{self, Command, Samples};

/// The table that comes with the firmware: textures of a simulated world, good for the emulated board. A real rig is
/// taught, or given a table.
static FACTORY: &[u8] = include_bytes!("../factory.tact");
/// The store is open by now, or will never be: two of its sectors erased take less than 2 s.
const OPENING: Duration = Duration::from_secs(10);
/// The sensor's first words are there by now.
const HEARD_MS: u64 = 150;

#[embassy_executor::task]
pub(crate) async fn session(flash: board::Storage, samples: Consumer<'static, Samples>) {
    static PLAN: static_cell::StaticCell<Plan> = static_cell::StaticCell::new();
    static ROOM: ConstStaticCell<[u8; 16 * 1024]> = ConstStaticCell::new([0; 16 * 1024]);
    let room = ROOM.take();
    let plan: &'static Plan = PLAN.init_with(Plan::new);
    let mut probe = Probe::new(samples);
    // Whatever was before the reset, the finger is lifted first, and waits for nothing but the sensor. The stage does not
    // move before the calibration is there, which says whether the finger is in the air.
    Timer::after_millis(HEARD_MS).await;
    let _ = probe.lift().await;
    let store = with_timeout(OPENING, open(flash))
        .await
        .unwrap_or_else(|_| {
            defmt::error!("the store does not answer");
            None
        });
    let mut memory = Memory::new(store, FACTORY, room, tell_link);
    memory.reload().await;
    let _ = probe.home().await;
    loop {
        servo::forget_stop();
        BUSY.store(false, Relaxed);
        servo::waits();
        let request = JOBS.receive().await;
        servo::progress();
        BUSY.store(true, Relaxed);
        let id = request.id;
        let done = work(request.ask, &mut probe, &mut memory, plan).await;
        match done {
            Ok(()) => tell(Tell::Done(id)),
            Err(why) => refuse(id, why),
        }
    }
}

/// The store, its settings in use.
async fn open(flash: board::Storage) -> Option<Storage> {
    let mut store = memory::open(flash).await?;
    if let Err(why) = restore(&mut store).await {
        defmt::error!("settings are not read: {=str}", text(&why).as_str());
    }
    Some(store)
}

/// Skin and calibration as they were; each whatever becomes of the other.
async fn restore(store: &mut Storage) -> Result<(), StoreError<embassy_stm32::flash::Error>> {
    let skin = store.skin().await;
    if let Ok(skin) = &skin {
        let _ = servo::command(Command::Skin(*skin)).await;
    }
    if let Some(calibration) = store.calibration().await? {
        let _ = servo::command(Command::Calibrate(calibration)).await;
    }
    skin.map(|_| ())
}

/// Tells the link of the table in force.
fn tell_link(memory: &Memory) {
    let Ok(table) = Table::read(memory.in_force()) else {
        return;
    };
    TABLE.lock(|cell| {
        cell.set(TableInUse {
            textures: table.textures(),
            bytes: memory.in_force().len() as u32,
            crc: table.crc(),
            factory: memory.is_factory(),
        });
    });
}

impl Memory {
    /// What the skin has been through is worth keeping, but no reason to fail.
    async fn keep_skin(&mut self) {
        if let Some(store) = &mut self.store {
            let _ = store.set_skin(&servo::snapshot().skin).await;
        }
    }

    /// Learns from a visit that the probe is certain of. The exploration has its answer whatever becomes of that.
    async fn learn_by_itself(&mut self, visited: &Visited) {
        let Some(store) = &mut self.store else {
            return;
        };
        match teaching::learn_by_itself(visited, store, self.room).await {
            Ok(Some(taught)) => {
                tell_link(self);
                tell(taught);
            }
            Ok(None) => {}
            Err(why) => {
                defmt::error!("not learned: {=str}", why.as_str());
                self.reload().await;
            }
        }
    }
}

/// Does what was asked for; the error is the answer.
async fn work(ask: Ask, probe: &mut Probe, memory: &mut Memory, plan: &Plan) -> Result<(), Text> {
    match ask {
        Ask::Home => {
            memory.visited = None;
            probe.home().await.map_err(text)
        }
        Ask::Identify(wanted) => {
            memory.visited = None;
            probe.begin(wanted.seed).await;
            let table = Table::read(memory.in_force()).map_err(text)?;
            // awaited where it lies: moving it would take its size of the stack, twice
            let done = {
                let exploration = pin!(session::identify::<_, Chip>(
                    &wanted, probe, table, plan, tell
                ));
                exploration.await
            };
            memory.keep_skin().await;
            let visited = done?;
            if wanted.learn {
                memory.learn_by_itself(&visited).await;
            }
            memory.visited = Some(visited);
            Ok(())
        }
        Ask::Answer(name) => {
            let visited = memory
                .visited
                .take()
                .ok_or_else(|| text("nothing was felt since the rig moved last: explore first"))?;
            let (store, base, room) = memory.to_learn()?;
            let done = teaching::answer(&visited, &name, &base, store, room).await;
            memory.reload().await;
            match done {
                Ok(taught) => {
                    tell(taught);
                    Ok(())
                }
                Err(why) => {
                    // another name may do
                    memory.visited = Some(visited);
                    Err(why)
                }
            }
        }
        Ask::Rename { from, to } => {
            let (store, base, room) = memory.to_learn()?;
            let done = teaching::rename(&from, &to, &base, store, room).await;
            memory.reload().await;
            done
        }
        Ask::Forget(what) => {
            let (store, base, room) = memory.to_learn()?;
            let done = teaching::forget(&what, &base, store, room).await;
            memory.reload().await;
            done
        }
        Ask::Train(wanted) => {
            memory.visited = None;
            probe.begin(wanted.seed).await;
            let (store, base, room) = memory.to_learn()?;
            let done =
                session::train::<_, _, Chip>(&wanted, probe, store, base, plan, room, tell).await;
            memory.reload().await;
            memory.keep_skin().await;
            done
        }
        Ask::WriteCalibration(bytes) => {
            let bytes = bytes
                .as_slice()
                .try_into()
                .map_err(|_| text("a calibration has 60 bytes"))?;
            let calibration = RigCalibration::from_bytes(bytes).map_err(text)?;
            servo::command(Command::Calibrate(calibration))
                .await
                .map_err(text)?;
            keep(memory.store()?, &calibration).await
        }
        Ask::Calibrate => {
            memory.visited = None;
            let calibration = calibrate(probe).await?;
            tell(link::calibration());
            keep(memory.store()?, &calibration).await
        }
        Ask::ReadTable(offset) => {
            let bytes = memory.in_force();
            let rest = bytes
                .get(offset as usize..)
                .ok_or_else(|| text("the table has no such byte"))?;
            let part = rest.get(..rest.len().min(PART)).unwrap_or_default();
            tell(Tell::TablePart {
                offset,
                length: bytes.len() as u32,
                bytes: Vec::from_slice(part).unwrap_or_default(),
            });
            Ok(())
        }
        Ask::BeginTable(length) => {
            let store = memory.store()?;
            store.begin_table(length as usize).await.map_err(text)
        }
        Ask::WriteTable { offset, bytes } => {
            let store = memory.store()?;
            match store.write_table(offset as usize, &bytes).await {
                // said again by a host that did not hear the answer; the table's checksum is looked at in the end
                Err(StoreError::Part { offset, wanted })
                    if offset.checked_add(bytes.len()) == Some(wanted) =>
                {
                    Ok(())
                }
                written => written.map_err(text),
            }
        }
        Ask::CommitTable => {
            let store = memory.store.as_mut().ok_or_else(broken)?;
            let done = store.commit_table(memory.room).await;
            let done = done.map(|_| ()).map_err(text);
            memory.reload().await;
            done
        }
        Ask::FactoryTable => {
            let done = memory.store()?.factory_table().await.map_err(text);
            memory.reload().await;
            done
        }
        Ask::Status | Ask::Stop | Ask::Stream(_) | Ask::ReadCalibration => Ok(()),
    }
}

/// Measures the motor's current without load and takes it into use.
async fn calibrate(probe: &mut Probe) -> Result<RigCalibration, Text> {
    if servo::snapshot().phase == Phase::Parked {
        probe.home().await.map_err(text)?;
    }
    let mut runs = UnloadedRuns::default();
    while let Some(speed_um_s) = runs.next_speed() {
        let (from_mm, to_mm, current_a) = probe.run_unloaded(speed_um_s).await.map_err(text)?;
        runs.took(from_mm, to_mm, current_a);
    }
    let rig = servo::snapshot();
    let mut calibration = runs.finish(&rig.calibration).map_err(text)?;
    calibration.pressure.pdc_no_contact = rig
        .air_counts
        .unwrap_or(calibration.pressure.pdc_no_contact);
    calibration.check().map_err(text)?;
    servo::command(Command::Calibrate(calibration))
        .await
        .map_err(text)?;
    Ok(calibration)
}

/// Keeps a calibration. Settings that cannot be read have lost theirs: they are begun anew.
async fn keep(store: &mut Storage, calibration: &RigCalibration) -> Result<(), Text> {
    if store.settings().is_err() {
        store.erase_settings().await.map_err(text)?;
    }
    store.set_calibration(calibration).await.map_err(text)
}
