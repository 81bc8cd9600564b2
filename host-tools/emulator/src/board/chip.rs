//! The chip: rigless' STM32F427 with the additions that make it the firmware's STM32F429, and with the rig on its pins.
//!
//! The edge lines of EXTI and the programmable flash array are added. Models whose pins the rig needs to the nanosecond
//! (TIM1, TIM3, TIM4, ADC1) are wrapped: [`Tapped`] lets the rig act before and after every access to them.

use std::num::{NonZeroU32, NonZeroU64};

use rigless::device::{Device, ErasedDevice, Level, ResetCause};
use rigless::machine::{Board as Machine, Target, armv7m};
use rigless::mcu::{Mcu, Operate};
use rigless::snapshot::Store;
use rigless::soc::stm32f427::peripherals::adc::Adc;
use rigless::soc::stm32f427::peripherals::gpio::Gpio;
use rigless::soc::stm32f427::peripherals::tim::{Advanced, Counter, General, Tim};
use rigless::soc::stm32f427::peripherals::{Stm32f427, rcc};
use rigless::soc::stm32f427::{CPU, MEMORY, generated};
use rigless::soc::{Bus, Region};
use rigless::time::VirtualNanos;

use super::exti::Exti;
use super::peers::{DisplayPins, MotionPins, SensorPins, Serial};
use super::pins::{PinId, REST_LEVELS};
use super::rig::SharedRig;
use super::taps::{Current, Encoder, Pwm, Step, Tapped, channel};

/// Timers run on the internal oscillator after a reset.
const RESET_HZ: u64 = rcc::HSI_HZ;
const USART3: usize = 2;

const TIM8: usize = 1;

#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) f427: Stm32f427,
    exti: Exti,
    step: Tapped<Tim<Advanced>, Step>,
    pwm: Tapped<Tim<General>, Pwm>,
    encoder: Tapped<Tim<General>, Encoder>,
    current: Tapped<Adc, Current>,
    /// of EXTI, TIM1, TIM3, TIM4, ADC1 on the bus
    slots: [usize; 5],
}

fn narrow() -> Tim<General> {
    Tim::with_clock(RESET_HZ, Counter::Narrow)
}

fn advanced() -> Tim<Advanced> {
    Tim::with_clock(RESET_HZ, Counter::Narrow).breaks_on("RCC", rcc::CLOCK_FAILURE)
}

fn converter() -> Adc {
    // the common block divides by 2 at reset
    let mut adc = Adc::with_clock(RESET_HZ / 2);
    adc.set_reference(Current::REFERENCE);
    adc
}

impl Part {
    fn new(rig: &SharedRig) -> Result<Self, rigless::soc::Error> {
        let mut f427 = Stm32f427::new()?;
        // the debug probe's 8 MHz on OSC_IN; no 32 kHz crystal is used
        f427.rcc.attach_crystals(8_000_000, 0);
        f427.set_supply(3300);
        let slot = |name| f427.bus().slot(name);
        let slots = [
            slot("EXTI")?,
            slot("TIM1")?,
            slot("TIM3")?,
            slot("TIM4")?,
            slot("ADC1")?,
        ];
        f427.usart[USART3].attach(Serial(rig.clone()));
        f427.spi[0].attach(SensorPins(rig.clone()));
        f427.spi[3].attach(MotionPins(rig.clone()));
        f427.i2c[0].attach(DisplayPins(rig.clone()));
        Ok(Self {
            exti: Exti::default(),
            step: Tapped {
                model: advanced(),
                tap: Step(rig.clone()),
            },
            pwm: Tapped {
                model: narrow(),
                tap: Pwm::new(rig.clone(), RESET_HZ),
            },
            encoder: Tapped {
                model: narrow(),
                tap: Encoder::new(rig.clone(), RESET_HZ),
            },
            current: Tapped {
                model: converter(),
                tap: Current(rig.clone()),
            },
            f427,
            slots,
        })
    }
}

impl Store for Part {}

impl Mcu for Part {
    fn bus(&self) -> &Bus {
        self.f427.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.f427.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        Mcu::reset(&mut self.f427, at, cause);
        self.exti = Exti::default();
        self.step.model = advanced();
        self.pwm.model = narrow();
        self.pwm.tap.restart(RESET_HZ);
        self.encoder.model = narrow();
        self.encoder.tap.restart(RESET_HZ);
        self.current.model = converter();
    }

    /// Only USART3 has a peer outside. rigless' own poll asks all eight ports at every stop.
    fn poll(&mut self, now: VirtualNanos) {
        self.f427
            .drive_serial_port(now, USART3, |port, registers, context| {
                Device::poll(port, registers, context);
            });
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        let model: &mut dyn ErasedDevice = match self.slots.iter().position(|own| *own == slot) {
            Some(0) => &mut self.exti,
            Some(1) => &mut self.step,
            Some(2) => &mut self.pwm,
            Some(3) => &mut self.encoder,
            Some(_) => &mut self.current,
            None => return self.f427.split(slot),
        };
        (self.f427.bus_mut(), Some(model))
    }
}

/// The part's memory, its flash array programmable: a store to it reaches the driver, which does what the array does.
static MEMORY_MAP: [Region; 5] = [
    MEMORY[0].programmed_by("FLASH"),
    MEMORY[1],
    MEMORY[2],
    MEMORY[3],
    MEMORY[4],
];

/// Shows the core that memory; nothing else of it is ever asked.
#[derive(Debug)]
struct MemoryView(Bus);

impl Mcu for MemoryView {
    fn bus(&self) -> &Bus {
        &self.0
    }

    fn bus_mut(&mut self) -> &mut Bus {
        &mut self.0
    }

    fn reset(&mut self, _: VirtualNanos, _: ResetCause) {}

    fn poll(&mut self, _: VirtualNanos) {}

    fn split(&mut self, _: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        (&mut self.0, None)
    }
}

#[derive(Debug)]
pub(crate) struct Board {
    pub(crate) part: Part,
    view: MemoryView,
    instructions_per_second: NonZeroU64,
    mpu: armv7m::MpuRegions,
    /// the pins that are driven from outside, in the order in which that began
    driven: Vec<(PinId, Option<bool>)>,
}

impl Store for Board {}

impl Machine for Board {
    fn name(&self) -> &'static str {
        "nucleo-f429zi"
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec!["mcu"]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.part)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        const CORE_HZ: NonZeroU64 = NonZeroU64::new(168_000_000).expect("it is not 0");
        const REFCLK_DIVIDER: NonZeroU32 = NonZeroU32::new(8).expect("it is not 0");
        let lines = u32::from(Operate::cpu(&self.part).interrupt_lines);
        let core = armv7m::Core {
            variant: armv7m::Variant::M4,
            clock_hz: CORE_HZ,
            interrupt_lines: NonZeroU32::new(lines).expect("the part has interrupts"),
            priority_bits: 4,
            refclk_divider: REFCLK_DIVIDER,
            instructions_per_second: self.instructions_per_second,
            boot: "flash",
        }
        .spec_with_parts(
            &rigless::cpu::armv7m::windows(Mcu::bus(&self.part)),
            armv7m::Fpu::FpV4Sp,
            self.mpu,
        );
        vec![Target::new("mcu", &mut self.view, core)]
    }
}

impl Board {
    /// A board with a rig on its pins. Errors: rigless' tables of the part do not fit together.
    pub(crate) fn new(
        rig: &SharedRig,
        instructions_per_second: NonZeroU64,
        mpu: bool,
    ) -> Result<Self, rigless::soc::Error> {
        let view = Bus::builder(CPU, &MEMORY_MAP, [generated::FLASH]).build()?;
        let mut board = Self {
            part: Part::new(rig)?,
            view: MemoryView(view),
            mpu: match mpu {
                true => armv7m::MpuRegions::Eight,
                false => armv7m::MpuRegions::None,
            },
            instructions_per_second,
            driven: Vec::new(),
        };
        for (pin, level) in REST_LEVELS {
            board.drive(VirtualNanos(0), pin, Some(level));
        }
        Ok(board)
    }

    pub(crate) fn level(&mut self, pin: PinId) -> bool {
        let (gpio, registers) = self.part.f427.port(pin.port());
        gpio.level(pin.pin(), registers) == Level::High
    }

    pub(crate) fn tone(&mut self) -> Option<u32> {
        let (tim, registers) = self.part.f427.advanced_timer(TIM8);
        let pulse = tim.pulse(channel(4), registers)?;
        (pulse.period.0 > 0 && pulse.width.0 > 0).then(|| (1_000_000_000 / pulse.period.0) as u32)
    }

    pub(crate) fn function(&mut self, pin: PinId) -> Option<u8> {
        let (_, registers) = self.part.f427.port(pin.port());
        Gpio::function(pin.pin(), registers)
    }

    /// Drives a pin from outside, or lets it go, and gives EXTI its edge where SYSCFG leads the pin there.
    pub(crate) fn drive(&mut self, at: VirtualNanos, id: PinId, level: Option<bool>) {
        self.driven.retain(|(driven, _)| *driven != id);
        self.driven.push((id, level));
        let pin = id.pin();
        let (before, after) =
            self.part
                .f427
                .drive_port(at, id.port(), |gpio, registers, context| {
                    let before = gpio.level(pin, registers);
                    gpio.drive(pin, level.map(Level::from), registers, context);
                    (before, gpio.level(pin, registers))
                });
        if before == after {
            return;
        }
        use generated::syscfg::Register as Syscfg;
        let line = id.number();
        let control = [
            Syscfg::Exticr1,
            Syscfg::Exticr2,
            Syscfg::Exticr3,
            Syscfg::Exticr4,
        ][usize::from(line / 4)];
        let Some(syscfg) = self.part.bus().registers("SYSCFG") else {
            return;
        };
        let routed = syscfg.get(control) >> (4 * (line % 4)) & 0xF;
        if routed as usize == id.port() {
            let slot = self.part.slots[0];
            let (registers, mut context) = self.part.f427.bus_mut().drive(at, slot);
            self.part
                .exti
                .edge(line, after == Level::High, registers, &mut context);
        }
    }

    /// Drives everything again: a reset makes rigless build its ports anew.
    pub(crate) fn redrive(&mut self, at: VirtualNanos) {
        for (pin, level) in self.driven.clone() {
            self.drive(at, pin, level);
        }
    }
}
