//! The handheld in a hand: states, button, buzzer and table; and how long the core sleeps between them.
use core::sync::atomic::AtomicU32;
use core::sync::atomic::Ordering::Relaxed;

use embassy_stm32::gpio::{Input, OutputType, Pull};
use embassy_stm32::peripherals;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_time::{Duration, Instant, Ticker, Timer, with_timeout};
use heapless::spsc::Consumer;
use static_cell::{ConstStaticCell, StaticCell};
use tactus_core::dsp::{Plain, Plan};
use tactus_core::handheld::jobs::{Outcome, work};
use tactus_core::handheld::{About, Handheld, Picture, Screen, TICKS_HZ, draw};
use tactus_core::probe::seams::Events;
use tactus_core::probe::{Memory, TableInUse};
use tactus_core::store::StoreError;
use tactus_core::wire::{Event, text};

use super::acquire::{self, Word};
use super::display;
use crate::board;
use crate::chip::flash::{self, Bank2, MappedTable};
use crate::chip::rescue;

/// The table that comes with the handheld: textures of a simulated world under a simulated hand. Its
/// whitening says how slides of one texture by hand differ; the user trains a real probe.
static FACTORY: &[u8] = include_bytes!("../../handheld.tact");
/// The store is open by now, or will never be.
const OPENING: Duration = Duration::from_secs(10);
/// Ticks from one picture to the next: 20 a second.
const PICTURE: u32 = TICKS_HZ / 20;
/// Ticks from one word in the log about sleep to the next.
const SAY: u32 = 5 * TICKS_HZ;
/// `hand` gets on at least this often; the longest that it does is to erase two sectors, ms.
const PATIENCE_MS: u32 = 5000;

/// How long the core has slept, us.
static ASLEEP_US: AtomicU32 = AtomicU32::new(0);
/// When `hand` got on last, ms.
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

/// Feeds the watchdog as long as `hand` gets on.
#[embassy_executor::task]
pub(crate) async fn watch() {
    let mut ticker = Ticker::every(Duration::from_millis(100));
    loop {
        ticker.next().await;
        let now = Instant::now().as_millis() as u32;
        if now.wrapping_sub(PROGRESS_MS.load(Relaxed)) < PATIENCE_MS {
            rescue::pet();
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
            acquire::LATE.load(Relaxed),
            acquire::LOST.load(Relaxed)
        );
    }
}

type Buzzer = SimplePwm<'static, peripherals::TIM8>;

/// Sounds a tone, or none.
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

#[embassy_executor::task]
pub(crate) async fn hand(
    flash: board::Storage,
    handle: board::Handle,
    mut words: Consumer<'static, Word>,
) {
    static PLAN: StaticCell<Plan> = StaticCell::new();
    static BUFFER: ConstStaticCell<[u8; 16 * 1024]> = ConstStaticCell::new([0; 16 * 1024]);
    let plan: &'static Plan = PLAN.init_with(Plan::new);
    let button = Input::new(handle.button, Pull::Down);
    let mut buzzer = SimplePwm::new(
        handle.tones,
        None,
        None,
        None,
        Some(PwmPin::new(handle.buzzer, OutputType::PushPull)),
        Hertz(2000),
        CountingMode::EdgeAlignedUp,
    );
    let store = with_timeout(OPENING, flash::open(flash)).await;
    let store = store.unwrap_or(Err(StoreError::Silent));
    let mut memory = Memory::new(store, MappedTable, FACTORY, BUFFER.take());
    memory.reload(&mut Logged).await;
    let textures = memory.table().map_or(0, |table| table.textures());
    let mut probe = Handheld::<Plain>::new(plan, textures);
    if let Err(why) = memory.table() {
        probe.memory_failed(text(why));
    }
    let mut awake = Awake::default();
    awake.was(None);
    let (mut listens, mut same, mut tone, mut tick, mut say) = (true, false, None, 0u32, 0);
    let mut ticker = Ticker::every(Duration::from_hz(TICKS_HZ.into()));
    acquire::listen(true);
    loop {
        ticker.next().await;
        PROGRESS_MS.store(Instant::now().as_millis() as u32, Relaxed);
        tick = tick.wrapping_add(1);
        while let Some(word) = words.dequeue() {
            probe.word(word);
        }
        probe.tick(button.is_high());
        if probe.tone() != tone {
            tone = probe.tone();
            sound(&mut buzzer, tone);
        }
        let job = probe.job();
        if (job.is_some() || tick.is_multiple_of(PICTURE)) && probe.is_new() {
            show(&probe, &memory, &awake);
        }
        if let Some(job) = job {
            // nobody takes words meanwhile: they are not asked for, and what comes next does not follow what came
            acquire::listen(false);
            while let Some(word) = words.dequeue() {
                probe.word(word);
            }
            probe.lose(1);
            // the picture goes out meanwhile
            Timer::after_millis(1).await;
            work(job, &mut probe, &mut memory, &mut Logged, log).await;
            ticker.reset();
            same = false;
            listens = probe.listens();
            acquire::listen(listens);
        }
        if probe.listens() != listens {
            listens = probe.listens();
            same = false;
            acquire::listen(listens);
        }
        if tick.is_multiple_of(TICKS_HZ) {
            awake.was(same.then_some(listens));
            same = true;
        }
        say += 1;
        // the log is written with interrupts off, which may cost a slide a sensor slot
        if say >= SAY && !probe.is_touched() {
            awake.say();
            say = 0;
        }
    }
}

/// Draws what the probe shows.
fn show(probe: &Handheld<'_, Plain>, memory: &Knowledge, awake: &Awake) {
    // reading a table means checking it, which takes milliseconds
    let table = if probe.names_textures() {
        memory.table().ok()
    } else {
        None
    };
    let about = About {
        version: env!("CARGO_PKG_VERSION"),
        awake: awake.listening.get(),
        awake_at_rest: awake.resting.get(),
        late: acquire::LATE.load(Relaxed),
        lost: acquire::LOST.load(Relaxed),
    };
    let screen = probe.screen(table.as_ref(), &about);
    if matches!(screen, Screen::Dark) {
        return display::picture(None);
    }
    let mut picture = Picture::new();
    let Ok(()) = draw(&screen, &mut picture);
    display::picture(Some(&picture));
}

type Knowledge = Memory<'static, Bank2, MappedTable>;

/// There is no host to tell: what goes wrong goes to the log.
struct Logged;

impl Events for Logged {
    fn tell(&mut self, event: Event) {
        if let Event::Trouble(why) = event {
            defmt::error!("{=str}", text(why).as_str());
        }
    }

    fn table(&mut self, _: TableInUse) {}
}

/// Logs what came of a job.
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
        Outcome::NotLearned(why) => defmt::error!("not learned: {=str}", why.as_str()),
    }
}
