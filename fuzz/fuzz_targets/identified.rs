//! See `lnn_fuzz::identified`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lnn_fuzz::identified::run(bytes));
