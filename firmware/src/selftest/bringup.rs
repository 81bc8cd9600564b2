//! `tactus device bringup` at the other end of the link: it asks for one measurement after the other and judges them. Here is only
//! measured, and motors move only after somebody has squeezed the finger in the hand, within the bounds of [`Motors`]. Whatever
//! comes while one moves stops it.
use core::future::Future;
use core::sync::atomic::Ordering::Relaxed;

use embassy_futures::select::{Either, select};
use embassy_stm32::gpio::{Flex, Pull, Speed};
use embassy_stm32::usart::{BufferedUartRx, BufferedUartTx};
use embassy_time::{Duration, Instant, Timer, with_timeout};
use embedded_io_async::{Read as _, Write as _};
use heapless::Vec;
use tactus_core::sensor::pressure::Channel;
use tactus_core::store::StoreError;
use tactus_core::wire::bringup::{
    Answer, Ask, BRINGUP, ChipSeen, LeverSeen, Look, MARK, MAX_POINTS, Measure, POINTS, PinsSeen,
    Saw, SensorSeen, StageSeen, Stopped,
};
use tactus_core::wire::{MAX_FRAME, Receiver, Reset, Text, encode, text};

use super::account::wait_us;
use super::chip::{bor_level, clock, hang, rewrite};
use super::motors::{AT_REST, LEVER_STEPS, Motors};
use super::sensor::{Second, Sensor, Touch};
use crate::board;
use crate::chip::{flash, rescue};
use crate::tasks::link;

/// How long a start waits for the host's first question, which comes every 0.2 s.
const FIRST: Duration = Duration::from_secs(1);
/// The encoder is looked at so often: nobody pushes the stage by 32 mm in that time.
const LOOK: Duration = Duration::from_millis(20);
/// The pull of a pin needs this long to charge a metre of cable, us: 40 kohm and 1 nF, five times over.
const SETTLES_US: u32 = 200;
/// 1 mm/s: slow enough that the eye sees which way it goes.
const LEVER_STEPS_S: i32 = 1600;

/// The line to the host.
pub(super) struct Line {
    tx: BufferedUartTx<'static>,
    rx: BufferedUartRx<'static>,
    receiver: Receiver,
    id: u16,
}

impl Line {
    pub(super) fn new(tx: BufferedUartTx<'static>, rx: BufferedUartRx<'static>) -> Self {
        Self {
            tx,
            rx,
            receiver: Receiver::new(),
            id: 0,
        }
    }

    /// The host's next question; what is none is left.
    pub(super) async fn ask(&mut self) -> Measure {
        loop {
            let mut byte = [0];
            // a framing or overrun error costs bytes, which the CRC notices
            if self.rx.read(&mut byte).await.is_err() {
                continue;
            }
            if let Some(Ok(ask)) = self.receiver.push::<Ask>(byte[0])
                && ask.mark == MARK
            {
                self.id = ask.id;
                return ask.measure;
            }
        }
    }

    /// Whether the host asks for something in the first second.
    pub(super) async fn is_asked(&mut self) -> bool {
        with_timeout(FIRST, self.ask()).await.is_ok()
    }

    async fn answer(&mut self, saw: Saw) {
        let answer = Answer {
            id: self.id,
            at_ms: Instant::now().as_millis() as u32,
            mark: MARK,
            saw,
        };
        let mut buffer = [0; MAX_FRAME + 1];
        // every answer fits
        let frame = encode(&answer, &mut buffer).unwrap_or_default();
        // the driver takes no more than its buffer holds, and wakes nobody who waits for room
        for chunk in frame.chunks(link::CHUNK) {
            // the line reports no error while sending
            let _ = self.tx.write(chunk).await;
            let _ = self.tx.flush().await;
        }
    }

    /// Moves something, unless another question comes: then it is left where it is.
    async fn unless_asked<T>(&mut self, moves: impl Future<Output = T>) -> Result<T, Stopped> {
        match select(moves, self.ask()).await {
            Either::First(done) => Ok(done),
            Either::Second(_) => Err(Stopped::Asked),
        }
    }
}

/// What is measured.
pub(super) struct Parts {
    pub(super) sensor: board::Sensor,
    pub(super) lever: board::Lever,
    pub(super) stage: board::Stage,
    pub(super) current: board::Current,
    pub(super) switches: board::Switches,
    pub(super) store: Option<board::Storage>,
    pub(super) watchdog: board::Watchdog,
}

/// Answers the host for good.
pub(super) async fn serve(
    mut r: Parts,
    mut line: Line,
    reset: Reset,
    last_words: Option<Text>,
) -> ! {
    let hello = Saw::Hello {
        protocol: BRINGUP,
        version: env!("CARGO_PKG_VERSION").try_into().unwrap_or_default(),
        reset,
        last_words,
    };
    line.answer(hello.clone()).await;
    let pins = pins(&mut r);
    let mut touch = Touch::new(Sensor::new(r.sensor, reset).await, 0.0);
    let mut motors = Motors::new(r.lever, r.stage, r.current, r.switches);
    let mut squeezed = false;
    let mut store = None;
    loop {
        let Ok(measure) = with_timeout(LOOK, line.ask()).await else {
            motors.count();
            continue;
        };
        let may_move = match measure {
            Measure::Lever(_) | Measure::LeverTop | Measure::Stage(_) | Measure::Ramp => {
                may_move(&motors, squeezed)
            }
            _ => Ok(()),
        };
        if !matches!(measure, Measure::Series(_) | Measure::Hello) {
            motors.series.clear();
        }
        let saw = match measure {
            Measure::Hello => hello.clone(),
            Measure::Chip => Saw::Chip(chip()),
            Measure::Pins => Saw::Pins(pins),
            Measure::Sensor => Saw::Sensor(sensor(&mut touch, &mut motors.series).await),
            Measure::Look => Saw::Look(look(&mut motors)),
            Measure::Squeeze => {
                let done = line.unless_asked(touch.squeezed()).await.flatten();
                squeezed = done.is_ok();
                Saw::Squeeze(done)
            }
            Measure::Lever(_) | Measure::LeverTop => {
                let steps = match measure {
                    Measure::Lever(steps) => Some(steps.into()),
                    _ => None,
                };
                let seen = lever(&mut line, &mut motors, &mut touch, steps, may_move).await;
                squeezed &= !matches!(seen.ended, Err(Stopped::Pressed | Stopped::Silent));
                Saw::Lever(seen)
            }
            Measure::Stage(to_the_right) => {
                Saw::Stage(stage(&mut line, &mut motors, to_the_right, may_move).await)
            }
            Measure::Ramp => {
                let done = match may_move {
                    Ok(()) => line.unless_asked(moving(motors.ramp())).await.flatten(),
                    Err(why) => Err(why),
                };
                rested(&mut motors);
                Saw::Ramp(done)
            }
            Measure::Store => {
                if let Some(pins) = r.store.take() {
                    store = Some(flash::open(pins).await);
                }
                Saw::Store(rewritten(&mut store).await)
            }
            Measure::Watchdog => {
                motors.stop();
                hang(r.watchdog);
                // the watchdog did not come: the host sees that by the next start's cause
                cortex_m::peripheral::SCB::sys_reset()
            }
            Measure::Restart => {
                motors.stop();
                cortex_m::peripheral::SCB::sys_reset()
            }
            Measure::Series(from) => {
                let points = motors.series.get(from.into()..).unwrap_or_default();
                let points = points.get(..POINTS).unwrap_or(points);
                Saw::Series(Vec::from_slice(points).unwrap_or_default())
            }
        };
        line.answer(saw).await;
    }
}

/// What hangs on the pins, before their drivers have them. The sensor is selected meanwhile, without a clock.
fn pins(r: &mut Parts) -> PinsSeen {
    let mut seen = PinsSeen::default();
    let (sensor, stage, switches) = (&mut r.sensor, &mut r.stage, &mut r.switches);
    let mut select = Flex::new(sensor.select.reborrow());
    let select_tied = tied(&mut select);
    select.set_low();
    select.set_as_output(Speed::Low);
    wait_us(SETTLES_US);
    let levels = [
        tied(&mut Flex::new(switches.lever_top.reborrow())),
        tied(&mut Flex::new(switches.stage_left.reborrow())),
        tied(&mut Flex::new(switches.stage_right.reborrow())),
        tied(&mut Flex::new(switches.e_stop.reborrow())),
        tied(&mut Flex::new(stage.encoder_a.reborrow())),
        tied(&mut Flex::new(stage.encoder_b.reborrow())),
        tied(&mut Flex::new(sensor.miso.reborrow())),
        tied(&mut Flex::new(sensor.mosi.reborrow())),
        select_tied,
        tied(&mut Flex::new(r.lever.enable.reborrow())),
        tied(&mut Flex::new(stage.enable.reborrow())),
    ];
    select.set_high();
    for ((up, down), bit) in levels.into_iter().zip(0..) {
        seen.up |= u16::from(up) << bit;
        seen.down |= u16::from(down) << bit;
    }
    seen
}

/// A pin's level with the chip's pull-up, and with its pull-down.
fn tied(pin: &mut Flex<'_>) -> (bool, bool) {
    pin.set_as_input(Pull::Up);
    wait_us(SETTLES_US);
    let up = pin.is_high();
    pin.set_as_input(Pull::Down);
    wait_us(SETTLES_US);
    (up, pin.is_high())
}

fn chip() -> ChipSeen {
    let clock = clock();
    ChipSeen {
        khz: clock.khz,
        external: clock.external && board::has_clock(),
        locked: clock.locked,
        pa12: clock.pa12,
        brown_out: bor_level(),
    }
}

async fn sensor(touch: &mut Touch, series: &mut Vec<[i16; 2], MAX_POINTS>) -> SensorSeen {
    let identity = touch.sensor().identity();
    let mut pac = 0;
    let second = touch.sensor().second(|pressure| {
        let counts = pressure.counts.get() as i16;
        match pressure.channel {
            Channel::Pac => pac = counts,
            Channel::Pdc => {
                let _ = series.push([pac, counts]);
            }
        }
    });
    let Second {
        words,
        garbled,
        refused,
        silent,
        late,
        last,
        pac,
        pdc,
        ..
    } = second.await;
    touch.rests_at(pdc.mean());
    SensorSeen {
        identity,
        words,
        garbled,
        error_frames: refused,
        silent,
        late,
        last,
        pac: [pac.mean(), pac.rms()],
        pdc: [pdc.mean(), pdc.rms()],
    }
}

/// The skin's work before and after it was written, mJ.
async fn rewritten(
    store: &mut Option<Result<flash::Storage, StoreError>>,
) -> Result<[u32; 2], Text> {
    match store {
        Some(Ok(store)) => {
            let (before, after, _) = rewrite(store).await.map_err(text)?;
            Ok([before, after].map(|skin| (skin.energy_j() * 1e3) as u32))
        }
        Some(Err(why)) => Err(text(why)),
        None => Err(text("it was not opened")),
    }
}

fn look(motors: &mut Motors) -> Look {
    let current = motors.conversions(AT_REST).ok();
    if let Some(current) = &current {
        motors.zero = current.mean();
    }
    let switches = &motors.switches;
    let (lever_top, e_stop) = (switches.lever_top.is_high(), switches.e_stop.is_high());
    let (stage_left, stage_right) = (
        switches.stage_left.is_high(),
        switches.stage_right.is_high(),
    );
    Look {
        lever_top,
        stage_left,
        stage_right,
        e_stop,
        encoder: motors.count(),
        current: current.map(|current| [current.mean(), current.rms()]),
    }
}

fn may_move(motors: &Motors, squeezed: bool) -> Result<(), Stopped> {
    let switches = &motors.switches;
    if !squeezed {
        Err(Stopped::NotSqueezed)
    } else if switches.e_stop.is_high() {
        Err(Stopped::EStop)
    } else if switches.stage_left.is_high() || switches.stage_right.is_high() {
        Err(Stopped::SwitchOpen)
    } else {
        Ok(())
    }
}

/// Should the firmware give up meanwhile, the rescue can drive both motors.
async fn moving<T>(moves: impl Future<Output = T>) -> T {
    rescue::ARMED.store(true, Relaxed);
    moves.await
}

/// After a move, whether it ended or was left.
fn rested(motors: &mut Motors) {
    motors.stop();
    rescue::ARMED.store(false, Relaxed);
}

/// So many steps, downwards positive, or up to the switch.
async fn lever(
    line: &mut Line,
    motors: &mut Motors,
    touch: &mut Touch,
    steps: Option<i32>,
    may_move: Result<(), Stopped>,
) -> LeverSeen {
    let from = motors.lever.steps();
    let moved = match may_move {
        Ok(()) => {
            let moves = moving(async {
                motors.hold_lever().await;
                let Some(steps) = steps else {
                    return motors.lever_up(touch).await;
                };
                let most = steps.abs().min(LEVER_STEPS);
                let rate = LEVER_STEPS_S * steps.signum();
                // up, no further than to the switch
                let until = (steps < 0).then_some(true);
                motors.drive_lever(touch, rate, most, until).await
            });
            line.unless_asked(moves).await
        }
        Err(why) => Err(why),
    };
    rested(motors);
    let (rise, ended) = match moved {
        // so many steps were wanted, and made
        Ok((_, rise, Err(Stopped::TopStaysClosed))) if steps.is_some() => (rise, Ok(())),
        Ok((_, rise, ended)) => (rise, ended),
        Err(why) => (0.0, Err(why)),
    };
    LeverSeen {
        steps: motors.lever.steps() - from,
        at_top: motors.switches.lever_top.is_high(),
        rise,
        ended,
    }
}

async fn stage(
    line: &mut Line,
    motors: &mut Motors,
    to_the_right: bool,
    may_move: Result<(), Stopped>,
) -> StageSeen {
    let from = motors.count();
    let moved = match may_move {
        Ok(()) => {
            line.unless_asked(moving(motors.move_stage(to_the_right)))
                .await
        }
        Err(why) => Err(why),
    };
    rested(motors);
    let moved_um = motors.count() - from;
    match moved {
        Ok(moved) => StageSeen {
            moved_um,
            duty: moved.duty,
            driven_ma: 1e3 * moved.driven_a,
            braking_ma: 1e3 * moved.braking_a,
            ended: moved.ended,
        },
        Err(why) => StageSeen {
            moved_um,
            duty: 0.0,
            driven_ma: 0.0,
            braking_ma: 0.0,
            ended: Err(why),
        },
    }
}

/// After the self-test: a host that asks gets a board that starts again, and answers.
pub(super) async fn wait(mut line: Line) -> ! {
    line.ask().await;
    Timer::after_millis(1).await;
    cortex_m::peripheral::SCB::sys_reset()
}
