//! The image that `cargo xtask bench` counts instructions with: see `tactus_firmware::bench`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    tactus_firmware::bench()
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "tactus-bench is firmware for the STM32F429ZI and does nothing on a PC. Run it with `cargo xtask bench`."
    );
    std::process::exit(2);
}
