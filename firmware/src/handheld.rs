//! The handheld probe. Who runs where, and who tells whom what:
//!
//! | executor | task | does | tells |
//! |---|---|---|---|
//! | UART4's interrupt, woken by TIM2's | `acquire` | a sensor word every 227 us, while they are wanted | words to `hand` |
//! | UART7's interrupt, woken by the clock's | `hand` | states, button, buzzer, table; owns the store | pictures to `show` |
//! | UART7's interrupt | `show` | the display, by I2C1 and its DMA | |
//! | UART7's interrupt | `watch` | the watchdog, as long as `hand` gets on | |
//! | thread mode | | sleeps, and counts for how long | `hand` |
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use embassy_executor::InterruptExecutor;
use embassy_stm32::gpio::{Input, OutputType, Pull};
use embassy_stm32::interrupt::{self as irq, InterruptExt as _, Priority};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_stm32::{interrupt, peripherals};
use embassy_time::{Duration, Instant, Ticker, Timer, with_timeout};
use heapless::spsc::{Consumer, Queue};
use static_cell::{ConstStaticCell, StaticCell};
use tactus_core::features::Plan;
use tactus_core::handheld::picture::Picture;
use tactus_core::handheld::screens::{About, Screen, draw};
use tactus_core::handheld::{Choice, Handheld, Job, TICKS_HZ, free_name, judge};
use tactus_core::kernels::Plain;
use tactus_core::session::text;
use tactus_core::table::Table;
use tactus_core::teaching;
use tactus_core::wire::{Name, Text};

use crate::acquire::{self, WORDS, Word};
use crate::memory::{self, Memory};
use crate::rig::ACQUIRE;
use crate::{board, display, rescue};

/// The table that comes with the handheld: textures of a simulated world under a simulated hand. It tells how the slides
/// of a hand differ; a real probe is taught.
static FACTORY: &[u8] = include_bytes!("../handheld.tact");
/// The store is open by now, or will never be.
const OPENING: Duration = Duration::from_secs(10);
/// Ticks from one picture to the next: 20 a second.
const PICTURE: u32 = TICKS_HZ / 20;
/// Ticks from one word in the log about sleep to the next.
const SAY: u32 = 5 * TICKS_HZ;
/// `hand` gets on at least this often; the longest that it does is to erase two sectors, ms.
const PATIENCE_MS: u32 = 5000;

static HAND: InterruptExecutor = InterruptExecutor::new();
/// How long the core has slept, us.
static ASLEEP_US: AtomicU32 = AtomicU32::new(0);
/// When `hand` got on last, ms.
static PROGRESS_MS: AtomicU32 = AtomicU32::new(0);

#[interrupt]
fn UART7() {
    // SAFETY: called from here only, and started before the interrupt is on.
    unsafe { HAND.on_interrupt() }
}

/// Starts everything, and sleeps whenever nothing is to be done. To be called once, from thread mode.
pub fn handheld() -> ! {
    static WORD_QUEUE: ConstStaticCell<Queue<Word, WORDS>> = ConstStaticCell::new(Queue::new());
    let (_, last_words) = rescue::reset_cause();
    rescue::watch_start();
    let r = board::start();
    defmt::info!("tactus-handheld {=str}", env!("CARGO_PKG_VERSION"));
    if let Some(words) = last_words {
        defmt::error!("before the reset: {=str}", words.as_str());
    }
    let (words_in, words_out) = WORD_QUEUE.take().split();
    irq::I2C1_EV.set_priority(Priority::P6);
    irq::I2C1_ER.set_priority(Priority::P6);
    irq::DMA1_STREAM0.set_priority(Priority::P6);
    irq::DMA1_STREAM6.set_priority(Priority::P6);
    irq::UART7.set_priority(Priority::P7);
    let hands = HAND.start(interrupt::UART7);
    // until `hand` can take them
    acquire::listen(false);
    let slots = ACQUIRE.start(interrupt::UART4);
    match acquire::acquire(r.acquire, words_in) {
        Ok(task) => slots.spawn(task),
        Err(_) => defmt::error!("no acquisition"),
    }
    match (
        hand(r.store, r.handle, words_out),
        display::show(r.display),
        watch(),
    ) {
        (Ok(hand), Ok(show), Ok(watch)) => {
            hands.spawn(hand);
            hands.spawn(show);
            hands.spawn(watch);
        }
        _ => defmt::error!("a task was spawned twice"),
    }
    sleep()
}

/// Sleeps for ever but for interrupts, and counts the time. With interrupts held off, the first one ends the sleep but
/// runs only after the time was taken: nothing that is done is counted as sleep.
fn sleep() -> ! {
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
async fn watch() {
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
async fn hand(flash: board::Storage, handle: board::Handle, mut words: Consumer<'static, Word>) {
    static PLAN: StaticCell<Plan> = StaticCell::new();
    static ROOM: ConstStaticCell<[u8; 16 * 1024]> = ConstStaticCell::new([0; 16 * 1024]);
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
    let store = with_timeout(OPENING, memory::open(flash)).await;
    let mut memory = Memory::new(store.unwrap_or(None), FACTORY, ROOM.take(), |_| ());
    memory.reload().await;
    let textures = Table::read(memory.in_force()).map_or(0, |table| table.textures());
    let mut probe = Handheld::<Plain>::new(plan, textures);
    if let Err(why) = Table::read(memory.in_force()) {
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
            work(job, &mut probe, &mut memory).await;
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
fn show(probe: &Handheld<'_, Plain>, memory: &Memory, awake: &Awake) {
    // reading a table means checking it, which takes milliseconds
    let table = if probe.names_textures() {
        Table::read(memory.in_force()).ok()
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

/// Does what the probe wants to be done with the table.
async fn work(job: Job, probe: &mut Handheld<'_, Plain>, memory: &mut Memory) {
    match job {
        Job::Judge(slides) => {
            let table = match Table::read(memory.in_force()) {
                Ok(table) => table,
                Err(why) => return probe.memory_failed(text(why)),
            };
            let judged = judge::<Plain>(table, &slides).map(|(judgement, visited)| {
                if let Some((texture, p)) = judgement.leading.first() {
                    defmt::info!(
                        "{=usize} slides: {=str} {=f32}, sure {=bool}, unknown {=bool}",
                        slides.len(),
                        table.name(*texture).unwrap_or_default(),
                        *p,
                        judgement.sure,
                        judgement.unknown
                    );
                }
                (judgement, visited)
            });
            match judged {
                Ok((judgement, visited)) => {
                    memory.visited = Some(visited);
                    probe.judged(Ok(judgement));
                }
                Err(why) => probe.judged(Err(why)),
            }
        }
        Job::Teach(choice) => {
            let taught = teach(choice, memory).await;
            memory.reload().await;
            match &taught {
                Ok(name) => defmt::info!("learned {=str}", name.as_str()),
                Err(why) => defmt::error!("not learned: {=str}", why.as_str()),
            }
            let textures = Table::read(memory.in_force()).map_or(0, |table| table.textures());
            probe.taught(taught, textures);
        }
    }
}

/// Learns the visit that was judged last.
async fn teach(choice: Choice, memory: &mut Memory) -> Result<Name, Text> {
    let table = Table::read(memory.in_force()).map_err(text)?;
    let name = match choice {
        Choice::Known(texture) => {
            Name::try_from(table.name(texture).unwrap_or_default()).unwrap_or_default()
        }
        Choice::Numbered => free_name(&table),
        Choice::Spelled(name) => name,
    };
    let visited = memory
        .visited
        .take()
        .ok_or_else(|| text("nothing was felt: slide first"))?;
    let (store, base, room) = memory.to_learn()?;
    teaching::answer(&visited, &name, &base, store, room).await?;
    Ok(name)
}
