//! The watchdog, which this module owns: it is started before the peripherals are handed out, and petted until the chip
//! starts anew, whatever has become of the tasks.
use embassy_stm32::pac::IWDG;
use embassy_stm32::pac::iwdg::vals::{Key, Pr};

use crate::board;

/// Starts it for the start-up, which takes milliseconds: half a second and more, by its oscillator of 17 to 47 kHz.
pub(crate) fn start() {
    set(Pr::DIVIDE_BY32, 800);
}

/// Gives it 0.1 s, 68 to 188 ms by its oscillator, and starts it if it was not.
pub(crate) fn tighten(_: board::Watchdog) {
    set(Pr::DIVIDE_BY4, 799);
}

fn set(prescaler: Pr, reload: u16) {
    IWDG.kr().write(|w| w.set_key(Key::START));
    IWDG.kr().write(|w| w.set_key(Key::ENABLE));
    IWDG.pr().write(|w| w.set_pr(prescaler));
    IWDG.rlr().write(|w| w.set_rl(reload));
    // They take five of its cycles to arrive, 0.3 ms at most, and its oscillator has to start. Before that a reload
    // would load 4 s, and what is set next would be ignored. By 16 MHz this is at most some 10 ms, by 168 MHz more than
    // 0.3.
    for _ in 0..20_000 {
        if IWDG.sr().read().0 == 0 {
            break;
        }
    }
    pet();
}

/// Pets it; does no harm where it is not running.
pub(crate) fn pet() {
    IWDG.kr().write(|w| w.set_key(Key::RESET));
}
