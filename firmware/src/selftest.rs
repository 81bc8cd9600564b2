//! The other end of `tactus device bringup`: it asks for one measurement after the other and judges them. Here is only
//! measured, and motors move only after somebody has squeezed the finger in the hand, within the bounds of [`Motors`].
//! Whatever comes while one moves stops it.
use core::future::Future;
use core::sync::atomic::Ordering::Relaxed;

use embassy_futures::select::{Either, select};
use embassy_stm32::gpio::{Flex, Pin as _, Pull, Speed};
use embassy_stm32::usart::{BufferedUartRx, BufferedUartTx};
use embassy_time::{Duration, Instant, Timer, with_timeout};
use embedded_io_async::{Read as _, Write as _};
use heapless::Vec;
use tactus_core::sensor::pressure::Channel;
use tactus_core::store::StoreError;
use tactus_core::wire::bringup::{
    Answer, Ask, BRINGUP, Checked, ConverterSeen, LeverSeen, Look, MARK, Measure, POINTS, PinsSeen,
    READINGS, Saw, SensorSeen, StageSeen, Stopped,
};
use tactus_core::wire::{MAX_FRAME, Receiver, Text, encode, text};

use self::chip::{chip, hang, rewrite, wait_us};
use self::hand::Hand;
use self::motors::{AT_REST, LEVER_STEPS, Motors};
use self::sensor::{Sensor, Touch};
use crate::board;
use crate::checks::{self, Kernels};
use crate::chip::{finger, flash, rescue};
use crate::tasks::link;
use crate::tasks::servo::Pins;

mod chip;
mod hand;
mod motors;
mod sensor;

/// The encoder is looked at so often: nobody pushes the stage by 32 mm in that time.
const LOOK: Duration = Duration::from_millis(20);
/// The pull of a pin needs this long to charge a metre of cable, us: 40 kohm and 1 nF, five times over.
const SETTLES_US: u32 = 200;
/// From one reading of a converter's channels to the next, us.
const CONVERTS_US: u64 = 400;
/// 1 mm/s: slow enough that the eye sees which way it goes.
const LEVER_STEPS_S: i32 = 1600;

struct Line {
    tx: BufferedUartTx<'static>,
    rx: BufferedUartRx<'static>,
    receiver: Receiver,
    id: u16,
}

impl Line {
    /// The host's next question; other frames are left out.
    async fn ask(&mut self) -> Measure {
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

/// Answers the host for good, from its first question on. To be called once, from thread mode.
pub async fn selftest() {
    let (reset, last_words) = rescue::reset_cause();
    let mut r = board::start();
    let Some((tx, rx)) = link::open(r.link) else {
        rescue::refuse("the link's rate cannot be had");
    };
    // SAFETY: the cycle counter is nobody else's.
    let mut core = unsafe { cortex_m::Peripherals::steal() };
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    defmt::info!(
        "tactus-selftest {=str} waits for `tactus device bringup`",
        env!("CARGO_PKG_VERSION")
    );
    let mut line = Line {
        tx,
        rx,
        receiver: Receiver::new(),
        id: 0,
    };
    line.ask().await;
    let hello = Saw::Hello {
        protocol: BRINGUP,
        version: env!("CARGO_PKG_VERSION").try_into().unwrap_or_default(),
        reset,
        last_words,
    };
    line.answer(hello.clone()).await;
    let bus = &r.sensor;
    let wires = [
        (bus.sck.port(), bus.sck.pin()),
        (bus.miso.port(), bus.miso.pin()),
        (bus.mosi.port(), bus.mosi.pin()),
        (bus.select.port(), bus.select.pin()),
    ]
    .map(|(port, pin)| port << 4 | pin);
    let pins = pins(&mut r.sensor, &mut r.lever, &mut r.stage, &mut r.switches);
    let mut bench = Bench {
        hello,
        pins,
        wires,
        hand: Hand::new(r.display, r.handle),
        kernels: Kernels::new(),
        touch: Touch::new(Sensor::new(r.sensor, reset).await, 0.0),
        motors: Motors::new(Pins::new(r.lever, r.stage, r.current, r.switches)),
        squeezed: false,
        storage: Some(r.store),
        store: None,
        watchdog: Some(r.watchdog),
    };
    loop {
        let Ok(measure) = with_timeout(LOOK, line.ask()).await else {
            bench.motors.pins.count();
            continue;
        };
        let saw = bench.measure(measure, &mut line).await;
        line.answer(saw).await;
    }
}

struct Bench {
    hello: Saw,
    pins: PinsSeen,
    wires: [u8; 4],
    hand: Hand,
    kernels: Kernels,
    touch: Touch,
    motors: Motors,
    /// Somebody has squeezed the finger: motors may move.
    squeezed: bool,
    storage: Option<board::Storage>,
    store: Option<Result<flash::Storage, StoreError>>,
    watchdog: Option<board::Watchdog>,
}

impl Bench {
    async fn measure(&mut self, measure: Measure, line: &mut Line) -> Saw {
        if !matches!(measure, Measure::Series(_) | Measure::Hello) {
            self.motors.series.clear();
        }
        match measure {
            Measure::Hello => self.hello.clone(),
            Measure::Chip => Saw::Chip(chip()),
            Measure::Pins => Saw::Pins(self.pins),
            Measure::Sensor => Saw::Sensor(self.sensor().await),
            Measure::Look => Saw::Look(look(&mut self.motors)),
            Measure::Squeeze => {
                let done = line.unless_asked(self.touch.squeezed()).await.flatten();
                self.squeezed = done.is_ok();
                Saw::Squeeze(done)
            }
            Measure::Lever(steps) => Saw::Lever(self.lever(Some(steps.into()), line).await),
            Measure::LeverTop => Saw::Lever(self.lever(None, line).await),
            Measure::Stage(to_the_right) => Saw::Stage(self.stage(to_the_right, line).await),
            Measure::Ramp => {
                let done = match self.may_move() {
                    Ok(()) => line.unless_asked(self.motors.ramp()).await.flatten(),
                    Err(why) => Err(why),
                };
                self.rested();
                Saw::Ramp(done)
            }
            Measure::Store => {
                if let Some(pins) = self.storage.take() {
                    self.store = Some(flash::open(pins, None).await);
                }
                Saw::Store(self.rewritten().await)
            }
            Measure::Watchdog => {
                self.motors.stop();
                if let Some(watchdog) = self.watchdog.take() {
                    hang(watchdog);
                }
                // the watchdog did not come: the host sees that by the next start's cause
                cortex_m::peripheral::SCB::sys_reset()
            }
            Measure::Restart => {
                self.motors.stop();
                cortex_m::peripheral::SCB::sys_reset()
            }
            Measure::Series(from) => {
                let points = self.motors.series.get(from.into()..).unwrap_or_default();
                let points = points.get(..POINTS).unwrap_or(points);
                Saw::Series(Vec::from_slice(points).unwrap_or_default())
            }
            Measure::Kernel(number) => Saw::Checks(self.kernels.check(number)),
            Measure::Timers => Saw::Checks(checks::timers(&mut self.motors.pins.current)),
            Measure::Flash => Saw::Checks(match &mut self.storage {
                Some(storage) => checks::flash(storage).await,
                None => Vec::from([Checked::new(
                    "flash",
                    false,
                    "the store has it: start again",
                )]),
            }),
            Measure::Converter => Saw::Converter(self.converter().await),
            Measure::Wires => Saw::Wires(self.wires),
            Measure::Hand => Saw::Hand(self.hand.look().await),
        }
    }

    /// True if a motor may move; should the firmware give up meanwhile, the rescue can drive both then.
    fn may_move(&self) -> Result<(), Stopped> {
        let switches = &self.motors.pins;
        if !self.squeezed {
            Err(Stopped::NotSqueezed)
        } else if switches.e_stop.is_high() {
            Err(Stopped::EStop)
        } else if switches.stage_left.is_high() || switches.stage_right.is_high() {
            Err(Stopped::SwitchOpen)
        } else {
            rescue::ARMED.store(true, Relaxed);
            Ok(())
        }
    }

    fn rested(&mut self) {
        self.motors.stop();
        rescue::ARMED.store(false, Relaxed);
    }

    /// So many steps, downwards positive, or up to the switch.
    async fn lever(&mut self, steps: Option<i32>, line: &mut Line) -> LeverSeen {
        let from = self.motors.pins.lever.steps();
        let may_move = self.may_move();
        let (motors, touch) = (&mut self.motors, &mut self.touch);
        let moved = match may_move {
            Ok(()) => {
                let moves = async {
                    motors.hold_lever().await;
                    let Some(steps) = steps else {
                        return motors.lever_up(touch).await;
                    };
                    let most = steps.abs().min(LEVER_STEPS);
                    let rate = LEVER_STEPS_S * steps.signum();
                    // up, no further than to the switch
                    motors.drive_lever(touch, rate, most, steps < 0).await
                };
                line.unless_asked(moves).await
            }
            Err(why) => Err(why),
        };
        self.rested();
        let (rise, ended) = match moved {
            // so many steps were wanted, and made
            Ok((rise, Err(Stopped::TopStaysClosed))) if steps.is_some() => (rise, Ok(())),
            Ok((rise, ended)) => (rise, ended),
            Err(why) => (0.0, Err(why)),
        };
        self.squeezed &= !matches!(ended, Err(Stopped::Pressed | Stopped::Silent));
        LeverSeen {
            steps: self.motors.pins.lever.steps() - from,
            at_top: self.motors.pins.lever_top.is_high(),
            rise,
            ended,
        }
    }

    async fn stage(&mut self, to_the_right: bool, line: &mut Line) -> StageSeen {
        let from = self.motors.pins.count();
        let moved = match self.may_move() {
            Ok(()) => {
                line.unless_asked(self.motors.move_stage(to_the_right))
                    .await
            }
            Err(why) => Err(why),
        };
        self.rested();
        let seen = moved.unwrap_or_else(|why| StageSeen {
            moved_um: 0,
            duty: 0.0,
            driven_ma: 0.0,
            braking_ma: 0.0,
            ended: Err(why),
        });
        StageSeen {
            moved_um: self.motors.pins.count() - from,
            ..seen
        }
    }

    async fn sensor(&mut self) -> SensorSeen {
        let identity = self.touch.sensor.identity();
        let (mut pac, series) = (0, &mut self.motors.series);
        let second = self.touch.sensor.second(|pressure| {
            let counts = pressure.counts.get() as i16;
            match pressure.channel {
                Channel::Pac => pac = counts,
                Channel::Pdc => {
                    let _ = series.push([pac, counts]);
                }
            }
        });
        let second = second.await;
        let (pac, pdc) = (&second.pac, &second.pdc);
        self.touch.rests_at(pdc.mean());
        // what a part says of its words tells more than its name
        let identity = identity.and_then(|who| second.why.map_or(Ok(who), |why| Err(text(why))));
        SensorSeen {
            finger: finger::code(),
            identity,
            words: second.words,
            garbled: second.garbled,
            error_frames: second.refused,
            silent: second.silent,
            late: second.late,
            last: second.last,
            pac: [pac.mean(), pac.rms()],
            pdc: [pdc.mean(), pdc.rms()],
        }
    }

    async fn converter(&mut self) -> ConverterSeen {
        let (mut undriven, mut counts) = (0, [[u16::MAX, 0]; 2]);
        for _ in 0..READINGS {
            Timer::after_micros(CONVERTS_US).await;
            let both = self.touch.sensor.conversions();
            for (read, [least, most]) in both.iter().zip(&mut counts) {
                let read = read.unwrap_or_else(|| {
                    undriven += 1;
                    u16::MAX
                });
                (*least, *most) = (read.min(*least), read.max(*most));
            }
            let point = both.map(|read| read.map_or(-1, |counts| counts as i16));
            let _ = self.motors.series.push(point);
        }
        self.touch.sensor.speed_up();
        ConverterSeen {
            read: 2 * READINGS,
            undriven,
            counts,
        }
    }

    /// The skin's work before and after it was written, mJ.
    async fn rewritten(&mut self) -> Result<[u32; 2], Text> {
        match &mut self.store {
            Some(Ok(store)) => {
                let skins = rewrite(store).await.map_err(text)?;
                Ok(skins.map(|skin| (skin.energy_j() * 1e3) as u32))
            }
            Some(Err(why)) => Err(text(why)),
            None => Err(text("it was not opened")),
        }
    }
}

/// What hangs on the pins, before their drivers have them. The sensor is selected meanwhile, without a clock.
fn pins(
    sensor: &mut board::Sensor,
    lever: &mut board::Lever,
    stage: &mut board::Stage,
    switches: &mut board::Switches,
) -> PinsSeen {
    let mut seen = PinsSeen::default();
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
        tied(&mut Flex::new(lever.enable.reborrow())),
        tied(&mut Flex::new(stage.enable.reborrow())),
    ];
    select.set_high();
    for ((up, down), bit) in levels.into_iter().zip(0..) {
        seen.up |= u16::from(up) << bit;
        seen.down |= u16::from(down) << bit;
    }
    seen
}

fn tied(pin: &mut Flex<'_>) -> (bool, bool) {
    pin.set_as_input(Pull::Up);
    wait_us(SETTLES_US);
    let up = pin.is_high();
    pin.set_as_input(Pull::Down);
    wait_us(SETTLES_US);
    (up, pin.is_high())
}

fn look(motors: &mut Motors) -> Look {
    let current = motors.conversions(AT_REST).ok();
    if let Some(current) = &current {
        motors.zero = current.mean();
    }
    let switches = &motors.pins;
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
        encoder: motors.pins.count(),
        current: current.map(|current| [current.mean(), current.rms()]),
    }
}
