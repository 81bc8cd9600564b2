//! The image of `tactus_firmware::handheld`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
#[cortex_m_rt::entry]
fn main() -> ! {
    tactus_firmware::handheld()
}

#[cfg(not(target_os = "none"))]
include!("../on_a_pc.rs");
