//! What only the chip itself can answer: see `tactus_firmware::silicon`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[embassy_executor::main]
async fn main(_spawner: embassy_executor::Spawner) {
    tactus_firmware::silicon().await;
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "tactus-silicon is firmware for the STM32F429ZI and does nothing on a PC. Flash it with `cargo xtask flash --test`."
    );
    std::process::exit(2);
}
