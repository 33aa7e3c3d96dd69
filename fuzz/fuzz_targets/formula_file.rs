//! See `lnn_fuzz::formula_file`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| lnn_fuzz::formula_file::run(bytes));
