//! See [`tactus_fuzz::wire`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("wire"),
    |data: &[u8]| tactus_fuzz::wire(data)
);
