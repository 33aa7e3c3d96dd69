//! See `lnn_fuzz::record`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lnn_fuzz::record::run(bytes));
