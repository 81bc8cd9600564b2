//! What the host asks for, one thing after the other: explorations, training, calibration, tables. Owns the store.
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::flash::{Async, Bank2Region1, Flash};
use embassy_time::Timer;
use heapless::Vec;
use heapless::spsc::Consumer;
use static_cell::ConstStaticCell;
use tactus_core::explorer::{Config, Explorer};
use tactus_core::features::{Plan, Slide};
use tactus_core::kernels::Plain;
use tactus_core::movement::Movement;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::control::Phase;
use tactus_core::rig::guard::Fault;
use tactus_core::rig::unloaded::UnloadedRuns;
use tactus_core::rig::{Event, MAX_REJECTED, Rig as _, explore};
use tactus_core::store::{Store, StoreError};
use tactus_core::table::{MAX_ACTIONS, MAX_MOVEMENTS, Table};
use tactus_core::training::{Training, Wanted};
use tactus_core::wire::{
    Ask, Identify, MAX_OUTLOOK, MAX_TEXTURES, Name, PART, Promise, Tell, Text, Train,
};

use crate::board;
use crate::link::{self, BUSY, JOBS, TABLE, TableInUse, refuse, tell, text};
use crate::probe::Probe;
use crate::servo::{self, Command, Samples};

/// The table that comes with the firmware: textures of a simulated world, good for the emulated board. A real rig is
/// taught, or given a table.
static FACTORY: &[u8] = include_bytes!("../factory.tact");
/// Bank 2 in the chip's memory: memory.x, STORE.
const STORE_AT: usize = 0x0810_0000;
const STORE_LENGTH: usize = 64 * 1024;
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
    let mut store = match Store::open(flash).await {
        Ok(store) => Some(store),
        Err(why) => {
            defmt::error!("the store cannot be opened: {=str}", text(&why).as_str());
            None
        }
    };
    let mut probe = Probe::new(samples);
    if let Some(store) = &mut store {
        if let Err(why) = restore(store).await {
            defmt::error!("settings are not read: {=str}", text(&why).as_str());
        }
    }
    use_table(store.as_ref());
    // Whatever was before the reset, the finger is lifted first. Homing wants to hear the sensor.
    Timer::after_millis(HEARD_MS).await;
    let _ = probe.home().await;
    loop {
        BUSY.store(false, Relaxed);
        let request = JOBS.receive().await;
        BUSY.store(true, Relaxed);
        let id = request.id;
        let done = work(request.ask, &mut probe, &mut store, plan, room).await;
        match done {
            Ok(()) => tell(Tell::Done(id)),
            Err(why) => refuse(id, why),
        }
    }
}

/// Calibration and skin as they were.
async fn restore(store: &mut Storage) -> Result<(), StoreError<embassy_stm32::flash::Error>> {
    if let Some(calibration) = store.calibration().await? {
        let _ = servo::command(Command::Calibrate(calibration)).await;
    }
    let skin = store.skin().await?;
    let _ = servo::command(Command::Skin(skin)).await;
    Ok(())
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
            let done = explore_once(&identify, probe, table_bytes(store.as_ref()), plan).await;
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
                Err(StoreError::Part { offset, wanted }) if offset + bytes.len() == wanted => Ok(()),
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
            let done = train(&wanted, probe, store, plan, room).await;
            use_table(Some(store));
            let _ = store.set_skin(&servo::snapshot().skin).await;
            done
        }
        Ask::Status | Ask::Stop | Ask::Stream(_) | Ask::ReadCalibration => Ok(()),
    }
}

/// An exploration from the first choice to the verdict, everything of it told.
async fn explore_once(
    identify: &Identify,
    probe: &mut Probe,
    table: &'static [u8],
    plan: &Plan,
) -> Result<(), Text> {
    let table = Table::read(table).map_err(text)?;
    let config = Config {
        strategy: identify.strategy,
        threshold: identify.threshold,
        max_slides: identify.max_slides,
    };
    let mut explorer = if identify.among.is_empty() {
        Explorer::<'_, MAX_TEXTURES>::new(table, probe.measures(), config)
    } else {
        let candidates = identify.among.iter().copied();
        Explorer::among(table, probe.measures(), config, candidates)
    }
    .map_err(text)?;
    probe.seed(identify.seed);
    let _ = servo::command(Command::SampleChanged).await;
    let mut random = identify.seed.rotate_left(16).max(1);
    let mut slide: u8 = 1;
    let verdict = explore(
        probe,
        &mut explorer,
        plan,
        || {
            random ^= random << 13;
            random ^= random >> 17;
            random ^= random << 5;
            random
        },
        |event| match event {
            Event::Chosen(action, outlook) => {
                let mut best: Vec<Promise, MAX_ACTIONS> = outlook
                    .iter()
                    .map(|o| Promise {
                        action: o.action,
                        uncertainty: o.uncertainty,
                        benefit: o.benefit,
                    })
                    .collect();
                best.sort_unstable_by(|a, b| b.benefit.total_cmp(&a.benefit));
                if let Some(movement) = table.movement(action.movement) {
                    tell(Tell::Chosen {
                        slide,
                        movement,
                        action,
                        outlook: best.into_iter().take(MAX_OUTLOOK).collect(),
                    });
                }
            }
            Event::Felt(action, measurement, posterior) => {
                tell(Tell::Felt {
                    slide,
                    action,
                    felt: measurement.into(),
                    posterior: Vec::from_slice(posterior).unwrap_or_default(),
                });
                slide = slide.saturating_add(1);
            }
            Event::Rejected(_, why) => tell(Tell::Rejected {
                slide,
                why: text(why),
            }),
        },
    )
    .await
    .map_err(text)?;
    let name = table.name(verdict.texture).unwrap_or_default();
    tell(Tell::Verdict {
        texture: verdict.texture,
        name: Name::try_from(name).unwrap_or_default(),
        probability: verdict.probability,
        sure: verdict.sure,
        slides: explorer.slides(),
    });
    Ok(())
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
    let calibration = runs.finish(&servo::snapshot().calibration).map_err(text)?;
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

/// Learns the texture under the finger, going on where an earlier training of it stopped; every trial is stored at once.
async fn train(
    wanted: &Train,
    probe: &mut Probe,
    store: &mut Storage,
    plan: &Plan,
    room: &mut [u8],
) -> Result<(), Text> {
    let table = Table::read(table_bytes(Some(store))).map_err(text)?;
    let name = wanted.name.as_str();
    let mut training = Training::new(
        Wanted {
            name,
            trials: wanted.trials,
            pilot: wanted.pilot,
            measures: probe.measures(),
        },
        Some(&table),
        Storage::MAX_TABLE,
    )
    .map_err(text)?;
    let movements: Vec<Movement, MAX_MOVEMENTS> =
        training.learned().iter().map(|(m, _)| *m).collect();
    for movement in movements {
        let before = store.trained(name, movement, training.table()).await;
        if let Some(experience) = before.map_err(text)? {
            training.resume(movement, experience).map_err(text)?;
        }
    }
    probe.seed(wanted.seed);
    let _ = servo::command(Command::SampleChanged).await;
    let mut rejected = 0;
    while let Some(movement) = training.next() {
        let mut slide = Slide::<Plain>::new(plan);
        probe.perform(movement, &mut slide).await.map_err(text)?;
        let measurement = match slide.finish() {
            Ok(measurement) => measurement,
            Err(why) => {
                rejected += 1;
                tell(Tell::Rejected {
                    slide: rejected,
                    why: text(why),
                });
                if rejected == MAX_REJECTED {
                    return Err(text(Fault::Rejected));
                }
                continue;
            }
        };
        rejected = 0;
        let trained = training
            .took(movement, &measurement.properties)
            .map_err(text)?;
        store.set_trained(&trained).await.map_err(text)?;
        tell(Tell::Learned {
            movement,
            trial: trained.experience.trials(),
            left: training.left(),
            felt: (&measurement).into(),
        });
    }
    if training.makes_table() {
        let length = {
            let new = training.encode(Some(&table), room).map_err(text)?;
            new.as_bytes().len()
        };
        store.begin_table(length).await.map_err(text)?;
        let bytes = room.get(..length).unwrap_or_default();
        store.write_table(0, bytes).await.map_err(text)?;
        store.commit_table(room).await.map_err(text)?;
        // what the table holds now need not be kept beside it
        store.forget_trained(name).await.map_err(text)?;
    }
    Ok(())
}
