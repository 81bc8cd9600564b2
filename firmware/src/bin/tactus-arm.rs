//! The image of a probe on somebody else's arm: see `tactus_firmware::arm`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    tactus_firmware::arm()
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "tactus-arm is firmware for the STM32F429ZI and does nothing on a PC. Run it on the emulated board with `cargo xtask emulate --port N --arm-port N`."
    );
    std::process::exit(2);
}
