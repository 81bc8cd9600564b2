//! See [`tactus_fuzz::scenario`].
#![no_main]

libfuzzer_sys::fuzz_target!(
    init: tactus_fuzz::write_seeds("scenario"),
    |data: &[u8]| tactus_fuzz::scenario(data)
);

libfuzzer_sys::fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    match tactus_fuzz::another_scenario(&data[..size], max_size, seed) {
        Some(other) => {
            data[..other.len()].copy_from_slice(&other);
            other.len()
        }
        None => libfuzzer_sys::fuzzer_mutate(data, size, max_size),
    }
});
