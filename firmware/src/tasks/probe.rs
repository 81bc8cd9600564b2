//! What the host asks for, one thing after the other. Owns the store.
use core::sync::atomic::Ordering::Relaxed;

use embassy_time::{Instant, Timer};
use static_cell::StaticCell;
use tactus_core::dsp::Plan;
use tactus_core::probe::seams::{Events, RigHandle as _};
use tactus_core::probe::servo_rig::ServoRig;
use tactus_core::probe::{self, Memory, Probe};
use tactus_core::table::factory;
use tactus_core::wire::{Event, Reset, Text};

use super::drive;
use super::drive::ServoHandle;
use super::link::{BUSY, EventSink, JOBS};
use super::outbox;
use crate::board;
use crate::chip::flash::{self, MappedTable};
use crate::chip::reading::{self, Part};
use crate::chip::{KERNELS, finger};

/// The sensor's first words are there so long after it was found.
const HEARD_MS: u64 = 50;

#[embassy_executor::task]
pub(crate) async fn probe(
    flash: board::Storage,
    go: board::Go,
    servo: ServoHandle,
    booted: (Reset, Option<Text>),
) {
    let (reset, last_words) = booted;
    static PLAN: StaticCell<Plan> = StaticCell::new();
    let has_stage = servo.has_stage;
    let mut rig = ServoRig::new(servo);
    let mut events = EventSink::new(go, false);
    finger::found().await;
    let flaw = || board::flaw()?.try_into().ok();
    outbox::booted(reset, last_words.or_else(flaw));
    // textures of a simulated world, which suit the emulated board; a real rig is trained by its user, or receives a
    // table
    let table = if has_stage {
        factory::rig(finger::name())
    } else {
        factory::arm(finger::name())
    };
    // Whatever was before the reset, the finger is lifted first, and waits for nothing but the sensor. The stage does
    // not move before the calibration is there, which says whether the finger is in the air.
    Timer::after_millis(HEARD_MS).await;
    // An arm is told to stop, and asked for more once somebody asks for a slide: it may not be there.
    let lifted = !has_stage || rig.lift().await.is_ok();
    let failed = reading::failed(reset);
    let opening = async {
        let mut store = flash::open(flash, failed).await?;
        if failed != Some(Part::Store)
            && let Err(why) = store.mend().await
        {
            events.tell(Event::Trouble(why.into()));
        }
        Ok(store)
    };
    let mut store = flash::wait(opening, drive::progress).await;
    let restored = match &mut store {
        Ok(store) => probe::restore(store, &mut rig).await,
        Err(why) => Err(*why),
    };
    if let Err(why) = restored {
        events.tell(Event::Trouble(why.into()));
    }
    let mut probe = Probe {
        rig,
        memory: Memory::new(store, MappedTable, table, flash::buffer()),
        events,
        plan: PLAN.init_with(|| Plan::with(KERNELS)),
    };
    flash::reload(&mut probe.memory, failed, &mut probe.events).await;
    // a lever that does not go up must not be asked again before somebody has looked at it
    if lifted && has_stage {
        let _ = probe.rig.home().await;
    }
    loop {
        drive::forget_stop();
        BUSY.store(false, Relaxed);
        drive::waits();
        let request = JOBS.receive().await;
        drive::progress();
        BUSY.store(true, Relaxed);
        probe.memory.at(Instant::now().as_millis() as u32);
        probe.serve(&request).await;
    }
}
