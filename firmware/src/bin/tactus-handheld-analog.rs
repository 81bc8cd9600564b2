//! The image for the finger `analog` of the handheld probe: see `tactus_firmware::handheld`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    tactus_firmware::handheld()
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "tactus-handheld-analog is firmware for the STM32F429ZI and does nothing on a PC. `cargo xtask test` plays the scenarios in host-tools/emulator/scenarios with it on the emulated board."
    );
    std::process::exit(2);
}
