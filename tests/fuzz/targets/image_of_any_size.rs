//! The target `image_of_any_size` for libFuzzer.

#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| mba_fuzz::image_of_any_size(data));
