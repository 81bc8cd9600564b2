//! The image of the rig on a NUCLEO-F767ZI: see `tactus_firmware::rig`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    tactus_firmware::rig()
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "tactus-rig-f767 is firmware for the STM32F767ZI and does nothing on a PC. Flash it as docs/src/another-board.md says."
    );
    std::process::exit(2);
}
