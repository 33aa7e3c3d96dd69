//! See `lnn_fuzz::page`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lnn_fuzz::page::run(bytes));
