//! The self-test of a board and its rig: each part in turn, with what was measured and what to do about it, over defmt.
//!
//! Motors move only after all switches were seen closed, and no further than a bound; nothing here needs the finger, which
//! must be off. The watchdog comes last: it starts the chip again, and the next start says whether it did.
use core::fmt::Display;
use core::mem::MaybeUninit;
use core::ptr::addr_of_mut;
use core::sync::atomic::Ordering::Relaxed;

use cortex_m::peripheral::DWT;
use defmt::Display2Format;
use embassy_stm32::Peri;
use embassy_stm32::adc::{Adc, SampleTime};
use embassy_stm32::flash::Flash;
use embassy_stm32::gpio::{AnyPin, Input, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::mode::Blocking;
use embassy_stm32::pac::gpio::vals::Idr;
use embassy_stm32::pac::rcc::vals::Sw;
use embassy_stm32::pac::{GPIOA, RCC};
use embassy_stm32::spi::mode::Master;
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::qei::Qei;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Instant, Timer, block_for};
use tactus_core::rig::lever::{APPROACH_STEPS_S, MAX_STEPS, RETRACT_STEPS_S};
use tactus_core::rig::stage::StageConstants;
use tactus_core::sensor::biotac::{BioTac, Diagnosis, IdentityBytes, WordStats};
use tactus_core::sensor::pressure::Channel;
use tactus_core::sensor::{Exchange, PressureSensor as _};
use tactus_core::store::Store;
use tactus_core::wire::Reset;

use crate::board;
use crate::chip::lever::Lever;
use crate::chip::rescue;

const CORE_HZ: u32 = 168_000_000;
const SLOTS_PER_S: u64 = 4400;
/// A slot that begins later than this leaves the sensor less than its 50 us before the next one.
const LATE_US: u64 = 100;
/// P_AC of a BioTac that nobody touches. Less is a dead converter, more is a bad ground.
const PAC_NOISE_COUNTS: core::ops::RangeInclusive<f32> = 1.0..=8.0;
/// P_DC of a finger filled as it should be, in air.
const PDC_COUNTS: core::ops::RangeInclusive<f32> = 2000.0..=3200.0;
/// The current amplifier's zero is half of the reference, 2048; this is far beyond what its resistors can do.
const ZERO_COUNTS: f32 = 60.0;
/// 13 mA; the slowest slide draws 40.
const CURRENT_NOISE_COUNTS: f32 = 16.0;
/// 2 mm of the lever.
const LEVER_STEPS: i32 = 3200;
/// 0.1 mm: how far from where it opened the lever's switch may close.
const LEVER_PLAY: i32 = 160;
/// About 36 mm/s: enough to overcome friction, slow enough to stop by hand.
const STAGE_DUTY: f32 = 0.08;
const STAGE_MM: f32 = 1.0;
/// At that duty no more than 10 mm, should the encoder be silent.
const STAGE_MS: u32 = 250;
const WATCHDOG_US: u32 = 100_000;

/// What survives the reset by the watchdog; RAM that the start-up code leaves alone.
#[derive(Clone, Copy)]
struct Kept {
    /// [`Kept::HANGS`] while the watchdog is waited for.
    magic: u32,
    passed: u32,
    failed: u32,
}

impl Kept {
    const HANGS: u32 = 0x7ac7_d061;
}

#[unsafe(link_section = ".uninit.SELFTEST")]
static mut KEPT: MaybeUninit<Kept> = MaybeUninit::uninit();

/// Swaps what is kept; the test is one task, and no interrupt comes here.
fn keep(kept: Kept) -> Kept {
    // SAFETY: as above; every bit pattern is a value.
    unsafe {
        let at = addr_of_mut!(KEPT).cast::<Kept>();
        let before = at.read_volatile();
        at.write_volatile(kept);
        before
    }
}

/// How the checks went so far.
#[derive(Default)]
struct Account {
    passed: u32,
    failed: u32,
}

impl Account {
    fn check(&mut self, good: bool, name: &str, measured: impl Display, remedy: &str) -> bool {
        let measured = Display2Format(&measured);
        if good {
            self.passed += 1;
            defmt::info!("PASS {=str}: {}", name, measured);
        } else {
            self.failed += 1;
            defmt::error!("FAIL {=str}: {}. {=str}", name, measured, remedy);
        }
        good
    }

    fn leave_out(&mut self, name: &str, why: &str) {
        self.failed += 1;
        defmt::error!("FAIL {=str}: not tested, {=str}", name, why);
    }
}

/// Tests the board and ends with the green or the red LED. To be called once, from thread mode.
pub async fn selftest() {
    let (reset, last_words) = rescue::reset_cause();
    let kept = keep(Kept {
        magic: 0,
        passed: 0,
        failed: 0,
    });
    let r = board::start();
    let mut green = Output::new(r.leds.green, Level::Low, Speed::Low);
    let mut blue = Output::new(r.leds.blue, Level::Low, Speed::Low);
    let mut red = Output::new(r.leds.red, Level::Low, Speed::Low);
    let mut account = Account::default();

    if kept.magic == Kept::HANGS {
        account = Account {
            passed: kept.passed,
            failed: kept.failed,
        };
        account.check(
            reset == Reset::Watchdog,
            "watchdog",
            format_args!("started again by {reset:?}"),
            "Something else ended the hang: leave the reset button alone and run the test again",
        );
    } else {
        defmt::info!("tactus-selftest {=str}", env!("CARGO_PKG_VERSION"));
        let well = match &last_words {
            Some(words) => account.check(
                false,
                "reset",
                format_args!("{reset:?}, last words: {}", words.as_str()),
                "The firmware gave up before: report this line. Motors stay off; run the test again for them",
            ),
            None => account.check(
                matches!(reset, Reset::Power | Reset::Pin | Reset::Software),
                "reset",
                format_args!("{reset:?}"),
                "Check the supply, power off and on, run the test again",
            ),
        };
        chip(&mut account);
        sensor(r.acquire, &mut account).await;
        rig(r.lever, r.stage, r.switches, well, &mut blue, &mut account).await;
        store(r.store, &mut account).await;
        watchdog(r.watchdog, &mut account).await;
    }
    if account.failed == 0 {
        green.set_high();
        defmt::info!("SELF-TEST PASSED: {=u32} checks", account.passed);
    } else {
        red.set_high();
        defmt::error!(
            "SELF-TEST FAILED: {=u32} passed, {=u32} failed",
            account.passed,
            account.failed
        );
    }
    // the LEDs keep their levels while they are not dropped
    core::future::pending().await
}

/// Clocks, and the pin that bank 2 of the flash depends on.
fn chip(account: &mut Account) {
    // SAFETY: the cycle counter is nobody else's.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    let began = DWT::cycle_count();
    block_for(Duration::from_millis(10));
    let khz = DWT::cycle_count().wrapping_sub(began) / 10;
    let (control, switch) = (RCC.cr().read(), RCC.cfgr().read().sws());
    let locked = control.hserdy() && control.pllrdy() && switch == Sw::PLL1_P;
    account.check(
        locked && khz.abs_diff(CORE_HZ / 1000) <= CORE_HZ / 100_000,
        "clock",
        format_args!(
            "{khz} kHz; HSE {}, PLL {}",
            ready(control.hserdy()),
            ready(control.pllrdy())
        ),
        "The 8 MHz come from the debug probe on the board: leave it on, and the solder bridges of OSC_IN as delivered (UM1974)",
    );
    account.check(
        GPIOA.idr().read().idr(12) == Idr::LOW,
        "PA12",
        if GPIOA.idr().read().idr(12) == Idr::LOW {
            "low"
        } else {
            "high"
        },
        "PA12 must be low while bank 2 of the flash is used: take the plug out of the USB user connector CN13",
    );
}

fn ready(is: bool) -> &'static str {
    if is { "ready" } else { "not ready" }
}

/// The bus of the sensor, used directly.
struct Sensor {
    spi: Spi<'static, Blocking, Master>,
    select: Output<'static>,
}

impl Sensor {
    fn exchange<R: AsMut<[u8]>>(&mut self, mut exchange: Exchange<R>) -> R {
        // the bus itself cannot fail: no mode fault with software select, no overrun with blocking transfers
        if let Some(command) = &exchange.command {
            self.select.set_low();
            let _ = self.spi.blocking_write(command);
            self.select.set_high();
            wait_us(exchange.gap_us);
        }
        self.select.set_low();
        let _ = self.spi.blocking_transfer_in_place(exchange.read.as_mut());
        self.select.set_high();
        wait_us(exchange.rest_us);
        exchange.read
    }
}

/// At least so long.
fn wait_us(us: u32) {
    cortex_m::asm::delay(us * (CORE_HZ / 1_000_000));
}

/// Mean and standard deviation of counts.
#[derive(Default)]
struct Spread {
    number: f32,
    sum: f32,
    squares: f32,
    /// sums are about the first value, so that they stay small
    first: f32,
}

impl Spread {
    fn add(&mut self, counts: u16) {
        let counts = f32::from(counts);
        if self.number == 0.0 {
            self.first = counts;
        }
        let off = counts - self.first;
        self.number += 1.0;
        self.sum += off;
        self.squares += off * off;
    }

    fn mean(&self) -> f32 {
        self.first + self.sum / self.number.max(1.0)
    }

    fn rms(&self) -> f32 {
        let mean = self.sum / self.number.max(1.0);
        libm::sqrtf((self.squares / self.number.max(1.0) - mean * mean).max(0.0))
    }
}

async fn sensor(pins: board::Acquire, account: &mut Account) {
    let mut config = spi::Config::default();
    config.frequency = Hertz(5_250_000);
    config.miso_pull = Pull::Up;
    let mut sensor = Sensor {
        spi: Spi::new_blocking(pins.spi, pins.sck, pins.mosi, pins.miso, config),
        select: Output::new(pins.select, Level::High, Speed::VeryHigh),
    };
    Timer::after_millis(BioTac::POWER_UP_MS.into()).await;
    let mut bytes = IdentityBytes::default();
    for exchange in bytes.exchanges() {
        sensor.exchange(exchange);
    }
    match bytes.decode() {
        Ok(id) => account.check(
            true,
            "sensor identity",
            format_args!("{}, firmware {}, flex {}", id.serial, id.firmware, id.flex),
            "",
        ),
        Err(why) => account.check(
            false,
            "sensor identity",
            why,
            "SCK PA5, MISO PA6, MOSI PB5, CS PD14, 3.3 V and ground",
        ),
    };

    let mut stats = WordStats::default();
    let (mut pac, mut pdc) = (Spread::default(), Spread::default());
    let mut late: u32 = 0;
    let began = Instant::now();
    for slot in 0..SLOTS_PER_S {
        let due = began + Duration::from_micros(slot * 1_000_000 / SLOTS_PER_S);
        Timer::at(due).await;
        if Instant::now().saturating_duration_since(due).as_micros() > LATE_US {
            late += 1;
        }
        let channel = if slot % 2 == 0 {
            Channel::Pac
        } else {
            Channel::Pdc
        };
        let word = BioTac::decode(channel, sensor.exchange(BioTac::exchange(channel)));
        stats.count(&word);
        if let Ok(pressure) = word {
            match channel {
                Channel::Pac => pac.add(pressure.counts.get()),
                Channel::Pdc => pdc.add(pressure.counts.get()),
            }
        }
    }
    let diagnosis = stats.diagnosis();
    account.check(
        diagnosis == Diagnosis::Good && late == 0,
        "sensor words",
        format_args!(
            "{} words, {} garbled, {} error frames, {} silent, {late} late: {diagnosis}",
            stats.words,
            stats.parity + stats.padding,
            stats.error_frames,
            stats.no_sensor
        ),
        "Shorten the cable and check the pins named above",
    );
    account.check(
        PAC_NOISE_COUNTS.contains(&pac.rms()),
        "P_AC noise",
        format_args!("{:.2} counts rms", pac.rms()),
        "1 to 8 are right. Less: the sensor does not convert. More: is the finger touched? Check its ground",
    );
    account.check(
        PDC_COUNTS.contains(&pdc.mean()),
        "P_DC",
        format_args!("{:.0} counts", pdc.mean()),
        "2000 to 3200 are right without contact. Refill the finger as its manual says; keep off anything that presses it",
    );
}

struct Switches {
    lever_top: Input<'static>,
    stage_left: Input<'static>,
    stage_right: Input<'static>,
    e_stop: Input<'static>,
}

/// Current amplifier, switches, lever and stage; motors only if all is `well` so far.
async fn rig(
    lever: board::Lever,
    stage: board::Stage,
    switches: board::Switches,
    well: bool,
    blue: &mut Output<'static>,
    account: &mut Account,
) {
    let switch = |pin: Peri<'static, AnyPin>| Input::new(pin, Pull::Up);
    let switches = Switches {
        lever_top: switch(switches.lever_top.into()),
        stage_left: switch(switches.stage_left.into()),
        stage_right: switch(switches.stage_right.into()),
        e_stop: switch(switches.e_stop.into()),
    };
    let mut lever = Lever::new(lever);
    let mut pwm = SimplePwm::new(
        stage.timer,
        Some(PwmPin::new(stage.pwm, OutputType::PushPull)),
        None,
        None,
        None,
        Hertz::khz(20),
        Default::default(),
    );
    let mut pwm = pwm.ch1();
    pwm.set_duty_cycle_fully_off();
    pwm.enable();
    let full = pwm.max_duty_cycle();
    let mut bridge = Output::new(stage.enable, Level::Low, Speed::Low);
    let mut right = Output::new(stage.direction, Level::Low, Speed::Low);
    let encoder = Qei::new(
        stage.encoder,
        stage.encoder_a,
        stage.encoder_b,
        Default::default(),
    );
    let mut adc = Adc::new(stage.adc);
    let mut current_pin = stage.current;

    let mut current = Spread::default();
    for _ in 0..1000 {
        current.add(adc.blocking_read(&mut current_pin, SampleTime::CYCLES56));
        wait_us(20);
    }
    account.check(
        (current.mean() - 2048.0).abs() <= ZERO_COUNTS && current.rms() <= CURRENT_NOISE_COUNTS,
        "motor current at rest",
        format_args!("{:.0} counts, noise {:.1} rms", current.mean(), current.rms()),
        "2048 +- 60 and below 16 rms are right. The amplifier's output belongs to PA3, its reference to half of 3.3 V",
    );

    let mut closed = true;
    for (name, input) in [
        ("left switch PF14", &switches.stage_left),
        ("right switch PF15", &switches.stage_right),
        ("emergency stop PF13", &switches.e_stop),
    ] {
        closed &= account.check(
            input.is_low(),
            name,
            level(input),
            "Push the stage to its middle, release the emergency stop; if it stays so its wire is broken",
        );
    }
    // pressed is no fault here: the lever's own check tells it from a broken wire
    let top = level(&switches.lever_top);
    account.check(true, "lever switch PF12", top, "");

    if !(closed && well) {
        let why = if well {
            "since a switch is open"
        } else {
            "after this reset"
        };
        account.leave_out("lever", why);
        account.leave_out("stage", why);
        return;
    }
    defmt::warn!("THE MOTORS MOVE IN 3 s: the finger must be off, hands away");
    for _ in 0..15 {
        blue.set_high();
        Timer::after_millis(100).await;
        blue.set_low();
        Timer::after_millis(100).await;
    }
    blue.set_high();
    // should the firmware give up now, the rescue can drive both
    rescue::ARMED.store(true, Relaxed);

    let lifted = match test_lever(&mut lever, &switches).await {
        Ok((up, play)) => account.check(
            true,
            "lever",
            format_args!("{up} steps up to its switch, 2 mm down and up again within {play} steps"),
            "",
        ),
        Err(why) => account.check(
            false,
            "lever",
            why,
            "STEP PE9, DIR PE11 (high is down), EN PE13, switch PF12, 16 microsteps, the driver's supply",
        ),
    };
    lever.drive(false, 0);
    if !lifted {
        rescue::ARMED.store(false, Relaxed);
        blue.set_low();
        account.leave_out("stage", "since the lever may be down");
        return;
    }

    let mut drive = |duty: f32| {
        right.set_level((duty > 0.0).into());
        pwm.set_duty_cycle((libm::fabsf(duty) * full as f32) as u32);
    };
    bridge.set_high();
    let mut count: i32 = 0;
    let mut position_mm = || {
        count += i32::from(encoder.count().wrapping_sub(count as u16) as i16);
        count as f32 * StageConstants::REFERENCE.mm_per_count
    };
    position_mm();
    let there = move_stage(STAGE_DUTY, &mut drive, &mut position_mm, &switches).await;
    let moved = match there {
        Ok(right_mm) => move_stage(-STAGE_DUTY, &mut drive, &mut position_mm, &switches)
            .await
            .map(|left_mm| (right_mm, left_mm)),
        Err(why) => Err(why),
    };
    bridge.set_low();
    match moved {
        Ok((right_mm, left_mm)) => account.check(
            true,
            "stage",
            format_args!("{right_mm:.2} mm to the right, {:.2} mm back", -left_mm),
            "",
        ),
        Err(why) => account.check(
            false,
            "stage",
            why,
            "PWM PC6, DIR PC7 (high is right), EN PC8, encoder PD12 and PD13, the bridge's supply",
        ),
    };
    rescue::ARMED.store(false, Relaxed);
    blue.set_low();
}

fn level(input: &Input<'_>) -> &'static str {
    if input.is_low() { "closed" } else { "open" }
}

/// Drives the lever until its switch is as wanted, three times in a row; the steps made.
async fn drive_lever(
    lever: &mut Lever,
    switches: &Switches,
    rate: i32,
    most: i32,
    until_open: Option<bool>,
) -> Result<i32, &'static str> {
    let from = lever.steps();
    let mut seen = 0;
    lever.drive(true, rate);
    let done = loop {
        Timer::after_millis(1).await;
        let made = (lever.steps() - from).abs();
        seen = match until_open {
            Some(open) if switches.lever_top.is_high() == open => seen + 1,
            _ => 0,
        };
        if switches.e_stop.is_high() {
            break Err("emergency stop");
        }
        if seen >= 3 {
            break Ok(made);
        }
        if made >= most {
            break if until_open.is_some() {
                Err(
                    "the switch at its top stays closed on the way up: it does not move, or moves down",
                )
            } else {
                Ok(made)
            };
        }
    };
    lever.drive(true, 0);
    // the step that is under way
    Timer::after_millis(2).await;
    done
}

/// Up to the switch, 2 mm down and up again: steps to the switch, and the difference between the ways.
async fn test_lever(lever: &mut Lever, switches: &Switches) -> Result<(i32, i32), &'static str> {
    // the drivers want a while with current before they step
    lever.drive(true, 0);
    Timer::after_millis(10).await;
    let most = MAX_STEPS * 5 / 4;
    let up = drive_lever(lever, switches, RETRACT_STEPS_S, most, Some(true)).await?;
    let down = 2 * APPROACH_STEPS_S;
    drive_lever(lever, switches, down, LEVER_STEPS, None).await?;
    if switches.lever_top.is_high() {
        return Err(
            "the switch at its top stays open 2 mm below: its wire is broken, or the lever does not move",
        );
    }
    let most = LEVER_STEPS + LEVER_PLAY;
    let back = drive_lever(lever, switches, -down, most, Some(true)).await?;
    let play = (back - LEVER_STEPS).abs();
    if play > LEVER_PLAY {
        return Err("it came back to its switch too early: it loses steps on the way down");
    }
    Ok((up, play))
}

/// Moves the stage by at least [`STAGE_MM`] and brakes it; how far it went, mm, to the right positive.
async fn move_stage(
    duty: f32,
    drive: &mut impl FnMut(f32),
    position_mm: &mut impl FnMut() -> f32,
    switches: &Switches,
) -> Result<f32, &'static str> {
    let from_mm = position_mm();
    let direction = duty.signum();
    drive(duty);
    let mut ms = 0;
    let done = loop {
        Timer::after_millis(1).await;
        ms += 1;
        let moved_mm = (position_mm() - from_mm) * direction;
        let limit = if duty > 0.0 {
            &switches.stage_right
        } else {
            &switches.stage_left
        };
        if switches.e_stop.is_high() {
            break Err("emergency stop");
        }
        if limit.is_high() {
            break Err("it ran into a limit switch: push it to its middle and run the test again");
        }
        if moved_mm > STAGE_MM {
            break Ok(());
        }
        if moved_mm < -STAGE_MM / 2.0 {
            break Err(
                "the encoder counts backwards: swap its lines A and B, or the motor's wires",
            );
        }
        if ms >= STAGE_MS {
            break Err(
                "the encoder does not count: a line of it is cut, or the stage does not move",
            );
        }
    };
    // without duty the bridge shorts the motor
    drive(0.0);
    Timer::after_millis(200).await;
    let moved_mm = position_mm() - from_mm;
    done.map(|()| moved_mm)
}

/// Writes the skin's record as it is and reads it again: nothing else is changed, and nothing at all where it is not read.
async fn store(flash: board::Storage, account: &mut Account) {
    let flash = Flash::new(flash.flash, board::Irqs)
        .into_regions()
        .bank2_region1;
    const REMEDY: &str = "Nothing was erased. Report this line; the rig works without a store but forgets at power-off";
    let mut store = match Store::open(flash).await {
        Ok(store) => store,
        Err(why) => {
            account.check(false, "store", why, REMEDY);
            return;
        }
    };
    let before = match store.skin().await {
        Ok(skin) => skin,
        Err(why) => {
            account.check(false, "store", why, REMEDY);
            return;
        }
    };
    let written = store.set_skin(&before).await;
    match (written, store.skin().await) {
        (Ok(()), Ok(after)) => account.check(
            (after.energy_j(), after.wear_j()) == (before.energy_j(), before.wear_j()),
            "store",
            format_args!(
                "the skin's record, {:.1} J, is {:.1} J after writing it; {} table",
                before.energy_j(),
                after.energy_j(),
                if store.table().is_some() { "a" } else { "no" }
            ),
            REMEDY,
        ),
        (Err(why), _) | (_, Err(why)) => account.check(false, "store", why, REMEDY),
    };
}

/// Hangs until the watchdog starts the chip again; comes back only if it does not.
async fn watchdog(watchdog: board::Watchdog, account: &mut Account) {
    defmt::info!(
        "the watchdog now: {=u32} passed, {=u32} failed so far. If no line follows within a second, look at the LEDs",
        account.passed,
        account.failed
    );
    // for the probe to read the log
    Timer::after_millis(100).await;
    keep(Kept {
        magic: Kept::HANGS,
        passed: account.passed,
        failed: account.failed,
    });
    let mut watchdog = IndependentWatchdog::new(watchdog.iwdg, WATCHDOG_US);
    watchdog.unleash();
    critical_section::with(|_| wait_us(5 * WATCHDOG_US));
    keep(Kept {
        magic: 0,
        passed: 0,
        failed: 0,
    });
    account.check(
        false,
        "watchdog",
        "0.5 s of hanging, and no reset",
        "The watchdog's oscillator does not run: replace the board",
    );
}
