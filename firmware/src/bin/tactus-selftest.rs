//! The board's self-test: see `tactus_firmware::selftest`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[embassy_executor::main]
async fn main(_spawner: embassy_executor::Spawner) {
    tactus_firmware::selftest().await;
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "tactus-selftest is firmware for the STM32F429ZI and does nothing on a PC. Flash it with `cargo xtask flash --self-test`."
    );
    std::process::exit(2);
}
