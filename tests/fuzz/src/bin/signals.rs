//! See [`tactus_fuzz::signals`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("signals"),
    |data: &[u8]| tactus_fuzz::signals(data)
);
