//! See `lnn_fuzz::linalg`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lnn_fuzz::linalg::run(bytes));
