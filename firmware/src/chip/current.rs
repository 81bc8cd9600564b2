//! The current of the stage's motor. It swings with every period of the motor's PWM, by up to 0.2 A, so that a single
//! reading says little. ADC1 converts without pause, DMA2 writes what it finds to a ring, and the ring's mean is taken
//! over whole periods of the PWM, at evenly spread places within them. This module owns the converter and the stream:
//! embassy's ring-buffered driver takes an interrupt for each half of the ring, panics there on a bus error, and does
//! not look for an overrun, after which nothing comes any more.
use core::mem::ManuallyDrop;
use core::sync::atomic::{AtomicU16, Ordering::Relaxed};

use embassy_stm32::gpio::{Flex, OutputType};
use embassy_stm32::pac::adc::regs::Cr2;
use embassy_stm32::pac::adc::vals::{Dds, SampleTime};
use embassy_stm32::pac::adccommon::vals::Adcpre;
use embassy_stm32::pac::dma::vals::{Dir, Size};
use embassy_stm32::pac::{ADC1, ADC123_COMMON, DMA2};
use embassy_stm32::peripherals;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_stm32::{Peri, rcc};

use crate::board::{self, held};
use crate::chip;

/// The motor's PWM: 84 MHz of its timer / 4100, beyond what is heard.
const PWM: Hertz = Hertz(20_487);
const PWM_TICKS: u32 = 84_000_000 / PWM.0;
pub(crate) fn pwm(
    timer: Peri<'static, peripherals::TIM3>,
    pin: board::StagePwm,
) -> SimplePwm<'static, peripherals::TIM3> {
    let pin = Some(PwmPin::new(pin, OutputType::PushPull));
    let mut pwm = SimplePwm::new(timer, pin, None, None, None, PWM, Default::default());
    pwm.ch1().set_duty_cycle_fully_off();
    pwm.ch1().enable();
    pwm
}

/// Ticks of that timer in a conversion: 480 cycles of sampling and 12 of converting, 84 MHz / 8 each.
const CONVERSION_TICKS: u32 = (480 + 12) * 8;
/// Conversions in the ring, at as many places of the PWM's period: their mean is the current's to 0.5 mA.
pub(crate) const CONVERSIONS: usize = 25;
/// Periods of the PWM in which they are made: 1.17 ms.
const PERIODS: u32 = 24;
const _: () = assert!(CONVERSIONS as u32 * CONVERSION_TICKS == PERIODS * PWM_TICKS);
/// After so long the ring is whole, ms.
pub(crate) const RING_MS: u64 = 2;

/// PA3 (data sheet, table 10).
const CHANNEL: u8 = 3;
/// Of DMA2, which carries ADC1 on its channel 0 (RM0090, table 44).
const STREAM: usize = 0;
/// The converter is steady 3 us after it is switched on (data sheet, t_STAB): twice that, since the emulated core makes
/// a loop of so many cycles in fewer instructions.
const STEADY_CYCLES: u32 = 2 * 3 * 168;
/// A stream that is switched off ends the transfer under way first; looks at that, each longer than a transfer.
const LOOKS: u32 = 20;

/// What was converted last, in no order that matters: each new conversion is at the place in the PWM's period of the
/// one whose room it takes.
static RING: [AtomicU16; CONVERSIONS] = [const { AtomicU16::new(0) }; CONVERSIONS];

pub(crate) struct Current {
    _pin: ManuallyDrop<Flex<'static>>,
    _adc: Peri<'static, peripherals::ADC1>,
    _stream: Peri<'static, peripherals::DMA2_CH0>,
    /// Room that was left in the ring when it was looked at last.
    left: u16,
    whole: bool,
}

impl Current {
    pub(crate) fn new(current: board::Current) -> Self {
        let mut pin = held(current.pin);
        pin.set_as_analog();
        rcc::enable_and_reset::<peripherals::ADC1>();
        ADC123_COMMON.ccr().write(|w| w.set_adcpre(Adcpre::DIV8));
        let mut converter = Self {
            _pin: pin,
            _adc: current.adc,
            _stream: current.stream,
            left: 0,
            whole: false,
        };
        converter.start();
        converter
    }

    /// The conversions of the last whole periods; `None` if there are none since the last look, or not yet as many.
    /// What stands still is started anew.
    pub(crate) fn ring(&mut self) -> Option<impl Iterator<Item = u16>> {
        let stream = DMA2.st(STREAM);
        let left = stream.ndtr().read().ndt();
        // a stream that was switched off says so of itself, too
        let runs = stream.cr().read().en();
        let filled = runs && self.turns();
        // as many conversions as there is room for leave the count as it was
        if !runs || left == self.left && !filled {
            self.start();
            return None;
        }
        self.left = left;
        self.whole
            .then(|| RING.iter().map(|code| code.load(Relaxed)))
    }

    pub(crate) fn turns(&mut self) -> bool {
        let filled = DMA2.isr(STREAM / 4).read().tcif(STREAM);
        if filled {
            DMA2.ifcr(STREAM / 4).write(|w| w.set_tcif(STREAM, true));
            self.whole = true;
        }
        filled
    }

    pub(crate) fn amperes(&mut self) -> Option<f32> {
        let sum: u32 = self.ring()?.map(u32::from).sum();
        Some(amperes(sum as f32 / CONVERSIONS as f32))
    }

    /// Starts converter and stream from the beginning, whatever has become of them. Bounded: a stream that does not
    /// stop is left to itself, and the next look finds that it does not go on.
    fn start(&mut self) {
        // no conversion under way, no request
        ADC1.cr2().write(|_| ());
        let stream = DMA2.st(STREAM);
        stream.cr().write(|_| ());
        for _ in 0..LOOKS {
            if !stream.cr().read().en() {
                break;
            }
        }
        DMA2.ifcr(STREAM / 4).write(|w| {
            w.set_feif(STREAM, true);
            w.set_dmeif(STREAM, true);
            w.set_teif(STREAM, true);
            w.set_htif(STREAM, true);
            w.set_tcif(STREAM, true);
        });
        stream.par().write_value(ADC1.dr().as_ptr() as u32);
        stream.m0ar().write_value(RING.as_ptr() as u32);
        stream.ndtr().write(|w| w.set_ndt(CONVERSIONS as u16));
        stream.cr().write(|w| {
            w.set_dir(Dir::PERIPHERAL_TO_MEMORY);
            w.set_psize(Size::BITS16);
            w.set_msize(Size::BITS16);
            w.set_minc(true);
            w.set_circ(true);
            w.set_en(true);
        });
        self.left = CONVERSIONS as u16;
        self.whole = false;
        // an overrun would keep it from starting
        ADC1.sr().write(|_| ());
        ADC1.smpr2()
            .write(|w| w.set_smp(CHANNEL.into(), SampleTime::CYCLES480));
        ADC1.sqr3().write(|w| w.set_sq(0, CHANNEL));
        let mut control = Cr2::default();
        control.set_adon(true);
        control.set_cont(true);
        control.set_dma(true);
        // without it the requests end with the ring's last place
        control.set_dds(Dds::CONTINUOUS);
        ADC1.cr2().write_value(control);
        chip::wait_cycles(STEADY_CYCLES);
        control.set_swstart(true);
        ADC1.cr2().write_value(control);
    }
}

/// Amperes of the stage's motor by the amplifier's 12 bits over 3.3 V: 1 V/A about 2048.
pub(crate) fn amperes(code: f32) -> f32 {
    (code - 2048.0) * (3.3 / 4096.0)
}
