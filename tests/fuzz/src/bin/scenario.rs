//! See [`tactus_fuzz::scenario`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("scenario"),
    |data: &[u8]| tactus_fuzz::scenario(data)
);
