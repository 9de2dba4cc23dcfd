//! The target `calibration` for libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| mba_fuzz::calibration(data));
