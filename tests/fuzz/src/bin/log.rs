//! See [`tactus_fuzz::log`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("log"),
    |data: &[u8]| tactus_fuzz::log(data)
);
