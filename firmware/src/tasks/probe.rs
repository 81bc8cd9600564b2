//! What the host asks for, one thing after the other. Owns the store.
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_time::Timer;
use heapless::spsc::Consumer;
use static_cell::StaticCell;
use tactus_core::dsp::Plan;
use tactus_core::probe::seams::{Events, RigHandle as _};
use tactus_core::probe::servo_rig::{Samples, ServoRig};
use tactus_core::probe::{self, Memory, Probe, TableInUse};
use tactus_core::table::factory;
use tactus_core::wire::{Event, Failure, Reset, Text};

use super::drive;
use super::link::{BUSY, JOBS, TABLE};
use super::outbox::{self, tell};
use super::rig_handle::ServoHandle;
use crate::board;
use crate::chip::flash::{self, MappedTable};
use crate::chip::{KERNELS, finger};

/// The sensor's first words are there so long after it was found.
const HEARD_MS: u64 = 50;

/// Why the chip started, and what was said before.
type Booted = (Reset, Option<Text>);

#[embassy_executor::task]
pub(crate) async fn probe(
    flash: board::Storage,
    go: board::Go,
    samples: Consumer<'static, Samples>,
    booted: Booted,
) {
    work::<true>(flash, go, samples, booted).await
}

/// The same where somebody else's arm moves the finger.
#[embassy_executor::task]
pub(crate) async fn probe_on_arm(
    flash: board::Storage,
    go: board::Go,
    samples: Consumer<'static, Samples>,
    booted: Booted,
) {
    work::<false>(flash, go, samples, booted).await
}

async fn work<const HAS_STAGE: bool>(
    flash: board::Storage,
    go: board::Go,
    samples: Consumer<'static, Samples>,
    (reset, last_words): Booted,
) {
    static PLAN: StaticCell<Plan> = StaticCell::new();
    let mut rig = ServoRig::new(ServoHandle::<HAS_STAGE>(samples));
    finger::found().await;
    let flaw = || board::flaw()?.try_into().ok();
    outbox::booted(reset, last_words.or_else(flaw));
    // textures of a simulated world, which suit the emulated board; a real rig is trained by its user, or receives a table
    let table = if HAS_STAGE {
        factory::rig(finger::name())
    } else {
        factory::arm(finger::name())
    };
    // Whatever was before the reset, the finger is lifted first, and waits for nothing but the sensor. The stage does not
    // move before the calibration is there, which says whether the finger is in the air.
    Timer::after_millis(HEARD_MS).await;
    // An arm is told to stop, and asked for more once somebody asks for a slide: it may not be there.
    let lifted = !HAS_STAGE || rig.lift().await.is_ok();
    let opening = async {
        let mut store = flash::open(flash).await?;
        if let Err(why) = store.mend().await {
            trouble(why.into());
        }
        Ok(store)
    };
    let mut store = flash::wait(opening, drive::progress).await;
    let restored = match &mut store {
        Ok(store) => probe::restore(store, &mut rig).await,
        Err(why) => Err(*why),
    };
    if let Err(why) = restored {
        trouble(why.into());
    }
    let mut probe = Probe {
        rig,
        memory: Memory::new(store, MappedTable, table, flash::buffer()),
        events: Told(Output::new(go.same, Level::Low, Speed::Low)),
        plan: PLAN.init_with(|| Plan::with(KERNELS)),
    };
    probe.memory.reload(&mut probe.events).await;
    // a lever that does not go up must not be asked again before somebody has looked at it
    if lifted && HAS_STAGE {
        let _ = probe.rig.home().await;
    }
    loop {
        drive::forget_stop();
        BUSY.store(false, Relaxed);
        drive::waits();
        let request = JOBS.receive().await;
        drive::progress();
        BUSY.store(true, Relaxed);
        probe.serve(&request).await;
    }
}

/// The words for it are the host's.
fn trouble(why: Failure) {
    defmt::error!("trouble: the host is told what it is");
    tell(Event::Trouble(why));
}

/// Tells the host, and the tasks that answer it meanwhile; has the go / no-go output.
struct Told(Output<'static>);

impl Events for Told {
    fn tell(&mut self, event: Event) {
        tell(event);
    }

    fn table(&mut self, table: TableInUse) {
        TABLE.lock(|cell| cell.set(table));
    }

    fn go(&mut self, on: bool) {
        self.0.set_level(on.into());
    }
}
