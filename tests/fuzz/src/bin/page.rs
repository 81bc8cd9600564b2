//! See [`tactus_fuzz::page`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("page"),
    |data: &[u8]| tactus_fuzz::page(data)
);
