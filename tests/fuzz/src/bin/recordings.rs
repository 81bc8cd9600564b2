//! See [`tactus_fuzz::recordings`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("recordings"),
    |data: &[u8]| tactus_fuzz::recordings(data)
);
