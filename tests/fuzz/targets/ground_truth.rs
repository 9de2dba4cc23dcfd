//! The target `ground_truth` for libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| mba_fuzz::ground_truth(data));
