//! See `lnn_fuzz::network`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lnn_fuzz::network::run(bytes));
