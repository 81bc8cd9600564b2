//! A handheld's parts beside the finger.
use embassy_stm32::gpio::{Input, OutputType, Pull};
use embassy_stm32::peripherals;
use embassy_stm32::time::Hertz;
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_time::Timer;
use tactus_core::wire::bringup::HandSeen;

use crate::board;
use crate::tasks::display;

pub(super) struct Hand {
    display: board::Display,
    button: Input<'static>,
    buzzer: SimplePwm<'static, peripherals::TIM8>,
}

impl Hand {
    pub(super) fn new(display: board::Display, handle: board::Handle) -> Self {
        let pin = PwmPin::new(handle.buzzer, OutputType::PushPull);
        let counts = CountingMode::EdgeAlignedUp;
        Self {
            display,
            button: Input::new(handle.button, Pull::Down),
            buzzer: SimplePwm::new(
                handle.tones,
                None,
                None,
                None,
                Some(pin),
                Hertz(2000),
                counts,
            ),
        }
    }

    pub(super) async fn look(&mut self) -> HandSeen {
        let display = display::light(&mut self.display).await;
        let mut tone = self.buzzer.ch4();
        tone.set_duty_cycle_percent(50);
        tone.enable();
        Timer::after_millis(500).await;
        tone.disable();
        HandSeen {
            display,
            pressed: self.button.is_high(),
        }
    }
}
