//! See [`tactus_fuzz::store`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("store"),
    |data: &[u8]| tactus_fuzz::store(data)
);
