//! The target `resume_slam` for libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| mba_fuzz::resume_slam(data));
