//! The target `recording` for libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| mba_fuzz::recording(data));
