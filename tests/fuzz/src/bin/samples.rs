//! See [`tactus_fuzz::samples`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("samples"),
    |data: &[u8]| tactus_fuzz::samples(data)
);
