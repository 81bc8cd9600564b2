//! The image for the finger `analog` of the rig: see `tactus_firmware::rig`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    tactus_firmware::rig()
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "tactus-rig-analog is firmware for the STM32F429ZI and does nothing on a PC. Run it on the emulated board with `cargo xtask emulate --finger analog`."
    );
    std::process::exit(2);
}
