//! The image of `tactus_firmware::selftest`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[embassy_executor::main]
async fn main(_spawner: embassy_executor::Spawner) {
    tactus_firmware::selftest().await;
}

#[cfg(not(target_os = "none"))]
include!("../on_a_pc.rs");
