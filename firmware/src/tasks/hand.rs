//! The handheld in a hand: states, button, buzzer and table; and how long the core sleeps between them.
use core::cell::Cell;
use core::sync::atomic::Ordering::Relaxed;
use core::sync::atomic::{AtomicBool, AtomicU32};

use embassy_stm32::gpio::{Input, OutputType, Pull};
use embassy_stm32::peripherals;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_sync::blocking_mutex::Mutex;
use embassy_time::{Duration, Instant, Ticker};
use heapless::spsc::Consumer;
use static_cell::StaticCell;
use tactus_core::dsp::Plan;
use tactus_core::handheld::by_hand::{self, ByHand, Hand};
use tactus_core::handheld::jobs::{self, Outcome};
use tactus_core::handheld::{About, Handheld, Moved, Picture, Screen, TICKS_HZ, draw};
use tactus_core::probe::seams::Events;
use tactus_core::probe::{self, Memory, Probe, RigState};
use tactus_core::rig::calibration::RigCalibration;
use tactus_core::sensor::FingerName;
use tactus_core::sensor::paa5100je::{MotionFault, Paa5100je};
use tactus_core::table::factory;
use tactus_core::wire::{Event, Reset, Text};

use super::display;
use super::level::OneLevel;
use super::link::{BUSY, Body, EventSink, HEARD, JOBS};
use super::outbox::{self, STREAM};
use crate::board;
use crate::chip::flash::{self, MappedTable};
use crate::chip::motion::MotionBus;
use crate::chip::reading;
use crate::chip::slots::{self, Word};
use crate::chip::watchdog;
use crate::chip::{KERNELS, finger};

/// Ticks from one word in the log about sleep to the next.
const SAY: u32 = 5 * TICKS_HZ;
/// `hand` gets on at least this often, ms. The longest that it does is to turn a page of settings, to erase the largest
/// sector, 2 s, and to write 64 KB, 1.6 s.
const PATIENCE_MS: u32 = 10_000;

static ASLEEP_US: AtomicU32 = AtomicU32::new(0);
static PROGRESS_MS: AtomicU32 = AtomicU32::new(0);

/// Sleeps for ever but for interrupts, and counts the time. With interrupts held off, the first one ends the sleep but
/// runs only after the time was taken: nothing that is done is counted as sleep.
pub(crate) fn sleep() -> ! {
    loop {
        cortex_m::interrupt::disable();
        let from = Instant::now();
        cortex_m::asm::dsb();
        cortex_m::asm::wfi();
        // before the interrupt runs: it may be the one in which the time is read
        ASLEEP_US.fetch_add(from.elapsed().as_micros() as u32, Relaxed);
        // SAFETY: they were on before, and nothing here is in their way.
        unsafe { cortex_m::interrupt::enable() };
    }
}

fn progress() {
    PROGRESS_MS.store(Instant::now().as_millis() as u32, Relaxed);
}

#[embassy_executor::task]
pub(crate) async fn watch() {
    let mut ticker = Ticker::every(Duration::from_millis(100));
    loop {
        ticker.next().await;
        let now = Instant::now().as_millis() as u32;
        if now.wrapping_sub(PROGRESS_MS.load(Relaxed)) < PATIENCE_MS {
            watchdog::pet();
        }
    }
}

/// Share of time that the core was awake, second by second: while it listens, and while it rests.
#[derive(Default)]
struct Awake {
    since_us: u64,
    asleep_us: u32,
    listening: Share,
    resting: Share,
}

#[derive(Default)]
struct Share {
    awake_us: u64,
    all_us: u64,
}

impl Share {
    fn get(&self) -> Option<f32> {
        (self.all_us > 0).then(|| self.awake_us as f32 / self.all_us as f32)
    }
}

impl Awake {
    /// So it was since the last time; `None`: not the same all the while.
    fn was(&mut self, listening: Option<bool>) {
        let (now_us, asleep_us) = (Instant::now().as_micros(), ASLEEP_US.load(Relaxed));
        let all_us = now_us - self.since_us;
        let slept_us = u64::from(asleep_us.wrapping_sub(self.asleep_us));
        (self.since_us, self.asleep_us) = (now_us, asleep_us);
        let share = match listening {
            Some(true) => &mut self.listening,
            Some(false) => &mut self.resting,
            None => return,
        };
        share.all_us += all_us;
        share.awake_us += all_us.saturating_sub(slept_us);
    }

    fn say(&self) {
        if let Some(share) = self.listening.get() {
            defmt::info!("awake listening: {=f32}", share);
        }
        if let Some(share) = self.resting.get() {
            defmt::info!("awake at rest: {=f32}", share);
        }
        defmt::info!(
            "sensor slots: {=u32} late, {=u32} lost",
            slots::LATE.load(Relaxed),
            slots::LOST.load(Relaxed)
        );
    }
}

type Buzzer = SimplePwm<'static, peripherals::TIM8>;

fn sound(buzzer: &mut Buzzer, tone: Option<u16>) {
    match tone {
        Some(hz) => {
            buzzer.set_frequency(Hertz(hz.into()));
            let mut pin = buzzer.ch4();
            pin.set_duty_cycle_percent(50);
            pin.enable();
        }
        None => buzzer.ch4().disable(),
    }
}

static STATE: Mutex<OneLevel, Cell<RigState>> =
    Mutex::new(Cell::new(RigState::parked(unmeasured(FingerName::Biotac))));
static STOPPED: AtomicBool = AtomicBool::new(false);

pub(crate) const BODY: Body = Body {
    state: || STATE.lock(Cell::get),
    stop: |all| STOPPED.store(all, Relaxed),
    lost: || 0,
    arm: |_| false,
};

/// A fingertip that nobody has measured; what belongs to motors is not used.
const fn unmeasured(finger: FingerName) -> RigCalibration {
    RigCalibration {
        unloaded_a: (0.0, 0.0),
        newton_per_ampere: 1.0,
        ..RigCalibration::unmeasured(&finger.parts().model)
    }
}

struct Parts {
    words: Consumer<'static, Word>,
    button: Input<'static>,
    buzzer: Buzzer,
    ticker: Ticker,
    awake: Awake,
    /// Whether words come, whether that was so for the whole second, and ticks.
    listens: bool,
    same: bool,
    ticks: u32,
    /// The sensor of motion, and whether it failed when that was logged last.
    motion: Paa5100je<MotionBus>,
    motion_fails: bool,
}

impl Hand for Parts {
    fn feels_gravity(&self) -> bool {
        finger::parts().feels_gravity
    }

    async fn wait(&mut self) {
        self.ticker.next().await;
        progress();
        self.ticks = self.ticks.wrapping_add(1);
        if self.ticks.is_multiple_of(TICKS_HZ) {
            self.awake.was(self.same.then_some(self.listens));
            self.same = true;
        }
    }

    fn word(&mut self) -> Option<Word> {
        self.words.dequeue()
    }

    fn moved(&mut self) -> Option<Moved> {
        let sensor = &mut self.motion;
        let moved = sensor.poll(Instant::now().as_millis() as u32);
        // a probe without one is asked now and then: it may be plugged in
        if !sensor.is_found() {
            return None;
        }
        let fault = sensor.fault();
        if fault.is_some() != self.motion_fails {
            self.motion_fails = fault.is_some();
            match fault {
                None => defmt::info!("motion sensor: works"),
                Some(MotionFault::Bus) => defmt::error!("motion sensor: no bus"),
                Some(MotionFault::Identity([id, inverse])) => {
                    defmt::error!("motion sensor: answers {=u8} {=u8}", id, inverse);
                }
                Some(MotionFault::Forgot) => defmt::error!("motion sensor: lost its power"),
            }
        }
        Some(moved)
    }

    fn gravity(&self) -> Option<f32> {
        slots::gravity()
    }

    fn is_pressed(&mut self) -> bool {
        self.button.is_high()
    }

    fn listen(&mut self, on: bool) {
        if on && !self.listens {
            // what was done meanwhile took its time
            self.ticker.reset();
        }
        (self.listens, self.same) = (on, false);
        slots::listen(on);
    }

    fn sound(&mut self, tone: Option<u16>) {
        sound(&mut self.buzzer, tone);
    }

    fn show(&mut self, screen: &Screen<'_>) {
        if matches!(screen, Screen::Dark) {
            return display::picture(None);
        }
        let mut picture = Picture::new();
        let Ok(()) = draw(screen, &mut picture);
        display::picture(Some(&picture));
    }

    fn about(&self) -> About {
        About {
            version: env!("CARGO_PKG_VERSION"),
            awake: self.awake.listening.get(),
            awake_at_rest: self.awake.resting.get(),
            late: slots::LATE.load(Relaxed),
            lost: slots::LOST.load(Relaxed),
            ..About::default()
        }
    }

    fn publish(&mut self, state: &RigState) {
        STATE.lock(|cell| cell.set(*state));
    }

    fn is_stopped(&self) -> bool {
        STOPPED.load(Relaxed)
    }

    fn streams(&self) -> bool {
        STREAM.load(Relaxed)
    }

    fn tell(&mut self, event: Event) {
        if HEARD.load(Relaxed) {
            outbox::tell(event);
        }
    }
}

#[embassy_executor::task]
pub(crate) async fn hand(
    flash: board::Storage,
    handle: board::Handle,
    go: board::Go,
    motion: board::Motion,
    words: Consumer<'static, Word>,
    booted: (Reset, Option<Text>),
) {
    static PLAN: StaticCell<Plan> = StaticCell::new();
    let plan: &'static Plan = PLAN.init_with(|| Plan::with(KERNELS));
    let buzzer = SimplePwm::new(
        handle.tones,
        None,
        None,
        None,
        Some(PwmPin::new(handle.buzzer, OutputType::PushPull)),
        Hertz(2000),
        CountingMode::EdgeAlignedUp,
    );
    finger::found().await;
    let (reset, last_words) = booted;
    outbox::booted(reset, last_words);
    // textures of a simulated world under a simulated hand; the user trains a real probe
    let table = factory::handheld(finger::name());
    let failed = reading::failed(reset);
    let store = flash::wait(flash::open(flash, failed), progress).await;
    let mut events = EventSink::new(go, true);
    let mut memory = Memory::new(store, MappedTable, table, flash::buffer());
    flash::reload(&mut memory, failed, &mut events).await;
    let textures = memory.table().map_or(0, |table| table.textures());
    let mut handheld = Handheld::new(plan, textures);
    if let Some(why) = memory.trouble() {
        handheld.memory_failed(jobs::words(why));
    }
    let mut awake = Awake::default();
    awake.was(None);
    let parts = Parts {
        words,
        button: Input::new(handle.button, Pull::Down),
        buzzer,
        ticker: Ticker::every(Duration::from_hz(TICKS_HZ.into())),
        awake,
        listens: false,
        same: false,
        ticks: 0,
        motion: Paa5100je::new(MotionBus::new(motion)),
        motion_fails: false,
    };
    let mut probe = Probe {
        rig: ByHand::new(parts, handheld, unmeasured(finger::name())),
        memory,
        events,
        plan,
    };
    if let Ok(store) = probe.memory.store()
        && let Err(why) = probe::restore(store, &mut probe.rig).await
    {
        probe.events.tell(Event::Trouble(why.into()));
    }
    let mut said = 0;
    loop {
        by_hand::step(&mut probe, log).await;
        if let Ok(request) = JOBS.try_receive() {
            STOPPED.store(false, Relaxed);
            BUSY.store(true, Relaxed);
            probe.memory.at(Instant::now().as_millis() as u32);
            by_hand::serve(&mut probe, &request).await;
            BUSY.store(false, Relaxed);
        }
        let parts = &probe.rig.hand;
        // the log is written with interrupts off, which may cost a slide a sensor slot
        if parts.ticks.wrapping_sub(said) >= SAY && !probe.rig.handheld.is_touched() {
            parts.awake.say();
            said = parts.ticks;
        }
    }
}

fn log(outcome: Outcome<'_>) {
    match outcome {
        Outcome::Judged {
            slides,
            leading: (name, p),
            judgement,
        } => defmt::info!(
            "slides {=usize}: {=str} {=f32}, sure {=bool}, unknown {=bool}",
            slides,
            name,
            p,
            judgement.sure,
            judgement.unknown
        ),
        Outcome::Learned(name) => defmt::info!("learned {=str}", name.as_str()),
        Outcome::NotLearned(why) => defmt::error!("not learned: {=str}", why),
    }
}
