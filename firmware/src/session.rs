//! What the host asks for, one thing after the other: explorations, training, calibration, tables. Owns the store.
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::flash::{Async, Bank2Region1, Flash};
use embassy_time::Timer;
use heapless::Vec;
use heapless::spsc::Consumer;
use static_cell::ConstStaticCell;
use tactus_core::explorer::{Config, Explorer};
use tactus_core::features::{Plan, PropertySet, Slide};
use tactus_core::kernels::Kernels;
use tactus_core::movement::Movement;
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::rig::control::{Ended, Phase, Refused};
use tactus_core::rig::guard::Fault;
use tactus_core::rig::pins::Felt;
use tactus_core::rig::{Event, Rig, explore};
use tactus_core::store::{Store, StoreError};
use tactus_core::table::Table;
use tactus_core::wire::{
    self, Ask, Block, Identify, MAX_OUTLOOK, MAX_TEXTURES, Name, PART, Promise, Tell,
};

use crate::link::{BUSY, JOBS, STREAM, TABLE, TableInUse, refuse, tell, text};
use crate::servo::{self, Command, Samples};
use crate::{acquire, board};

/// The table that comes with the firmware: textures of a simulated world, good for the emulated board. A real rig is
/// taught, or given a table.
static FACTORY: &[u8] = include_bytes!("../factory.tact");
/// Bank 2 in the chip's memory: memory.x, STORE.
const STORE_AT: usize = 0x0810_0000;
const STORE_LENGTH: usize = 64 * 1024;
/// A movement that takes longer than this does not end.
const PATIENCE_MS: u32 = 120_000;
/// How often the samples are looked after.
const LOOK_MS: u64 = 10;

type Storage = Store<Bank2Region1<'static, Async>>;

/// Why a movement of this probe failed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum ProbeError {
    Refused(Refused),
    Fault(Fault),
    Stopped,
    Hangs,
}

impl core::fmt::Display for ProbeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Refused(why) => why.fmt(f),
            Self::Fault(fault) => {
                let recovery = fault.row().map_or("reset", |row| row.recovery);
                write!(f, "{fault}: {recovery}")
            }
            Self::Stopped => f.write_str("stopped"),
            Self::Hangs => f.write_str("the rig does not come to an end: home it"),
        }
    }
}

impl core::error::Error for ProbeError {}

/// The rig that the servo moves, as the exploration sees it.
struct Probe {
    samples: Consumer<'static, Samples>,
    random: u32,
}

impl Probe {
    /// Xorshift: for where slides begin and for random choices, not for secrets.
    fn random(&mut self) -> u32 {
        self.random ^= self.random << 13;
        self.random ^= self.random >> 17;
        self.random ^= self.random << 5;
        self.random
    }

    /// 0 to 1.
    fn start(&mut self) -> f32 {
        (self.random() >> 8) as f32 / (1 << 24) as f32
    }

    /// Waits until the rig is at rest; `each` is called every [`LOOK_MS`], and once more at the end.
    async fn rest(
        &mut self,
        mut each: impl FnMut(&mut Consumer<'static, Samples>),
    ) -> Result<Option<Ended>, ProbeError> {
        let mut left_ms = PATIENCE_MS;
        loop {
            Timer::after_millis(LOOK_MS).await;
            // before the samples, so that none of a movement that is over is left behind
            let rig = servo::snapshot();
            each(&mut self.samples);
            match rig.phase {
                Phase::Faulted(fault) if rig.at_rest => return Err(ProbeError::Fault(fault)),
                _ if rig.at_rest => return Ok(rig.ended),
                _ => {}
            }
            left_ms = left_ms.saturating_sub(LOOK_MS as u32);
            if left_ms == 0 {
                servo::stop();
                return Err(ProbeError::Hangs);
            }
        }
    }

    async fn home(&mut self) -> Result<(), ProbeError> {
        servo::command(Command::Home)
            .await
            .map_err(ProbeError::Refused)?;
        self.rest(|_| ()).await.map(|_| ())
    }
}

/// Raw samples on their way to the host, in blocks.
struct Blocks {
    block: Block,
}

impl Blocks {
    const EMPTY: Block = Block {
        number: 0,
        still: true,
        steady: None,
        pac: Vec::new(),
        shear_mn: Vec::new(),
        lost: 0,
    };

    fn send(&mut self) {
        let number = self.block.number.wrapping_add(1);
        let still = self.block.still;
        let block = core::mem::replace(&mut self.block, Self::EMPTY);
        tell(Tell::Block(block));
        self.block.number = number;
        self.block.still = still;
    }

    fn put(&mut self, samples: &Samples) {
        let still = samples.felt == Felt::Still;
        let full = self.block.pac.len() + samples.pac.len() > self.block.pac.capacity()
            || self.block.shear_mn.is_full();
        let begins = matches!(samples.felt, Felt::Begin(_));
        if (full || still != self.block.still || begins)
            && !(self.block.pac.is_empty() && self.block.shear_mn.is_empty())
        {
            self.send();
        }
        self.block.still = still;
        if let Felt::Begin(steady) = &samples.felt {
            self.block.steady = Some((steady.start, steady.end));
        }
        // there is room: a block takes many of these
        let _ = self.block.pac.extend_from_slice(&samples.pac);
        if let Some(shear_mn) = samples.shear_mn {
            let _ = self.block.shear_mn.push(shear_mn);
        }
    }

    fn end(mut self, lost: u32) {
        self.block.lost = lost;
        self.send();
    }
}

impl Rig for Probe {
    type Error = ProbeError;

    fn measures(&self) -> PropertySet {
        PropertySet::ALL
    }

    async fn perform<K: Kernels>(
        &mut self,
        movement: Movement,
        slide: &mut Slide<'_, K>,
    ) -> Result<(), ProbeError> {
        if servo::snapshot().phase == Phase::Parked {
            self.home().await?;
        }
        while self.samples.dequeue().is_some() {}
        let lost = || {
            acquire::LOST
                .load(Relaxed)
                .wrapping_add(servo::LOST.load(Relaxed))
        };
        let lost_before = lost();
        let start = self.start();
        servo::command(Command::Start(movement, start))
            .await
            .map_err(ProbeError::Refused)?;
        let mut blocks = STREAM.load(Relaxed).then_some(Blocks {
            block: Blocks::EMPTY,
        });
        let ended = self
            .rest(|queue| {
                while let Some(samples) = queue.dequeue() {
                    feel(&samples, slide);
                    if let Some(blocks) = &mut blocks {
                        blocks.put(&samples);
                    }
                }
            })
            .await;
        let gap = match ended {
            Ok(Some(Ended::Gap(samples))) => samples,
            _ => 0,
        };
        let gap = gap + lost().wrapping_sub(lost_before);
        if gap > 0 {
            slide.lose(gap);
        }
        if let Some(blocks) = blocks {
            blocks.end(gap);
        }
        match ended? {
            Some(Ended::Whole | Ended::Gap(_)) => Ok(()),
            Some(Ended::Stopped) | None => Err(ProbeError::Stopped),
        }
    }
}

/// Gives what a tick felt to the core.
fn feel<K: Kernels>(samples: &Samples, slide: &mut Slide<'_, K>) {
    match &samples.felt {
        Felt::Nothing => return,
        Felt::Still => return slide.push_still(&samples.pac),
        Felt::Begin(steady) => slide.start(steady.clone()),
        Felt::Slide => {}
    }
    slide.push(&samples.pac);
    slide.push_shear(samples.shear_mn.as_slice());
}

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
    let mut probe = Probe {
        samples,
        random: 0x2012_0618,
    };
    if let Some(store) = &mut store {
        if let Err(why) = restore(store).await {
            defmt::error!("settings are not read: {=str}", text(&why).as_str());
        }
    }
    use_table(store.as_ref());
    // whatever was before the reset, the finger is lifted first
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
    stored.unwrap_or(FACTORY)
}

fn use_table(store: Option<&Storage>) {
    let bytes = table_bytes(store);
    if let Ok(table) = Table::read(bytes) {
        TABLE.lock(|cell| {
            cell.set(TableInUse {
                textures: table.textures(),
                bytes: bytes.len() as u32,
                crc: table.crc(),
                factory: store.is_none_or(|store| store.table().is_none()),
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
) -> Result<(), wire::Text> {
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
            let store = store.as_mut().ok_or_else(no_store)?;
            store.set_calibration(&calibration).await.map_err(text)
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
            store
                .write_table(offset as usize, &bytes)
                .await
                .map_err(text)
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
        Ask::Train(_) | Ask::Calibrate => Err(text("todo")),
        Ask::Status | Ask::Stop | Ask::Stream(_) | Ask::ReadCalibration => Ok(()),
    }
}

/// An exploration from the first choice to the verdict, everything of it told.
async fn explore_once(
    identify: &Identify,
    probe: &mut Probe,
    table: &'static [u8],
    plan: &Plan,
) -> Result<(), wire::Text> {
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
    // 0 would stay 0
    probe.random = identify.seed.max(1);
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
                let mut best: Vec<Promise, { tactus_core::table::MAX_ACTIONS }> = outlook
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
