//! The target `c_interface` for libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| mba_fuzz::c_interface(data));
