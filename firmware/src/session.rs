//! What the host asks for, one thing after the other: explorations, training, calibration, tables. Owns the store.
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::flash::{Async, Bank2Region1, Flash};
use embassy_time::{Duration, Timer, with_timeout};
use heapless::Vec;
use heapless::spsc::Consumer;
use static_cell::ConstStaticCell;
use tactus_core::features::Plan;
use tactus_core::kernels::Plain;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::control::Phase;
use tactus_core::rig::unloaded::UnloadedRuns;
use tactus_core::session::{self, text};
use tactus_core::store::{Store, StoreError};
use tactus_core::table::Table;
use tactus_core::wire::{Ask, PART, Tell, Text};

use crate::board;
use crate::link::{self, BUSY, JOBS, TABLE, TableInUse, refuse, tell};
use crate::probe::Probe;
use crate::servo::{self, Command, Samples};

/// The table that comes with the firmware: textures of a simulated world, good for the emulated board. A real rig is
/// taught, or given a table.
static FACTORY: &[u8] = include_bytes!("../factory.tact");
/// Bank 2 in the chip's memory: memory.x, STORE.
const STORE_AT: usize = 0x0810_0000;
const STORE_LENGTH: usize = 64 * 1024;
/// The store is open by now, or will never be: two of its sectors erased take less than 2 s.
const OPENING: Duration = Duration::from_secs(10);
/// The sensor's first words are there by now.
const HEARD_MS: u64 = 150;

type Storage = Store<Bank2Region1<'static, Async>>;

#[embassy_executor::task]
pub(crate) async fn session(flash: board::Storage, samples: Consumer<'static, Samples>) {
    static PLAN: static_cell::StaticCell<Plan> = static_cell::StaticCell::new();
    static ROOM: ConstStaticCell<[u8; 16 * 1024]> = ConstStaticCell::new([0; 16 * 1024]);
    let room = ROOM.take();
    let plan: &'static Plan = PLAN.init_with(Plan::new);
    let flash = Flash::new(flash.flash, board::Irqs)
        .into_regions()
        .bank2_region1;
    let mut probe = Probe::new(samples);
    // Whatever was before the reset, the finger is lifted first, and waits for nothing but the sensor. The stage does not
    // move before the calibration is there, which says whether the finger is in the air.
    Timer::after_millis(HEARD_MS).await;
    let _ = probe.lift().await;
    let mut store = with_timeout(OPENING, open(flash))
        .await
        .unwrap_or_else(|_| {
            defmt::error!("the store does not answer");
            None
        });
    use_table(store.as_ref());
    let _ = probe.home().await;
    loop {
        servo::forget_stop();
        BUSY.store(false, Relaxed);
        servo::waits();
        let request = JOBS.receive().await;
        servo::progress();
        BUSY.store(true, Relaxed);
        let id = request.id;
        let done = work(request.ask, &mut probe, &mut store, plan, room).await;
        match done {
            Ok(()) => tell(Tell::Done(id)),
            Err(why) => refuse(id, why),
        }
    }
}

/// The store, its settings in use.
async fn open(flash: Bank2Region1<'static, Async>) -> Option<Storage> {
    let mut store = match Store::open(flash).await {
        Ok(store) => store,
        Err(why) => {
            defmt::error!("the store cannot be opened: {=str}", text(&why).as_str());
            return None;
        }
    };
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

/// The table in use: the stored one, or the factory's.
fn table_bytes(store: Option<&Storage>) -> &'static [u8] {
    let stored = store.and_then(Storage::table).and_then(|table| {
        let at = table.offset as usize;
        // SAFETY: the store's sectors are mapped at this address and are nothing else; the slot in use is erased only while
        // no exploration, and so no reader of this slice, is under way.
        let store = unsafe { core::slice::from_raw_parts(STORE_AT as *const u8, STORE_LENGTH) };
        store.get(at..at.checked_add(table.length)?)
    });
    // one that another version of this firmware wrote is not understood
    stored
        .filter(|bytes| Table::read(bytes).is_ok())
        .unwrap_or(FACTORY)
}

fn use_table(store: Option<&Storage>) {
    let bytes = table_bytes(store);
    if let Ok(table) = Table::read(bytes) {
        TABLE.lock(|cell| {
            cell.set(TableInUse {
                textures: table.textures(),
                bytes: bytes.len() as u32,
                crc: table.crc(),
                factory: core::ptr::eq(bytes, FACTORY),
            });
        });
    }
}

/// Does what was asked for; the error is the answer.
async fn work(
    ask: Ask,
    probe: &mut Probe,
    store: &mut Option<Storage>,
    plan: &Plan,
    room: &mut [u8],
) -> Result<(), Text> {
    let no_store = || text("the store is broken: see the log");
    match ask {
        Ask::Home => probe.home().await.map_err(text),
        Ask::Identify(identify) => {
            let table = Table::read(table_bytes(store.as_ref())).map_err(text)?;
            probe.begin(identify.seed).await;
            let done = session::identify::<_, Plain>(&identify, probe, table, plan, tell).await;
            if let Some(store) = store {
                // what the skin has been through is worth keeping, but no reason to fail
                let _ = store.set_skin(&servo::snapshot().skin).await;
            }
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
            keep(store.as_mut().ok_or_else(no_store)?, &calibration).await
        }
        Ask::ReadTable(offset) => {
            let bytes = table_bytes(store.as_ref());
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
            let store = store.as_mut().ok_or_else(no_store)?;
            store.begin_table(length as usize).await.map_err(text)
        }
        Ask::WriteTable { offset, bytes } => {
            let store = store.as_mut().ok_or_else(no_store)?;
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
            let opened = store.as_mut().ok_or_else(no_store)?;
            opened.commit_table(room).await.map_err(text)?;
            use_table(store.as_ref());
            Ok(())
        }
        Ask::FactoryTable => {
            let opened = store.as_mut().ok_or_else(no_store)?;
            opened.factory_table().await.map_err(text)?;
            use_table(store.as_ref());
            Ok(())
        }
        Ask::Calibrate => {
            let calibration = calibrate(probe).await?;
            tell(link::calibration());
            keep(store.as_mut().ok_or_else(no_store)?, &calibration).await
        }
        Ask::Train(wanted) => {
            let store = store.as_mut().ok_or_else(no_store)?;
            let table = Table::read(table_bytes(Some(store))).map_err(text)?;
            probe.begin(wanted.seed).await;
            let done =
                session::train::<_, _, Plain>(&wanted, probe, store, table, plan, room, tell).await;
            use_table(Some(store));
            let _ = store.set_skin(&servo::snapshot().skin).await;
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
