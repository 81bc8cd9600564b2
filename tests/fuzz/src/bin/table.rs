//! See [`tactus_fuzz::table`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("table"),
    |data: &[u8]| tactus_fuzz::table(data)
);
