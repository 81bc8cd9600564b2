//! See [`tactus_fuzz::import`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("import"),
    |data: &[u8]| tactus_fuzz::import(data)
);
