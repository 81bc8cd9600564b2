//! The encoder's counter.
use embassy_stm32::Peri;
use embassy_stm32::pac::TIM4;
use embassy_stm32::pac::timer::vals::FilterValue;
use embassy_stm32::peripherals::{self, PD12, PD13};
use embassy_stm32::timer::qei::Qei;

/// The encoder's counter behind its filters: a level counts once five samples of 84 MHz / 16 have it, 0.95 us, as the
/// edges of the bridge beside its wires are on them, too. At 500 mm/s a line keeps its level for 4 us.
pub(crate) fn filtered(
    timer: Peri<'static, peripherals::TIM4>,
    a: Peri<'static, PD12>,
    b: Peri<'static, PD13>,
) -> Qei<'static, peripherals::TIM4> {
    let encoder = Qei::new(timer, a, b, Default::default());
    TIM4.ccmr_input(0).modify(|w| {
        w.set_icf(0, FilterValue::FDTS_DIV16_N5);
        w.set_icf(1, FilterValue::FDTS_DIV16_N5);
    });
    encoder
}
