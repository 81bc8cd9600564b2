//! The rig's firmware: so far it boots the board, says which movements it knows and blinks.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod board;
#[cfg(target_os = "none")]
use {
    board::Board, defmt_rtt as _, embassy_executor::Spawner, embassy_time::Timer, panic_probe as _,
    tactus_core::movement::Movement,
};

#[cfg(target_os = "none")]
#[embassy_executor::main]
async fn main(_spawner: Spawner) -> ! {
    let mut board = Board::new();
    defmt::info!("tactus-rig {=str}", env!("CARGO_PKG_VERSION"));
    for (property, movement) in [
        ("traction", Movement::FOR_TRACTION),
        ("fineness", Movement::FOR_FINENESS),
        ("roughness", Movement::FOR_ROUGHNESS),
    ] {
        defmt::info!(
            "{=str}: {=u16} mN, {=u32} um/s",
            property,
            movement.force_mn(),
            movement.speed_um_s()
        );
    }
    loop {
        for led in &mut board.leds {
            led.set_high();
            Timer::after_millis(200).await;
            led.set_low();
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "tactus-rig is firmware for the STM32F429ZI and does nothing on a PC. Build it with `cargo xtask build`."
    );
    std::process::exit(2);
}
